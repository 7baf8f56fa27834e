"""Responses of an active sonar's bins, and the log ratio of its returns against the product over every bin."""

import dataclasses
import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

from faintrack.beliefs.axis import Axis
from faintrack.errors import InputError
from faintrack.likelihoods.exceedances import FADES, NODES, ExceedanceLikelihood, edge_class, fades
from faintrack.sensors.active import ActiveSonar, Ping, Pulse, ping
from faintrack.sensors.bistatic import fixed
from tests.sonar import SONARS, every_bin, log_ratio, pair, responses, states_at, sweep, tone
from tests.tolerances import assert_equal, assert_mean

SNR, THRESHOLD = 8.0, 3.0
OPERATIONS = 300
"""Roundings in a log ratio of a hundred terms, and in the place of its state in bins."""
LARGEST = 300.0
"""Nats a bin: how steeply the largest terms change with the place."""
DRAWS = 4_000
CAPACITY = 96
"""One for all pings, and as many states in all tests: what is compiled once serves them all."""

kinds = pytest.mark.parametrize("kind", SONARS)


def returns_of(sonar: ActiveSonar, seed: int = 0, share: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    """A share of all bins, with the first and the last of delay, beam and Doppler among them."""
    rng = np.random.default_rng(seed)
    chosen = rng.random(sonar.shape) < share
    chosen[0, 0, 0] = chosen[-1, -1, -1] = chosen[0, -1, -1] = chosen[-1, 0, 0] = True
    bins = np.argwhere(chosen)
    return bins, THRESHOLD + rng.exponential(4.0, size=len(bins))


def heard(sonar: ActiveSonar, bins: np.ndarray, power: np.ndarray) -> Ping:
    return ping(sonar, 0.0, bins, power, CAPACITY)


def places(sonar: ActiveSonar, parts: int, *first: list[float]) -> np.ndarray:
    """Places in bins, multiples of a fraction of a bin, at both ends of all axes among them; shape (64, 3)."""
    rng = np.random.default_rng(1)
    delays, beams, dopplers = sonar.shape
    ends = [[0, 0, 0], [delays - 1, beams - 1, dopplers - 1], [1, beams - 1 / parts, 0], [delays - 2, 1 / parts, 1]]
    drawn = np.stack([rng.integers(0, (length - 1) * parts + 1, 60) / parts for length in sonar.shape], axis=1)
    return np.concatenate([np.reshape(first, (-1, 3)), ends, drawn])[:64] * [1, 1, sonar.doppler is not None]


def test_responses_by_hand(dtype: type) -> None:
    """aughenbaugh2010, eq. 9-11: by pocket calculator."""
    sonar = tone()
    expected = {
        (0, 0, 0): 1.0,
        (0, 1, 0): (math.sin(math.pi / 3) / (math.pi / 3)) ** 2,
        (0, 3, 0): 0.0,
        (1, 0, 0): 0.6**2,
        (0, 0, 1): (math.sin(2) / 2) ** 2,
        (2, 0, 1): (0.2 * math.sin(0.4) / 0.4) ** 2,
        (-1, 1.5, -2): (0.6 * math.sin(2.4) / 2.4) ** 2 * (2 / math.pi) ** 2,
        (2.5, 0, 0): 0.0,
    }
    off = jnp.asarray(list(expected), dtype).T
    assert_equal(sonar.response(*off), list(expected.values()), dtype, 50, scale=1.0)
    expected = {
        (0, 0, 0): 1.0,
        (1, 0, 0): (0.8 * math.sin(math.pi * 0.64) / (math.pi * 0.8)) ** 2 / 0.8**2,
        (-2, 0, 0): (0.6 * math.sin(math.pi * 0.96) / (math.pi * 0.96)) ** 2,
        (5, 0, 0): 0.0,
    }
    off = jnp.asarray(list(expected), dtype).T
    assert_equal(sweep().response(*off), list(expected.values()), dtype, 50, scale=1.0)


@kinds
def test_responses_are_symmetric_and_end_at_the_reach(kind: str, dtype: type) -> None:
    sonar = SONARS[kind](reach=(1, 2, 1))
    off = np.random.default_rng(0).uniform(-1, 1, size=(3, 100)) * np.array([1.6, 2.6, 1.6])[:, None]
    off[2] *= sonar.doppler is not None
    found, turned = (np.asarray(sonar.response(*jnp.asarray(each, dtype))) for each in (off, -off))
    assert_equal(found, turned, dtype, 50, scale=1.0)
    within = (np.abs(off) <= np.array(sonar.reach)[:, None]).all(axis=0)
    assert np.all((found > 0) == within)
    assert np.all(found <= 1)


@kinds
def test_places_in_bins(kind: str, dtype: type) -> None:
    """Of targets whose echoes fall on known places; bearings run from 0 to the number of beams."""
    sonar = SONARS[kind]()
    expected = places(sonar, 5)
    found = np.stack(sonar.place(sonar.pair, states_at(sonar, expected)), axis=1)
    off = found - expected
    off[:, 1] = (off[:, 1] + sonar.beams / 2) % sonar.beams - sonar.beams / 2
    assert_equal(off, np.zeros_like(off), dtype, OPERATIONS, scale=10.0)
    assert np.all((found[:, 1] >= 0) & (found[:, 1] <= sonar.beams))


@kinds
def test_the_log_ratio_is_the_product_over_every_bin(kind: str, dtype: type) -> None:
    """At the places that the table holds, in bins and between, near the ends of all axes and across the first beam."""
    sonar = SONARS[kind]()
    bins, power = returns_of(sonar)
    likelihood = ExceedanceLikelihood(sonar, SNR, THRESHOLD)
    at = places(sonar, NODES)
    found = log_ratio(likelihood, heard(sonar, bins, power), states_at(sonar, at))
    expected = every_bin(sonar, SNR, THRESHOLD, bins, power, at)
    assert found.dtype == dtype
    assert np.ptp(expected) > 15
    assert_equal(found, expected, dtype, OPERATIONS, scale=LARGEST)


def test_classes_of_fading_are_those_of_an_exponential_number() -> None:
    edges = (0.05, 0.4, 2.0)
    for (power, chance), low, high in zip(fades(edges), (0.0, *edges), (*edges, np.inf), strict=True):
        expected = quad(lambda g: math.exp(-g), low, high)[0]
        assert chance == pytest.approx(expected)
        assert power == pytest.approx(quad(lambda g: g * math.exp(-g), low, high)[0] / expected)
    assert sum(power * chance for power, chance in FADES) == pytest.approx(1)
    assert sum(chance for _, chance in FADES) == pytest.approx(1)


def test_bins_that_fade_together_have_the_mean_ratio_over_their_fades(dtype: type) -> None:
    """Every class by the product over every bin. Sixteen quiet bins of a loud echo count one fade, not sixteen."""
    sonar = sweep()
    bins, power = returns_of(sonar)
    likelihood, at = ExceedanceLikelihood(sonar, SNR, THRESHOLD, FADES), places(sonar, NODES)
    found = log_ratio(likelihood, heard(sonar, bins, power), states_at(sonar, at))
    every = [every_bin(sonar, SNR * level, THRESHOLD, bins, power, at) + math.log(chance) for level, chance in FADES]
    assert found.dtype == dtype
    assert_equal(found, np.logaddexp.reduce(every, axis=0), dtype, OPERATIONS, scale=LARGEST)
    loud = [ExceedanceLikelihood(sonar, 300.0, THRESHOLD, *given) for given in ((), (FADES,))]
    none = heard(sonar, np.zeros((0, 3)), np.zeros(0))
    steady, fading = (float(log_ratio(one, none, states_at(sonar, at[:64]))[4]) for one in loud)
    assert steady < fading - 3
    # At least the chance of the deepest fade, in which 300 is below the threshold.
    assert fading > math.log(FADES[0][1]) - 3


@kinds
def test_between_the_places_of_the_table(kind: str, float64: type) -> None:
    """Straight lines are off by at most an eighth of the second differences along the axes: below 0.03 nats here."""
    sonar = SONARS[kind]()
    bins, power = returns_of(sonar)
    likelihood = ExceedanceLikelihood(sonar, SNR, THRESHOLD)
    at = places(sonar, 1000)
    found = log_ratio(likelihood, heard(sonar, bins, power), states_at(sonar, at))
    expected = every_bin(sonar, SNR, THRESHOLD, bins, power, at)
    none = np.zeros((0, 3))

    def bend(axis: int) -> float:
        """Largest second difference of the sum over quiet bins between the table's places of one bin."""
        line = np.tile([5.0, 2.0, 0.0 if sonar.doppler is None else 3.0], (NODES + 1, 1))
        line[:, axis] += np.arange(NODES + 1) / NODES
        return float(np.abs(np.diff(every_bin(sonar, SNR, THRESHOLD, none, none[:, 0], line), n=2)).max())

    allowed = sum(bend(axis) for axis in range(3 if sonar.doppler is not None else 2)) / 8
    assert np.abs(found - expected).max() < 1.5 * allowed < 0.03


@kinds
def test_what_is_not_heard_has_the_ratio_1(kind: str) -> None:
    """In the blanked time, beyond the last delay, outside the Doppler band: exactly 0 in logs."""
    sonar = SONARS[kind]()
    delays, _, dopplers = sonar.shape
    at = [[-0.6, 1.0, 0.0], [-3.0, 2.0, 0.0], [delays - 0.4, 0.0, 0.0], [delays + 5.0, 0.0, 0.0]]
    if sonar.doppler is not None:
        at += [[5.0, 1.0, -0.6], [5.0, 1.0, dopplers - 0.4]]
    bins, power = returns_of(sonar)
    states = states_at(sonar, places(sonar, 3, *at))
    found = log_ratio(ExceedanceLikelihood(sonar, SNR, THRESHOLD), heard(sonar, bins, power), states)
    assert not np.any(found[: len(at)])
    assert np.all(found[len(at) :])


@kinds
def test_no_echo_tells_nothing(kind: str) -> None:
    sonar = SONARS[kind]()
    bins, power = returns_of(sonar)
    states = states_at(sonar, places(sonar, 3))
    found = log_ratio(ExceedanceLikelihood(sonar, 0.0, THRESHOLD), heard(sonar, bins, power), states)
    assert_equal(found, np.zeros(len(found)), np.float32, OPERATIONS, scale=1.0)


def test_a_loud_return_is_finite() -> None:
    """A ratio of e^900 in single precision."""
    sonar = sweep()
    bins, power = np.array([[7, 3, 0]]), np.array([1000.0])
    at = places(sonar, NODES, [7.0, 3.0, 0.0], [9.0, 2.0, 0.0])
    found = log_ratio(ExceedanceLikelihood(sonar, 9.0, THRESHOLD), heard(sonar, bins, power), states_at(sonar, at))
    expected = every_bin(sonar, 9.0, THRESHOLD, bins, power, at)
    assert expected[0] > 850
    assert_equal(found, expected, np.float32, OPERATIONS, scale=1000.0)


def test_a_ping_brings_its_own_pair() -> None:
    sonar, moved = tone(), tone(pair=None)
    bins, power = returns_of(sonar)
    states = states_at(sonar, places(sonar, 3))
    own = ping(moved, 0.0, bins, power, CAPACITY, pair())
    first = log_ratio(ExceedanceLikelihood(sonar, SNR, THRESHOLD), heard(sonar, bins, power), states)
    second = log_ratio(ExceedanceLikelihood(moved, SNR, THRESHOLD), own, states)
    assert_equal(first, second, np.float32, OPERATIONS, scale=LARGEST)


def draw_every_bin(sonar: ActiveSonar, threshold: float, mean: np.ndarray) -> Ping:
    """Stack of pings, every bin drawn."""
    power = np.random.default_rng(5).exponential(size=(DRAWS, sonar.size)) * mean.ravel()
    count = int((power > threshold).sum(axis=1).max())
    order = np.argsort(power <= threshold, axis=1, kind="stable")[:, :count]
    power = np.take_along_axis(power, order, axis=1)
    bins = np.stack(np.unravel_index(order, sonar.shape), axis=-1)
    return Ping(
        jnp.zeros(DRAWS), jnp.asarray(bins, jnp.int32), jnp.asarray(power, jnp.float32), jnp.asarray(power > threshold)
    )


@pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=pytest.mark.slow if kind == "tone" else ()) for kind in SONARS]
)
@pytest.mark.parametrize("present", [True, pytest.param(False, marks=pytest.mark.slow)], ids=["target", "noise"])
def test_mean_ratio_is_1(kind: str, present: bool) -> None:
    """4,000 pings with every bin drawn, 5 standard errors, each below 0.02: of the ratio under noise, and of its
    inverse under a target near the last bins. The SNR is one at which the ratio has a variance."""
    sonar = SONARS[kind]()
    snr, threshold = 0.7, 1.5
    at = np.array([[5.0, 2.0, 3.0], [0.0, 7.5, 0.25], [11.25, 0.0, 6.0]]) * np.array([1, 1, sonar.doppler is not None])
    likelihood = ExceedanceLikelihood(sonar, snr, threshold)
    states = states_at(sonar, at)

    @eqx.filter_jit
    def ratios(likelihood: ExceedanceLikelihood, pings: Ping) -> jax.Array:
        return jax.vmap(lambda each: likelihood.log_ratio(each, states))(pings)

    mean = 1 + snr * present * responses(sonar, at[[2]])[0]
    found = np.asarray(ratios(likelihood, draw_every_bin(sonar, threshold, mean)), float)
    assert_mean(np.exp(-found[:, 2] if present else found), 1.0)


