"""Reports of where a ship, or any target that is known, was."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True)
class Ship:
    """Reports of one ship.

    Attributes
    ----------
    name : its MMSI or name.
    times : ascending; seconds since 1970 UTC, or on the clock of the data.
    utc : which of both.
    places : latitude and longitude in degrees, or the components of a place.
    degrees : which of both.
    """

    name: str
    times: Float[np.ndarray, " report"]
    utc: bool
    places: Float[np.ndarray, "report component"]
    degrees: bool
