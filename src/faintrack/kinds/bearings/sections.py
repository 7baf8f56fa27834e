"""Sections of a scenario for sets of bearings: what the detector reports, and where new targets are looked for."""

import itertools
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from faintrack.kinds.scenario import Scenario
from faintrack.scenario.alarm import Alarms
from faintrack.scenario.moving import PlanarTargets
from faintrack.scenario.section import Pair, Section, require_sector
from faintrack.scenario.sections import ManySection, ParticlesSection, TargetSection


class BearingsSection(Section):
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

    error_deg: float = Field(gt=0, le=90, examples=[1.0])
    detection_probability: float = Field(gt=0, le=1, examples=[0.9])
    false_per_scan: float = Field(gt=0, le=1000, examples=[3.0])
    sector_deg: Pair | None = None
    range: Pair | None = Field(default=None, examples=[(200.0, 3000.0)])
    x: Pair | None = None
    y: Pair | None = None
    speed: float = Field(gt=0, examples=[15.0])
    capacity: Annotated[int, Field(ge=1, le=1000)] = 32

    @model_validator(mode="after")
    def _births(self) -> "BearingsSection":
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
    def _sector(self) -> "BearingsSection":
        require_sector(self.sector_deg)
        return self


class ContactSection(TargetSection):
    """What is known of targets before any scan.

    Attributes
    ----------
    arrival_rate : of an absent target; per second.
    departure_rate : of a present target; per second.
    velocity_noise : density of the acceleration along each axis; m/s per root second. Where not given, it adds up to a
        tenth of `bearings.speed` in a minute.
    """

    velocity_noise: float | None = Field(default=None, ge=0)


class ObserverSection(Section):
    """An observer of a simulation.

    Attributes
    ----------
    path : time in s, east and north in m of the points that it passes, in straight lines; before the first and after
        the last it stands still.
    """

    path: Annotated[
        tuple[Annotated[tuple[float, float, float], Field(strict=False)], ...], Field(strict=False, min_length=1)
    ]

    @model_validator(mode="after")
    def _ascending(self) -> "ObserverSection":
        for (first, *_), (second, *_) in itertools.pairwise(self.path):
            if not first < second:
                raise ValueError(f"path has a point at {second:g} s after one at {first:g} s: expected ascending times")
        return self


class SimulationSection(Section):
    """Bearings to draw, as `[bearings]` says that they are reported.

    Attributes
    ----------
    scans : number of them.
    interval : from scan to scan; s.
    seed : of the random numbers.
    observers : that report in every scan.
    targets : that they detect.
    """

    scans: int = Field(ge=1, le=1_000_000, examples=[60])
    interval: float = Field(default=1.0, gt=0)
    seed: int = Field(default=0, ge=0, lt=2**32)
    observers: Annotated[tuple[ObserverSection, ...], Field(strict=False, min_length=1, max_length=64)] = Field(
        examples=[[{"path": [[0.0, 0.0, 0.0], [60.0, 600.0, 0.0]]}]]
    )
    targets: PlanarTargets = Field(default=(), examples=[[{"x": 900.0, "y": 700.0, "vx": -8.0, "vy": 4.0}]])


class BearingsScenario(Scenario):
    """What to run with sets of bearings."""

    kind: Literal["bearings"] = "bearings"
    bearings: BearingsSection
    target: ContactSection = ContactSection()
    filter: ParticlesSection = ParticlesSection()
    tracker: ManySection = ManySection()
    alarm: Alarms | None = None
    simulation: SimulationSection | None = None

    @model_validator(mode="before")
    @classmethod
    def _whole(cls, values: Any) -> Any:
        if values.get("bearings") is None:
            raise ValueError(
                "there is no [bearings]: expected it with what the detector reports and where new targets are "
                "(--scenario FILE)"
            )
        return values
