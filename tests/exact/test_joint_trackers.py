"""Joint trackers against sums over every subset of targets that exist, and proposals against plain motion."""

import dataclasses
import itertools
import math
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.likelihoods.beam_energies import ELSEWHERE, BeamEnergies
from faintrack.sensors.stations import EnergyScan
from faintrack.targets.motion import PlanarMotion
from faintrack.targets.states import PlanarState
from faintrack.targets.target import Target
from faintrack.trackers.joint import Followed, JointTrackers, _mixed
from tests.region import FANS, MODEL, STATIONS
from tests.tolerances import STANDARD_ERRORS, rounding

KEY = jax.random.key(1)
STAYS = 0.02
"""Rate of departure; with it existence after prediction is exp(-0.02) of that before."""

ANYWHERE = tuple(PlanarState(*(jnp.array(sign * most) for most in (500.0, 500.0, 50.0, 50.0))) for sign in (-1, 1))
BEFORE = [0.6, 0.7, 0.8]
"""Existence of three targets before a scan."""

GHOSTS = [(100.0, 100.0), (-100.0, -100.0), (100.0, -100.0)]
"""Two targets, and one of the places where their beams cross otherwise."""

still = JointTrackers(
    Target(None, PlanarMotion(0.0), 0.0, STAYS), MODEL, ANYWHERE, slots=3, particles=1024, proposals=1
)


def held(trackers: JointTrackers, places: list[tuple[float, float]], existence: list[float], spread: float) -> Followed:
    """Targets around places; all are put into slots one after the other."""
    followed = trackers.init(PlanarState(*(jnp.zeros(()),) * 4))
    for number, ((x, y), q) in enumerate(zip(places, existence, strict=True)):
        off = spread * jax.random.normal(jax.random.key(number), (2, trackers.particles))
        states = PlanarState(x + off[0], y + off[1], *jnp.zeros((2, trackers.particles)))
        followed = trackers.take(followed, states, jnp.array(math.log(q / (1 - q))), STATIONS, 1)
    return followed


def scan(seed: int) -> EnergyScan:
    energy = 2 + 2 * jax.random.normal(jax.random.key(seed), (2, 37))
    return EnergyScan(jnp.array(1.0), energy, jnp.ones((2, 37), bool), STATIONS)


def beams_of(places: list[tuple[float, float]]) -> np.ndarray:
    """Beam of each of three places in each array."""
    x, y = np.array(places).T
    return np.asarray(MODEL.fans.beams(STATIONS, PlanarState(jnp.asarray(x), jnp.asarray(y), *jnp.zeros((2, 3)))))


def said(beams: np.ndarray, chosen: np.ndarray) -> list[float]:
    """Log ratio of each array with targets in some of the places, every beam counted once."""
    table = np.asarray(MODEL.table(scan(7), 3), float)
    return [
        sum(table[array, beam, n] for beam, n in zip(*np.unique(row[chosen], return_counts=True), strict=True))
        for array, row in enumerate(beams)
    ]


def summed(log_ratio: Callable[[np.ndarray], float]) -> np.ndarray:
    """Log odds of three targets after a scan, by Bayes' rule over the eight sets of those that exist."""
    predicted = np.array(BEFORE) * math.exp(-STAYS)
    joint, total = np.zeros(3), 0.0
    for subset in itertools.product([False, True], repeat=3):
        chosen = np.array(subset)
        weight = np.prod(np.where(chosen, predicted, 1 - predicted)) * math.exp(log_ratio(chosen))
        total += weight
        joint += weight * chosen
    return np.log(joint / (total - joint))


@pytest.mark.parametrize(
    "places",
    [
        [(10.0, 10.0), (300.0, -200.0), (-200.0, 300.0)],
        [(10.0, 10.0), (10.0, 10.0), (-200.0, 300.0)],
        GHOSTS,
    ],
    ids=["apart", "two in one place", "one where the beams of two cross"],
)
def test_existence_is_the_sum_over_every_subset(places: list[tuple[float, float]]) -> None:
    """Targets whose places are known: probabilities by Bayes' rule over the eight subsets, each beam multiplied out.

    Who exists is drawn for each of n particles, so odds err by chance: a share strays by 1/(2 sqrt(n)) at most, and
    odds no further than that over the smallest share, 0.2.
    """
    after = still.step(held(still, places, BEFORE, 0.0), scan(7), jnp.ones(3, bool), jax.random.key(1))
    beams = beams_of(places)
    expected = summed(lambda chosen: sum(said(beams, chosen)))
    apart = all(len(set(row)) == 3 for row in beams)
    tolerance = rounding(np.float32, 1000) if apart else STANDARD_ERRORS / (0.2 * 2 * math.sqrt(1024))
    np.testing.assert_allclose(after.beliefs.log_odds, expected, atol=tolerance)


@pytest.mark.parametrize(
    "places", [GHOSTS, [(10.0, 10.0), (10.0, 10.0), (-200.0, 300.0)]], ids=["a ghost", "two in one"]
)
def test_tentative_existence_is_the_sum_over_every_set(places: list[tuple[float, float]]) -> None:
    """Bayes' rule over eight sets; what the arrays say is the joint energies' ratio, multiplied out."""
    after = still.step(held(still, places, BEFORE, 0.0), scan(7), jnp.zeros(3, bool), jax.random.key(1))
    beams = beams_of(places)
    expected = summed(lambda chosen: sum(said(beams, chosen)))
    np.testing.assert_allclose(after.beliefs.log_odds, expected, atol=rounding(np.float32, 1000))


