"""Simulated returns against the distribution that they have when every bin is drawn."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from faintrack.likelihoods.exceedances import ExceedanceLikelihood
from faintrack.sensors.active import ActiveSonar, Ping
from faintrack.simulation.active import capacity_for, draw_ping
from tests.sonar import SONARS, pair, responses, states_at, tone
from tests.tolerances import STANDARD_ERRORS, assert_mean

SNR, THRESHOLD = 8.0, 3.0
DRAWS = 2_000
SURPRISE = 1e-5
"""Level of a Kolmogorov-Smirnov test with a fixed key."""
PLACE = np.array([[0.3, 7.6, 5.2]])
"""In bins: near the first delay, between the last beam and the first, near the last Doppler bin."""
TWO = np.concatenate([PLACE, [[2.7, 1.2, 4.4]]])
"""And another whose bins are partly the same."""


@eqx.filter_jit
def draw(
    keys: jax.Array, likelihood: ExceedanceLikelihood, capacity: int, state: object, present: jax.Array
) -> tuple[Ping, jax.Array]:
    def one(key: jax.Array) -> tuple[Ping, jax.Array]:
        return draw_ping(key, likelihood, capacity, jnp.zeros(()), state, present)

    return jax.lax.map(one, keys, batch_size=500)


def drawn(sonar: ActiveSonar, capacity: int | None, present: bool, place: np.ndarray = PLACE) -> tuple:
    """Stack of pings, how many returns each had no entry for, and the mean power of every bin."""
    likelihood = ExceedanceLikelihood(sonar, SNR, THRESHOLD)
    place = place * [1, 1, sonar.doppler is not None]
    states = states_at(sonar, place)
    state = states if len(place) > 1 else jax.tree.map(lambda values: values[0], states)
    capacity = capacity_for(likelihood, len(place)) if capacity is None else capacity
    pings, lost = draw(jax.random.split(jax.random.key(7), DRAWS), likelihood, capacity, state, jnp.array(present))
    return jax.tree.map(np.asarray, pings), np.asarray(lost), 1 + SNR * present * responses(sonar, place).sum(axis=0)


@pytest.mark.parametrize("kind", SONARS)
@pytest.mark.parametrize(
    ("present", "place"),
    [(True, TWO), *(pytest.param(*other, PLACE, marks=pytest.mark.slow) for other in ((False,), (True,)))],
    ids=["two targets", "noise", "target"],
)
def test_returns_are_those_of_bins_drawn_one_by_one(kind: str, present: bool, place: np.ndarray) -> None:
    """2,000 pings, 5 standard errors: how often each bin is returned, and mean and variance of how many are, which tell
    that bins are independent; Kolmogorov and Smirnov: their power. None is lost."""
    sonar = SONARS[kind]()
    pings, lost, mean = drawn(sonar, None, present, place)
    assert not np.any(lost)
    chance = np.exp(-THRESHOLD / mean).ravel()
    flat = np.ravel_multi_index(np.moveaxis(pings.bins, -1, 0), sonar.shape)
    counted = np.bincount(flat[pings.there], minlength=sonar.size)
    off = (counted - DRAWS * chance) / np.sqrt(DRAWS * chance * (1 - chance))
    assert np.abs(off).max() < STANDARD_ERRORS
    total = pings.there.sum(axis=1)
    assert_mean(total, chance.sum())
    assert_mean((total - chance.sum()) ** 2, (chance * (1 - chance)).sum())
    excess, level = pings.power[pings.there] - THRESHOLD, mean.ravel()[flat[pings.there]]
    assert excess.min() >= 0
    for chosen in (level < 1.01, level > 1.01, level > 0.9 * level.max()):
        if chosen.any():
            assert stats.kstest(excess[chosen] / level[chosen], stats.expon.cdf).pvalue > SURPRISE


def test_returns_come_in_order_of_the_delay_and_once() -> None:
    sonar = tone()
    pings, _, _ = drawn(sonar, None, True)
    flat = np.ravel_multi_index(np.moveaxis(pings.bins, -1, 0), sonar.shape)
    following = pings.there[:, 1:]
    assert np.all(np.diff(flat, axis=1)[following] > 0)
    assert np.all(np.diff(pings.there.astype(int), axis=1) <= 0)
    assert not np.any(pings.power[~pings.there])


def test_a_target_that_is_not_heard_is_noise() -> None:
    """In the blanked time, two bins before the first: with and without it the same returns."""
    sonar, place = tone(), np.array([[-2.0, 3.0, 3.0]])
    first, second = (drawn(sonar, None, present, place)[0] for present in (False, True))
    assert eqx.tree_equal(first, second)


def test_a_capacity_that_is_too_small_is_reported() -> None:
    """As often as there are more returns than 30, with 5 standard errors; those that are kept come first in delay."""
    sonar, capacity = tone(), 30
    pings, lost, mean = drawn(sonar, capacity, False)
    chance = np.exp(-THRESHOLD / mean).ravel()
    assert_mean(lost > 0, stats.binom.sf(capacity, sonar.size, chance[0]))
    assert np.all(pings.there[lost > 0])
    _, lost, mean = drawn(sonar, capacity, True)
    assert np.mean(lost > 0) > stats.binom.sf(capacity, sonar.size, chance[0])


def test_the_pair_of_a_ping_comes_with_it() -> None:
    """Sensors that move give the returns that they would give standing still in the same place."""
    still, moving = (ExceedanceLikelihood(tone(pair=each), SNR, THRESHOLD) for each in (pair(), None))
    state = jax.tree.map(lambda each: each[0], states_at(tone(), PLACE))
    key, time = jax.random.key(3), jnp.array(60.0)
    first, _ = draw_ping(key, still, 96, time, state, True)
    second, _ = draw_ping(key, moving, 96, time, state, True, pair())
    assert second.pair is not None
    assert first.pair is None
    assert eqx.tree_equal((first.bins, first.power, first.there), (second.bins, second.power, second.there))