@pytest.mark.parametrize("rate", [1e-4, 0.0498, 0.3])
def test_mean_ratio_of_a_bin_is_1_in_any_background(rate: float, float64: type) -> None:
    """Probability that the bin is quiet, and the integral over its excess; the rate is below, at and above that of
    noise of mean 1. The last factor is what the bin tells when it is quiet, from the module's first sum."""
    likelihood = ExceedanceLikelihood(tone(), SNR, THRESHOLD)
    for response in (1.0, 0.3, 0.01, 0.0):
        mean = 1 + SNR * response
        quiet = (1 - math.exp(-THRESHOLD / mean)) / (1 - math.exp(-THRESHOLD))

        def heard(excess: float, response: float = response, quiet: float = quiet) -> float:
            told = likelihood.told(*(jnp.asarray(part) for part in (response, THRESHOLD + excess, rate)))
            return rate * math.exp(-excess + float(told)) * quiet

        found = (1 - rate) * quiet + quad(heard, 0, 400, epsabs=1e-9, epsrel=1e-9, limit=200)[0]
        assert found == pytest.approx(1.0, abs=1e-6)


@pytest.mark.slow
@kinds
def test_mean_ratio_is_1_in_a_learnt_background(kind: str) -> None:
    """4,000 pings with every bin drawn, 5 standard errors: bins of the first half exceed the threshold three times as
    often as those of the second."""
    sonar = SONARS[kind]()
    snr, threshold = 0.7, 1.5
    at = np.array([[5.0, 2.0, 3.0], [0.0, 7.5, 0.25], [11.25, 0.0, 6.0]]) * np.array([1, 1, sonar.doppler is not None])
    likelihood = ExceedanceLikelihood(sonar, snr, threshold)
    states = states_at(sonar, at)
    rate = np.where(np.arange(sonar.size) < sonar.size / 2, 0.3, 0.1)
    mean = threshold / -np.log(rate)
    pings = draw_every_bin(sonar, threshold, mean)
    rates = jnp.asarray(rate)[jnp.ravel_multi_index(tuple(jnp.moveaxis(pings.bins, -1, 0)), sonar.shape)]
    # The excess of exponential noise of any mean, in units of its mean.
    means = jnp.asarray(mean)[jnp.ravel_multi_index(tuple(jnp.moveaxis(pings.bins, -1, 0)), sonar.shape)]
    power = threshold + (pings.power - threshold) / means
    pings = dataclasses.replace(pings, power=power, rate=rates)

    @eqx.filter_jit
    def ratios(likelihood: ExceedanceLikelihood, pings: Ping) -> jax.Array:
        return jax.vmap(lambda each: likelihood.log_ratio(each, states))(pings)

    # Quiet bins are those of noise of mean 1 in the table, to straight lines.
    assert_mean(np.exp(np.asarray(ratios(likelihood, pings), float)), 1.0)


