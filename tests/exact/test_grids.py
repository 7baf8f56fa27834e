"""Grids: beliefs summed over every path, the Kalman filter, and estimates against direct sums."""

from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import solve

from faintrack.beliefs.axis import Axis
from faintrack.beliefs.belief import Belief, covariance, mean, standard_deviation
from faintrack.beliefs.grids import Grid, highest_density, marginal, refined_mode
from faintrack.filters.grid import GridFilter, in_steps
from faintrack.filters.run import run
from faintrack.filters.separable import separable
from faintrack.targets.motion import PlanarMotion
from faintrack.targets.states import BearingState, PlanarState, RangeState
from faintrack.targets.target import Target, rates
from tests.exact.test_sum_over_paths import APPEARS, CELLS, JUMPS, RATIO, SCANS, STAYS, CellScan, every_path
from tests.tolerances import assert_equal

KEY = jax.random.key(0)


class Place(eqx.Module):
    """A cell of a line."""

    place: Any
    angles: ClassVar[tuple[str, ...]] = ()
    rates: ClassVar[dict[str, str]] = {}


class Jumps(eqx.Module):
    """Any matrix of jumps is a transport."""

    def carry(self, log_weights: Any, start: Any, end: Any, key: Any) -> tuple[Any, Any]:
        def advance(weights: Any, number: Any) -> tuple[Any, Any]:
            return weights @ jnp.asarray(JUMPS, weights.dtype), jnp.zeros((), weights.dtype)

        return in_steps([advance], log_weights, start, end, 1.0)


class Ratios(eqx.Module):
    """The scan is the ratio of each cell."""

    def log_ratio(self, scan: CellScan, states: Place) -> Any:
        return jnp.log(scan.ratio)


def test_the_filter_is_the_sum_over_every_path(dtype: type) -> None:
    """Every sequence of absence and cells with its probability: the same existence and the same cells."""
    grid = Grid(Place, (("place", Axis(0.0, 1.0, CELLS)),))
    target = Target(None, None, *rates(APPEARS, STAYS, 1.0))
    scans = CellScan(jnp.arange(1.0, SCANS + 1, dtype=dtype), jnp.asarray(RATIO, dtype))
    filter = GridFilter(grid, target, Jumps(), jnp.full(CELLS, -np.log(CELLS), dtype))
    _, (existence, cells), _ = run(
        filter, Ratios(), scans, KEY, lambda belief: (belief.existence, jnp.exp(belief.log_weights))
    )
    for scan in range(SCANS):
        expected, where, _ = every_path(scan + 1)
        assert_equal(existence[scan], expected, dtype, 200)
        assert_equal(cells[scan], where, dtype, 200)


def test_a_gaussian_target_is_followed_as_by_the_kalman_filter() -> None:
    """Ten contacts on a fine grid: mean, covariance and log evidence, but for what cells add, a few per cent."""
    grid = Grid(RangeState, (("range", Axis(-10.0, 0.1, 201)), ("range_rate", Axis(-1.5, 0.1, 31))))
    noise, interval, std = 0.2, 1.0, 0.8
    motion = PlanarMotion(noise)
    target = Target(None, motion, 0.0, 0.0)
    filter = GridFilter(grid, target, separable(grid, motion, interval))
    start, spread = np.array([-3.0, 0.5]), np.diag([1.0, 0.15])
    states = grid.states()
    log_weights = -((states.range - start[0]) ** 2) / 2 - (states.range_rate - start[1]) ** 2 / (2 * 0.15)
    belief = Belief(states, log_weights - jax.nn.logsumexp(log_weights), jnp.array(0.0), jnp.array(0.0))
    transition = np.array([[1, interval], [0, 1]])
    process = noise**2 * np.array([[interval**3 / 3, interval**2 / 2], [interval**2 / 2, interval]])
    rng = np.random.default_rng(4)
    contacts = -3 + 0.5 * np.arange(1, 11) + std * rng.normal(size=10)
    middle, error, log_evidence, ours = start, spread, 0.0, 0.0

    @jax.jit
    def advance(belief: Belief, time: Any, contact: Any) -> tuple[Belief, Any]:
        predicted = filter.predict(belief, time, KEY)
        log_ratio = -((contact - states.range) ** 2) / (2 * std**2)
        joint = predicted.log_weights + log_ratio
        total = jax.nn.logsumexp(joint)
        return Belief(states, joint - total, predicted.log_odds, predicted.time), total

    for number, contact in enumerate(contacts):
        belief, total = advance(belief, jnp.array(number + 1.0), jnp.array(contact, jnp.float32))
        ours += float(total)
        middle, error = transition @ middle, transition @ error @ transition.T + process
        innovation = error[0, 0] + std**2
        log_evidence += -0.5 * (contact - middle[0]) ** 2 / innovation - 0.5 * np.log(innovation / std**2)
        gain = error[:, 0] / innovation
        middle, error = middle + gain * (contact - middle[0]), error - np.outer(gain, error[0])
    found = mean(belief)
    np.testing.assert_allclose([found.range, found.range_rate], middle, atol=0.05 * np.sqrt(np.diag(error)).min())
    np.testing.assert_allclose(covariance(belief), error, rtol=0.05, atol=0.01 * error[0, 0])
    np.testing.assert_allclose(ours, log_evidence, atol=0.1)


