"""Laws of the tracker of several targets, on a small region with two arrays."""

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.likelihoods.beam_energies import ELSEWHERE, BeamEnergies
from faintrack.sensors.stations import EnergyScan, Fans, Stations
from faintrack.simulation.energies import draw_energies
from faintrack.trackers.several import SeveralEstimate
from tests.region import BEAM, SCANS, paths, scans, tracker

TWO = paths((-200.0, -150.0, 3.0, 2.0), (250.0, 200.0, -3.0, -1.0))
"""Their beams cross otherwise in two places of the region, which move as steadily."""

CLEAR = paths((-300.0, 300.0, 2.5, -1.0), (300.0, -300.0, -2.5, 1.0))
"""Of the other two crossings one is behind an array, or farther than 2 km: there is one way to explain all beams."""


OUTSIDE = (2000.0, 0.0, -2.0, 1.0)
"""Heard by both arrays, and where the surroundings are watched within these."""


def follow(data: EnergyScan, slots: int = 4, seed: int = 0, surroundings: float = 0.0) -> SeveralEstimate:
    what = tracker(slots, surroundings)
    return what.steps(what.init(jax.random.key(0)), data, jax.random.key(seed))[1]


@pytest.fixture(scope="module")
def found() -> SeveralEstimate:
    return follow(scans(0, CLEAR))


def test_both_targets_are_declared_once_each_and_followed(found: SeveralEstimate) -> None:
    """Beams are five degrees, some forty metres, wide: a track errs by less than one."""
    label = np.asarray(found.label)
    assert set(np.unique(label)) == {0, 1, 2}
    last = label[-1] > 0
    assert last.sum() == 2
    at = np.stack([found.mean.x[-1], found.mean.y[-1]], axis=-1)[last]
    truth = np.stack([CLEAR.x[-1], CLEAR.y[-1]], axis=-1)
    nearest = np.linalg.norm(at[:, None] - truth, axis=-1)
    assert sorted(nearest.argmin(axis=1)) == [0, 1]
    assert nearest.min(axis=1).max() < 45


def test_no_target_is_declared_where_there_is_none() -> None:
    assert np.all(np.asarray(follow(scans(1, TWO, present=False)).label) == 0)


def test_a_target_outside_that_one_array_hears_is_not_declared() -> None:
    """It crosses beams that the region lies in, and is far behind it."""
    behind = paths((100.0, 5000.0, 0.0, 0.0))
    assert np.all(np.asarray(follow(scans(2, behind)).label) == 0)


def test_probabilities_stay_probabilities(found: SeveralEstimate) -> None:
    for values in (found.existence, found.detection):
        assert jnp.all((values >= 0) & (values <= 1))
    assert jnp.all(jnp.isfinite(found.covariance[found.label > 0]))


def test_same_key_same_bits(found: SeveralEstimate) -> None:
    again = follow(scans(0, CLEAR))
    for one, other in zip(jax.tree.leaves(found), jax.tree.leaves(again), strict=True):
        assert jnp.array_equal(one, other, equal_nan=True)


def test_silent_scans_find_nothing_and_lose_existence_slowly() -> None:
    """Scans without a usable beam leave the odds to arrival and departure."""
    data = scans(0, TWO)
    silent = EnergyScan(data.time, jnp.full_like(data.energy, jnp.nan), jnp.zeros_like(data.usable), data.stations)
    after = follow(silent)
    share = 1e-3 / 2e-3 * -np.expm1(-2e-3 * np.arange(1, SCANS + 1))
    assert np.all(np.asarray(after.label) == 0)
    # Those that arrive may have left the grid since: existence is at most that of a target that stays.
    assert np.all(np.asarray(after.detection) <= share[:, None] * (1 + 1e-4))


@pytest.mark.slow
def test_a_full_tracker_says_so() -> None:
    after = follow(scans(0, TWO), slots=1)
    assert np.asarray(after.label).max() == 1
    assert np.asarray(after.full).any()


@pytest.mark.slow
def test_a_target_outside_is_in_hand_and_no_track() -> None:
    after = follow(scans(3, paths(OUTSIDE)), surroundings=1800.0)
    assert np.all(np.asarray(after.label) == 0)
    held = np.asarray(after.existence[-1]) > 0.99
    assert held.sum() == 1
    assert abs(float(after.mean.x[-1][held][0]) - 1920) < 250


@pytest.mark.parametrize("seed", range(3))
def test_with_the_target_outside_in_hand_no_crossing_of_its_beam_is_taken_for_one_inside(seed: int) -> None:
    """Two sources explain all beams; a crossing with the target's beam would take a third, and lie 130 m away."""
    truth = paths((-200.0, 100.0, 1.0, 1.0), OUTSIDE)
    after = follow(scans(seed, truth), seed=seed, surroundings=1800.0)
    scan, slot = np.nonzero(after.label)
    assert set(np.asarray(after.label)[scan, slot]) == {1}
    assert scan[-1] == SCANS - 1
    apart = np.hypot(after.mean.x[scan, slot] - truth.x[scan, 0], after.mean.y[scan, slot] - truth.y[scan, 0])
    assert apart.mean() < 40


