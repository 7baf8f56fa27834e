"""Sensors that give a value for every cell: range profiles, range-Doppler matrices, images.

A scan holds one value a cell on named axes; the names are those of the state's components, so that a likelihood knows
which cell a target lies in.
"""

import functools
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from faintrack.axis import Axis, Lattice


@dataclass(frozen=True)
class Cells(Lattice):
    """Where the cells of a sensor lie.

    Attributes
    ----------
    axes : name and values of each axis of a scan, in the order of the array: (("y", ...), ("x", ...)) for an image.

    Examples
    --------
    >>> Cells((("y", Axis(0.0, 1.0, 3)), ("x", Axis(0.0, 1.0, 4)))).shape
    (3, 4)
    """

    axes: tuple[tuple[str, Axis], ...]

    def nearest(self, states: Any) -> tuple[tuple[Int[Array, "..."], ...], Bool[Array, "..."]]:
        """Index along every axis of the cell that each state lies in, and whether it lies in one.

        The indices are kept within the cells, so that they can be read with everywhere.
        """
        places = [axis.nearest(getattr(states, name)) for name, axis in self.axes]
        within = [(place >= 0) & (place < axis.count) for place, (_, axis) in zip(places, self.axes, strict=True)]
        inside = functools.reduce(jnp.logical_and, within)
        clipped = (jnp.clip(place, 0, axis.count - 1) for place, (_, axis) in zip(places, self.axes, strict=True))
        return tuple(clipped), inside


class CellScan(eqx.Module):
    """One frame of such a sensor, or a stack of them.

    Attributes
    ----------
    time : seconds.
    values : one a cell, in the order of the cells' axes: amplitude, envelope or power, as the likelihood expects.
    """

    time: Float[Array, "*frame"]
    values: Float[Array, "..."]
