"""Sections of a scenario for the records of arrays: where they stand, the region searched, what their beams report."""

import re
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from faintrack.kinds.scenario import Scenario
from faintrack.scenario.alarm import Alarms
from faintrack.scenario.array import ArraySection
from faintrack.scenario.moving import PlanarTargets
from faintrack.scenario.section import FilePath, Pair, Section
from faintrack.scenario.sections import AnalysisSection, SeedSection, TargetSection, TrackerSection

Latitude = Annotated[float, Field(ge=-89, le=89)]
Longitude = Annotated[float, Field(ge=-360, le=360)]


class StationSection(Section):
    """One array whose bearing-time record is tracked in; see `faintrack.sensors.stations`.

    An array by itself, without a region, needs no place: its targets are followed in bearing.

    Attributes
    ----------
    name : of the array.
    file : name of its record, where the order of the files is not that of the stations.
    x, y : where it stands: metres east and north.
    latitude, longitude : or these; degrees.
    path : or a CSV file that tells where it moves, see `faintrack.kinds.records.read`; relative to this file.
    line : whether it is a line, which hears 0 to 180 degrees from its axis; otherwise clockwise from north.
    heading_deg : direction of a line's axis; degrees clockwise from north. That of the channels or the path where not
        given.
    array : its channels, where the file is a recording.
    beams_deg : bearings of its first and last beam, where the file does not tell; degrees.
    start_time : what time 0 of its record is in UTC, where the file does not tell.
    clock_offset : by how much its clock is ahead; seconds.
    """

    name: str = Field(examples=["array"])
    file: str | None = None
    x: float | None = None
    y: float | None = None
    latitude: Latitude | None = None
    longitude: Longitude | None = None
    path: FilePath | None = None
    line: bool | None = None
    heading_deg: float | None = None
    array: ArraySection | None = None
    beams_deg: Pair | None = None
    start_time: str | None = None
    clock_offset: float = 0.0

    def require_place(self) -> None:
        """Refuse a station of which it is not told where it stands, or how the axis of a line lies.

        Raises
        ------
        ValueError : there is no way to tell, or more than one, or half of one.
        """
        ways, begun = self._ways, self.placed
        if len(begun) != 1:
            *others, last = ways
            listed = " and ".join(begun) or "none"
            raise ValueError(f"{self.name}: expected one of {', '.join(others)}, and {last}; found {listed}")
        if None in ways[begun[0]]:
            raise ValueError(f"{self.name}: expected both {begun[0]}")
        if self.array is None and self.is_line and self.heading_deg is None and self.path is None:
            raise ValueError(f"{self.name}: heading_deg is missing: expected the direction of the line's axis")

    @property
    def placed(self) -> list[str]:
        """Ways in which it is told, or half told, where the array stands."""
        return [way for way, values in self._ways.items() if any(value is not None for value in values)]

    @property
    def _ways(self) -> dict[str, tuple[float | str | None, ...]]:
        places = {"x and y": (self.x, self.y), "latitude and longitude": (self.latitude, self.longitude)}
        return {**places, "path": (self.path,)}

    @model_validator(mode="after")
    def _shape_is_known(self) -> "StationSection":
        if self.array is not None:
            given = [name for name in ("line", "beams_deg") if getattr(self, name) is not None]
            if given:
                raise ValueError(f"{self.name}: there is array, which tells {given[0]}: expected one of them")
        if self.start_time is not None:
            parse_utc(self.start_time)
        return self

    @property
    def is_line(self) -> bool:
        """Whether the array is a line, as far as the table tells."""
        return self.line is not False