@pytest.mark.parametrize("reach", range(4))
def test_places_of_one_class_have_the_same_bins(reach: int) -> None:
    """On axes of every length, from one bin on; and the classes are numbered from 0 without a gap."""
    for count in range(1, 14):
        whole = np.arange(-1, count)
        classes = edge_class(whole, count, reach)
        bins = whole[:, None] + np.arange(-reach, reach + 2)
        exist = (bins >= 0) & (bins < count)
        assert np.unique(classes).tolist() == list(range(classes.max() + 1))
        for each in range(classes.max() + 1):
            assert len(np.unique(exist[classes == each], axis=0)) == 1
    assert np.array_equal(edge_class(jnp.asarray(whole), count, reach), classes)


def test_what_cannot_be_used_is_said() -> None:
    sonar = tone()
    with pytest.raises(InputError, match="threshold is 0 and SNR 2; expected above 0, and at least 0"):
        ExceedanceLikelihood(sonar, 2.0, 0.0)
    with pytest.raises(InputError, match="threshold is 3 and SNR -1; expected"):
        ExceedanceLikelihood(sonar, -1.0, 3.0)
    for pulse in ((0.0, 1.0), (100.0, 0.0), (100.0, 1.0, -1.0), (100.0, 1.0, 0.0, 0.0)):
        with pytest.raises(InputError, match="expected frequency and duration above 0, bandwidth at least 0"):
            Pulse(*pulse)
    with pytest.raises(InputError, match=r"2 beams of width 0\.1 rad; expected at least 3, above 0"):
        ActiveSonar(Pulse(100.0, 1.0), Axis(1.0, 1.0, 4), 2, 0.1, None)
    with pytest.raises(InputError, match="8 beams of width 0 rad"):
        ActiveSonar(Pulse(100.0, 1.0), Axis(1.0, 1.0, 4), 8, 0.0, None)
    for reach in ((3, 4, 3), (-1, 3, 3)):
        with pytest.raises(InputError, match="expected at least 0, and less than half of the 8 beams"):
            tone(reach=reach)
    lost = tone(pair=None)
    with pytest.raises(InputError, match="neither the sonar nor the ping says where source and receiver are"):
        ExceedanceLikelihood(lost, 1.0, 1.0).log_ratio(heard(lost, np.array([[0, 0, 0]]), np.array([2.0])), fixed(0, 0))


