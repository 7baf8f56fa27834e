"""Targets of a simulation that move in a plane, each for a time."""

from typing import Annotated

from pydantic import Field, model_validator

from faintrack.scenario.section import Section


class PlanarTargetSection(Section):
    """A target that moves at a constant velocity and is there from `start` to `end`.

    Attributes
    ----------
    x, y : where it is at `start`, east and north; m.
    vx, vy : its velocity; m/s.
    start, end : seconds from the first scan; to the last where not given.
    """

    x: float
    y: float
    vx: float = 0.0
    vy: float = 0.0
    start: float = Field(default=0.0, ge=0)
    end: float | None = None

    @model_validator(mode="after")
    def _lasts(self) -> "PlanarTargetSection":
        if self.end is not None and not self.end > self.start:
            raise ValueError(f"end is {self.end:g} s: expected more than start, {self.start:g} s")
        return self


PlanarTargets = Annotated[tuple[PlanarTargetSection, ...], Field(strict=False)]
"""Targets of a simulation; in a file a list of tables."""