class RegionSection(Section):
    """Where targets are looked for; see `faintrack.trackers.detectors`.

    Attributes
    ----------
    x, y : ends of the region, east and north; metres.
    latitude, longitude : or these; degrees.
    cell : side of a cell of a detector; metres.
    detectors : along x and y.
    overlap : share of a detector that it has in common with the next.
    speed : targets move at most this fast along each axis, either way; m/s.
    speeds : number of cells along each axis of the velocity, from -`speed` to `speed`.
    surroundings : how far outside the region targets are followed too, but are no tracks; metres. They explain energy
        that targets of the region would be made of.
    """

    x: Pair | None = None
    y: Pair | None = None
    latitude: Annotated[tuple[Latitude, Latitude], Field(strict=False)] | None = None
    longitude: Annotated[tuple[Longitude, Longitude], Field(strict=False)] | None = None
    cell: float = Field(gt=0, examples=[50.0])
    detectors: Annotated[
        tuple[Annotated[int, Field(ge=1, le=100)], Annotated[int, Field(ge=1, le=100)]], Field(strict=False)
    ] = (2, 2)
    overlap: float = Field(default=0.25, ge=0, le=0.9)
    speed: float = Field(gt=0, examples=[6.0])
    speeds: int = Field(default=7, ge=2, le=99)
    surroundings: float = Field(default=0, ge=0, le=1e6)

    @model_validator(mode="after")
    def _has_ends(self) -> "RegionSection":
        ways = {"x and y": (self.x, self.y), "latitude and longitude": (self.latitude, self.longitude)}
        begun = [way for way, ends in ways.items() if any(end is not None for end in ends)]
        if len(begun) != 1 or None in ways[begun[0]]:
            raise ValueError(f"expected either {' or '.join(ways)}; found {' and '.join(begun) or 'none'}")
        for name in begun[0].split(" and "):
            low, high = getattr(self, name)
            if not low < high:
                raise ValueError(f"{name} goes from {low:g} to {high:g}: expected the lower end first")
        return self

    @property
    def degrees(self) -> bool:
        """Whether its ends are latitudes and longitudes."""
        return self.latitude is not None


