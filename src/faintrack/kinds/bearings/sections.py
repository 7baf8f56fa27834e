"""Table of a scenario for sets of bearings: what the detector reports, and where new targets are looked for."""

from typing import Annotated

from pydantic import Field, model_validator

from faintrack.scenario.array import Pair, Table


class BearingsTable(Table):
    """Sets of bearings that are tracked in; see `faintrack.sensors.bearing_sets`.

    Attributes
    ----------
    error_deg : standard deviation of the target's bearing; degrees.
    detection_probability : that a target in the sector is reported in a scan.
    false_per_scan : expected number of false bearings of an observer in a scan of the whole sector.
    sector_deg : from its first bearing clockwise to its last; degrees clockwise from north. Everywhere where not given.
    range : new targets are at this distance from the observer, nearest and farthest, at any bearing of the sector; m.
    x, y : instead, new targets lie anywhere in this region, east and north; m.
    speed : new targets move at most this fast along each axis, either way; m/s.
    capacity : room for so many bearings of an observer in a scan.
    """

    error_deg: float = Field(gt=0, le=90)
    detection_probability: float = Field(gt=0, le=1)
    false_per_scan: float = Field(gt=0, le=1000)
    sector_deg: Pair | None = None
    range: Pair | None = None
    x: Pair | None = None
    y: Pair | None = None
    speed: float = Field(gt=0)
    capacity: Annotated[int, Field(ge=1, le=1000)] = 32

    @model_validator(mode="after")
    def _births(self) -> "BearingsTable":
        if (self.x is None) != (self.y is None) or (self.range is None) == (self.x is None):
            raise ValueError("where new targets are: expected either range, or x and y")
        for name in ("range", "x", "y"):
            ends = getattr(self, name)
            if ends is not None and not ends[0] < ends[1]:
                raise ValueError(f"{name} goes from {ends[0]:g} to {ends[1]:g} m: expected the lower end first")
        if self.range is not None and self.range[0] < 0:
            raise ValueError(f"range begins at {self.range[0]:g} m: expected 0 or more")
        return self

    @model_validator(mode="after")
    def _sector(self) -> "BearingsTable":
        if self.sector_deg is not None:
            first, last = self.sector_deg
            if not (-360 <= first <= 360 and -360 <= last <= 360) or (last - first) % 360 == 0:
                raise ValueError(
                    f"sector_deg goes from {first:g} to {last:g} degrees: expected two different bearings, -360 to 360"
                )
        return self
