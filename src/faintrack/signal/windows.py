"""Sums over squares of pixels, and pictures moved by whole pixels."""

import jax.numpy as jnp
from jaxtyping import Array, Float, Int


def square_sum(values: Float[Array, "y x"], reach: int) -> Float[Array, "y x"]:
    """Sum over the square around each pixel; the picture is mirrored at its edges, its outermost pixels not repeated.

    Parameters
    ----------
    values : of a picture, at least `reach` + 1 pixels along each axis.
    reach : of the square along each axis; pixels.

    Examples
    --------
    >>> square_sum(jnp.ones((4, 4)), 1)[0].tolist()
    [9.0, 9.0, 9.0, 9.0]
    """
    height, width = values.shape
    padded = jnp.pad(values, reach, mode="reflect")
    columns = jnp.stack([padded[start : start + height] for start in range(2 * reach + 1)]).sum(axis=0)
    return jnp.stack([columns[:, start : start + width] for start in range(2 * reach + 1)]).sum(axis=0)


def shifted(values: Float[Array, "y x"], moved: Int[Array, " axis"]) -> Float[Array, "y x"]:
    """Values moved by whole pixels along y and x, 0 where nothing was before.

    Examples
    --------
    >>> shifted(jnp.arange(6.0).reshape(2, 3), jnp.array([0, 1])).tolist()
    [[0.0, 0.0, 1.0], [0.0, 3.0, 4.0]]
    """
    y, x = (jnp.arange(count) - moved[axis] for axis, count in enumerate(values.shape))
    inside = ((y >= 0) & (y < values.shape[0]))[:, None] & ((x >= 0) & (x < values.shape[1]))[None, :]
    return jnp.where(inside, jnp.roll(values, moved, axis=(0, 1)), 0)
