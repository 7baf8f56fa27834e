"""Several targets in one row of cells: found, kept apart, given up; and one target as its own filter has it."""

import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.beliefs.axis import Axis, between
from faintrack.beliefs.grids import Grid
from faintrack.filters.bernoulli_particle import BernoulliParticleFilter
from faintrack.filters.grid import GridFilter
from faintrack.filters.separable import separable
from faintrack.likelihoods.cells import CellLikelihood, gaussian
from faintrack.sensors.cells import Cells, CellScan
from faintrack.targets.motion import PlanarMotion
from faintrack.targets.silence import Silence
from faintrack.targets.states import RangeState
from faintrack.targets.target import Target, UniformBirth
from faintrack.trackers.many import ManyEstimate, ManyTargetsTracker
from faintrack.trackers.single import SingleTargetTracker

COUNT, LEVEL, SCANS = 60, 6.0, 40
CELLS = Cells((("range", Axis(0.0, 1.0, COUNT)),))
MOTION = PlanarMotion(0.1)
BIRTH = UniformBirth(
    RangeState(jnp.asarray(-0.5), jnp.asarray(-1.0)), RangeState(jnp.asarray(COUNT - 0.5), jnp.asarray(1.0))
)
TARGET = Target(BIRTH, MOTION, 0.001, 0.005)
LIKELIHOOD = CellLikelihood(CELLS, gaussian, LEVEL)
SILENCE = Silence(0.02, 0.2, 0.05)
GRID = Grid(RangeState, (("range", CELLS.axes[0][1]), ("range_rate", between(-1.0, 1.0, 5))))
FILTERS: dict[str, Any] = {
    "grid": GridFilter(GRID, TARGET, separable(GRID, MOTION, 1.0)),
    "particles": BernoulliParticleFilter(TARGET, 1000, 500),
}
PATHS = {
    "apart": (10 + 0.3 * np.arange(SCANS), 45 - 0.2 * np.arange(SCANS)),
    "crossing": (15 + 0.6 * np.arange(SCANS), 40 - 0.5 * np.arange(SCANS)),
}


def scans(*paths: np.ndarray, seed: int = 0, there: np.ndarray | None = None) -> CellScan:
    """Rows of cells with a target in the nearest cell to each path."""
    values = np.random.default_rng(seed).normal(size=(SCANS, COUNT))
    for path in paths:
        on = np.ones(SCANS, bool) if there is None else there
        values[np.arange(SCANS)[on], np.round(path).astype(int)[on]] += LEVEL
    return CellScan(jnp.arange(1.0, SCANS + 1), jnp.asarray(values, jnp.float32))


@functools.cache
def tracker(name: str, targets: int = 3) -> ManyTargetsTracker:
    return ManyTargetsTracker(FILTERS[name], LIKELIHOOD, SILENCE, targets)


def followed(name: str, frames: CellScan, targets: int = 3) -> ManyEstimate:
    several = tracker(name, targets)
    return several.steps(several.init(jax.random.key(0)), frames, jax.random.key(1))[1]


def tracks(estimate: ManyEstimate) -> dict[int, tuple[np.ndarray, np.ndarray]]:
    """Scans and ranges of every label."""
    label, place = np.asarray(estimate.label), np.asarray(estimate.mean.range)
    return {number: (np.nonzero(label == number)[0], place[label == number]) for number in set(label[label > 0])}


@pytest.mark.parametrize("name", FILTERS)
@pytest.mark.parametrize("scene", PATHS)
def test_two_targets_have_a_label_each(name: str, scene: str) -> None:
    paths = PATHS[scene]
    found = tracks(followed(name, scans(*paths, seed=3)))
    assert len(found) == 2
    owners = []
    for number, place in found.values():
        assert number[0] <= 8
        assert np.all(np.diff(number) == 1)
        off = np.abs(place - np.stack([path[number] for path in paths]))
        owners.append(int(off.mean(axis=1).argmin()))
        # Half of a cell, and some cells more while the two are in one.
        assert np.mean(off[owners[-1]] < 2) > 0.85
    assert sorted(owners) == [0, 1]


@pytest.mark.parametrize("name", FILTERS)
def test_noise_has_no_track(name: str) -> None:
    assert tracks(followed(name, scans(seed=5))) == {}


def test_a_label_moves_no_further_than_motion_allows() -> None:
    """Between two scans: the largest speed, six deviations of what acceleration adds, and two of the belief itself."""
    estimate = followed("particles", scans(*PATHS["crossing"], seed=4))
    deviation = np.sqrt(np.asarray(estimate.covariance)[:, :, 0, 0])
    for slot in range(3):
        label = np.asarray(estimate.label)[:, slot]
        same = (label[1:] == label[:-1]) & (label[1:] > 0)
        moved = np.abs(np.diff(np.asarray(estimate.mean.range)[:, slot]))[same]
        assert np.all(moved < 1.2 + 6 * 0.1 / 3**0.5 + 2 * (deviation[1:, slot] + deviation[:-1, slot])[same])


@pytest.mark.parametrize("name", FILTERS)
def test_a_pulsed_target_is_one_track(name: str) -> None:
    path = 20 + 0.2 * np.arange(SCANS)
    (track,) = tracks(followed(name, scans(path, seed=6, there=np.arange(SCANS) % 5 == 0))).values()
    number, place = track
    assert number[-1] == SCANS - 1
    assert np.mean(np.abs(place - path[number]) < 3) > 0.9


@pytest.mark.parametrize("name", FILTERS)
def test_one_that_leaves_is_given_up(name: str) -> None:
    path = 20 + 0.2 * np.arange(SCANS)
    (track,) = tracks(followed(name, scans(path, seed=7, there=np.arange(SCANS) < 15))).values()
    assert 15 <= track[0][-1] < 15 + 20


def test_a_full_tracker_says_so() -> None:
    estimate = followed("grid", scans(*PATHS["apart"], 30 + 0.0 * np.arange(SCANS), seed=8), targets=2)
    assert bool(estimate.full.any())
    assert len(tracks(estimate)) == 2
    assert not followed("grid", scans(*PATHS["apart"], seed=8), targets=2).full.any()


def test_before_a_track_it_is_the_filter_of_one_target() -> None:
    """Both take the same scans in; what is sought has the existence of the single filter until it is declared."""
    frames = scans(seed=9)
    single = SingleTargetTracker(FILTERS["grid"], LIKELIHOOD)
    alone = single.steps(single.init(jax.random.key(0)), frames, jax.random.key(1))[1]
    estimate = followed("grid", frames)
    np.testing.assert_allclose(estimate.existence[:, -1], alone.existence, rtol=1e-4)
    np.testing.assert_allclose(estimate.log_evidence, alone.log_evidence, rtol=1e-3, atol=1e-4)
