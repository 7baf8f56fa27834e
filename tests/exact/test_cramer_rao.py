"""The posterior Cramer-Rao bound: the Kalman filter's covariance, Stone Soup's metric, numeric integration."""

import datetime
import math
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from faintrack.metrics.cramer_rao import bearing_information, posterior_bound
from faintrack.sensors.bearing_sets import BearingSensor
from tests.tolerances import STANDARD_ERRORS, rounding

STEP = np.array([[1.0, 1.0], [0.0, 1.0]])
NOISE = 0.1 * np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]])
START = np.diag([50.0, 4.0])


def test_linear_bound_is_the_kalman_covariance() -> None:
    row, error = np.array([[1.0, 0.2]]), np.array([[2.0]])
    states = jnp.zeros((3, 12, 2))
    move, measure = (lambda state: jnp.asarray(STEP, state.dtype) @ state), (lambda state, scan: row @ state)
    information = jnp.linalg.inv(jnp.asarray(START))
    found = posterior_bound(states, information, move, jnp.asarray(NOISE), measure, jnp.asarray(error))
    covariance, expected = START, []
    for scan in range(12):
        covariance = covariance if scan == 0 else STEP @ covariance @ STEP.T + NOISE
        gain = covariance @ row.T / (row @ covariance @ row.T + error)
        covariance = covariance - gain @ row @ covariance
        expected.append(covariance)
    # Inverses of a noise whose eigenvalues are a hundred apart lose two digits.
    np.testing.assert_allclose(found, expected, rtol=rounding(np.float32, 5000))


def test_share_of_information_is_noise_that_is_larger() -> None:
    row = np.array([[1.0, 0.0]])
    states = jnp.zeros((1, 8, 2))
    information = jnp.linalg.inv(jnp.asarray(START))
    move, measure = (lambda state: jnp.asarray(STEP, state.dtype) @ state), (lambda state, scan: row @ state)
    less = posterior_bound(states, information, move, jnp.asarray(NOISE), measure, jnp.array([[2.0]]), 0.25)
    noisier = posterior_bound(states, information, move, jnp.asarray(NOISE), measure, jnp.array([[8.0]]))
    np.testing.assert_allclose(less, noisier, rtol=rounding(np.float32, 1000))


def test_bearings_only_bound_is_stone_soups() -> None:
    """Theirs has sensors that stand still, and takes the prior for that after the first scan."""
    pytest.importorskip("stonesoup", reason="peer of the bench and dev extras")
    from stonesoup.metricgenerator.pcrbmetric import PCRBMetric
    from stonesoup.models.measurement.nonlinear import Cartesian2DToBearing
    from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
    from stonesoup.types.array import StateVector
    from stonesoup.types.groundtruth import GroundTruthPath, GroundTruthState
    from stonesoup.types.state import GaussianState

    scans, error, density, places = 10, math.radians(1), 0.1, np.array([[0.0, 600.0], [0.0, 50.0]])
    start = np.array([380.0, 12.0, 200.0, -12.0])
    covariance = np.diag([2500.0, 9.0, 2500.0, 9.0])
    matrix, noise = np.kron(np.eye(2), STEP), density / 0.1 * np.kron(np.eye(2), NOISE)
    truth = np.array([np.linalg.matrix_power(matrix, scan) @ start for scan in range(scans)])
    clock = datetime.datetime(2026, 1, 1)
    path = GroundTruthPath(
        [
            GroundTruthState(StateVector(state), clock + datetime.timedelta(seconds=scan))
            for scan, state in enumerate(truth)
        ]
    )
    metric = PCRBMetric(
        prior=GaussianState(StateVector(start), covariance, timestamp=clock),
        transition_model=CombinedLinearGaussianTransitionModel([ConstantVelocity(density)] * 2),
        measurement_model=Cartesian2DToBearing(ndim_state=4, mapping=(0, 2), noise_covar=np.array([[error**2]])),
        # With an axis more a column of it is a column, which theirs needs.
        sensor_locations=places[:, :, None],
        irf=0.7,
    )
    manager = SimpleNamespace(states_sets={"groundtruth_paths": {path}})
    (found,) = metric.compute_metric(manager)
    theirs = found.value["inverse_j"]

    def measure(state: jax.Array, scan: jax.Array) -> jax.Array:
        return jnp.arctan2(state[2] - places[1], state[0] - places[0])

    ours = posterior_bound(
        jnp.asarray(truth[None, 1:]),
        jnp.linalg.inv(jnp.asarray(matrix @ covariance @ matrix.T + noise)),
        lambda state: jnp.asarray(matrix, state.dtype) @ state,
        jnp.asarray(noise),
        measure,
        jnp.asarray(np.eye(2) * error**2),
        0.7,
    )
    np.testing.assert_allclose(ours, theirs[1:], rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize(("detection", "false"), [(1.0, 5.0), (0.8, 20.0), (0.6, 0.5)])
def test_information_among_false_bearings(detection: float, false: float) -> None:
    """With at most one false bearing near the target, by integration; more of them only matter to second order."""
    sensor = BearingSensor(error=1e-3, detection_probability=detection, false_per_scan=false)
    found, error = bearing_information(sensor, 200_000, seed=1)
    density = sensor.false_per_radian * sensor.error

    def told(z: float) -> float:
        """Square of the score times the density of a single bearing, the target's or a false one."""
        ratio = 1 - detection + detection * norm.pdf(z) / density
        return (detection * z * norm.pdf(z) / density / ratio) ** 2 * density * ratio

    # Of no bearing there is no score. Weight of one bearing alone: e^-(16 densities), of the rest of order density^2.
    alone, _ = quad(told, -8, 8, points=[0])
    assert abs(found - alone) < STANDARD_ERRORS * error + 20 * density
    assert 0 < found < detection + STANDARD_ERRORS * error


def test_no_false_bearing_leaves_the_probability_of_detection() -> None:
    sensor = BearingSensor(error=0.01, detection_probability=0.6, false_per_scan=1e-9)
    found, error = bearing_information(sensor, seed=2)
    assert abs(found - 0.6) < STANDARD_ERRORS * error
