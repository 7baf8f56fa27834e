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

from faintrack.beliefs.axis import Axis, Lattice
from faintrack.beliefs.belief import Belief


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
    gain : what the level of a target counts in each cell, where others are part of the background; 1 where None.
    independent : share of what each cell says that neither its neighbours nor the frames before have said; 1 where
        None.
    moved : cells along each axis by which the scene has moved since the frame before; None where there is no scene.
    """

    time: Float[Array, "*frame"]
    values: Float[Array, "..."]
    gain: Float[Array, "..."] | None = None
    independent: Float[Array, "..."] | None = None
    moved: Int[Array, "*frame axis"] | None = None


def cell_surface(belief: Belief, cells: Cells) -> Float[Array, "*cells"]:
    r"""Log of the target likelihood ratio of every cell of a sensor (stone2002, eq. 28), summed over all else.

    Parameters
    ----------
    belief : of particles, or on a grid.
    cells : of the sensor.

    Returns
    -------
    :math:`\log \left[ \frac{q}{1 - q} \sum_{i \in \text{cell}} w_i \right]`; minus infinity where no point lies.

    Examples
    --------
    >>> from faintrack.targets.states import RangeState
    >>> states = RangeState(jnp.array([0.2, 1.9, 2.1]), jnp.zeros(3))
    >>> belief = Belief(states, jnp.log(jnp.array([0.5, 0.25, 0.25])), jnp.log(jnp.array(3.0)), jnp.array(0.0))
    >>> jnp.exp(cell_surface(belief, Cells((("range", Axis(0.0, 1.0, 3)),)))).round(2).tolist()
    [1.5, 0.0, 1.5]
    """
    place, inside = cells.nearest(belief.states)
    shape = belief.log_weights.shape
    weights = jnp.where(inside, jnp.exp(belief.log_weights), 0)
    index = tuple(jnp.broadcast_to(each, shape).ravel() for each in place)
    return belief.log_odds + jnp.log(jnp.zeros(cells.shape, weights.dtype).at[index].add(weights.ravel()))
