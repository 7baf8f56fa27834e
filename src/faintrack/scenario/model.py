"""What to run: one TOML file for the array or the frames, the target, the tracker and, if wanted, a simulation.

Every field has a default but the ones that only the user can know. Units are those of the field's name: `_deg`
degree, `_db` decibel, otherwise SI.

.. code-block:: toml

    [array]                      # as in a file of its own, see `faintrack.scenario.array`
    line = {count = 32, spacing = 0.375}

    [analysis]
    band = [100.0, 1800.0]       # Hz
    frame = 1.0                  # s

    [simulation]
    duration = 180.0             # s
    sample_rate = 4000.0         # Hz
    sources = [{snr_db = -30.0, bearing_deg = 60.0, bearing_rate_deg = 0.1, start = 60.0}]

Images, range-time and range-Doppler matrices have `[frames]` in place of `[array]`, `[analysis]`, `[likelihood]`:

.. code-block:: toml

    [frames]
    frame_interval = 0.04        # s
    background = "whiten"

    [cells]
    levels = [2.0, 5.0, 12.0]    # of the target, over the standard deviation of the background

Sets of bearings have `[bearings]` there, see `faintrack.scenario.bearings`. Returns of an active sonar have `[sonar]`
and `[grid]`:

.. code-block:: toml

    [sonar]
    delay = [4.333, 34.05]       # of the first and the last bin; s
    delay_bins = 18000
    beams = 72
    beam_width_deg = 5.0
    source = [0.0, 0.0]          # m east and north
    receiver = [0.0, 5000.0]
    threshold_db = 10.0
    snr_db = 9.5
    pulse = {frequency = 2350.0, duration = 1.0, bandwidth = 400.0}

    [grid]
    x = [-33e3, 33e3]            # m
    y = [-33e3, 33e3]
    cells = [51, 51]
    speed = 12.0                 # m/s
    speeds = 7

Bearing-time records of several arrays have `[[stations]]` and `[region]`:

.. code-block:: toml

    [[stations]]
    name = "south"
    x = 0.0                      # m
    y = 0.0
    heading_deg = 90.0           # of the line's axis

    [[stations]]
    name = "east"
    x = 2000.0
    y = 500.0
    line = false

    [region]
    x = [-1000.0, 2500.0]        # m
    y = [500.0, 3500.0]
    cell = 50.0
    speed = 12.0                 # m/s
"""

import tomllib
from pathlib import Path
from typing import Annotated, Literal

import tomli_w
from pydantic import BaseModel, Field, ValidationError, model_validator

from faintrack.errors import InputError
from faintrack.scenario.array import ArrayDescription, Pair, Table, problem
from faintrack.scenario.bearings import BearingsTable
from faintrack.scenario.sonar import GridTable, SonarTable
from faintrack.scenario.stations import EnergiesTable, RegionTable, SeveralTable, StationTable


class Analysis(Table):
    """How samples become scans; see `faintrack.signal.beamformer.beamformer`.

    Attributes
    ----------
    band : lowest and highest frequency; Hz. Everything where not given.
    frame : between scans; s.
    beams : number of bearings; chosen from the array where not given.
    snapshot : length of one transform within a frame; s; chosen from the array where not given.
    """

    band: Pair | None = None
    frame: float = Field(default=1.0, gt=0)
    beams: int | None = Field(default=None, ge=8, le=7200)
    snapshot: float | None = Field(default=None, gt=0)


