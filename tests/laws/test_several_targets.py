"""Laws of the tracker of several targets, on a small region with two arrays."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.sensors.stations import EnergyScan
from faintrack.trackers.several import SeveralEstimate
from tests.region import SCANS, paths, scans, tracker

TWO = paths((-200.0, -150.0, 3.0, 2.0), (250.0, 200.0, -3.0, -1.0))


def follow(data: EnergyScan, slots: int = 4, seed: int = 0) -> SeveralEstimate:
    watching = tracker(slots).init(jax.random.key(0))
    return tracker(slots).steps(watching, data, jax.random.key(seed))[1]


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


def test_a_full_tracker_says_so() -> None:
    after = follow(scans(0, TWO), slots=1)
    assert np.asarray(after.label).max() == 1
    assert np.asarray(after.full).any()
