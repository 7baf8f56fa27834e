"""Laws of the tracker of several targets, on a small region with two arrays."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.sensors.stations import EnergyScan
from faintrack.trackers.several import SeveralEstimate
from tests.region import SCANS, paths, scans, tracker

TWO = paths((-200.0, -150.0, 3.0, 2.0), (250.0, 200.0, -3.0, -1.0))


OUTSIDE = (2000.0, 0.0, -2.0, 1.0)
"""Heard by both arrays, and where the surroundings are watched within these."""


def follow(data: EnergyScan, slots: int = 4, seed: int = 0, surroundings: float = 0.0) -> SeveralEstimate:
    what = tracker(slots, surroundings)
    return what.steps(what.init(jax.random.key(0)), data, jax.random.key(seed))[1]


@pytest.fixture(scope="module")
def found() -> SeveralEstimate:
    return follow(scans(0, TWO))


def test_both_targets_are_declared_once_each_and_followed(found: SeveralEstimate) -> None:
    """Beams are five degrees, some forty metres, wide: a track errs by less than one."""
    label = np.asarray(found.label)
    assert set(np.unique(label)) == {0, 1, 2}
    last = label[-1] > 0
    assert last.sum() == 2
    at = np.stack([found.mean.x[-1], found.mean.y[-1]], axis=-1)[last]
    truth = np.stack([TWO.x[-1], TWO.y[-1]], axis=-1)
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
    again = follow(scans(0, TWO))
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
