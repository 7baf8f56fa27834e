r"""Where an echo comes from: source, receiver and target in the plane.

With D the distance from source to receiver, :math:`\psi` the bearing from receiver to source, R the range from the
receiver to the target at bearing :math:`\phi`, and c the sound speed, an echo arrives after

.. math:: c \tau = R + \sqrt{R^2 - 2 R D \cos(\phi - \psi) + D^2}

and the other way round, for :math:`c \tau > D` (aughenbaugh2010, eq. 15),

.. math:: R = \frac{c \tau}{2} \frac{1 - (D / c \tau)^2}{1 - (D / c \tau) \cos(\phi - \psi)} .

Bearings are in radians anticlockwise from +x. A source and a receiver in one place, D = 0, are a monostatic sonar; all
of it holds for them. The target is taken to stand still while the sound is under way.
"""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from faintrack.numerics.trigonometry import arctan2
from faintrack.targets.states import PlanarState

Real = Float[Array, "..."]


class Bistatic(eqx.Module):
    """A source and a receiver.

    Attributes
    ----------
    source, receiver : where they are and how they move; components are scalars.
    sound_speed : m/s.

    Examples
    --------
    A source at the origin, a receiver 5 km north of it, a target 12 km east of the source:

    >>> from faintrack.sensors.bistatic import Bistatic, fixed
    >>> pair = Bistatic(fixed(0.0, 0.0), fixed(0.0, 5000.0))
    >>> delay, bearing = pair.echo(fixed(12000.0, 0.0))
    >>> round(float(delay), 3), round(float(jnp.degrees(bearing)), 1)
    (16.667, -22.6)
    >>> [round(float(part), 1) + 0.0 for part in pair.position(delay, bearing)]
    [12000.0, 0.0]
    """

    source: PlanarState
    receiver: PlanarState
    sound_speed: float = eqx.field(static=True, default=1500.0)

    @property
    def separation(self) -> tuple[Real, Real]:
        """Distance from receiver to source, m, and the bearing of the source from the receiver, radians."""
        east, north = self.source.x - self.receiver.x, self.source.y - self.receiver.y
        return jnp.hypot(east, north), jnp.arctan2(north, east)

    def echo(self, states: Any) -> tuple[Real, Real]:
        """Delay from transmission to arrival, s, and bearing of the echo at the receiver, radians."""
        east, north = states.x - self.receiver.x, states.y - self.receiver.y
        there = jnp.hypot(states.x - self.source.x, states.y - self.source.y)
        return (jnp.hypot(east, north) + there) / self.sound_speed, arctan2(north, east)

    def doppler(self, states: Any, frequency: float) -> Real:
        r"""Shift of an echo's frequency, Hz; positive where the path shortens.

        Notes
        -----
        .. math::
            \nu = f_0 \left[ \frac{c - \hat u_{ST} \cdot V_T}{c + \hat u_{RT} \cdot V_T} \;
            \frac{c + \hat u_{RT} \cdot V_R}{c - \hat u_{ST} \cdot V_S} - 1 \right]

        with the unit vectors from source and receiver to the target. Source: aughenbaugh2010, eq. 17.
        """
        c, source, receiver = self.sound_speed, self.source, self.receiver
        (sx, sy), (rx, ry) = self.directions(states)
        leaves = (c - sx * states.vx - sy * states.vy) / (c - sx * source.vx - sy * source.vy)
        returns = (c + rx * receiver.vx + ry * receiver.vy) / (c + rx * states.vx + ry * states.vy)
        return frequency * (leaves * returns - 1)

    def doppler_gradient(self, states: Any, frequency: float) -> tuple[Real, Real]:
        r"""Change of the Doppler shift with the velocity components of a slow target, Hz s/m.

        Notes
        -----
        .. math:: \nabla \nu = -\frac{f_0}{c} (\hat u_{ST} + \hat u_{RT})

        Lines of equal Doppler, the lines of velocity ambiguity, lie across it (aughenbaugh2010, eq. 18; its eq. 19
        agrees with eq. 17 if a and c there point from receiver and source to the target).
        """
        (sx, sy), (rx, ry) = self.directions(states)
        factor = -frequency / self.sound_speed
        return factor * (sx + rx), factor * (sy + ry)

    def directions(self, states: Any) -> tuple[tuple[Real, Real], tuple[Real, Real]]:
        """Unit vectors from the source and from the receiver to each state; 0 in their own place."""
        source, receiver = self.source, self.receiver
        return _unit(states.x - source.x, states.y - source.y), _unit(states.x - receiver.x, states.y - receiver.y)

    def position(self, delay: Real, bearing: Real) -> tuple[Real, Real]:
        """Place that an echo comes from (aughenbaugh2010, eq. 13-14); that of the receiver before the direct sound."""
        distance = self.distance(delay, bearing)
        return self.receiver.x + distance * jnp.cos(bearing), self.receiver.y + distance * jnp.sin(bearing)

    def distance(self, delay: Real, bearing: Real) -> Real:
        """Range from the receiver to the place of an echo (the module's equation), m; 0 before the direct sound."""
        apart, where = self.separation
        path = jnp.maximum(self.sound_speed * delay, apart)
        # Behind the source, on the line through both, no delay tells the places apart: there the range is 0 too.
        denominator = 2 * (path - apart * jnp.cos(bearing - where))
        product = (path - apart) * (path + apart)
        return jnp.where(product > 0, product / jnp.where(denominator > 0, denominator, 1), 0)


def fixed(x: float, y: float) -> PlanarState:
    """A platform that stands still; metres."""
    return PlanarState(jnp.asarray(x, float), jnp.asarray(y, float), jnp.zeros(()), jnp.zeros(()))


def _unit(x: Real, y: Real) -> tuple[Real, Real]:
    length = jnp.hypot(x, y)
    safe = jnp.where(length > 0, length, 1)
    return x / safe, y / safe
