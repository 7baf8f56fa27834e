"""Newborn particles that go where a scan points still stand for the birth density."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.sensors.beams import BeamScan
from tests.scenes import CIRCLE, LINE, Scene, log_ratio
from tests.tolerances import assert_mean

KEYS, COUNT = 2000, 100


def scan_of(scene: Scene) -> BeamScan:
    """A source about as loud as the noise."""
    rng = np.random.default_rng(2)
    return scene.scan(rng.normal(size=(16, 4)) + rng.normal(size=(16, 1)))


@pytest.fixture(scope="module", params=[LINE, CIRCLE], ids=["line", "circle"])
def guided(request: pytest.FixtureRequest) -> tuple[Scene, np.ndarray, np.ndarray]:
    """The scene; each particle's weight and its (ratio, component), components from 0 to 1 between the ends."""
    scene = Scene(np.float32, request.param)
    scan, likelihood, birth = scan_of(scene), scene.white_signal(), scene.target.birth
    low, high = (jnp.stack(jax.tree.leaves(corner))[:, None] for corner in (birth.low, birth.high))

    @jax.jit
    @jax.vmap
    def one(key: jax.Array) -> tuple[jax.Array, jax.Array]:
        states, log_weights = likelihood.propose(scan, birth, key, COUNT)
        unit = (jnp.stack(jax.tree.leaves(states)) - low) / (high - low)
        ratio = jnp.exp(likelihood.log_ratio(scan, states))
        return jnp.exp(log_weights), jnp.concatenate([ratio[None], unit])

    weights, values = one(jax.random.split(jax.random.key(1), KEYS))
    return scene, np.asarray(weights), np.asarray(values)


def test_guided_draws_stand_for_the_birth_density(guided: tuple[Scene, np.ndarray, np.ndarray]) -> None:
    """2,000 keys of 100 particles, 5 standard errors: mean and mean square of each component, and of the weights."""
    _, weights, values = guided
    unit = values[:, 1:]
    assert weights.max() <= 2
    moments = np.concatenate([np.ones_like(unit[:, :1]), unit, unit**2], axis=1)
    assert_mean(np.mean(weights[:, None] * moments, axis=2), np.array([1.0] + 3 * [1 / 2] + 3 * [1 / 3]))


def test_guided_draws_give_the_same_evidence(guided: tuple[Scene, np.ndarray, np.ndarray]) -> None:
    """2,000 keys of 100 particles, 5 standard errors: the mean ratio is its integral over the birth density."""
    scene, weights, values = guided
    birth = scene.target.birth
    bearing, snr_db = (
        np.linspace(getattr(birth.low, name), getattr(birth.high, name), 2001)[1::2] for name in ("bearing", "snr_db")
    )
    mesh = scene.states([bearing[:, None], np.zeros((1, 1)), snr_db[None, :]])
    expected = np.mean(np.exp(np.asarray(log_ratio(scene.white_signal(), scan_of(scene), mesh), np.float64)))
    assert_mean(np.mean(weights * values[:, 0], axis=1), expected)


def test_guided_draws_are_surer_of_a_loud_source(guided: tuple[Scene, np.ndarray, np.ndarray]) -> None:
    """What they are for: the evidence varies less from key to key than with draws from the birth density."""
    scene, weights, values = guided
    scan, likelihood, birth = scan_of(scene), scene.white_signal(), scene.target.birth
    plain = log_ratio(likelihood, scan, birth.sample(jax.random.key(2), KEYS * COUNT))
    unguided = np.exp(plain).reshape(KEYS, COUNT).mean(axis=1)
    assert np.mean(weights * values[:, 0], axis=1).std() < 0.8 * unguided.std()
