"""What the value of a cell is drawn from, one function for each amplitude model of `faintrack.likelihoods.cells`.

Each is a function of a random key and the level of a target in every cell, 0 where there is none.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

Draw = Callable[[PRNGKeyArray, Array], Array]


def gaussian_value(key: PRNGKeyArray, level: Float[Array, "*cells"]) -> Float[Array, "*cells"]:
    """Amplitude with variance 1 and mean `level`."""
    return level + jax.random.normal(key, level.shape, level.dtype)


def swerling1_value(key: PRNGKeyArray, level: Float[Array, "*cells"]) -> Float[Array, "*cells"]:
    """Exponential power with mean 1 + `level`."""
    return (1 + level) * jax.random.exponential(key, level.shape, level.dtype)


def swerling0_value(key: PRNGKeyArray, level: Float[Array, "*cells"]) -> Float[Array, "*cells"]:
    """Power of a constant amplitude in complex Gaussian noise of power 1; mean 1 + `level`."""
    parts = jax.random.normal(key, (2 * level.size,), level.dtype).reshape(2, *level.shape) * 0.5**0.5
    return (jnp.sqrt(level) + parts[0]) ** 2 + parts[1] ** 2


def rayleigh_value(key: PRNGKeyArray, level: Float[Array, "*cells"]) -> Float[Array, "*cells"]:
    """Envelope whose square has the mean 2 (1 + `level`)."""
    return jnp.sqrt(2 * swerling1_value(key, level))
