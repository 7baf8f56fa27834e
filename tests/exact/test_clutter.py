"""Compound clutter: the ratio is that of the integrals it comes from, the tracker finds the level, draws are K."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats
from scipy.integrate import quad

from faintrack.beliefs.axis import Axis
from faintrack.likelihoods.cells import swerling1
from faintrack.likelihoods.clutter import ClutterLikelihood, absolute, lomax
from faintrack.sensors.cells import Cells, CellScan
from faintrack.signal.clutter import ClutterScan, ClutterTracker, Level
from faintrack.simulation.clutter import CompoundClutter, draw_levels, draw_scans
from faintrack.targets.states import RangeState
from tests.tolerances import assert_equal, assert_mean

SHAPE, SCALE, RATIO = 3.5, 7.0, 2.0
OPERATIONS = 100
INTEGRAL = 1e-8
"""To which the numerical integrals are taken, and compared."""
DRAWS = 20_000
LEVEL = Level(jnp.array(SHAPE), jnp.array(SCALE))


def level_of(dtype: type) -> Level:
    return Level(jnp.asarray(SHAPE, dtype), jnp.asarray(SCALE, dtype))


@pytest.mark.parametrize("power", [0.01, 1.0, 30.0])
def test_the_level_is_integrated_out(power: float, float64: type) -> None:
    def density(ratio: float) -> float:
        def joint(level: float) -> float:
            mean = (1 + ratio) * level
            return stats.expon(scale=mean).pdf(power) * stats.invgamma(SHAPE, scale=SCALE).pdf(level)

        return quad(joint, 0, np.inf, epsrel=INTEGRAL, limit=200)[0]

    actual = lomax(jnp.array(power), level_of(float64), RATIO)
    np.testing.assert_allclose(actual, np.log(density(RATIO) / density(0.0)), atol=10 * INTEGRAL)


def test_a_cell_is_the_ratio_of_two_lomax_densities(dtype: type) -> None:
    power = np.array([0.01, 1.0, 30.0, 1e4])
    expected = stats.lomax(SHAPE, scale=SCALE * (1 + RATIO)).logpdf(power) - stats.lomax(SHAPE, scale=SCALE).logpdf(
        power
    )
    actual = lomax(jnp.asarray(power, dtype), level_of(dtype), RATIO)
    assert actual.dtype == dtype
    assert_equal(actual, expected, dtype, OPERATIONS, scale=10.0)


@pytest.mark.parametrize("ratio", [0.1, 2.0, 100.0])
def test_mean_ratio_under_clutter_is_1(ratio: float, float64: type) -> None:
    noise, level = stats.lomax(SHAPE, scale=SCALE), level_of(float64)

    def share(place: float) -> float:
        """Over the distribution function, so that the heavy tail is a finite interval."""
        return float(jnp.exp(lomax(jnp.array(noise.ppf(place)), level, ratio)))

    assert abs(quad(share, 0, 1, epsrel=INTEGRAL)[0] - 1) < 10 * INTEGRAL


def test_a_known_level_is_swerling(float64: type) -> None:
    """With n to infinity the difference falls as 1 / n; z^2 / (2 n) is its size."""
    power, count = jnp.array([0.1, 2.0, 8.0]), 1e9
    known = lomax(power * 3, Level(jnp.array(count), jnp.array(3 * count)), RATIO)
    np.testing.assert_allclose(known, swerling1(power, RATIO), atol=100 / count)


def test_a_strong_echo_tells_at_most_what_is_known() -> None:
    assert_equal(lomax(jnp.array(1e20), LEVEL, RATIO), SHAPE * np.log(3), np.float32, OPERATIONS, scale=10.0)


def test_a_target_of_given_power_in_its_cell(dtype: type) -> None:
    cells = Cells((("range", Axis(0.0, 1.0, 3)),))
    scale = jnp.asarray([1.0, 7.0, 70.0], dtype)
    scan = ClutterScan(
        jnp.array(0.0, dtype), jnp.asarray([1.0, 30.0, 30.0], dtype), Level(jnp.full_like(scale, SHAPE), scale)
    )
    states = RangeState(jnp.asarray([1.0, 2.0, 3.0], dtype), jnp.zeros(3, dtype))
    actual = ClutterLikelihood(cells, 4.0, absolute).log_ratio(scan, states)
    expected = [
        stats.lomax(SHAPE, scale=a * (1 + 4.0 * SHAPE / a)).logpdf(30.0) - stats.lomax(SHAPE, scale=a).logpdf(30.0)
        for a in (7.0, 70.0)
    ]
    assert_equal(actual, [*expected, 0.0], dtype, OPERATIONS, scale=10.0)


def test_bayes_rule_scan_by_scan() -> None:
    """Nothing forgotten: shape and scale are those of the product of all densities; and the mean ratio is 1."""
    tracker = ClutterTracker(forget=1.0)
    level = stats.invgamma(SHAPE, scale=SCALE).rvs(DRAWS, random_state=1)
    power = np.random.default_rng(2).exponential(level, (6, DRAWS)).astype(np.float32)
    start = Level(jnp.full(DRAWS, SHAPE), jnp.full(DRAWS, SCALE))
    after, scans = tracker.run(start, CellScan(jnp.arange(6.0), jnp.asarray(power)))
    assert_equal(after.scale, SCALE + power.sum(axis=0, dtype=float), np.float32, OPERATIONS)
    assert_equal(after.shape, np.full(DRAWS, SHAPE + 6), np.float32, OPERATIONS)
    assert_mean(np.exp(lomax(scans.values[5], jax.tree.map(lambda x: x[5], scans.level), 0.5)), 1.0)


def test_the_tracker_finds_the_level() -> None:
    """The mean of scale over shape is the level, though it started at half of it; forgotten as 0.8^60 = 2e-6."""
    tracker = ClutterTracker(forget=0.8, own=0.5, neighbour=0.25, guard=2, train=3)
    power = 5.0 * jax.random.exponential(jax.random.key(3), (4_000, 60, 13))
    scans = CellScan(jnp.zeros(60), power)
    start = tracker.init(jnp.full(13, 2.5))
    after = jax.jit(jax.vmap(lambda values: tracker.run(start, CellScan(scans.time, values))[0]))(power)
    neighbours = np.array([3, 3, 3, 4, 5, 6, 6, 6, 5, 4, 3, 3, 3])
    assert_equal(after.shape, np.tile((0.5 + 0.25 * neighbours) / 0.2, (4_000, 1)), np.float32, OPERATIONS)
    assert_mean(after.scale / after.shape, 5.0)


def test_a_target_is_judged_by_what_it_does_not_reach() -> None:
    """A scan's power in a cell and its guard is not in the level for that cell, and is in that of the others."""
    tracker = ClutterTracker(forget=0.9, neighbour=1.0, guard=1, train=2)
    quiet = jnp.ones(11)
    used = [tracker.step(tracker.init(quiet), power)[1].scale for power in (quiet, quiet.at[5].set(1e3))]
    changed = np.flatnonzero(np.asarray(used[0] != used[1]))
    assert changed.tolist() == [2, 3, 7, 8]


