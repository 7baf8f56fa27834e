r"""Values between the points of an evenly spaced table, by cubic convolution.

A ratio that depends on the data through beam power is tabulated once a frame; every particle then reads it in
between. The
kernel is that of Catmull and Rom: four neighbours an axis, exact for parabolas, error of third order in the spacing. (A
straight line between beams half a main lobe apart would lose a tenth of the power of a source between them.)
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from faintrack.sensors.beams import BeamGrid

Neighbours = list[tuple[Int[Array, "..."], Float[Array, "..."]]]
"""Four table indices around each point, each with its weight. One array an index: XLA reads a table that way four times
as fast as with the four stacked in one array."""


def neighbours(position: Float[Array, "*points"]) -> Neighbours:
    """Four table indices around each position (in units of the spacing) and their weights, which sum to 1.

    Examples
    --------
    >>> [(int(index), float(weight)) for index, weight in neighbours(jnp.array(2.5))]
    [(1, -0.0625), (2, 0.5625), (3, 0.5625), (4, -0.0625)]
    """
    left = jnp.floor(position)
    t = position - left
    weights = (
        t * (-0.5 + t * (1.0 - 0.5 * t)),
        1.0 + t * t * (-2.5 + 1.5 * t),
        t * (0.5 + t * (2.0 - 1.5 * t)),
        t * t * (-0.5 + 0.5 * t),
    )
    first = left.astype(jnp.int32) - 1
    return [(first + number, weight) for number, weight in enumerate(weights)]


def bearing_neighbours(grid: BeamGrid, bearing: Float[Array, "*points"]) -> Neighbours:
    """Neighbours among the bearings of a grid: around the circle, or mirrored at the ends of a line."""
    count = grid.beams
    if grid.circular:
        return [(index % count, weight) for index, weight in neighbours((bearing + jnp.pi) * count / (2 * jnp.pi))]
    last = count - 1

    def mirrored(index: Int[Array, "*points"]) -> Int[Array, "*points"]:
        index = jnp.abs(index)
        return jnp.where(index > last, 2 * last - index, index)

    return [(mirrored(index), weight) for index, weight in neighbours(bearing * last / jnp.pi)]


def elevation_neighbours(grid: BeamGrid, elevation: Float[Array, "*points"]) -> Neighbours:
    """Neighbours among the rings of a grid; elevations beyond those that are looked at are read at their ends."""
    first, step, last = grid.elevations[0], grid.elevations[1] - grid.elevations[0], grid.rings - 1
    place = jnp.clip((elevation - first) / step, 1, last - 1)
    return [(jnp.minimum(index, last), weight) for index, weight in neighbours(place)]


def read(table: Float[Array, " bearing"], near: Neighbours) -> Float[Array, "..."]:
    """Values of a table between its points.

    Examples
    --------
    >>> float(read(jnp.arange(6.0) ** 2, neighbours(jnp.array(2.5))))
    6.25
    """
    # Read from memory: XLA would otherwise form the table anew for every point.
    table = jax.lax.optimization_barrier(table)
    return sum((table[index] * weight for index, weight in near), start=jnp.zeros(()))


def read_plane(
    table: Float[Array, "bearing snr"], near_row: Neighbours, near_column: Neighbours
) -> Float[Array, "..."]:
    """Values of a table of two axes between its points; see `read`."""
    table = jax.lax.optimization_barrier(table)
    return sum(
        (
            row_weight * sum((table[row, column] * weight for column, weight in near_column), start=jnp.zeros(()))
            for row, row_weight in near_row
        ),
        start=jnp.zeros(()),
    )


def read_space(
    table: Float[Array, "ring bearing snr"], near_ring: Neighbours, near_row: Neighbours, near_column: Neighbours
) -> Float[Array, "..."]:
    """Values of a table of three axes between its points; see `read`."""
    rings, rows, columns = table.shape
    flat = table.reshape(rings * rows, columns)
    return sum(
        (
            weight * read_plane(flat, [(ring * rows + row, share) for row, share in near_row], near_column)
            for ring, weight in near_ring
        ),
        start=jnp.zeros(()),
    )
