"""A straight course measured with Gaussian noise: the filter finds the mean and covariance of Kalman's."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from faintrack.beliefs.belief import Belief, covariance, mean
from faintrack.filters.bernoulli_particle import BernoulliParticleFilter
from faintrack.filters.run import step
from faintrack.targets.motion import PlanarMotion
from faintrack.targets.states import PlanarState
from faintrack.targets.target import Target, UniformBirth
from tests.tolerances import assert_mean

TIMES = np.array([1.0, 2.0, 2.5, 4.0, 5.0])
MEASURED = np.array([[1.2, -0.4], [2.9, 0.3], [2.8, -0.8], [5.4, -1.0], [5.1, -2.2]])
"""Position at each time: x and y, metres."""
ERROR, VELOCITY_NOISE = 1.0, 0.6
START = np.diag([2.0, 2.0, 1.0, 1.0])
"""Covariance of x, y, vx, vy at time 0, about a mean of 0."""
RUNS, PARTICLES = 200, 4000


class PositionScan(eqx.Module):
    """A measured position."""

    time: Float[Array, "*scan"]
    position: Float[Array, "*scan axis"]


class Measured(eqx.Module):
    """Density of the position about the target's, as a ratio to the constant density 1."""

    def log_ratio(self, scan: PositionScan, states: PlanarState) -> Array:
        off = (states.x - scan.position[0]) ** 2 + (states.y - scan.position[1]) ** 2
        return -off / (2 * ERROR**2) - jnp.log(2 * jnp.pi * ERROR**2)


def kalman() -> tuple[np.ndarray, np.ndarray, float]:
    """Mean, covariance and log evidence after the last scan."""
    middle, spread, log_evidence, before = np.zeros(4), START, 0.0, 0.0
    look = np.eye(2, 4)
    for time, measured in zip(TIMES, MEASURED, strict=True):
        interval, before = time - before, time
        move = np.kron([[1.0, interval], [0.0, 1.0]], np.eye(2))
        accelerated = np.array([[interval**3 / 3, interval**2 / 2], [interval**2 / 2, interval]])
        middle = move @ middle
        spread = move @ spread @ move.T + VELOCITY_NOISE**2 * np.kron(accelerated, np.eye(2))
        innovation = measured - look @ middle
        expected = look @ spread @ look.T + ERROR**2 * np.eye(2)
        log_evidence -= 0.5 * innovation @ np.linalg.solve(expected, innovation)
        log_evidence -= 0.5 * np.log(np.linalg.det(2 * np.pi * expected))
        gain = spread @ look.T @ np.linalg.inv(expected)
        middle = middle + gain @ innovation
        spread = spread - gain @ look @ spread
    return middle, spread, log_evidence


def test_mean_covariance_and_evidence() -> None:
    """200 runs, 5 standard errors of about 0.002 m, 0.002 m^2 and 0.006."""
    middle, spread, log_evidence = kalman()
    found = filtered(jax.random.split(jax.random.key(2), RUNS))
    assert_mean(found[0], middle)
    assert_mean(found[1], spread)
    assert_mean(found[2], log_evidence)


def filtered(keys: jax.Array) -> tuple[np.ndarray, ...]:
    """Mean, covariance and log evidence of each run."""
    scalar = PlanarState(*jnp.zeros(4))
    target = Target(UniformBirth(scalar, scalar), PlanarMotion(VELOCITY_NOISE), 0.0, 0.0)
    filter = BernoulliParticleFilter(target, PARTICLES, births=1)
    scans = PositionScan(jnp.asarray(TIMES, jnp.float32), jnp.asarray(MEASURED, jnp.float32))

    def one(key: jax.Array) -> tuple[Array, Array, Array]:
        belief = filter.init(key, existence=1.0)
        draws = jax.random.normal(jax.random.fold_in(key, 0), (4, PARTICLES + 1))
        cloud = PlanarState(*(np.sqrt(np.diag(START)).astype(np.float32)[:, None] * draws))
        belief = dataclasses.replace(belief, states=cloud)

        def advance(belief: Belief, numbered: tuple[PositionScan, Array]) -> tuple[Belief, Array]:
            scan, number = numbered
            return step(filter, Measured(), belief, scan, jax.random.fold_in(key, number))

        belief, log_evidence = jax.lax.scan(advance, belief, (scans, jnp.arange(1, len(TIMES) + 1)))
        return jnp.stack(jax.tree.leaves(mean(belief))), covariance(belief), log_evidence.sum()

    return tuple(np.asarray(each) for each in jax.jit(jax.vmap(one))(keys))
