"""Newborn particles that go where a scan points still stand for the birth density."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.filters.guide import guide
from faintrack.sensors.beams import BeamScan
from faintrack.targets.states import BearingState
from tests.scenes import Scene, log_ratio
from tests.tolerances import assert_mean

KEYS, COUNT = 2000, 100


@pytest.fixture
def scan(either_scene: Scene) -> BeamScan:
    """A source in front, about as loud as the noise."""
    rng = np.random.default_rng(2)
    return either_scene.scan(rng.normal(size=(16, 4)) + rng.normal(size=(16, 1)))


def means(scene: Scene, scan: BeamScan, of: Callable[[BearingState, jax.Array], jax.Array]) -> np.ndarray:
    """Weighted mean of a function of states and log ratio over each key's particles; shape (key, ...)."""
    likelihood, birth = scene.white_signal(), scene.target.birth

    @jax.jit
    @jax.vmap
    def one(key: jax.Array) -> jax.Array:
        states, log_weights = guide(likelihood, scan, birth, key, COUNT)
        weights = jnp.exp(log_weights)
        return jnp.mean(weights * of(states, likelihood.log_ratio(scan, states)), axis=-1)

    return np.asarray(one(jax.random.split(jax.random.key(1), KEYS)))


def test_guided_draws_stand_for_the_birth_density(either_scene: Scene, scan: BeamScan) -> None:
    """2,000 keys of 100 particles, 5 standard errors: mean and mean square of each component between its ends."""
    birth = either_scene.target.birth
    low, high = (jnp.stack(jax.tree.leaves(corner))[:, None] for corner in (birth.low, birth.high))

    def moments(states: BearingState, _: jax.Array) -> jax.Array:
        unit = (jnp.stack(jax.tree.leaves(states)) - low) / (high - low)
        return jnp.concatenate([jnp.ones_like(unit[:1]), unit, unit**2])

    assert_mean(means(either_scene, scan, moments), np.array([1.0] + 3 * [1 / 2] + 3 * [1 / 3]))


def test_guided_draws_give_the_same_evidence(either_scene: Scene, scan: BeamScan) -> None:
    """2,000 keys of 100 particles, 5 standard errors: the mean ratio is its integral over the birth density."""
    birth = either_scene.target.birth
    bearing, snr_db = (
        np.linspace(getattr(birth.low, name), getattr(birth.high, name), 2001)[1::2] for name in ("bearing", "snr_db")
    )
    mesh = either_scene.states([bearing[:, None], np.zeros((1, 1)), snr_db[None, :]])
    expected = np.mean(np.exp(np.asarray(log_ratio(either_scene.white_signal(), scan, mesh), np.float64)))
    assert_mean(means(either_scene, scan, lambda _, log_ratios: jnp.exp(log_ratios)), expected)
