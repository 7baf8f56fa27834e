"""The study of stone2002: surfaces against sums over paths, tiny probabilities against counting."""

import itertools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import norm

from faintrack.errors import InputError
from faintrack.likelihoods.clutter import ClutterLikelihood
from faintrack.metrics.change_of_measure import log_probability_under_noise
from faintrack.sensors.cells import CellScan
from faintrack.signal.clutter import ClutterScan, Level
from faintrack.studies.stone2002 import periscope, simulation, study, tenet
from tests.tolerances import STANDARD_ERRORS, rounding


def test_prior_is_the_papers() -> None:
    assert simulation.prior_log_ratio() == pytest.approx(-math.log(2700), rel=4 * rounding(np.float32))


@pytest.mark.parametrize(("position", "velocity"), [(40, 1), (2, -3), (99, 5), (103, 2)])
def test_surface_is_the_sum_over_all_paths(position: int, velocity: int) -> None:
    values = np.random.default_rng(1).normal(size=(3, 100))
    surfaces = jax.jit(simulation.surfaces)(CellScan(jnp.arange(3.0), jnp.asarray(values, jnp.float32)))
    # Two cells of silence on either side; cells of the sensor are numbered from 1.
    share = np.array([0.5, 1.0, 0.5]) * simulation.LEVEL
    logs = []
    for first, second in itertools.product((-1, 0, 1), repeat=2):
        end = [position - 2 * velocity - first - second, position - velocity - second, position]
        if not 1 <= end[0] <= 100:
            continue
        log_ratio = sum(
            u * values[time, cell - 1] - u * u / 2
            for time, place in enumerate(end)
            for cell, u in zip((place - 1, place, place + 1), share, strict=True)
            if 1 <= cell <= 100
        )
        logs.append(
            math.log(1 / 2700) + math.log(simulation.PLANT[first + 1] * simulation.PLANT[second + 1]) + log_ratio
        )
    expected = logsumexp(logs) if logs else -np.inf
    assert surfaces[2, position + 70, velocity + 3] == pytest.approx(expected, rel=30 * rounding(np.float32), abs=1e-5)


@pytest.mark.slow
def test_false_alarms_by_change_of_measure_are_those_counted() -> None:
    keys = jax.random.split(jax.random.key(3), 400)
    drawn, noise = (
        {name: np.asarray(values) for name, values in jax.jit(jax.vmap(run))(keys).items()}
        for run in (simulation.modelled, simulation.noise)
    )
    scan, threshold = 1, 0.0
    log_probability, error = log_probability_under_noise(
        drawn["peak"][:, scan] > threshold, drawn["log_ratio"][:, scan]
    )
    counted = (noise["peak"][:, scan] > threshold).mean()
    assert 0.01 < counted < 0.2
    spread = math.hypot(error * math.exp(log_probability), math.sqrt(counted * (1 - counted) / len(keys)))
    assert abs(math.exp(log_probability) - counted) < STANDARD_ERRORS * spread


def test_a_probability_below_the_smallest_double() -> None:
    # One normal number, mean 60 under the target: P0(y > 60) is about 1e-784.
    y = 60 + np.random.default_rng(0).normal(size=20_000)
    log_probability, error = log_probability_under_noise(y > 60, 60 * y - 60**2 / 2)
    assert log_probability == pytest.approx(norm.logsf(60), abs=STANDARD_ERRORS * error)
    assert error < 0.1


def test_a_single_run_has_no_standard_error() -> None:
    with pytest.raises(InputError, match=r"shapes \(1,\) and \(1,\); expected one value a run in each, at least two"):
        log_probability_under_noise(np.ones(1, bool), np.zeros(1))


def test_periscope_follows_the_simplified_recursion() -> None:
    rng = np.random.default_rng(2)
    power = rng.exponential(size=(3, periscope.RANGES)).astype(np.float32)
    level = Level(jnp.full(power.shape, 6.0), jnp.full(power.shape, 6.0))
    likelihood = ClutterLikelihood(periscope.scene().cells, 2.0)
    scans = ClutterScan(jnp.arange(3) * periscope.INTERVAL, jnp.asarray(power), level)
    over_range, _ = jax.jit(periscope.follow)(scans, likelihood)
    ratio = np.exp(np.asarray(jax.vmap(likelihood.table)(scans), float))
    velocity = periscope.RATES.values
    # Every state by itself: its prior in the first scan, then what has come from a feet before, and births.
    expected = np.full((periscope.RANGES, len(velocity)), periscope.PRIOR / (1 - periscope.PRIOR))
    expected *= ratio[0][:, None] / expected.size
    for scan in (1, 2):
        time = periscope.INTERVAL * scan
        moved = np.full(expected.shape, periscope.BIRTH)
        for number, v in enumerate(velocity):
            shift = int(np.round(v * time) - np.round(v * (time - periscope.INTERVAL)))
            for place in range(periscope.RANGES):
                if 0 <= place - shift < periscope.RANGES:
                    moved[place, number] += expected[place - shift, number]
        expected = moved * ratio[scan][:, None]
    np.testing.assert_allclose(np.exp(over_range[-1]), expected.sum(axis=1), rtol=1e-4)


def test_a_window_that_moves_carries_its_weights_along() -> None:
    weights = np.random.default_rng(3).normal(size=(1, 1, tenet.WINDOW, tenet.WINDOW)).astype(np.float32)
    moved = np.asarray(tenet.shifted(jnp.asarray(weights), jnp.array([2, -3])))
    np.testing.assert_array_equal(moved[..., :-2, 3:], weights[..., 2:, :-3])
    assert np.all(np.isneginf(moved[..., -2:, :]))
    assert np.all(np.isneginf(moved[..., :3]))


def test_the_window_starts_with_the_gate() -> None:
    grid = tenet.challenge().grid
    assert grid is not None
    weights = np.exp(grid.init(jax.random.key(0)).log_weights)
    assert weights.sum() == pytest.approx(1, rel=1e-5)
    over_place = weights.sum(axis=(0, 1, 3))
    # Ten pixels between -0.5 and 0.5: nine whole ones, and halves at both ends.
    inside = np.isclose(over_place, 0.1, rtol=1e-4).sum(), np.isclose(over_place, 0.05, rtol=1e-4).sum()
    assert inside == (9, 2)


def test_every_setting_has_a_name_of_its_own() -> None:
    names = [setting.name for setting in study.settings]
    assert len(set(names)) == len(names)