class TargetTable(Table):
    """What is known of targets before any scan.

    Attributes
    ----------
    arrival_rate : of an absent target; per second.
    departure_rate : of a present target; per second.
    bearing_rate_deg : new targets turn at most this fast, either way; degrees a second.
    bearing_rate_noise_deg : density of the bearing acceleration; degrees a second per root second.
    snr_db : lowest and highest SNR of a target at one channel, in the band; dB. Where not given, from the SNR at
        which a frame tells 0.02 nats of a target, to 20 dB.
    snr_noise_db : random walk of the SNR; dB per root second.
    speed : in frames: new targets move at most this fast along each axis, either way; units of the axis (pixels,
        metres) a second. One cell a frame where not given.
    velocity_noise : in frames, with a sonar, bearings or stations: density of the acceleration along each axis; units
        of the axis a second per root second. Where not given, in one frame it changes the way of the next by a tenth of
        a cell; with a sonar each component of the velocity has in the long run the standard deviation 0.4 `grid.speed`,
        which is `velocity_noise` times the root of half the relaxation; with bearings it adds up to a tenth of
        `bearings.speed` in a minute; with stations it is 0.01 `region.speed`.
    relaxation : with a sonar: time in which a velocity decays to 1/e; s.
    """

    arrival_rate: float = Field(default=0.001, gt=0)
    departure_rate: float = Field(default=0.005, gt=0)
    bearing_rate_deg: float = Field(default=0.5, ge=0)
    bearing_rate_noise_deg: float = Field(default=0.05, ge=0)
    snr_db: Pair | None = None
    snr_noise_db: float = Field(default=0.5, ge=0)
    speed: float | None = Field(default=None, gt=0)
    velocity_noise: float | None = Field(default=None, ge=0)
    relaxation: float = Field(default=36_000.0, gt=0)

    @model_validator(mode="after")
    def _ordered(self) -> "TargetTable":
        if self.snr_db is not None and not self.snr_db[0] < self.snr_db[1]:
            raise ValueError("snr_db: expected the lowest SNR first")
        return self


class LikelihoodTable(Table):
    """Which likelihood reads the scans.

    Attributes
    ----------
    kind : "unknown_noise", the noise power of every frequency and frame integrated out; "known_noise"; or "lobe_width".
    noise_power : for "known_noise": variance of the noise in one sample of a channel, the same at all frequencies.
    noise_seconds : for "known_noise", instead: the noise power of each frequency is measured over the first seconds.
    exponent : for "lobe_width": to which the beam power is raised.
    """

    kind: Literal["unknown_noise", "known_noise", "lobe_width"] = "unknown_noise"
    noise_power: float | None = Field(default=None, gt=0)
    noise_seconds: float | None = Field(default=None, gt=0)
    exponent: float = Field(default=5.0, gt=0)

    @model_validator(mode="after")
    def _noise_is_known(self) -> "LikelihoodTable":
        given = (self.noise_power is not None) + (self.noise_seconds is not None)
        if given != (self.kind == "known_noise"):
            raise ValueError('kind "known_noise" takes exactly one of noise_power and noise_seconds, the others none')
        return self


class FramesTable(Table):
    """Which frames are read from a file, and what is seen in them without a target.

    Attributes
    ----------
    variable : name of the array that holds the frames; see `faintrack.io.read_sequence` where not given.
    dims : names of its axes in the order of the file, one of them time.
    frame_interval : s from frame to frame; the file's own times where not given.
    background : "whiten", a scene of unknown brightness before which the target moves; "clutter", power of echoes with
        an unknown level in every cell; "none", noise of the level `cells.noise`. Where not given, "whiten" for images
        and "clutter" for all else.
    memory : frames after which "whiten" and "clutter" forget; 0 with "whiten" remembers none. Where not given, 30 of
        a scene, which moves, and 200 of clutter, whose level a target would otherwise raise.
    """

    variable: str | None = None
    dims: Annotated[tuple[str, ...], Field(strict=False)] | None = None
    frame_interval: float | None = Field(default=None, gt=0)
    background: Literal["whiten", "clutter", "none"] | None = None
    memory: float | None = Field(default=None, ge=0)


class CellsTable(Table):
    """What a target does to the cells of a frame; see `faintrack.likelihoods.cells`.

    Attributes
    ----------
    amplitude : values of the cells: "gaussian" or "student" (heavy tails), whose mean the target raises; "swerling0"
        or "swerling1", power; "rayleigh", envelope. "student" after whitening where not given; "clutter" takes none.
    noise : for background "none": standard deviation of the noise for "gaussian" and "student", its mean power for
        "swerling0" and "swerling1", root of half its mean square for "rayleigh"; unit of the frames.
    levels : of the target at its peak, one or several that are equally probable: mean over the standard deviation for
        "gaussian" and "student", otherwise power over the power of noise or clutter; linear.
    width : of the target's spread, see `faintrack.likelihoods.cells.gaussian_spread`; cells; 0 where it is all in one
        cell. Where not given, 0.55 after whitening and 0 otherwise.
    """

    amplitude: Literal["gaussian", "student", "swerling0", "swerling1", "rayleigh"] | None = None
    noise: float = Field(default=1.0, gt=0)
    levels: Annotated[tuple[Annotated[float, Field(gt=0)], ...], Field(strict=False, min_length=1)] | None = None
    width: float | None = Field(default=None, ge=0, le=10)