def test_a_ping_that_cannot_be_is_refused() -> None:
    sonar, here = tone(), np.array([[3, 2, 1], [4, 0, 0]])
    with pytest.raises(InputError, match=r"ping at 5 s: 2 bins and 1 powers; expected one power a bin"):
        ping(sonar, 5.0, here, np.ones(1), 4)
    with pytest.raises(InputError, match=r"ping at 5 s: 2 returns; expected at most the capacity, 1"):
        ping(sonar, 5.0, here, np.ones(2), 1)
    for wrong in ([12, 0, 0], [0, -1, 0], [0, 0, 7]):
        expected = rf"return 1: bin \({wrong[0]}, {wrong[1]}, {wrong[2]}\); expected delay, beam and Doppler below"
        with pytest.raises(InputError, match=expected):
            ping(sonar, 5.0, np.array([[3, 2, 1], wrong]), np.ones(2), 4)
    with pytest.raises(InputError, match=r"return 1: power is nan; expected above 0"):
        ping(sonar, 5.0, here, np.array([2.0, np.nan]), 4)
    with pytest.raises(InputError, match=r"two returns in the bin \(3, 2, 1\); expected one a bin"):
        ping(sonar, 5.0, here[[0, 1, 0]], np.ones(3), 4)


def test_returns_come_in_order_of_the_delay() -> None:
    sonar = tone()
    bins, power = returns_of(sonar)
    mixed = np.random.default_rng(3).permutation(len(bins))
    first, second = heard(sonar, bins, power), heard(sonar, bins[mixed], power[mixed])
    assert eqx.tree_equal(first, second)
    assert np.all(np.diff(first.bins[: len(bins), 0]) >= 0)
    assert int(first.there.sum()) == len(bins)