class EnergiesSection(Section):
    """What a beam reports; see `faintrack.likelihoods.beam_energies`.

    Attributes
    ----------
    absent : mean and standard deviation without a target, in the unit of the records. Where not given, both are
        estimated from every scan and `present` is in standard deviations above the mean; see
        `faintrack.signal.energies`.
    present : mean and standard deviation with one target. Where not given the mean lies two standard deviations above
        that without, and the standard deviation is the same.
    elsewhere : probability that a beam holds a source that is no target of the region. Where not given 0.05; 0 of an
        array by itself, to which every source is a target.
    """

    absent: Pair | None = None
    present: Pair | None = None
    elsewhere: float | None = Field(default=None, ge=0, le=0.2)

    @model_validator(mode="after")
    def _louder(self) -> "EnergiesSection":
        (low, spread), (high, wider) = self.levels
        if not spread > 0:
            raise ValueError(f"absent has the standard deviation {spread:g}: expected above 0")
        if not (high > low and wider >= spread):
            raise ValueError(
                f"present is {high:g} with standard deviation {wider:g}: expected above {low:g}, and not below "
                f"{spread:g}, those of absent"
            )
        return self

    @property
    def levels(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Mean and standard deviation without a target, and with one, in what the tracker is given."""
        absent = (0.0, 1.0) if self.absent is None else self.absent
        mean, std = absent
        return absent, (mean + 2 * std, std) if self.present is None else self.present


class SeveralSection(TrackerSection):
    """How tracks of several targets come about; see `faintrack.trackers.several`.

    Attributes
    ----------
    slots : targets that can be followed at once.
    particles : that follow a target; rounded up to a power of two.
    detect : target-present probability of a detector at which its target is handed over to particles.
    declare : existence at which a track begins, once its target has been in hand for `hold` scans.
    hold : scans; more where beams of targets cross those of others for long.
    drop : existence below which a target is given up.
    false_tracks : an hour or a day that are promised, "1/h"; it takes a `calibration`.
    calibration : how the threshold was found on data without a target; `faintrack calibrate` writes it.
    margin : beams on either side of a target's own that it raises too.
    """

    slots: int = Field(default=8, ge=1, le=64)
    particles: int = Field(default=2048, ge=16, le=1_000_000)
    detect: float = Field(default=0.9, gt=0, lt=1)
    declare: float = Field(default=0.99, gt=0, lt=1)
    hold: int = Field(default=10, ge=1, le=1000)
    drop: float = Field(default=0.1, gt=0, lt=1)
    margin: int = Field(default=1, ge=0, le=100)


class HeardTargetSection(TargetSection):
    """What is known of targets before any scan.

    Attributes
    ----------
    arrival_rate : of a target in one detector; per second.
    departure_rate : of a present target; per second.
    velocity_noise : in a region: density of the acceleration along each axis; m/s per root second. Where not given,
        0.01 `region.speed`.
    bearing_rate_deg : of an array by itself: new targets turn at most this fast, either way; degrees a second.
    bearing_rate_noise_deg : the same: density of the bearing acceleration; degrees a second per root second.
    """

    velocity_noise: float | None = Field(default=None, ge=0)
    bearing_rate_deg: float = Field(default=0.5, ge=0)
    bearing_rate_noise_deg: float = Field(default=0.05, ge=0)


class SourceSection(Section):
    """A source that an array by itself hears, which turns evenly, from `start` to `end`.

    Attributes
    ----------
    bearing_deg : at `start`; degrees, as the array counts.
    bearing_rate_deg : degrees a second.
    start, end : seconds from the first scan; to the last where not given.
    """

    bearing_deg: float
    bearing_rate_deg: float = 0.0
    start: float = Field(default=0.0, ge=0)
    end: float | None = None

    @model_validator(mode="after")
    def _lasts(self) -> "SourceSection":
        if self.end is not None and not self.end > self.start:
            raise ValueError(f"end is {self.end:g} s: expected more than start, {self.start:g} s")
        return self


class SimulationSection(Section):
    """Records to draw: energies of every beam, as `energies` says of them.

    Attributes
    ----------
    scans : number of them.
    interval : between scans; s.
    beam_deg : from beam to beam, over 0 to 180 degrees from the axis of a line and the full circle of others.
    seed : of the random numbers.
    targets : what is heard in a region; places of one in degrees are from its middle.
    sources : what an array by itself hears.
    """

    scans: int = Field(ge=2, le=1_000_000, examples=[300])
    interval: float = Field(default=1.0, gt=0)
    beam_deg: float = Field(default=1.0, ge=0.01, le=90)
    seed: int = Field(default=0, ge=0, lt=2**32)
    targets: PlanarTargets = ()
    sources: Annotated[tuple[SourceSection, ...], Field(strict=False)] = ()


class RecordsScenario(Scenario):
    """What to run with the records, or recordings, of several arrays or of one by itself.

    Attributes
    ----------
    stations : the arrays.
    region : where targets are looked for; an array by itself has none and follows them in bearing.
    analysis : of recordings: how they become records.
    """

    kind: Literal["records"] = "records"
    stations: Annotated[tuple[StationSection, ...], Field(strict=False, min_length=1, examples=[[{"name": "array"}]])]
    region: RegionSection | None = None
    energies: EnergiesSection = EnergiesSection()
    analysis: AnalysisSection = AnalysisSection()
    target: HeardTargetSection = HeardTargetSection()
    filter: SeedSection = SeedSection()
    several: SeveralSection = SeveralSection()
    alarm: Alarms | None = None
    simulation: SimulationSection | None = None

    @model_validator(mode="after")
    def _names_differ(self) -> "RecordsScenario":
        names = [station.name for station in self.stations]
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise ValueError(f"two stations have the name {twice!r}: expected different ones")
        return self

    @model_validator(mode="after")
    def _places_in_a_region(self) -> "RecordsScenario":
        if self.region is None:
            return self
        right, wrong = "x and y", "latitude and longitude"
        if self.region.degrees:
            right, wrong = wrong, right
        for station in self.stations:
            station.require_place()
            if wrong in station.placed:
                raise ValueError(f"{station.name} has {wrong}, and region has {right}: expected the same for both")
        return self

    @model_validator(mode="after")
    def _one_array_without_a_region(self) -> "RecordsScenario":
        if self.region is not None:
            return self
        if len(self.stations) > 1:
            raise ValueError(f"there are {len(self.stations)} [[stations]] and no [region]: expected both")
        (alone,) = self.stations
        given = alone.placed + (["heading_deg"] if alone.heading_deg is not None else [])
        if given:
            raise ValueError(f"{alone.name} has {given[0]} and there is no [region]: expected both or neither")
        return self

    @model_validator(mode="after")
    def _simulation_is_of_the_region(self) -> "RecordsScenario":
        if self.simulation is not None:
            if self.region is None and self.simulation.targets:
                raise ValueError("simulation.targets are of a region, and there is none: expected simulation.sources")
            if self.region is not None and self.simulation.sources:
                raise ValueError(
                    "simulation.sources are of an array by itself: expected simulation.targets in a region"
                )
        return self


_UTC = re.compile(r"\d{4}-\d\d-\d\d([T ]\d\d:\d\d(:\d\d(\.\d{1,9})?)?)?Z?")


def parse_utc(text: str) -> np.datetime64:
    """Time from ISO text in UTC, to the nanosecond.

    Raises
    ------
    ValueError : the text is no such time.

    Examples
    --------
    >>> str(parse_utc("2016-01-12T13:02Z"))
    '2016-01-12T13:02:00.000000000'
    """
    try:
        if _UTC.fullmatch(text) is None:
            raise ValueError
        return np.datetime64(text.removesuffix("Z"), "ns")
    except ValueError:
        raise ValueError(f"start_time is {text!r}: expected a UTC time such as 2016-01-12T13:02:11") from None
