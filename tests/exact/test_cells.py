"""Cells: the ratio is that of the full densities of all cells, and what is simulated has those densities."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from faintrack.beliefs.axis import Axis
from faintrack.beliefs.belief import Belief
from faintrack.errors import InputError
from faintrack.likelihoods.cells import (
    CellLikelihood,
    gaussian,
    gaussian_spread,
    point,
    rayleigh,
    spill_over,
    swerling0,
    swerling1,
)
from faintrack.sensors.cells import Cells, CellScan, cell_surface
from faintrack.simulation.cells import draw_scans
from faintrack.targets.states import PlanarState, RangeState
from tests.tolerances import assert_equal, assert_mean

PROFILE = Cells((("range", Axis(1.0, 1.0, 12)),))
IMAGE = Cells((("y", Axis(0.0, 1.0, 6)), ("x", Axis(0.0, 2.0, 5))))
DENSITIES = {
    gaussian: lambda level: stats.norm(loc=level),
    swerling1: lambda level: stats.expon(scale=1 + level),
    # Twice the power of a cell: two Gaussian parts of variance 1, one with mean sqrt(2 s).
    swerling0: lambda level: stats.ncx2(2, np.maximum(2 * level, 1e-300), scale=0.5),
    rayleigh: lambda level: stats.rayleigh(scale=np.sqrt(1 + level)),
}
OPERATIONS = 200
"""Roundings in the sum of up to 25 log ratios, each of a few dozen."""
DRAWS = 5_000
SURPRISE = 1e-5
"""Level of a Kolmogorov-Smirnov test with a fixed key."""

every = pytest.mark.parametrize("amplitude", DENSITIES, ids=lambda amplitude: amplitude.__name__)


def planar(x: object, y: object, dtype: type = np.float32) -> PlanarState:
    x, y = jnp.asarray(x, dtype), jnp.asarray(y, dtype)
    return PlanarState(x, y, jnp.zeros_like(x), jnp.zeros_like(y))


def profile_state(value: object, dtype: type = np.float32) -> RangeState:
    value = jnp.asarray(value, dtype)
    return RangeState(value, jnp.zeros_like(value))


def values_of(cells: Cells, dtype: type) -> np.ndarray:
    return np.random.default_rng(3).exponential(size=cells.shape).astype(dtype) + dtype(0.1)


def brute_force(amplitude: object, values: np.ndarray, levels: np.ndarray) -> np.ndarray:
    """Sum of the log densities of all cells under the target, less that under noise; cells along the axes of values."""
    values, axes = values.astype(np.float64), tuple(range(-values.ndim, 0))
    noise = DENSITIES[amplitude](np.zeros(values.shape)).logpdf(values)
    return np.sum(DENSITIES[amplitude](levels).logpdf(values) - noise, axis=axes)


@eqx.filter_jit
def ratio(likelihood: CellLikelihood, scan: CellScan, states: object) -> jax.Array:
    return likelihood.log_ratio(scan, states)


draw = eqx.filter_jit(draw_scans)


@every
def test_a_cell_is_the_ratio_of_the_two_densities(amplitude: object, dtype: type) -> None:
    value, level = np.array([0.05, 0.7, 3.0, 20.0]), np.array([[0.1], [2.0], [12.0]])
    density = DENSITIES[amplitude]
    expected = density(level).logpdf(value) - density(np.zeros(1)).logpdf(value)
    actual = amplitude(jnp.asarray(value, dtype), jnp.asarray(level, dtype))
    assert actual.dtype == dtype
    assert_equal(actual, expected, dtype, 40, scale=200.0)


@every
def test_loud_cells_are_finite(amplitude: object) -> None:
    assert np.all(np.isfinite(amplitude(jnp.array([0.0, 1e4]), jnp.array([[0.0], [1e4]]))))


def test_one_cell_and_states_outside(dtype: type) -> None:
    """The cell that a state lies in, and nothing where it lies in none."""
    values = values_of(PROFILE, dtype)
    likelihood = CellLikelihood(PROFILE, swerling1, 3.0)
    states = profile_state([0.4, 0.6, 1.49, 5.2, 12.4, 12.6], dtype)
    actual = ratio(likelihood, CellScan(jnp.array(0.0, dtype), jnp.asarray(values)), states)
    one = [brute_force(swerling1, values[[cell]], np.array([3.0])) for cell in (0, 0, 4, 11)]
    assert_equal(actual, [0.0, *one, 0.0], dtype, OPERATIONS, scale=1.0)


def test_spill_over_of_stone(dtype: type) -> None:
    """stone2002, eq. 32; at both ends the factors with subscripts below 1 and above 12 are omitted."""
    values, u = values_of(PROFILE, dtype), 2.0
    likelihood = CellLikelihood(PROFILE, gaussian, u, spill_over(0.5), reach=1)
    at = np.arange(-1, 15)
    actual = ratio(likelihood, CellScan(jnp.array(0.0, dtype), jnp.asarray(values)), profile_state(at, dtype))
    cells = np.arange(1, 13)
    expected = [brute_force(gaussian, values, u * np.interp(np.abs(cells - j), [0, 1, 2], [1, 0.5, 0])) for j in at]
    y = values[3:6].astype(float)
    assert_equal(expected[6], u * y[0] / 2 + u * y[1] + u * y[2] / 2 - 3 * u**2 / 4, np.float64, OPERATIONS, scale=10)
    assert_equal(actual, expected, dtype, OPERATIONS, scale=10.0)


@pytest.mark.parametrize(
    ("amplitude", "oversample"),
    [(gaussian, 1), (gaussian, 3), (swerling1, 2), (swerling1, 3), (swerling0, 3), (rayleigh, 3)],
)
def test_an_image_is_the_product_over_all_pixels(amplitude: object, oversample: int, dtype: type) -> None:
    """At every place that the table tells apart, in the corners, and around the sensor."""
    values, reach, width = values_of(IMAGE, dtype), 2, 0.8
    likelihood = CellLikelihood(IMAGE, amplitude, 3.0, gaussian_spread(width), reach, oversample)
    within = (np.arange(oversample) + 0.5) / oversample - 0.5
    row, column = (np.repeat(np.arange(-3, count), oversample) for count in (9, 8))
    row_place, column_place = row + np.tile(within, 12), column + np.tile(within, 11)
    scan = CellScan(jnp.array(0.0, dtype), jnp.asarray(values))
    actual = ratio(likelihood, scan, planar(2 * column_place[None, :], row_place[:, None], dtype))
    rows, columns = np.arange(6)[:, None], np.arange(5)
    row, column, row_place, column_place = (
        each.reshape(shape)
        for each, shape in zip((row, column, row_place, column_place), 2 * [(-1, 1, 1, 1), (1, -1, 1, 1)], strict=True)
    )
    reached = np.maximum(np.abs(rows - row), np.abs(columns - column)) <= reach
    square = (rows - row_place) ** 2 + (columns - column_place) ** 2
    expected = brute_force(amplitude, values, 3.0 * np.exp(-square / (2 * width**2)) * reached)
    assert_equal(actual, expected, dtype, OPERATIONS, scale=50.0)
    assert not np.any(actual[0])
    assert np.any(actual[oversample])


def test_a_level_a_cell(dtype: type) -> None:
    values, level = values_of(PROFILE, dtype), np.linspace(0.5, 3.0, 12)
    likelihood = CellLikelihood(PROFILE, swerling1, jnp.asarray(level, dtype), spill_over(0.5), reach=1)
    actual = ratio(likelihood, CellScan(jnp.array(0.0, dtype), jnp.asarray(values)), profile_state([4.0], dtype))
    share = np.interp(np.abs(np.arange(1, 13) - 4), [0, 1, 2], [1, 0.5, 0])
    assert_equal(actual, [brute_force(swerling1, values, level * share)], dtype, OPERATIONS, scale=1.0)


def test_a_cell_without_a_number_says_nothing() -> None:
    values = values_of(PROFILE, np.float32)
    likelihood = CellLikelihood(PROFILE, gaussian, 2.0, spill_over(0.5), reach=1)
    missing = CellScan(jnp.array(0.0), jnp.asarray(values).at[4].set(jnp.nan))
    actual = ratio(likelihood, missing, profile_state([4.0, 5.0]))
    share = np.interp(np.abs(np.delete(np.arange(1, 13), 4)[None] - [[4], [5]]), [0, 1, 2], [1, 0.5, 0])
    expected = [brute_force(gaussian, np.delete(values, 4), 2.0 * row) for row in share]
    assert_equal(actual, expected, np.float32, OPERATIONS, scale=1.0)


@every
def test_what_is_drawn_has_the_densities(amplitude: object) -> None:
    """Kolmogorov and Smirnov: the target's cell, its neighbour, and a cell of noise, in frames with and without it."""
    likelihood = CellLikelihood(PROFILE, amplitude, 3.0, spill_over(0.5), reach=1)
    present = np.arange(DRAWS) % 2 == 0
    at = jnp.where(present, 5.0, 7.0)
    scans = draw(jax.random.key(5), likelihood, jnp.arange(float(DRAWS)), profile_state(at), jnp.asarray(present))
    for cell, level in ((5, 3.0), (6, 1.5), (4, 1.5), (8, 0.0)):
        with_target = np.asarray(scans.values)[present, cell - 1]
        assert stats.kstest(with_target, DENSITIES[amplitude](level).cdf).pvalue > SURPRISE
    assert stats.kstest(np.asarray(scans.values)[~present, 6], DENSITIES[amplitude](0.0).cdf).pvalue > SURPRISE


