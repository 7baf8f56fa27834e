"""Student noise and unknown levels against densities from scipy and direct integration."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import integrate, stats

from faintrack.beliefs.axis import Axis
from faintrack.errors import InputError
from faintrack.likelihoods.cells import CellLikelihood, gaussian, spill_over
from faintrack.likelihoods.heavy_tails import student
from faintrack.likelihoods.unknown_level import UnknownLevel
from faintrack.sensors.cells import Cells, CellScan
from faintrack.targets.states import RangeState
from tests.tolerances import STANDARD_ERRORS, assert_equal

CELLS = Cells((("range", Axis(0.0, 1.0, 20)),))


@pytest.mark.parametrize("freedom", [3.0, 6.0, 40.0])
def test_student_is_the_ratio_of_two_densities_of_variance_1(freedom: float, dtype: type) -> None:
    noise = stats.t(freedom, scale=np.sqrt((freedom - 2) / freedom))
    assert noise.var() == pytest.approx(1)
    value, level = np.linspace(-8, 12, 41), 2.5
    expected = noise.logpdf(value - level) - noise.logpdf(value)
    actual = student(freedom)(jnp.asarray(value, dtype), jnp.asarray(level, dtype))
    assert_equal(actual, expected, dtype, 8 * int(freedom), 10.0)


def test_mean_ratio_under_student_noise_is_1(float64: type) -> None:
    """By direct integration, to its error."""
    noise = stats.t(6.0, scale=np.sqrt(4 / 6))
    ratio = student(6.0)
    mean, error = integrate.quad(lambda y: float(jnp.exp(ratio(jnp.asarray(y), 3.0))) * noise.pdf(y), -30, 30, limit=60)
    beyond = noise.sf(30 - 3.0) + noise.cdf(-30 - 3.0)
    assert abs(mean + beyond - 1) < 1e-7 + error


@pytest.mark.parametrize("slack", [0.3, 0.7])
def test_slack_widens_the_density_under_a_target_with_its_level(slack: float, dtype: type) -> None:
    freedom, level, value = 6.0, 5.0, np.linspace(-8, 12, 41)
    scale = np.sqrt((freedom - 2) / freedom)
    noise = stats.t(freedom, scale=scale)
    target = stats.t(freedom, loc=level, scale=scale * np.hypot(1, slack * level))
    expected = target.logpdf(value) - noise.logpdf(value)
    actual = student(freedom, slack=slack)(jnp.asarray(value, dtype), jnp.asarray(level, dtype))
    assert_equal(actual, expected, dtype, 48, 10.0)


def test_draws_with_slack_have_the_mean_and_deviation_of_their_density() -> None:
    count, level, slack = 20_000, 5.0, 0.7
    drawn = np.asarray(student(10.0, slack=slack).draw(jax.random.key(0), jnp.full(count, level)), float)
    deviation = np.hypot(1, slack * level)
    assert abs(drawn.mean() - level) < STANDARD_ERRORS * deviation / count**0.5
    # Of ten degrees of freedom the kurtosis is 4.
    assert abs(drawn.var() / deviation**2 - 1) < STANDARD_ERRORS * (3 / count) ** 0.5


def test_slack_below_0_is_refused() -> None:
    with pytest.raises(InputError, match=r"slack is -0.1; expected at least 0"):
        student(10.0, slack=-0.1)


def test_no_level_says_nothing() -> None:
    assert not np.any(student(5.0)(jnp.linspace(-5, 50, 12), 0.0))


def test_a_broken_cell_is_told_from_a_target() -> None:
    """Gaussian noise takes a lone cell of 12 for a target; with heavy tails its silent neighbours weigh against it."""
    state = RangeState(jnp.array(10.0), jnp.array(0.0))
    broken = CellScan(jnp.array(0.0), jnp.zeros(20).at[10].set(12.0))
    target = CellScan(jnp.array(0.0), jnp.zeros(20).at[9:12].set(jnp.array([6.0, 12.0, 6.0])))
    heavy, light = (CellLikelihood(CELLS, model, 12.0, spill_over(0.5), reach=1) for model in (student(5.0), gaussian))
    assert light.log_ratio(broken, state) > 30
    assert heavy.log_ratio(broken, state) < 0 < heavy.log_ratio(target, state)


def test_unknown_level_is_the_mean_of_the_ratios() -> None:
    values = np.random.default_rng(0).normal(size=20) * 2
    scan = CellScan(jnp.array(0.0), jnp.asarray(values, jnp.float32))
    parts = tuple(CellLikelihood(CELLS, gaussian, level, spill_over(0.5), reach=1) for level in (1.0, 2.0, 4.0))
    states = RangeState(jnp.array([0.0, 7.0, 19.0, 25.0]), jnp.zeros(4))
    expected = np.log(np.mean([np.exp(np.asarray(part.log_ratio(scan, states), float)) for part in parts], axis=0))
    assert_equal(UnknownLevel(parts).log_ratio(scan, states), expected, np.float32, 20, 10.0)


def test_settings_that_make_no_sense() -> None:
    with pytest.raises(InputError, match=r"freedom is 2"):
        student(2.0)
    with pytest.raises(InputError, match="no likelihood"):
        UnknownLevel(())
    with pytest.raises(InputError, match="different places"):
        UnknownLevel((CellLikelihood(CELLS, gaussian, 1.0), CellLikelihood(CELLS, gaussian, 1.0, spill_over(0.5), 1)))
