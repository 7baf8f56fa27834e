"""Newborn particles that go where a scan points still stand for the birth density."""


import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.filters.guide import guide
from faintrack.targets.states import BearingState
from tests.scenes import RATIOS, Scene
from tests.tolerances import assert_mean

KEYS, COUNT = 2000, 100


def draws(case: str, scene: Scene) -> tuple[BearingState, jax.Array, jax.Array]:
    """States and weights, shape (key, particle), and the log ratio at each."""
    rng = np.random.default_rng(2)
    likelihood = RATIOS[case](scene)
    scan = scene.scan(rng.normal(size=(16, 4)) + rng.normal(size=(16, 1)))

    @jax.jit
    @jax.vmap
    def one(key: jax.Array) -> tuple[BearingState, jax.Array, jax.Array]:
        states, log_weights = guide(likelihood, scan, scene.target.birth, key, COUNT)
        return states, jnp.exp(log_weights), likelihood.log_ratio(scan, states)

    return one(jax.random.split(jax.random.key(1), KEYS))


@pytest.mark.parametrize("case", RATIOS)
def test_guided_draws_stand_for_the_birth_density(case: str, either_scene: Scene) -> None:
    """2,000 keys of 100 particles, 5 standard errors; no weight above 2."""
    states, weights, log_ratios = draws(case, either_scene)
    birth = either_scene.target.birth
    low, high = birth.low, birth.high
    assert weights.max() <= 2
    values = [jnp.ones_like(weights)]
    expected = [1.0]
    for name in ("bearing", "bearing_rate", "snr_db"):
        unit = (getattr(states, name) - getattr(low, name)) / (getattr(high, name) - getattr(low, name))
        assert np.all((unit >= 0) & (unit <= 1))
        values += [unit, unit**2]
        expected += [1 / 2, 1 / 3]
    means = [np.mean(weights * value, axis=1) for value in values]
    assert_mean(np.stack(means, axis=1), np.array(expected))

    bearing = np.linspace(float(low.bearing), float(high.bearing), 721)
    snr_db = np.linspace(float(low.snr_db), float(high.snr_db), 261)
    scan = None
