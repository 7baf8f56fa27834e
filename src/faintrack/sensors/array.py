r"""Arrays of hydrophones or microphones that hear plane waves.

A source far away at bearing :math:`\psi` sends a plane wave from the unit direction :math:`u(\psi)`. The
channel at position :math:`p_m` hears it later than the origin by

.. math:: \tau_m(\psi) = -\frac{p_m \cdot u(\psi)}{c}

(bosser2022, eq. 9: there :math:`v(t + \tau)`, the sign in our :math:`u`). In the frequency domain this is the
steering vector :math:`d_m = e^{-j 2\pi f \tau_m}` (eq. 15).

A **line** of sensors cannot tell the two sides of its axis apart: its bearing is the angle between source
and axis, 0 to pi. Any other geometry measures the full circle: bearing in the plane x (east), y (north), clockwise
from north, -pi to pi. Waves are **level** unless an elevation :math:`\varepsilon` is given, with

.. math:: u(\psi, \varepsilon) = (\cos\varepsilon \sin\psi, \; \cos\varepsilon \cos\psi, \; \sin\varepsilon) .

Channels in a level plane hear such a wave as a level one of the speed :math:`c / \cos\varepsilon`, its **trace
velocity**: they tell how far it is off the horizon, and not on which side.
"""

import dataclasses
from typing import Any

import equinox as eqx
import numpy as np
from jaxtyping import Array, Bool, Float

from faintrack.errors import InputError
from faintrack.numerics.precision import full_precision

RealArray = Float[Array, "..."] | Float[np.ndarray, "..."]


class SensorArray(eqx.Module):
    """Positions of an array's channels and the speed of the waves that they hear.

    Attributes
    ----------
    positions : shape (channel, 3); x east, y north, z up; metres.
    sound_speed : speed of the wave along the array; m/s.
    gains : shape (channel,); factor that corrects each channel: 1, -1 where inverted, 0 where dead.
    axis : shape (3,); unit vector along a line array, None for an array that measures the full circle.
    channel_names : one for each channel.
    """

    positions: Float[np.ndarray, "channel 3"] = eqx.field(converter=lambda p: np.asarray(p, np.float64))
    sound_speed: float
    gains: Float[np.ndarray, " channel"] = eqx.field(converter=lambda g: np.asarray(g, np.float64))
    axis: Float[np.ndarray, " 3"] | None
    channel_names: tuple[str, ...] = eqx.field(static=True)

    @property
    def circular(self) -> bool:
        """Whether bearings run around the full circle (otherwise 0 to pi from the axis)."""
        return self.axis is None

    @property
    def alive(self) -> Bool[Array, " channel"] | Bool[np.ndarray, " channel"]:
        """Which channels are used."""
        return self.gains != 0

    @full_precision
    def delays(self, bearing: RealArray, elevation: RealArray | None = None) -> RealArray:
        r"""How much later than the origin each channel hears a plane wave; seconds.

        Parameters
        ----------
        bearing : direction that the wave comes from; radians, from the axis of a line array, otherwise
            clockwise from north. A NumPy array gives a NumPy array, a JAX array a JAX array.
        elevation : above the horizon, of the same shape; radians. Level waves where not given, as of a line array.

        Notes
        -----
        .. math:: \tau_m = -p_m \cdot u(\psi, \varepsilon) / c

        Examples
        --------
        >>> array = line_array(count=2, spacing=1500.0, sound_speed=1500.0)
        >>> array.delays(np.array(0.0)).tolist()
        [0.5, -0.5]
        >>> square = sensor_array(np.array([[0.0, 0.0], [0.0, 1500.0], [1500.0, 0.0], [1500.0, 1500.0]]))
        >>> square.delays(np.array(0.0), np.array(np.pi / 3)).round(3).tolist()
        [0.25, -0.25, 0.25, -0.25]
        """
        xp = bearing.__array_namespace__()
        positions = xp.asarray(self.positions, dtype=bearing.dtype)
        if self.axis is not None:
            along = positions @ xp.asarray(self.axis, dtype=bearing.dtype)
            return -xp.cos(bearing)[..., None] * along / self.sound_speed
        if elevation is not None:
            across = xp.sin(bearing)[..., None] * positions[:, 0] + xp.cos(bearing)[..., None] * positions[:, 1]
            up = xp.sin(elevation)[..., None] * positions[:, 2]
            return -(xp.cos(elevation)[..., None] * across + up) / self.sound_speed
        return (
            -(xp.sin(bearing)[..., None] * positions[:, 0] + xp.cos(bearing)[..., None] * positions[:, 1])
            / self.sound_speed
        )