def test_levels_of_several_targets_add() -> None:
    likelihood = CellLikelihood(IMAGE, gaussian, 5.0, gaussian_spread(1.0), reach=1, oversample=3)
    x, y = jnp.tile(jnp.array([2.0, 4.67]), (DRAWS, 1)), jnp.tile(jnp.array([0.0, 1.33]), (DRAWS, 1))
    scans = draw(jax.random.key(6), likelihood, jnp.arange(float(DRAWS)), planar(x, y), jnp.ones((DRAWS, 2), bool))
    rows, columns = np.mgrid[:6, :5]
    expected = np.zeros((6, 5))
    for row, column, near in ((0.0, 1.0, (0, 1)), (4 / 3, 7 / 3, (1, 2))):
        within = np.maximum(np.abs(rows - near[0]), np.abs(columns - near[1])) <= 1
        expected += 5.0 * within * np.exp(-((rows - row) ** 2 + (columns - column) ** 2) / 2)
    assert_mean(scans.values, expected)


def test_the_surface_sums_points_into_cells(dtype: type) -> None:
    """Two points in one cell, one in another, and two beyond either end of an axis, which are in none."""
    x, y = jnp.array([0.0, 2.0, 1.5, 9.1, 4.0], dtype), jnp.array([1.0, 0.0, 0.4, 0.0, -1.0], dtype)
    states = PlanarState(x, y, jnp.zeros_like(x), jnp.zeros_like(y))
    weights = jnp.log(jnp.array([0.5, 0.125, 0.125, 0.125, 0.125], dtype))
    found = jnp.exp(cell_surface(Belief(states, weights, jnp.log(jnp.array(2.0, dtype)), jnp.zeros((), dtype)), IMAGE))
    expected = np.zeros(IMAGE.shape)
    expected[1, 0], expected[0, 1] = 1.0, 0.5
    assert_equal(found, expected, dtype, OPERATIONS)


def test_what_cannot_be_used_is_said() -> None:
    with pytest.raises(InputError, match="reach is -1 and oversample 1; expected at least 0, and at least 1"):
        CellLikelihood(PROFILE, gaussian, 1.0, point, reach=-1)
    with pytest.raises(InputError, match="width is 0; expected above 0"):
        gaussian_spread(0.0)
    other = CellLikelihood(PROFILE, lambda value, level: value * level, 1.0)
    with pytest.raises(InputError, match="there is no simulation of it; expected one of gaussian, swerling1"):
        draw_scans(jax.random.key(0), other, jnp.zeros(1), profile_state([1.0]), jnp.array([True]))