class FilterTable(Table):
    """What carries the belief.

    Attributes
    ----------
    kind : "particles"; or "grid", whose cells are in frames those of the sensor. Where not given, particles for
        recordings of an array and a grid for frames; with a sonar there is a grid only.
    particles : that follow a target.
    births : newborn particles a scan.
    guided : whether newborn particles are drawn where the scan points, which loud sources need; otherwise everywhere,
        as always in frames.
    seed : of the random numbers.
    speeds : of the grid, along each axis from -`target.speed` to `target.speed`.
    """

    kind: Literal["particles", "grid"] | None = None
    particles: int = Field(default=1000, ge=10, le=1_000_000)
    births: int = Field(default=250, ge=10, le=1_000_000)
    guided: bool = True
    seed: int = Field(default=0, ge=0)
    speeds: int = Field(default=3, ge=1, le=99)


class TrackerTable(Table):
    """How tracks come about.

    Attributes
    ----------
    method : "bernoulli", track before detect; or "cfar", the classical baseline (`faintrack.baselines`), which reads no
        likelihood and no particle filter.
    declare : existence at which a track begins.
    drop : existence of the track's own below which it ends.
    """

    method: Literal["bernoulli", "cfar"] = "bernoulli"
    declare: float = Field(default=0.97, gt=0, lt=1)
    drop: float = Field(default=0.3, gt=0, lt=1)

    @model_validator(mode="after")
    def _hysteresis(self) -> "TrackerTable":
        if not self.drop < self.declare:
            raise ValueError("drop: expected less than declare")
        return self


class SourceTable(Table):
    """A source that moves at a constant bearing rate and is heard from `start` to `end`.

    Attributes
    ----------
    snr_db : variance of its signal over variance of the noise at one channel; dB.
    bearing_deg : at `start`; degrees, from the axis of a line array or clockwise from north.
    bearing_rate_deg : degrees a second.
    start, end : seconds from the start of the recording; to its end where not given.
    """

    snr_db: float
    bearing_deg: float
    bearing_rate_deg: float = 0.0
    start: float = Field(default=0.0, ge=0)
    end: float | None = None


class SimulationTable(Table):
    """A recording to draw.

    Attributes
    ----------
    duration : s.
    sample_rate : Hz.
    seed : of the random numbers.
    noise_power : variance of the noise in each channel.
    noise_slope_db : dB per octave of the noise's spectrum; 0 for white noise.
    sources : what is heard.
    """

    duration: float = Field(gt=0)
    sample_rate: float = Field(gt=0)
    seed: int = Field(default=0, ge=0)
    noise_power: float = Field(default=1.0, gt=0)
    noise_slope_db: float = Field(default=0.0, ge=-24, le=24)
    sources: Annotated[tuple[SourceTable, ...], Field(strict=False)] = ()


class CfarTable(Table):
    """Detection and track score of `tracker.method` "cfar".

    Attributes
    ----------
    false_alarm_probability : of a beam in a frame of noise.
    guard, window : beams left out, and reference beams beyond them, on either side; from the main lobe where not given.
    detection_probability : of a target in a frame.
    """

    false_alarm_probability: float = Field(default=0.05, gt=0, lt=0.5)
    guard: int | None = Field(default=None, ge=0)
    window: int | None = Field(default=None, ge=1)
    detection_probability: float = Field(default=0.65, gt=0, lt=1)