def test_a_single_target_is_a_bernoulli_filter() -> None:
    """Spread over beams, its evidence is the mean ratio of its particles."""
    one = held(still, [(10.0, 10.0)], [0.5], 60.0)
    here = scan(3)
    after = still.step(one, here, jnp.ones(3, bool), jax.random.key(1))
    states = jax.tree.map(lambda values: values[0], one.beliefs.states)
    ratio = np.asarray(MODEL.log_ratio(here, states), float)
    predicted = 0.5 * math.exp(-STAYS)
    expected = math.log(predicted / (1 - predicted)) + math.log(np.mean(np.exp(ratio)))
    assert abs(float(after.beliefs.log_odds[0]) - expected) < rounding(np.float32, 1000)
    weights = np.exp(ratio) / np.exp(ratio).sum()
    np.testing.assert_allclose(np.exp(after.beliefs.log_weights[0]), weights, atol=rounding(np.float32, 1000))


def test_what_one_array_hears_and_the_other_does_not_speaks_against_a_target() -> None:
    """Tentative or declared: for it a beam says less than log 1/e, against it as much as energies do."""
    beams = np.asarray(MODEL.fans.beams(STATIONS, PlanarState(*(jnp.array(value) for value in (10.0, 10.0, 0.0, 0.0)))))
    energy = jnp.zeros((2, 37)).at[0, beams[0]].set(4.0)

    def share(energy: float, sources: int) -> float:
        """Of a number of sources in the density of a beam, all but a factor."""
        return ELSEWHERE ** (sources - 1) * math.exp(-((energy - 4 * sources) ** 2) / 2)

    here = EnergyScan(jnp.array(1.0), energy, jnp.ones((2, 37), bool), STATIONS)
    one = held(still, [(10.0, 10.0)], [0.5], 0.0)
    predicted = 0.5 * math.exp(-STAYS)
    before = math.log(predicted / (1 - predicted))
    evidence = sum(
        math.log(sum(share(energy, n + 1) for n in range(4)) / sum(share(energy, n) * ELSEWHERE for n in range(5)))
        for energy in (4.0, 0.0)
    )
    for declared in (True, False):
        after = still.step(one, here, jnp.full(3, declared), jax.random.key(1))
        assert abs(float(after.beliefs.log_odds[0]) - before - evidence) < rounding(np.float32, 100)


def test_a_target_beyond_the_limits_is_gone() -> None:
    loud = EnergyScan(jnp.array(1.0), jnp.full((2, 37), 4.0), jnp.ones((2, 37), bool), STATIONS)
    after = still.step(held(still, [(10.0, 10.0), (10.0, 600.0)], [0.9, 0.9], 1.0), loud, jnp.ones(3, bool), KEY)
    assert after.beliefs.existence[0] > 0.8
    assert after.beliefs.existence[1] < 1e-6


@pytest.mark.slow
def test_proposals_stand_for_plain_motion() -> None:
    """Place and evidence under coupled partitions and under one draw a particle agree, within five standard errors of
    32 repetitions each."""
    quiet = BeamEnergies(FANS, 0.0, 1.0, 1.0, 1.0)
    moving = Target(None, PlanarMotion(40.0), 0.0, STAYS)
    here = EnergyScan(jnp.array(1.0), scan(5).energy / 2, jnp.ones((2, 37), bool), STATIONS)

    def repeated(proposals: int) -> np.ndarray:
        trackers = JointTrackers(moving, quiet, ANYWHERE, slots=2, particles=512, proposals=proposals)
        followed = held(trackers, [(10.0, 10.0), (60.0, 10.0)], [0.9, 0.9], 30.0)

        def once(key: jax.Array) -> jax.Array:
            beliefs = trackers.step(followed, here, jnp.ones(2, bool), key).beliefs
            middle = jnp.sum(jnp.exp(beliefs.log_weights[0]) * beliefs.states.x[0])
            return jnp.stack([beliefs.log_odds[0], middle])

        return np.asarray(jax.jit(jax.vmap(once))(jax.random.split(jax.random.key(proposals), 32)), float)

    plain, coupled = repeated(1), repeated(4)
    error = np.sqrt((plain.var(axis=0, ddof=1) + coupled.var(axis=0, ddof=1)) / 32)
    assert np.all(np.abs(plain.mean(axis=0) - coupled.mean(axis=0)) < STANDARD_ERRORS * error)


def test_mixing_is_a_permutation() -> None:
    for offset in (0.0, 0.3, 0.999999):
        assert sorted(_mixed(jnp.float32(offset), 512).tolist()) == list(range(512))


def test_members_of_a_group_stay_paired() -> None:
    """Two targets in the same beams that exist for certain have the same weights after a scan, and are joint."""
    staying = dataclasses.replace(still, target=Target(None, PlanarMotion(0.0), 0.0, 0.0))
    followed = held(staying, [(10.0, 10.0), (12.0, 10.0)], [1 - 1e-6, 1 - 1e-6], 40.0)
    after = staying.step(followed, scan(2), jnp.ones(3, bool), jax.random.key(0))
    assert after.joint[:2, :2].all()
    np.testing.assert_allclose(*np.exp(after.beliefs.log_weights[:2]), rtol=rounding(np.float32, 1000))


def test_what_is_taken_goes_to_a_free_slot() -> None:
    followed = held(still, [(10.0, 10.0), (300.0, -200.0)], [0.5, 0.9], 0.0)
    assert followed.active.tolist() == [True, True, False]
    assert np.allclose(followed.beliefs.existence[:2], [0.5, 0.9])
