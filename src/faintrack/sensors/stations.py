r"""Several passive arrays, each with a fan of beams: which beam of each array a target is heard in.

An array stands at a place, or follows a path, and reports the energy of every beam once a scan: a row of its
bearing-time record. Arrays are fused at this level, before any track is made, so all that is asked of an array is the
number of the beam that a state falls in (kreucher2011, eq. 14):

.. math:: b_j(x) = \left\lfloor \frac{\psi_j(x) - \psi_{j1}}{\Delta_j} + \frac{1}{2} \right\rfloor

with :math:`\psi_{j1}` the first beam of array j and :math:`\Delta_j` the distance of its beams. The bearing
:math:`\psi_j` is counted as `faintrack.sensors.array` does: from the axis of a line, 0 to pi, which cannot tell its two
sides apart; clockwise from north, all around, for any other array.

States with a bearing of their own, such as `faintrack.targets.states.BearingState`, are heard in the same direction by
every array: with one array, targets are tracked in bearing alone.
"""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from faintrack.errors import InputError
from faintrack.numerics.trigonometry import arctan2

TURN = 2 * np.pi


class Stations(eqx.Module):
    """Where arrays stand.

    Attributes
    ----------
    x, y : east and north; metres.
    heading : direction of a line's axis; radians clockwise from north. Not read for other arrays.
    """

    x: Float[Array, "*scan array"]
    y: Float[Array, "*scan array"]
    heading: Float[Array, "*scan array"]


class EnergyScan(eqx.Module):
    """Energies of the beams of several arrays at one time, or a stack of such scans.

    Attributes
    ----------
    time : seconds.
    energy : of every beam; arrays with fewer beams than others are filled up.
    usable : which beams were measured; an array that is silent in this scan has none.
    stations : where the arrays are.
    """

    time: Float[Array, "*scan"]
    energy: Float[Array, "*scan array beam"]
    usable: Bool[Array, "*scan array beam"]
    stations: Stations


class Fans(eqx.Module):
    """Beams of several arrays, evenly spaced in bearing.

    Attributes
    ----------
    first : bearing of the first beam of each array; radians.
    step : from one beam to the next; radians, above 0.
    count : beams of each array.
    line : which arrays are lines.

    Raises
    ------
    InputError : no array, lengths that differ, a step that is not above 0, an array without a beam.

    Examples
    --------
    >>> import math
    >>> from faintrack.targets.states import PlanarState
    >>> degree = math.radians(1)
    >>> fans = Fans(first=(0.0, 0.0), step=(degree, degree), count=(181, 181), line=(True, True))
    >>> east = Stations(x=jnp.array([0.0, 700.0]), y=jnp.zeros(2), heading=jnp.full(2, math.pi / 2))
    >>> target = PlanarState(*(jnp.array(value) for value in (700.0, 700.0, 0.0, 0.0)))
    >>> fans.beams(east, target).tolist()
    [45, 90]
    """

    first: tuple[float, ...] = eqx.field(static=True)
    step: tuple[float, ...] = eqx.field(static=True)
    count: tuple[int, ...] = eqx.field(static=True)
    line: tuple[bool, ...] = eqx.field(static=True)

    def __check_init__(self) -> None:
        lengths = {len(self.first), len(self.step), len(self.count), len(self.line)}
        if lengths != {len(self.first)} or not self.first:
            raise InputError("fans of beams: expected at least one array, and as many entries in every field.")
        for number, (step, count) in enumerate(zip(self.step, self.count, strict=True)):
            if not step > 0 or count < 1:
                raise InputError(f"array {number}: {count} beams {step:g} rad apart; expected at least 1, above 0.")

    @property
    def arrays(self) -> int:
        """Number of arrays."""
        return len(self.count)

    @property
    def most(self) -> int:
        """Beams of the array that has most."""
        return max(self.count)

    def bearings(self, stations: Stations, states: Any) -> Float[Array, "array *points"]:
        """Bearing at which each array hears each state (the module's conventions); radians.

        Parameters
        ----------
        stations : of one scan.
        states : positions in the plane, or states with a bearing.
        """
        if hasattr(states, "bearing"):
            return jnp.broadcast_to(states.bearing, (self.arrays, *jnp.shape(states.bearing)))
        shape = (self.arrays, *(1,) * jnp.ndim(states.x + states.y))
        east = states.x - stations.x.reshape(shape)
        north = states.y - stations.y.reshape(shape)
        line = np.array(self.line).reshape(shape)
        bearing = arctan2(east, north)
        off = bearing - stations.heading.reshape(shape)
        off = jnp.abs(off - TURN * jnp.round(off / TURN))
        return jnp.where(line, off, bearing)

    def beams(self, stations: Stations, states: Any) -> Int[Array, "array *points"]:
        """Number of the beam of each array that each state falls in; -1 where it falls in none.

        Parameters and conventions are those of `bearings`. Fans of arrays that are not lines go on around the circle
        from wherever they begin.
        """
        bearing = self.bearings(stations, states)
        shape = (self.arrays, *(1,) * (bearing.ndim - 1))
        first, step, count, line = (
            np.reshape(np.array(values, kind), shape)
            for values, kind in (
                (self.first, bearing.dtype),
                (self.step, bearing.dtype),
                (self.count, np.int32),
                (self.line, bool),
            )
        )
        off = bearing - first
        off = jnp.where(line, off, off - TURN * jnp.floor((off + step / 2) / TURN))
        number = jnp.floor(off / step + 0.5).astype(jnp.int32)
        return jnp.where((number >= 0) & (number < count), number, -1)