PLANE = Grid(PlanarState, (("y", Axis(-1.0, 0.5, 9)), ("vx", Axis(0.0, 1.0, 4)), ("x", Axis(2.0, 0.25, 12))))


def test_marginals_and_densest_cells_are_direct_sums() -> None:
    weights = np.random.default_rng(0).exponential(size=PLANE.shape)
    weights /= weights.sum()
    belief = Belief(PLANE.states(), jnp.log(jnp.asarray(weights, jnp.float32)), jnp.array(0.0), jnp.array(0.0))
    assert_equal(np.exp(marginal(belief, PLANE, "x", "y")), weights.sum(axis=1), np.float32, 100)
    assert_equal(np.exp(marginal(belief, PLANE, "vx")), weights.sum(axis=(0, 2)), np.float32, 200)
    densest = np.asarray(highest_density(belief, 0.5))
    assert weights[densest].sum() >= 0.5 > weights[densest].sum() - weights[densest].min()
    assert weights[densest].min() > weights[~densest].max()


def test_mean_and_covariance_are_direct_sums(dtype: type) -> None:
    """Over all cells; the spread is a difference of values up to 5."""
    weights = np.random.default_rng(0).exponential(size=PLANE.shape)
    weights /= weights.sum()
    states = PLANE.states(dtype)
    belief = Belief(states, jnp.log(jnp.asarray(weights, dtype)), jnp.zeros((), dtype), jnp.zeros((), dtype))
    cells = np.stack([np.broadcast_to(values, PLANE.shape).ravel() for values in jax.tree.leaves(states)])
    expected = np.cov(cells, aweights=weights.ravel(), ddof=0)
    assert_equal(jax.tree.leaves(mean(belief)), cells @ weights.ravel(), dtype, 100, scale=5.0)
    assert_equal(covariance(belief), expected, dtype, 100, scale=5.0)
    assert_equal(jax.tree.leaves(standard_deviation(belief)), np.sqrt(np.diag(expected)), dtype, 100, scale=5.0)


def test_directions_on_a_grid_are_those_of_its_cells_as_points(dtype: type) -> None:
    """Bearings on both sides of pi."""
    grid = Grid(BearingState, (("bearing", Axis(2.8, 0.1, 7)), ("snr_db", Axis(-5.0, 1.0, 4))))
    weights = jnp.asarray(np.random.default_rng(0).dirichlet(np.ones(grid.size)).reshape(grid.shape), dtype)
    belief = Belief(grid.states(dtype), jnp.log(weights), jnp.zeros((), dtype), jnp.zeros((), dtype))
    points = jax.tree.map(lambda values: jnp.broadcast_to(values, grid.shape).ravel(), belief.states)
    listed = Belief(points, belief.log_weights.ravel(), belief.log_odds, belief.time)
    for estimate in (mean, standard_deviation, covariance):
        found, expected = (np.array(jax.tree.leaves(estimate(each))) for each in (belief, listed))
        assert_equal(found, expected, dtype, 100, scale=5.0)


def test_the_peak_of_a_normal_density_is_found_between_cells(float64: type) -> None:
    """Correlated, off the middles of cells, in three dimensions: exact."""
    precision = np.array([[2.0, 0.3, -0.5], [0.3, 1.0, 0.2], [-0.5, 0.2, 3.0]])
    peak = np.array([0.62, 1.8, 3.4])
    states = PLANE.states(float64)
    off = [value - middle for value, middle in zip((states.y, states.vx, states.x), peak, strict=True)]
    log_weights = -0.5 * sum(precision[i, j] * off[i] * off[j] for i in range(3) for j in range(3))
    state, spread = refined_mode(Belief(states, log_weights, jnp.array(0.0), jnp.array(0.0)), PLANE)
    np.testing.assert_allclose([state.y, state.vx, state.x], peak, rtol=1e-9)
    np.testing.assert_allclose(spread, solve(precision, np.eye(3)), rtol=1e-9)


@pytest.mark.parametrize("edge", [True, False])
def test_where_there_is_no_peak_the_cell_is_given(edge: bool) -> None:
    grid = Grid(RangeState, (("range", Axis(0.0, 1.0, 5)),))
    values = [5.0, 4.0, 3.0, 2.0, 1.0] if edge else [-np.inf, -np.inf, 0.0, -np.inf, -np.inf]
    state, spread = refined_mode(Belief(grid.states(), jnp.array(values), jnp.array(0.0), jnp.array(0.0)), grid)
    assert state.range == (0.0 if edge else 2.0)
    assert np.isnan(spread).all()
