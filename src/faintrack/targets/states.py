"""Target states: named components that broadcast against each other.

For particles every component has the shape (n,). On a grid they are open meshes, (nx, 1), (1, ny), ...: what reads only
`x` then costs nx evaluations. Nothing in the package relies on the order of components.

A state needs nothing but its fields: one of a user's own may be any dataclass that JAX takes for a tree. `angles` names
the components that are averaged as directions, `rates` tells the rate of each component that has one, `signs` names
those that are 1 or -1; a state without such has none.
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
    rates: ClassVar[dict[str, str]] = {"bearing": "bearing_rate"}


class SidedState(eqx.Module):
    """As `BearingState`, off the axis of a line of which the heading is known, on one of its two sides.

    Attributes
    ----------
    bearing : from the axis, 0 to pi; radians.
    bearing_rate : of a line that keeps its heading; radians a second.
    snr_db : power of the source over power of the noise at one channel, in the band that is analysed; dB.
    side : 1 to starboard, clockwise from the axis, -1 to port; 0 of a new target, which may be on either.
    """

    bearing: Float[Array, "..."]
    bearing_rate: Float[Array, "..."]
    snr_db: Float[Array, "..."]
    side: Float[Array, "..."]
    angles: ClassVar[tuple[str, ...]] = ("bearing",)
    rates: ClassVar[dict[str, str]] = {"bearing": "bearing_rate"}
    signs: ClassVar[tuple[str, ...]] = ("side",)


class WaveState(eqx.Module):
    """As `BearingState`, of a wave that need not be level.

    Attributes
    ----------
    bearing : radians.
    bearing_rate : radians a second.
    snr_db : power of the source over power of the noise at one channel, in the band that is analysed; dB.
    elevation : above the horizon; radians.
    """

    bearing: Float[Array, "..."]
    bearing_rate: Float[Array, "..."]
    snr_db: Float[Array, "..."]
    elevation: Float[Array, "..."]
    angles: ClassVar[tuple[str, ...]] = ("bearing",)
    rates: ClassVar[dict[str, str]] = {"bearing": "bearing_rate"}


class ToneState(eqx.Module):
    """A direction of arrival, and the frequency of a tone that is heard from there.

    Attributes
    ----------
    bearing : radians.
    bearing_rate : radians a second.
    snr_db : power of the tone over that of the noise in a band of 1 Hz around it, at one channel; dB.
    frequency : Hz.
    """

    bearing: Float[Array, "..."]
    bearing_rate: Float[Array, "..."]
    snr_db: Float[Array, "..."]
    frequency: Float[Array, "..."]
    angles: ClassVar[tuple[str, ...]] = ("bearing",)
    rates: ClassVar[dict[str, str]] = {"bearing": "bearing_rate"}


Direction = BearingState | SidedState | WaveState
"""What an array tells of a source."""


class RangeState(eqx.Module):
    """Distance from a sensor and its rate.

    Attributes
    ----------
    range : metres, or cells of a profile.
    range_rate : its rate, positive when the distance grows; m/s, or cells a second.
    """

    range: Float[Array, "..."]
    range_rate: Float[Array, "..."]
    angles: ClassVar[tuple[str, ...]] = ()
    rates: ClassVar[dict[str, str]] = {"range": "range_rate"}


class PlanarState(eqx.Module):
    """Position and velocity in the plane.

    Attributes
    ----------
    x, y : east and north; metres. In an image column and row; pixels.
    vx, vy : their rates; m/s. In an image pixels a second.
    """

    x: Float[Array, "..."]
    y: Float[Array, "..."]
    vx: Float[Array, "..."]
    vy: Float[Array, "..."]
    angles: ClassVar[tuple[str, ...]] = ()
    rates: ClassVar[dict[str, str]] = {"x": "vx", "y": "vy"}


class PlanarSnrState(eqx.Module):
    """Position, velocity and how loud the target is.

    Attributes
    ----------
    x, y : east and north; metres.
    vx, vy : their rates; m/s.
    snr_db : mean power of its echo over that of the noise; dB. It stays as it is.
    """

    x: Float[Array, "..."]
    y: Float[Array, "..."]
    vx: Float[Array, "..."]
    vy: Float[Array, "..."]
    snr_db: Float[Array, "..."]
    angles: ClassVar[tuple[str, ...]] = ()
    rates: ClassVar[dict[str, str]] = {"x": "vx", "y": "vy"}
