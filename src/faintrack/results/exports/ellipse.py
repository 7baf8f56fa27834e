r"""Where a target is with 95 % probability, if its place is Gaussian: an ellipse about the mean.

.. math:: (p - m)^T P^{-1} (p - m) = \chi^2_{2, 0.95} = -2 \ln 0.05

Drawn on earth, metres become degrees by the radii of curvature of the WGS84 ellipsoid at the mean, which suits ellipses
that are small beside the earth; the plane's north is taken for true north (see `faintrack.scenario.plane`).
"""

import math
from typing import Any

import numpy as np
from jaxtyping import Float

from faintrack.results.track import Track

SIGMAS = math.sqrt(-2 * math.log(0.05))
"""Half axis of the ellipse over the standard deviation along it."""

_EQUATOR, _FLATTENING = 6378137.0, 1 / 298.257223563


def axes_of(track: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Half axes, the longer one first, in the unit of the place, and the heading of the longer one.

    Parameters
    ----------
    track : with the places x, east, and y, north.

    Returns
    -------
    Three arrays with one value a scan; headings are in radians clockwise from north and do not jump by half a turn.

    Examples
    --------
    >>> import dataclasses
    >>> from types import SimpleNamespace
    >>> east = SimpleNamespace(mean={"x": 0, "y": 0}, covariance=np.array([[[9.0, 0.0], [0.0, 1.0]]]))
    >>> [round(float(part[0]) / scale, 3) for part, scale in zip(axes_of(east), (SIGMAS, SIGMAS, np.pi))]
    [3.0, 1.0, 0.5]
    """
    names = list(track.mean)
    index = [names.index("x"), names.index("y")]
    spread = np.asarray(track.covariance, float)[:, index][:, :, index]
    variances, directions = np.linalg.eigh(np.nan_to_num(spread))
    roots = SIGMAS * np.sqrt(np.maximum(variances, 0))
    heading = np.arctan2(directions[:, 0, 1], directions[:, 1, 1]) % np.pi
    return roots[:, 1], roots[:, 0], np.unwrap(heading, period=np.pi)


def outline(track: Track, scan: int, points: int = 36) -> Float[np.ndarray, "point 2"]:
    """Ring of longitude and latitude around a place on earth; counter-clockwise, the last point is the first.

    Parameters
    ----------
    track : with places on earth and covariance in metres.
    scan : number of it in the track.
    points : of the ring without the last.
    """
    longer, shorter, heading = (part[scan] for part in axes_of(track))
    turn = np.linspace(0, 2 * np.pi, points + 1)
    along, across = longer * np.cos(turn), -shorter * np.sin(turn)
    east = along * np.sin(heading) + across * np.cos(heading)
    north = along * np.cos(heading) - across * np.sin(heading)
    latitude, longitude = (float(track.earth[name][scan]) for name in ("latitude", "longitude"))
    meridian, parallel = _metres_per_radian(latitude)
    ring = np.stack([longitude + np.degrees(east / parallel), latitude + np.degrees(north / meridian)], axis=-1)
    ring[:, 0] = (ring[:, 0] + 180) % 360 - 180
    ring[-1] = ring[0]
    return ring


def _metres_per_radian(latitude: float) -> tuple[float, float]:
    """Radius of curvature along the meridian, and radius of the parallel."""
    squared = _FLATTENING * (2 - _FLATTENING)
    sine = math.sin(math.radians(latitude))
    bulge = 1 - squared * sine**2
    return _EQUATOR * (1 - squared) / bulge**1.5, _EQUATOR / math.sqrt(bulge) * math.cos(math.radians(latitude))
