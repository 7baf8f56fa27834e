"""Target states: named components that broadcast against each other.

For particles every component has the shape (n,). On a grid they are open meshes, (nx, 1), (1, ny), ...: what reads only
`x` then costs nx evaluations. Nothing in the package relies on the order of components.
"""

from typing import ClassVar

import equinox as eqx
from jaxtyping import Array, Float


class BearingState(eqx.Module):
    """A direction of arrival, its rate, and how loud the source is (bosser2022, eq. 4).

    Attributes
    ----------
    bearing : radians.
    bearing_rate : radians a second.
    snr_db : power of the source over power of the noise at one channel, in the band that is analysed; dB.
    """

    bearing: Float[Array, "..."]
    bearing_rate: Float[Array, "..."]
    snr_db: Float[Array, "..."]
    angles: ClassVar[tuple[str, ...]] = ("bearing",)


class PlanarState(eqx.Module):
    """Position and velocity in the plane.

    Attributes
    ----------
    x, y : east and north; metres.
    vx, vy : their rates; m/s.
    """

    x: Float[Array, "..."]
    y: Float[Array, "..."]
    vx: Float[Array, "..."]
    vy: Float[Array, "..."]
    angles: ClassVar[tuple[str, ...]] = ()
