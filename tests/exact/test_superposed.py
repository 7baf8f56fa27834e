"""Targets in superposition: ratios against Gaussian densities, backgrounds against moments taken directly."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import multivariate_normal

from faintrack.errors import InputError
from faintrack.likelihoods.protocols import with_others
from faintrack.sensors.superposed import SuperposedScan, inverse_square, picture
from faintrack.targets.births import PlanarBirth
from faintrack.targets.states import PlanarState
from tests.cases import network, superposed
from tests.tolerances import RATIO_OPERATIONS, assert_equal, assert_mean, assert_same_mean

COUNT = 20_000
PLACES = np.array([[3.0, 4.0], [12.0, 14.0], [40.0, 0.0]])


def at(places: np.ndarray, dtype: type = np.float32) -> PlanarState:
    """States at rest, from an array whose last axis is x and y."""
    x, y = (jnp.asarray(places[..., axis], dtype) for axis in (0, 1))
    return PlanarState(x, y, jnp.zeros_like(x), jnp.zeros_like(y))


def levels(places: np.ndarray) -> np.ndarray:
    """What targets add, from the equation."""
    sensors = np.column_stack([np.asarray(network().x), np.asarray(network().y)])
    return 20.0 / (((places[..., None, :] - sensors) ** 2).sum(axis=-1) + 25.0)


def scan_of(seed: int = 0) -> SuperposedScan:
    return picture(0.0, jnp.asarray(np.random.default_rng(seed).normal(size=9), jnp.float32))


def others(*clouds: np.ndarray) -> tuple[PlanarState, jax.Array]:
    """Beliefs whose points are given, of weights that fall."""
    places = np.stack(clouds)
    weights = np.broadcast_to(np.arange(places.shape[1], 0, -1.0), places.shape[:2])
    return at(places), jnp.asarray(np.log(weights / weights.sum(axis=1, keepdims=True)), jnp.float32)


def clouds(spread: float, seed: int = 1) -> list[np.ndarray]:
    draws = np.random.default_rng(seed)
    return [middle + spread * draws.normal(size=(30, 2)) for middle in ([5.0, 15.0], [9.0, 9.0])]


def test_ratio_is_that_of_two_gaussians() -> None:
    scan = scan_of()
    expected = [
        multivariate_normal.logpdf(scan.values, mean=level) - multivariate_normal.logpdf(scan.values, np.zeros(9))
        for level in levels(PLACES)
    ]
    assert_equal(superposed().log_ratio(scan, at(PLACES)), np.array(expected), np.float32, RATIO_OPERATIONS, 10.0)


def test_others_that_are_certain_shift_the_readings() -> None:
    scan, there = scan_of(), np.array([[5.0, 15.0], [9.0, 9.0]])
    beside = with_others(superposed(), scan, at(there[:, None]), jnp.zeros((2, 1)), jnp.ones(2))
    assert not np.any(beside.columns)
    mean = levels(there).sum(axis=0)
    expected = [
        multivariate_normal.logpdf(scan.values, mean=mean + level) - multivariate_normal.logpdf(scan.values, mean)
        for level in levels(PLACES)
    ]
    assert_equal(superposed().log_ratio(beside, at(PLACES)), np.array(expected), np.float32, RATIO_OPERATIONS, 10.0)


@pytest.mark.parametrize("spread", [0.3, 2.0])
def test_background_has_the_moments_of_beliefs(spread: float) -> None:
    """Mean exactly; the covariance is never more than that of the points, and all of it where these are near."""
    states, log_weights = others(*clouds(spread))
    existence, scan = np.array([0.7, 1.0]), scan_of()
    beside = with_others(superposed(), scan, states, log_weights, jnp.asarray(existence, jnp.float32))
    mean, matrix = np.zeros(9), np.zeros((9, 9))
    for q, weights, cloud in zip(existence, np.exp(np.asarray(log_weights, float)), clouds(spread), strict=True):
        each = levels(cloud)
        middle = weights @ each
        mean += q * middle
        matrix += q * (each.T * weights) @ each - q**2 * np.outer(middle, middle)
    assert_equal(beside.values, np.asarray(scan.values) - mean, np.float32, RATIO_OPERATIONS, 1.0)
    columns = np.asarray(beside.columns, float)
    left = np.linalg.eigvalsh(matrix - columns @ columns.T)
    # The ridge takes a ten-thousandth; rounding what single precision does.
    assert left.min() > -1e-5 * np.trace(matrix)
    assert left.sum() < (1e-3 if spread < 1 else 2e-2) * np.trace(matrix)
    expected = [
        multivariate_normal.logpdf(beside.values, level, np.eye(9) + columns @ columns.T)
        - multivariate_normal.logpdf(beside.values, np.zeros(9), np.eye(9) + columns @ columns.T)
        for level in levels(PLACES)
    ]
    assert_equal(superposed().log_ratio(beside, at(PLACES)), np.array(expected), np.float32, RATIO_OPERATIONS, 10.0)


def test_what_does_not_exist_changes_no_bit() -> None:
    states, log_weights = others(*clouds(1.0))
    beside = with_others(superposed(), scan_of(), states, log_weights, jnp.zeros(2))
    alone, next_to = (superposed().log_ratio(scan, at(PLACES)) for scan in (scan_of(), beside))
    np.testing.assert_array_equal(next_to, alone)


def test_order_of_the_others_does_not_matter_nor_whether_they_come_at_once() -> None:
    states, log_weights = others(*clouds(1.0))
    existence, likelihood = jnp.array([0.7, 0.9]), superposed()

    def added(scan: SuperposedScan, *numbers: int) -> SuperposedScan:
        chosen = np.array(numbers)
        return with_others(
            likelihood, scan, jax.tree.map(lambda each: each[chosen], states), log_weights[chosen], existence[chosen]
        )

    scan = scan_of()
    once = likelihood.log_ratio(added(scan, 0, 1), at(PLACES))
    for other in (added(scan, 1, 0), added(added(scan, 1), 0)):
        assert_equal(likelihood.log_ratio(other, at(PLACES)), once, np.float32, RATIO_OPERATIONS, 10.0)


def test_sensors_without_a_reading_are_as_if_they_were_not_there() -> None:
    states, log_weights = others(*clouds(1.0))
    likelihood, heard = superposed(), np.array([0, 1, 3, 4, 5, 7])
    scan = with_others(likelihood, scan_of(), states, log_weights, jnp.array([0.7, 0.9]))
    gaps = jnp.full(9, jnp.nan).at[heard].set(scan.values[heard])
    few = dataclasses.replace(network(), x=network().x[heard], y=network().y[heard])
    without = dataclasses.replace(scan, values=scan.values[heard], columns=scan.columns[heard])
    expected = dataclasses.replace(likelihood, network=few).log_ratio(without, at(PLACES))
    found = likelihood.log_ratio(dataclasses.replace(scan, values=gaps), at(PLACES))
    assert_equal(found, expected, np.float32, RATIO_OPERATIONS, 10.0)


def test_proposed_targets_stand_for_the_birth_density() -> None:
    """Weighted means of features are those of the density itself, up to the edge of the grid of places."""
    sites = at(np.array([[6.0, 6.0], [12.0, 14.0]]))
    moving = dataclasses.replace(sites, vx=jnp.array([2.0, -1.0]))
    birth = PlanarBirth(moving, PlanarState(*(jnp.full(2, each) for each in (1.0, 1.5, 0.5, 0.5))))
    scan = picture(0.0, jnp.asarray(levels(np.array([11.0, 13.0])), jnp.float32))

    def features(states: PlanarState) -> np.ndarray:
        x, y, vx, vy = (np.asarray(each) for each in jax.tree.leaves(states))
        return np.column_stack([x, y, vx, vy, x * vx, x < 9, y > 14.5])

    states, log_weights = superposed().propose(scan, birth, jax.random.key(0), COUNT)
    weights = np.exp(np.asarray(log_weights, float))
    # Systematic draws are no worse than independent ones.
    assert_mean(weights, 1.0)
    plain = features(birth.sample(jax.random.key(1), COUNT))
    assert_same_mean(features(states) * weights[:, None], plain)
    near = np.hypot(np.asarray(states.x) - 11, np.asarray(states.y) - 13) < 1
    sampled = birth.sample(jax.random.key(2), COUNT)
    assert near.mean() > 1.2 * (np.hypot(np.asarray(sampled.x) - 11, np.asarray(sampled.y) - 13) < 1).mean()


def test_a_gain_needs_a_core() -> None:
    with pytest.raises(InputError, match="core is 0 m"):
        inverse_square(1.0, 0.0)
