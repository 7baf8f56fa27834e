r"""Values between the points of an evenly spaced table, by cubic convolution.

A ratio that depends on the data through beam power is tabulated once a frame; every particle then reads it in
between. The
kernel is that of Catmull and Rom: four neighbours an axis, exact for parabolas, error of third order in the spacing. (A
straight line between beams half a main lobe apart would lose a tenth of the power of a source between them.)
"""

import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from faintrack.sensors.beams import BeamGrid


def neighbours(
    position: Float[Array, "*points"],
) -> tuple[Int[Array, "*points 4"], Float[Array, "*points 4"]]:
    """Four table indices around each position (in units of the spacing) and their weights, which sum to 1.

    Examples
    --------
    >>> index, weight = neighbours(jnp.array(2.5))
    >>> index.tolist(), weight.tolist()
    ([1, 2, 3, 4], [-0.0625, 0.5625, 0.5625, -0.0625])
    """
    left = jnp.floor(position)
    t = position - left
    weights = (
        t * (-0.5 + t * (1.0 - 0.5 * t)),
        1.0 + t * t * (-2.5 + 1.5 * t),
        t * (0.5 + t * (2.0 - 1.5 * t)),
        t * t * (-0.5 + 0.5 * t),
    )
    return left.astype(jnp.int32)[..., None] + jnp.arange(-1, 3), jnp.stack(weights, axis=-1)


def bearing_neighbours(
    grid: BeamGrid, bearing: Float[Array, "*points"]
) -> tuple[Int[Array, "*points 4"], Float[Array, "*points 4"]]:
    """Indices into the bearings of a grid and their weights: around the circle, or mirrored at the ends of a line."""
    count = grid.beams
    if grid.circular:
        index, weight = neighbours((bearing + jnp.pi) * count / (2 * jnp.pi))
        return index % count, weight
    index, weight = neighbours(bearing * (count - 1) / jnp.pi)
    index = jnp.abs(index)
    return jnp.where(index > count - 1, 2 * (count - 1) - index, index), weight
