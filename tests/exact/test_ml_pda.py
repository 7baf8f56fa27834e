"""Maximum likelihood over a batch: densities enumerated in double precision, and the Cramer-Rao bound."""

import itertools
import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm, poisson

from faintrack.baselines.ml_pda import Estimate, MlPda
from faintrack.baselines.pda import Association, turned
from faintrack.metrics.cramer_rao import bearing_information
from faintrack.sensors.bearing_sets import BearingSensor
from tests.tolerances import STANDARD_ERRORS, rounding

ERROR, DETECTION, FALSE = 0.01, 0.95, 2.0
"""Radians; probability; false bearings in a scan of the whole circle."""
SCANS, CAPACITY = 20, 12
PLACES = np.array([[0.0, 0.0], [1000.0, 0.0]])
"""Of two observers, who take turns."""
TRUTH = np.array([300.0, 600.0, 12.0, -8.0])


class Bearings(NamedTuple):
    time: jax.Array
    observer: jax.Array
    values: jax.Array
    there: jax.Array


def straight(state: jax.Array, seconds: jax.Array) -> jax.Array:
    return state.at[:2].add(seconds * state[2:])


def bearing(state: jax.Array, scan: Bearings) -> jax.Array:
    return jnp.arctan2(state[1] - scan.observer[1], state[0] - scan.observer[0])[None]


def values_of(scan: Bearings) -> tuple[jax.Array, jax.Array]:
    return scan.values, scan.there


def ml_pda(detection: float = DETECTION, false: float = FALSE) -> MlPda:
    error = jnp.array([[ERROR**2]])
    association = Association(bearing, values_of, error, detection, false / (2 * math.pi), differ=turned)
    return MlPda(association, straight)


def batch(sets: list[list[float]]) -> Bearings:
    """Scans a second apart."""
    values = np.array([np.pad(each, (0, CAPACITY - len(each))) for each in sets], np.float32)
    there = np.array([np.arange(CAPACITY) < len(each) for each in sets])
    observer = PLACES[np.arange(len(sets)) % 2]
    return Bearings(*(jnp.asarray(each) for each in (np.arange(len(sets)) * 1.0, observer, values[..., None], there)))


def true_bearing(scan: int, state: np.ndarray = TRUTH) -> float:
    off = state[:2] + scan * state[2:] - PLACES[scan % 2]
    return float(np.arctan2(off[1], off[0]))


def draw(seed: int, present: bool = True) -> list[list[float]]:
    random, sets = np.random.default_rng(seed), []
    for scan in range(SCANS):
        false = random.uniform(-np.pi, np.pi, random.poisson(FALSE)).tolist()
        hit = [true_bearing(scan) + ERROR * random.normal()] if present and random.random() < DETECTION else []
        sets.append(random.permutation(false + hit).tolist())
    return sets


def test_log_ratio_is_that_of_all_associations() -> None:
    """Every choice of a detection, or of none, in every scan; the false ones come in a Poisson number."""
    detection, false = 0.7, 1.5
    sets = [[true_bearing(0) + 0.012, 1.0], [], [true_bearing(2) - 0.004, true_bearing(2) + 0.02, -2.0]]

    def one(scan: int, chosen: int) -> float:
        count, around = len(sets[scan]), (1 / (2 * math.pi))
        if chosen < 0:
            return (1 - detection) * poisson.pmf(count, false) * around**count
        hit = norm.pdf(sets[scan][chosen], true_bearing(scan), ERROR)
        # Any place in the list is as likely.
        return detection * poisson.pmf(count - 1, false) * hit * around ** (count - 1) / count

    choices = itertools.product(*(range(-1, len(each)) for each in sets))
    with_target = sum(math.prod(one(scan, chosen) for scan, chosen in enumerate(choice)) for choice in choices)
    without = math.prod(poisson.pmf(len(each), false) / (2 * math.pi) ** len(each) for each in sets)
    result = ml_pda(detection, false).log_ratio(jnp.asarray(TRUTH, jnp.float32), batch(sets))
    # A bearing of single precision is off by 1e-5 of its error.
    assert float(result) == pytest.approx(math.log(with_target / without), abs=1e-3)


class Places(NamedTuple):
    time: jax.Array
    values: jax.Array
    there: jax.Array


