r"""A plane in metres for places given in latitude and longitude.

The azimuthal equidistant projection about a middle, on the WGS84 ellipsoid: distances and directions from the middle
are exact, elsewhere distances are wrong by :math:`d^2 / 6 R^2`, 40 millionths 100 km away. North is the plane's own,
and off the middle's meridian the direction to the pole leans against it: `north_deg` tells by how much, half a degree
50 km to the east at 50 degrees of latitude, more than some beams are apart.

Source: Snyder, *Map Projections: A Working Manual* (1987), chapter 25; computed by PROJ.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from faintrack.errors import InputError

Values = np.ndarray | np.floating | float

STEP_DEG = 1e-4
"""Latitude over which the direction of north is taken; ten metres."""


@dataclass(frozen=True)
class Plane:
    """A plane that touches the earth.

    Attributes
    ----------
    latitude, longitude : of its origin; degrees.

    Examples
    --------
    >>> plane = Plane(50.7, -1.2)
    >>> x, y = plane.metres(50.8, -1.2)
    >>> abs(round(float(x), 3)), round(float(y))
    (0.0, 11124)
    """

    latitude: float
    longitude: float

    def metres(self, latitude: Values, longitude: Values) -> tuple[np.ndarray, np.ndarray]:
        """East and north of places; metres."""
        x, y = self._projection()(np.asarray(longitude, float), np.asarray(latitude, float))
        return np.asarray(x), np.asarray(y)

    def degrees(self, x: Values, y: Values) -> tuple[np.ndarray, np.ndarray]:
        """Latitude and longitude of places; degrees."""
        longitude, latitude = self._projection()(np.asarray(x, float), np.asarray(y, float), inverse=True)
        return np.asarray(latitude), np.asarray(longitude)

    def north_deg(self, latitude: Values, longitude: Values) -> np.ndarray:
        """Direction of true north at places, clockwise from that of the plane; degrees.

        Examples
        --------
        >>> round(float(Plane(50.0, 0.0).north_deg(50.0, 0.7)), 2)
        -0.54
        """
        here = self.metres(latitude, longitude)
        there = self.metres(np.asarray(latitude) + STEP_DEG, longitude)
        return np.asarray(np.degrees(np.arctan2(there[0] - here[0], there[1] - here[1])))

    def _projection(self) -> Any:
        try:
            import pyproj
        except ImportError as error:
            raise InputError(
                'latitude and longitude need pyproj, which is not installed: pip install "faintrack[geo]".'
            ) from error
        return pyproj.Proj(proj="aeqd", lat_0=self.latitude, lon_0=self.longitude, ellps="WGS84")