class Scenario(Table):
    """What to run. The fields are the tables of the file."""

    array: ArrayDescription | None = None
    analysis: Analysis = Analysis()
    target: TargetTable = TargetTable()
    likelihood: LikelihoodTable = LikelihoodTable()
    filter: FilterTable = FilterTable()
    tracker: TrackerTable = TrackerTable()
    cfar: CfarTable = CfarTable()
    simulation: SimulationTable | None = None
    frames: FramesTable | None = None
    cells: CellsTable = CellsTable()
    sonar: SonarTable | None = None
    grid: GridTable | None = None
    bearings: BearingsTable | None = None
    stations: Annotated[tuple[StationTable, ...], Field(strict=False, min_length=1)] | None = None
    region: RegionTable | None = None
    energies: EnergiesTable = EnergiesTable()
    several: SeveralTable = SeveralTable()

    @model_validator(mode="after")
    def _one_kind(self) -> "Scenario":
        kind = next(
            (name for name in ("stations", "bearings", "sonar", "frames") if getattr(self, name) is not None), None
        )
        if kind is None:
            if self.filter.kind == "grid":
                raise ValueError('filter.kind is "grid": expected [frames] with it')
            return self
        # Compared with the defaults, not with what stands in the file: a scenario is written with all of its tables.
        unused: dict[str, Table | None] = {"array": None, "likelihood": LikelihoodTable(), "simulation": None}
        if kind != "stations":
            unused |= {"analysis": Analysis()}
        if kind != "frames":
            unused |= {"frames": None, "cells": CellsTable()}
        if kind != "sonar":
            unused |= {"sonar": None}
        if kind == "bearings":
            unused |= {"grid": None}
        found = [f"[{name}]" for name, default in unused.items() if getattr(self, name) != default]
        if found:
            raise ValueError(f"there are [{kind}] and {found[0]}: expected one of them")
        if self.tracker.method == "cfar":
            raise ValueError(f'tracker.method is "cfar": expected "bernoulli" with [{kind}]')
        if kind == "bearings" and (self.filter.kind == "grid" or self.target.speed is not None):
            wrong, right = "target.speed", "bearings.speed"
            if self.filter.kind == "grid":
                wrong, right = 'filter.kind "grid"', '"particles"'
            raise ValueError(f"there is {wrong}: expected {right} with [bearings]")
        return self

    @model_validator(mode="after")
    def _stations_have_their_region(self) -> "Scenario":
        if self.stations is None:
            for name, default in (("region", None), ("energies", EnergiesTable()), ("several", SeveralTable())):
                if getattr(self, name) != default:
                    raise ValueError(f"there is [{name}] and no [[stations]]: expected both")
            return self
        names = [station.name for station in self.stations]
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise ValueError(f"two stations have the name {twice!r}: expected different ones")
        if self.tracker != TrackerTable():
            raise ValueError("there are [[stations]] and [tracker]: expected [several] in its place")
        if self.filter != FilterTable(seed=self.filter.seed):
            raise ValueError("there are [[stations]] and [filter]: expected nothing but its seed")
        if self.target.speed is not None:
            raise ValueError("there is target.speed: expected region.speed with [[stations]]")
        if self.region is None:
            if len(self.stations) > 1:
                raise ValueError(f"there are {len(self.stations)} [[stations]] and no [region]: expected both")
            (alone,) = self.stations
            told = alone.placed + (["heading_deg"] if alone.heading_deg is not None else [])
            if told:
                raise ValueError(f"{alone.name} has {told[0]} and there is no [region]: expected both or neither")
            return self
        for station in self.stations:
            station.require_place()
        ways = {"x and y": self.region.x is None, "latitude and longitude": self.region.x is not None}
        for station in self.stations:
            for way, absent in ways.items():
                if absent and getattr(station, way.split()[0]) is not None:
                    raise ValueError(f"{station.name} has {way}, and region has not: expected the same for both")
        return self

    @model_validator(mode="after")
    def _sonar_has_its_grid(self) -> "Scenario":
        if (self.sonar is None) != (self.grid is None):
            found, missing = ("[sonar]", "[grid]") if self.grid is None else ("[grid]", "[sonar]")
            raise ValueError(f"there is {found} and no {missing}: expected both")
        if self.sonar is not None:
            if self.filter.kind == "particles":
                raise ValueError('filter.kind is "particles": expected "grid" with [sonar]')
            if self.target.speed is not None:
                raise ValueError("there is target.speed: expected grid.speed with [sonar]")
        return self


def read(path: str | Path) -> Scenario:
    """Scenario of a TOML file.

    Raises
    ------
    InputError : the file is missing, is not TOML, or has a field that is unknown or has the wrong value.
    """
    path = Path(path)
    try:
        with path.open("rb") as file:
            content = tomllib.load(file)
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror}).") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path} is not valid TOML ({error}).") from error
    try:
        return Scenario.model_validate(content)
    except ValidationError as error:
        raise InputError(f"{path}: {problem(error)}") from error


def to_toml(scenario: BaseModel) -> str:
    """TOML text of a scenario with every field that has a value; `read` gives the same scenario back.

    Examples
    --------
    >>> print(to_toml(Scenario()).splitlines()[0])
    [analysis]
    """
    return tomli_w.dumps(scenario.model_dump(exclude_none=True, mode="json"))
