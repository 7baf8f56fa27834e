"""Detectors: odds cut in two, what is handed over, cells looked at in several points."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.beliefs.axis import between
from faintrack.errors import InputError
from faintrack.likelihoods.beam_energies import BeamEnergies
from faintrack.sensors.stations import Fans
from faintrack.targets.states import PlanarState
from faintrack.trackers.beliefs import Beliefs
from faintrack.trackers.detectors import around, hand_over, surrounding_detector, tiles
from faintrack.trackers.several import bearing_tracker
from tests.region import FANS, STATIONS, tracker
from tests.tolerances import rounding

detectors = tracker().detectors
beams = FANS.beams(STATIONS, detectors.points)


def peaked(*places: tuple[int, int, int, float]) -> Beliefs:
    """Beliefs with peaks at cells (detector, x, y) and these log weights, nearly flat elsewhere."""
    start = detectors.init(jax.random.key(0))
    log_weights = start.log_weights
    for detector, x, y, height in places:
        log_weights = log_weights.at[detector, :, :, x, y].add(height)
    total = jax.nn.logsumexp(log_weights, axis=(1, 2, 3, 4), keepdims=True)
    return Beliefs(None, log_weights - total, jnp.array([2.0, 1.0]), start.time)


def handed_over(before: Beliefs, margin: int) -> tuple[Beliefs, Any, jax.Array]:
    """What the detectors alone hand over."""
    (left,), states, log_odds = hand_over((detectors,), (before,), (beams,), margin, 256, jax.random.key(1))
    return left, states, log_odds


def test_odds_are_cut_in_two() -> None:
    """Those handed over and those left add up to those before, in the detector that hands over."""
    before = peaked((0, 4, 8, 9.0), (0, 7, 2, 8.0))
    left, _, log_odds = handed_over(before, 1)
    together = jnp.logaddexp(log_odds, left.log_odds[0])
    assert abs(float(together - before.log_odds[0])) < rounding(np.float32, 1000)
    assert abs(float(jax.nn.logsumexp(left.log_weights[0]))) < rounding(np.float32, 10_000)
    # The peak is taken, the second target stays.
    assert left.log_weights[0, 2, 2, 4, 8] == -jnp.inf
    assert int(jnp.argmax(left.log_weights[0].sum(axis=(0, 1)))) == 7 * 16 + 2


def test_states_lie_in_the_beams_of_the_peak() -> None:
    before = peaked((0, 4, 8, 9.0))
    _, states, _ = handed_over(before, 0)
    grid = dict(detectors.filter.grid.axes)
    x = float(detectors.place.x[0]) + grid["x"].values[4]
    y = float(detectors.place.y[0]) + grid["y"].values[8]
    near = np.hypot(states.x - x, states.y - y)
    assert np.quantile(near, 0.9) < 2 * grid["x"].step
    assert np.abs(states.vx).max() <= grid["vx"].values[-1] + grid["vx"].step / 2


def test_detectors_that_overlap_are_emptied_of_the_same_target() -> None:
    before = peaked((0, 7, 8, 9.0), (1, 0, 8, 9.0))
    left, _, _ = handed_over(before, 1)
    assert left.log_weights[1, 2, 2, 0, 8] == -jnp.inf
    assert left.log_odds[1] < before.log_odds[1]


def test_detectors_of_two_kinds_are_emptied_of_the_same_target() -> None:
    """The surer kind hands over; the cell of the other in which the peak lies is empty after it."""
    wide = surrounding_detector(detectors, 400.0, 1.0)
    start = wide.init(jax.random.key(0))
    at = FANS.beams(STATIONS, wide.points)
    before = peaked((0, 4, 8, 9.0)), Beliefs(None, start.log_weights, jnp.array([-9.0]), start.time)
    left, states, _ = hand_over((detectors, wide), before, (beams, at), 1, 64, jax.random.key(1))
    # The peak is at (-175, 25) m: in the wide cell from -200 to 0 m east and 0 to 200 m north.
    assert np.hypot(states.x + 175, states.y - 25).mean() < 100
    assert np.all(np.isneginf(left[1].log_weights[0, :, :, 3, 4]))
    assert left[1].log_odds[0] < before[1].log_odds[0]


def test_surroundings_reach_as_far_as_they_are_told_to() -> None:
    wide = surrounding_detector(detectors, 400.0, 1.0)
    axes = dict(wide.filter.grid.axes)
    assert (axes["x"].step, axes["x"].count, axes["y"].count, axes["vx"].count) == (200.0, 8, 8, 3)
    states = PlanarState(*(jnp.array(values) for values in ([-790.0, 790.0, 810.0], [790.0, -790.0, 0.0], 0.0, 0.0)))
    assert wide.covers(states).tolist() == [True, True, False]
    assert not detectors.covers(states).any()
    low, high = wide.limits
    assert (low.vx, high.vx) == (detectors.limits[0].vx, detectors.limits[1].vx)


def test_a_cell_has_the_mean_ratio_of_its_points() -> None:
    before = detectors.init(jax.random.key(0))
    before = Beliefs(None, before.log_weights, jnp.zeros(2), before.time)
    log_ratio = jax.random.normal(jax.random.key(2), (2, 2, 2, 1, 1, 9, 16))
    after = detectors.update(before, log_ratio)
    mean = np.exp(np.asarray(log_ratio, float)).mean(axis=(0, 1))
    np.testing.assert_allclose(after.log_odds, np.log(mean.mean(axis=(1, 2, 3, 4))), atol=rounding(np.float32, 1000))


def test_points_are_spread_evenly_in_their_cells() -> None:
    x = np.unique(np.asarray(detectors.points.x)[:, 0, 0, 0, 0, :, 0])
    np.testing.assert_allclose(np.diff(x), 25.0, rtol=rounding(np.float32, 10_000))


def test_neighbours_in_every_array_that_hears_the_middle() -> None:
    numbers = jnp.array([[3, 4, 6, -1], [9, 9, 9, 9]])
    assert around(numbers, jnp.array([4, 9]), 1).tolist() == [True, True, False, False]
    assert around(numbers, jnp.array([-1, 9]), 1).tolist() == [False, False, False, True]
    assert not around(numbers, jnp.array([-1, -1]), 1).any()


def test_tiles_have_to_cover_the_region() -> None:
    with pytest.raises(InputError, match="cover 500 m of the 600 m along y"):
        tiles((0.0, 500.0), (0.0, 600.0), (2, 1), (10, 20), 25.0)


@pytest.mark.parametrize(
    ("line", "ends", "expected"), [(True, (-0.2, 1.0), "0 to 3.142"), (False, (0.0, 6.0), "-3.142 to 3.142")]
)
def test_bearings_that_no_array_of_the_kind_has_are_refused(
    line: bool, ends: tuple[float, float], expected: str
) -> None:
    likelihood = BeamEnergies(Fans((0.0,), (0.1,), (30,), (line,)))
    with pytest.raises(InputError, match=rf"bearings are sought from .* rad; expected some of {expected}"):
        bearing_tracker(likelihood, between(*ends, 20), between(-0.1, 0.1, 3), 0.01, 1.0, 0.01, 0.01)