def test_levels_are_gamma_and_travel() -> None:
    """Scans far apart in time: independent. A wave of 2 cells a scan is where it should be 3 scans later."""
    clutter = CompoundClutter(shape=0.8, length=2.0, duration=50.0, speed=10.0, mean=3.0)
    draw = jax.jit(jax.vmap(lambda key: draw_levels(key, clutter, 24, 0.2, 4)))
    levels = np.asarray(draw(jax.random.split(jax.random.key(4), 5_000)), np.float64)
    gamma = stats.gamma(0.8, scale=3.0 / 0.8)
    for place in ((0, 0), (3, 23)):
        assert stats.kstest(levels[:, *place], gamma.cdf).pvalue > 1e-5
    normal = stats.norm.ppf(np.clip(gamma.cdf(levels), 1e-12, 1 - 1e-12))
    for shift in (0, 4, 6, 8):
        expected = np.exp(-((shift - 6.0) ** 2) / (2 * 2.0**2) - 0.6 / 50.0)
        assert_mean(normal[:, 0, 4] * normal[:, 3, 4 + shift], expected)


def test_profiles_are_exponential_about_the_level_with_the_target_added() -> None:
    """Mean power 3 in every cell and 3 + 40 in the target's; second moment of K: 2 m^2 (1 + 1 / shape)."""
    clutter = CompoundClutter(shape=2.0, length=2.0, duration=5.0, mean=3.0)
    cells, time = Cells((("range", Axis(0.0, 1.0, 12)),)), 0.2 * jnp.arange(2)
    states = RangeState(jnp.array([4.0, 5.0]), jnp.ones(2))
    draw = eqx.filter_jit(
        jax.vmap(lambda key: draw_scans(key, clutter, cells, time, states, jnp.array([False, True]), 40.0).values)
    )
    power = np.asarray(draw(jax.random.split(jax.random.key(5), DRAWS)), np.float64)
    expected = np.full((2, 12), 3.0)
    expected[1, 5] = 43.0
    assert_mean(power, expected)
    assert_mean(power[:, 0] ** 2, 2 * 9.0 * (1 + 1 / 2.0))