def sensor_array(
    positions: np.ndarray,
    sound_speed: float = 1500.0,
    gains: np.ndarray | None = None,
    channel_names: tuple[str, ...] | None = None,
) -> SensorArray:
    """Array from positions; sensors on one straight line make a line array.

    Positions are taken relative to the mean of the channels in use.

    Parameters
    ----------
    positions : shape (channel, 2) or (channel, 3); x east, y north, z up; metres. On a line the axis, bearing
        0, points from the first channel to the last.
    sound_speed : m/s.
    gains : correction of each channel, 0 for a dead one; all 1 where not given.
    channel_names : "0", "1", ... where not given.

    Raises
    ------
    InputError : fewer than two channels in use, two at one place, values not finite, or shapes that disagree.

    Examples
    --------
    >>> sensor_array(np.array([[0.0, 0.0], [0.0, 1.0], [0.0, 3.0]])).circular
    False
    >>> sensor_array(np.array([[0.0, 0.0], [0.0, 1.0], [2.0, 0.0]])).circular
    True
    """
    positions = _numbers(positions, "positions")
    sound_speed = float(_numbers(sound_speed, "sound_speed", axes=0))
    if positions.ndim != 2 or positions.shape[1] not in (2, 3):
        raise InputError(f"positions have shape {positions.shape}; expected (channels, 2) or (channels, 3).")
    if positions.shape[1] == 2:
        positions = np.column_stack([positions, np.zeros(len(positions))])
    count = len(positions)
    gains = np.ones(count) if gains is None else _numbers(gains, "gains")
    names = tuple(str(i) for i in range(count)) if channel_names is None else tuple(channel_names)
    if gains.shape != (count,) or len(names) != count:
        raise InputError(
            f"there are {count} positions, {gains.size} gains and {len(names)} channel names; expected equal numbers."
        )
    if not (np.isfinite(positions).all() and np.isfinite(gains).all()):
        raise InputError("positions and gains must be finite numbers.")
    if not (np.isfinite(sound_speed) and sound_speed > 0):
        raise InputError(f"sound_speed is {sound_speed}; expected a number above 0 m/s.")
    used = positions[gains != 0]
    if len(used) < 2:
        raise InputError(f"the array has {len(used)} channels in use; expected at least 2.")
    apart = np.linalg.norm(positions[:, None] - positions[None], axis=-1)
    scale = apart.max()
    twins = np.argwhere(np.triu(apart <= 1e-9 * scale, k=1))
    if len(twins):
        first, second = twins[0]
        raise InputError(
            f"channels {names[first]} and {names[second]} have the same position {positions[first].tolist()}."
        )
    positions = positions - used.mean(axis=0)
    axis = used[-1] - used[0]
    axis = axis / np.linalg.norm(axis)
    off_axis = positions - np.outer(positions @ axis, axis)
    on_line = np.abs(off_axis[gains != 0]).max() < 1e-6 * scale
    return SensorArray(positions, sound_speed, gains, axis if on_line else None, names)


def _numbers(values: Any, name: str, axes: int | None = None) -> Float[np.ndarray, "..."]:
    """What was given as numbers, in double precision; text of a number is one."""
    try:
        numbers = np.asarray(values, np.float64)
    except (TypeError, ValueError):
        numbers = None
    if numbers is None or axes not in (None, numbers.ndim):
        raise InputError(f"{name} is {str(values)[:80]!r}; expected {'a number' if axes == 0 else 'numbers'}.")
    return numbers


def straightened(array: SensorArray, tolerance: float) -> tuple[SensorArray, float]:
    """Line array where all channels in use lie within a tolerance of a line, otherwise the array itself.

    Parameters
    ----------
    array : of any shape.
    tolerance : metres.

    Returns
    -------
    The array, and the largest distance of a channel in use from the line through them.

    Examples
    --------
    >>> bent = sensor_array(np.array([[0.0, 0.0], [1.0, 0.001], [2.0, 0.0]]))
    >>> line, off = straightened(bent, 0.01)
    >>> line.circular, round(off, 6), straightened(bent, 1e-5)[0] is bent
    (False, 0.000667, True)
    """
    if array.axis is not None:
        return array, 0.0
    used = array.positions[array.alive]
    # The direction of least squares, from the first channel to the last.
    axis = np.linalg.svd(used - used.mean(axis=0))[2][0]
    axis = axis if axis @ (used[-1] - used[0]) >= 0 else -axis
    off = float(np.linalg.norm(used - np.outer(used @ axis, axis), axis=1).max())
    return (array if off > tolerance else dataclasses.replace(array, axis=axis)), off


def line_array(count: int, spacing: float, sound_speed: float = 1500.0, heading: float = 0.0) -> SensorArray:
    """Uniform line array, bearing 0 along its heading.

    Parameters
    ----------
    count : channels, at least 2.
    spacing : between neighbours; metres.
    sound_speed : m/s.
    heading : direction from the first channel to the last; radians clockwise from north.

    Examples
    --------
    >>> line_array(32, 0.375).positions.shape
    (32, 3)
    """
    if count < 2 or not spacing > 0:
        raise InputError(f"a line array of {count} channels {spacing} m apart: expected at least 2, spacing above 0.")
    along = spacing * np.arange(count)
    return sensor_array(np.outer(along, [np.sin(heading), np.cos(heading)]), sound_speed)