def test_a_target_that_comes_into_the_region_is_a_track_from_then_on() -> None:
    after = follow(scans(3, paths((560.0, 100.0, -5.0, 0.0))), surroundings=1800.0)
    assert set(np.unique(after.label)) == {0, 1}
    assert np.asarray(after.mean.x)[np.asarray(after.label) == 1].max() <= 400
    assert np.asarray(after.label)[-1].max() == 1


def test_a_target_that_leaves_and_one_that_comes_are_two_tracks() -> None:
    """The first is gone after six scans, the second has its label once it has been in hand for ten."""
    number = np.arange(1, SCANS + 1)
    after = follow(scans(4, TWO, np.stack([number <= 18, number > 18], axis=1)))
    label = np.asarray(after.label)
    assert set(np.unique(label)) == {0, 1, 2}
    assert not (label[24:] == 1).any()
    assert not (label[:28] == 2).any()
    for one, target in ((1, 0), (2, 1)):
        scan, slot = np.nonzero(label == one)
        there = (scan < 18) if target == 0 else scan >= 18
        apart = np.hypot(after.mean.x[scan, slot] - TWO.x[scan, target], after.mean.y[scan, slot] - TWO.y[scan, target])
        assert apart[there].mean() < 45


def test_a_beam_shared_in_one_array_does_not_stop_detection() -> None:
    """The second comes after the first is declared, in the same beam of the southern array, 450 m behind it."""
    truth = paths((0.0, -200.0, 0.0, 0.0), (0.0, 250.0, 0.0, 0.0))
    there = np.stack([np.ones(SCANS, bool), np.arange(SCANS) >= 15], axis=1)
    after = follow(scans(5, truth, there))
    last = np.asarray(after.label[-1]) > 0
    assert last.sum() == 2
    np.testing.assert_allclose(np.sort(after.mean.y[-1][last]), [-200, 250], atol=45)
    assert np.abs(after.mean.x[-1][last]).max() < 45


def test_targets_that_cannot_be_told_from_their_crossings_are_undecided() -> None:
    """What is undecided has been in hand for ten scans, is no track, and has an existence between both thresholds."""
    after = follow(scans(0, TWO))
    undecided, existence = np.asarray(after.undecided), np.asarray(after.existence)
    assert undecided.any()
    assert not (undecided & (np.asarray(after.label) > 0)).any()
    assert np.all((existence[undecided] >= 0.1) & (existence[undecided] < 0.99))
    assert np.all(existence[:-9][undecided[9:]] > 0)


@pytest.mark.slow
def test_an_array_more_never_delays_a_target() -> None:
    """Faint targets, two deviations loud, on the same 24 paths: two standard errors are allowed from array to array."""
    stations = [(0.0, -500.0, math.pi / 2), (-500.0, 0.0, 0.0), (500.0, 0.0, 0.0), (0.0, 500.0, math.pi / 2)]
    starts = np.random.default_rng(0).uniform((-250, -250, -3, -3), (250, 250, 3, 3), (24, 4))
    first = np.stack([_in_hand(stations[:count], starts) for count in (2, 3, 4)])
    later = np.diff(first, axis=0)
    assert np.all(later.mean(axis=1) <= 2 * later.std(axis=1, ddof=1) / math.sqrt(24))
    sooner = first[0] - first[2]
    assert sooner.mean() > 2 * sooner.std(ddof=1) / math.sqrt(24)


def _in_hand(stations: list[tuple[float, float, float]], starts: np.ndarray) -> np.ndarray:
    """Scan in which each of several lone targets is in hand for the first time; all of them where never."""
    count = len(stations)
    fans = Fans((0.0,) * count, (BEAM,) * count, (37,) * count, (True,) * count)
    model = BeamEnergies(fans, present_mean=2.0, elsewhere=ELSEWHERE)
    what = dataclasses.replace(tracker(), trackers=dataclasses.replace(tracker().trackers, likelihood=model))
    where = Stations(*(jnp.array(values) for values in zip(*stations, strict=True)))
    noise = dataclasses.replace(model, elsewhere=0.0)
    first = []
    for run, start in enumerate(starts):
        truth, key = paths(tuple(start)), jax.random.key(run)
        data = draw_energies(key, noise, jnp.arange(1.0, SCANS + 1), where, truth, jnp.ones(truth.x.shape, bool))
        after = what.steps(what.init(key), data, key)[1]
        off = np.hypot(after.mean.x - truth.x, after.mean.y - truth.y)
        held = ((np.asarray(after.existence) > 0) & (off < 100)).any(axis=1)
        first.append(np.argmax(held) if held.any() else SCANS)
    return np.array(first, float)
