"""Sines and angles in single precision are as good as they say; in double precision they are those of JAX."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.numerics.trigonometry import arctan2, sine_cosine


def test_sine_and_cosine() -> None:
    """The stated error: 4e-7, and 1e-7 of the angle. Also at the eighths of a turn, where the series change."""
    angle = np.concatenate([np.linspace(-300, 300, 200_001), np.arange(-380, 381) * np.pi / 4]).astype(np.float32)
    sine, cosine = (np.asarray(values, float) for values in sine_cosine(jnp.asarray(angle)))
    exact, allowed = angle.astype(float), 4e-7 + 1e-7 * np.abs(angle)
    assert np.all(np.abs(sine - np.sin(exact)) <= allowed)
    assert np.all(np.abs(cosine - np.cos(exact)) <= allowed)


def test_angles_of_vectors() -> None:
    """The stated error, around the circle and at the sixteenths of a turn, where the series change; at all lengths."""
    angle = np.concatenate([np.linspace(-np.pi, np.pi, 200_001), np.arange(-16, 17) * np.pi / 16])
    length = 10.0 ** np.linspace(-30, 30, len(angle))
    x, y = (np.asarray(length * part(angle), np.float32) for part in (np.cos, np.sin))
    off = np.asarray(arctan2(jnp.asarray(y), jnp.asarray(x)), float) - np.arctan2(y.astype(float), x.astype(float))
    # Half a turn is as good as minus half a turn.
    assert np.max(np.abs(off - 2 * np.pi * np.round(off / (2 * np.pi)))) <= 3e-7


def test_angles_of_axes_and_of_no_vector() -> None:
    y, x = jnp.array([0.0, 0.0, 0.0, 1.0, -1.0]), jnp.array([0.0, 1.0, -1.0, 0.0, 0.0])
    np.testing.assert_array_equal(arctan2(y, x), np.float32([0, 0, np.pi, np.pi / 2, -np.pi / 2]))


@pytest.mark.parametrize(("y", "x"), [(3.0, -4.0), (4.0, 3.0), (-0.1, 2.0), (1.0, 1.0), (0.0, 1.0)])
def test_gradient_of_an_angle(y: float, x: float) -> None:
    """(x, -y) over the square of the length."""
    found = jax.grad(arctan2, argnums=(0, 1))(jnp.asarray(y), jnp.asarray(x))
    np.testing.assert_allclose(found, np.array([x, -y]) / (x * x + y * y), rtol=1e-6, atol=1e-6)


def test_double_precision_is_that_of_jax(float64: type) -> None:
    angle, other = jnp.linspace(-300.0, 300.0, 1001), jnp.linspace(2.0, -1.0, 1001)
    assert angle.dtype == float64
    sine, cosine = sine_cosine(angle)
    np.testing.assert_array_equal(sine, jnp.sin(angle))
    np.testing.assert_array_equal(cosine, jnp.cos(angle))
    np.testing.assert_array_equal(arctan2(angle, other), jnp.arctan2(angle, other))