def test_a_line_through_places_that_are_all_detected_is_least_squares() -> None:
    """Two measured numbers, no false ones: the fit and its covariance are those of linear least squares."""
    random, error = np.random.default_rng(0), np.array([[4.0, 1.0], [1.0, 2.0]])
    time = np.array([0.0, 1.0, 2.5, 4.0])
    values = np.array([[10.0, 20.0]]) + time[:, None] * np.array([3.0, -2.0])
    values = values + random.multivariate_normal([0, 0], error, 4)
    association = Association(
        lambda state, scan: state[:2], lambda scan: (scan.values, scan.there), jnp.asarray(error), 1.0, 1e-3
    )
    scans = Places(jnp.asarray(time), jnp.asarray(values)[:, None], jnp.ones((4, 1), bool))
    result = MlPda(association, straight).fit(jnp.array([[12.0, 15.0, 0.0, 0.0]]), scans)
    design = np.concatenate([np.hstack([np.eye(2), each * np.eye(2)]) for each in time])
    weight = np.kron(np.eye(4), np.linalg.inv(error))
    covariance = np.linalg.inv(design.T @ weight @ design)
    expected = covariance @ design.T @ weight @ values.ravel()
    # The ridge of 1e-5 and a condition of 30.
    np.testing.assert_allclose(result.state.mean, expected, rtol=1e-3)
    np.testing.assert_allclose(result.state.covariance, covariance, rtol=1e-3, atol=1e-3)
    ratio = sum(
        multivariate_normal.logpdf(value, (design[2 * number : 2 * number + 2] @ expected), error) - math.log(1e-3)
        for number, value in enumerate(values)
    )
    assert float(result.log_ratio) == pytest.approx(ratio, rel=rounding(np.float32, 300))


def starts(count: int = 12) -> np.ndarray:
    """All over the region, at all speeds."""
    random = np.random.default_rng(1)
    return np.hstack([random.uniform([0, 100], [1000, 1100], (count, 2)), random.uniform(-20, 20, (count, 2))])


@pytest.fixture(scope="module")
def fits() -> tuple[np.ndarray, ...]:
    """State, covariance and log ratio of draws with a target, log ratio of draws without."""
    method, begun = ml_pda(), jnp.asarray(starts(), jnp.float32)
    fit = jax.jit(jax.vmap(lambda scans: method.fit(begun, scans)))

    def of(seeds: range, present: bool) -> Estimate:
        return fit(jax.tree.map(lambda *each: jnp.stack(each), *(batch(draw(seed, present)) for seed in seeds)))

    with_target, without = of(range(60), True), of(range(1000, 1060), False)
    kept = with_target.state.mean, with_target.state.covariance, with_target.log_ratio, without.log_ratio
    return tuple(np.asarray(each, float) for each in kept)


@pytest.mark.slow
def test_estimates_reach_the_cramer_rao_bound(fits: tuple[np.ndarray, ...]) -> None:
    """Squared errors over the bound's covariance sum to the four components, a twentieth more allowed for curvature."""
    states, covariances, _, _ = fits
    share, _ = bearing_information(BearingSensor(ERROR, DETECTION, FALSE))
    information = np.zeros((4, 4))
    for scan in range(SCANS):
        off = TRUTH[:2] + scan * TRUTH[2:] - PLACES[scan % 2]
        slope = np.array([-off[1], off[0]]) / (off @ off)
        row = np.concatenate([slope, scan * slope])
        information += share * np.outer(row, row) / ERROR**2
    errors = states - TRUTH
    squares = np.einsum("di,ij,dj->d", errors, information, errors)
    standard_error = squares.std() / math.sqrt(len(squares))
    assert squares.mean() < 4 * 1.05 + STANDARD_ERRORS * standard_error
    assert squares.mean() > 4 - STANDARD_ERRORS * standard_error
    # What each says of its own error is right too.
    own = np.array([each @ np.linalg.solve(own, each) for each, own in zip(errors, covariances, strict=True)])
    assert abs(own.mean() - 4) < 0.2 + STANDARD_ERRORS * own.std() / math.sqrt(len(own))


@pytest.mark.slow
def test_a_target_is_told_from_none(fits: tuple[np.ndarray, ...]) -> None:
    """The highest ratio of false bearings alone lies below the lowest with a target, here by far."""
    _, _, with_target, without = fits
    assert without.max() < with_target.min() - 10


@pytest.mark.slow
def test_the_likeliest_target_is_likelier_than_the_true_one(fits: tuple[np.ndarray, ...]) -> None:
    _, _, with_target, _ = fits
    for seed in range(5):
        at_truth = ml_pda().log_ratio(jnp.asarray(TRUTH, jnp.float32), batch(draw(seed)))
        assert with_target[seed] > float(at_truth) - 1e-3
