"""One frame of an array as beam powers: the scan that bearing likelihoods read.

A frame is cut into snapshots, each transformed to frequency bins. For every bin the powers are summed over the
snapshots; nothing that a likelihood of stationary signals needs is lost by that.
"""

from typing import Any

import equinox as eqx
import numpy as np
from jaxtyping import Array, Complex, Float

from faintrack.sensors.array import RealArray, SensorArray

ComplexArray = Complex[Array, "..."] | Complex[np.ndarray, "..."]


class BeamScan(eqx.Module):
    r"""Beam power of one frame.

    Attributes
    ----------
    time : middle of the frame; seconds from the start of the recording.
    beam_power : shape (frequency, beam); :math:`\sum_k |\sum_m d_m^* z_{kmf}|^2` over snapshots k and channels m. Of
        several rings of beams the first comes first.
    total_power : shape (frequency,); :math:`\sum_k \sum_m |z_{kmf}|^2`.
    channels : number of channels that were used in this frame; below 2 the frame says nothing.
    spectra : what the powers were made of, where it is kept.
    field : sources that are part of the background; None where there are none (`faintrack.likelihoods.array_field`).
    """

    time: Float[Array, "*scan"]
    beam_power: Float[Array, "*scan frequency beam"]
    total_power: Float[Array, "*scan frequency"]
    channels: Float[Array, "*scan"]
    spectra: Complex[Array, "*scan snapshot frequency channel"] | None = None
    field: Any = None


class BeamGrid(eqx.Module):
    """The axes on which a frame is analysed.

    Attributes
    ----------
    frequency : shape (frequency,); bins in use, Hz.
    beams : number of bearings, in each ring.
    snapshots : transforms a frame.
    circular : whether the bearings run around the full circle.
    array : what hears, where it is known; scans are drawn with it.
    independent : share of what the bins of all snapshots hold that is independent of each other; 1 without a taper.
    elevations : of the rings of beams, evenly spaced, radians; the first and the last lie beyond what is looked at, to
        be read between. One ring of level beams where there are none.
    """

    frequency: Float[np.ndarray, " frequency"]
    beams: int = eqx.field(static=True)
    snapshots: int = eqx.field(static=True)
    circular: bool = eqx.field(static=True)
    array: SensorArray | None = None
    independent: float = eqx.field(static=True, default=1.0)
    elevations: tuple[float, ...] = eqx.field(static=True, default=())

    @property
    def bearing(self) -> Float[np.ndarray, " bearing"]:
        """Bearings of the beams of a ring; radians."""
        return bearings(self.beams, self.circular)

    @property
    def rings(self) -> int:
        """Rings of beams, one above the other."""
        return max(len(self.elevations), 1)

    @property
    def directions(self) -> tuple[Float[np.ndarray, " beam"], Float[np.ndarray, " beam"] | None]:
        """Bearing and elevation of every beam, ring after ring, radians; no elevation of level beams."""
        if not self.elevations:
            return self.bearing, None
        return np.tile(self.bearing, self.rings), np.repeat(self.elevations, self.beams)


def bearings(count: int, circular: bool) -> Float[np.ndarray, " bearing"]:
    """Evenly spaced bearings; radians.

    Examples
    --------
    >>> np.degrees(bearings(5, circular=False)).tolist()
    [0.0, 45.0, 90.0, 135.0, 180.0]
    >>> np.degrees(bearings(4, circular=True)).tolist()
    [-180.0, -90.0, 0.0, 90.0]
    """
    if circular:
        return -np.pi + 2 * np.pi * np.arange(count) / count
    return np.linspace(0.0, np.pi, count)


def lobe_width(array: SensorArray, frequency: float) -> float:
    r"""Main lobe of an array at broadside, from its peak to the first null of a uniform line of its length; radians.

    Notes
    -----
    .. math:: L = \frac{c}{f D}

    with D the largest extent of the channels in use plus one mean spacing. For the 55 hydrophones 0.375 m apart of
    bosser2022 at 2 kHz this is 2.08 degrees (the paper: approximately 2.12).

    Examples
    --------
    >>> from faintrack.sensors.array import line_array
    >>> round(float(np.degrees(lobe_width(line_array(55, 0.375), 2000.0))), 2)
    2.08
    """
    used = array.positions[array.alive]
    extent = np.linalg.norm(used[:, None] - used[None], axis=-1).max()
    return array.sound_speed / (frequency * extent * len(used) / (len(used) - 1))


def steering(
    array: SensorArray, frequency: RealArray, bearing: RealArray, elevation: RealArray | None = None
) -> ComplexArray:
    r"""What a plane wave of unit amplitude does to each channel.

    Parameters
    ----------
    array : geometry and sound speed.
    frequency : shape (frequency,); Hz.
    bearing : shape (bearing,); radians. NumPy in, NumPy out; JAX in, JAX out.
    elevation : of the same shape; level waves where not given.

    Returns
    -------
    Shape (frequency, bearing, channel).

    Notes
    -----
    .. math:: d_{fm}(\psi) = e^{-j 2 \pi f \tau_m(\psi)}

    (bosser2022, eq. 15).

    Examples
    --------
    >>> from faintrack.sensors.array import line_array
    >>> d = steering(line_array(2, 1.5), np.array([500.0]), np.array([0.0, np.pi / 2]))
    >>> d.real.round(3).tolist()
    [[[0.0, 0.0], [1.0, 1.0]]]
    """
    xp = bearing.__array_namespace__()
    return xp.exp(-2j * xp.pi * frequency[:, None, None] * array.delays(bearing, elevation))
