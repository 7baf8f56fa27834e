"""Sections of a scenario for sweeps of a scanning radar."""

from typing import Annotated, Literal

from pydantic import Field

from faintrack.kinds.scenario import Scenario
from faintrack.scenario.alarm import Alarms
from faintrack.scenario.section import Section
from faintrack.scenario.sections import TargetSection, TrackerSection


class SweepsSection(Section):
    """Which arrays of a file are the sweeps, and where and when they were taken.

    Attributes
    ----------
    variable : name of the array of intensities, (sweep, spoke, sample).
    times : name of the array of times, of each sweep or each spoke; seconds. Where not given "time", if there is one.
    interval : s from sweep to sweep, in place of times.
    sample_spacing : m from sample to sample; where not given the file's array `sample_spacing`.
    x, y, heading : names of the arrays of the antenna's place (m) and heading (degrees clockwise from north). Where not
        given "antenna_x", "antenna_y" and "heading_deg", if there are such.
    nearest : m within which nothing is looked for, as the transmitter is all that is seen there. Where not given, eight
        times the length of an echo.
    """

    variable: str = "intensity"
    times: str | None = None
    interval: float | None = Field(default=None, gt=0)
    sample_spacing: float | None = Field(default=None, gt=0)
    x: str | None = None
    y: str | None = None
    heading: str | None = None
    nearest: float | None = Field(default=None, ge=0)


class EchoSection(Section):
    """How an echo looks; see `faintrack.kinds.sweeps.echoes`.

    Attributes
    ----------
    across : standard deviation of an echo along the spokes, about that of the beam; spokes.
    along : the same in range, about that of the pulse; samples.
    levels : of an echo at its peak, one or several that are equally probable; shares of the full scale.
    deviation : of a cell, of all that makes it differ from the echo; share of the full scale. As large as the scale
        itself because the hundred cells of an echo rise and fall together: between them they tell no more than a few.
    full_scale : largest intensity; that of the first sweep where not given.
    """

    across: float = Field(default=8.0, ge=0.5, le=100)
    along: float = Field(default=4.0, ge=0.5, le=100)
    levels: Annotated[tuple[Annotated[float, Field(gt=0)], ...], Field(strict=False, min_length=1)] = (1 / 3, 1.0)
    deviation: float = Field(default=1.0, gt=0)
    full_scale: float | None = Field(default=None, gt=0)


class MovingSection(TargetSection):
    """What is known of echoes before any sweep.

    Attributes
    ----------
    arrival_rate : of an echo, fixed or moving, in a window without one; per second.
    departure_rate : of an echo; per second.
    moving : share of echoes that move.
    speed : targets move at most this fast eastward and northward, either way; m/s.
    velocity_noise : density of their acceleration along each axis; m/s per root second.
    """

    moving: float = Field(default=0.1, gt=0, lt=1)
    speed: float = Field(default=8.0, gt=0)
    velocity_noise: float = Field(default=0.02, ge=0)


class FilterSection(Section):
    """What carries the belief: windows on the echoes; see `faintrack.kinds.sweeps.windows`.

    Attributes
    ----------
    windows : at most; a sweep with more echoes than they cover is counted.
    speeds : along each axis, from -`target.speed` to `target.speed`; odd.
    watch : s over which targets are taken to move straight; then velocities change, and windows follow their targets.
    """

    windows: int = Field(default=1024, ge=8, le=100_000)
    speeds: int = Field(default=13, ge=3, le=49)
    watch: float = Field(default=60.0, gt=0)


class SlotsSection(TrackerSection):
    """How tracks come about.

    Attributes
    ----------
    declare : existence of a moving target, against a fixed echo or none, at which a track begins.
    drop : existence below which it ends.
    false_tracks : an hour or a day that are promised, "1/h"; it takes a `calibration`.
    calibration : how the threshold was found on data without a target; `faintrack calibrate` writes it.
    hold : s that an echo is watched before its target is declared: in less, fluctuations look like motion.
    slots : targets in hand at most; a sweep with more is counted.
    """

    declare: float = Field(default=0.98, gt=0, lt=1)
    hold: float = Field(default=45.0, ge=0)
    slots: int = Field(default=16, ge=1, le=256)


class SimulatedEchoSection(Section):
    """An echo that moves at a constant velocity; fixed where it has none.

    Attributes
    ----------
    place : east and north in the middle of the first sweep; m.
    velocity : east and north; m/s.
    level : mean of its peak; share of the full scale.
    """

    place: Annotated[tuple[float, float], Field(strict=False)]
    velocity: Annotated[tuple[float, float], Field(strict=False)] = (0.0, 0.0)
    level: float = Field(default=1.0, gt=0)


class SimulationSection(Section):
    """Sweeps to draw: echoes that fluctuate from sweep to sweep, in whole levels, and nothing between them.

    Attributes
    ----------
    sweeps, spokes, samples : numbers of them.
    fixed : echoes that stand, at places that are drawn evenly over the picture.
    fluctuation : standard deviation of the log of an echo's level from sweep to sweep; its length and width vary half
        as much.
    full_scale : largest level; 15 of four bits.
    antenna_velocity : of the antenna, east and north, from 0 in the middle of the first sweep; m/s.
    seed : of the random numbers.
    targets : what moves.
    """

    sweeps: int = Field(default=18, gt=0, le=100_000, examples=[18])
    spokes: int = Field(default=2048, ge=32, le=65536, examples=[512])
    samples: int = Field(default=1024, ge=64, le=65536, examples=[256])
    fixed: int = Field(default=100, ge=0, le=100_000)
    fluctuation: float = Field(default=0.3, ge=0, le=3)
    full_scale: int = Field(default=15, ge=1, le=255)
    antenna_velocity: Annotated[tuple[float, float], Field(strict=False)] = (0.0, 0.0)
    seed: int = Field(default=0, ge=0, lt=2**32)
    targets: Annotated[tuple[SimulatedEchoSection, ...], Field(strict=False)] = ()


class SweepsScenario(Scenario):
    """What to run with sweeps."""

    kind: Literal["sweeps"] = "sweeps"
    sweeps: SweepsSection = SweepsSection()
    echo: EchoSection = EchoSection()
    target: MovingSection = MovingSection()
    filter: FilterSection = FilterSection()
    tracker: SlotsSection = SlotsSection()
    alarm: Alarms | None = None
    simulation: SimulationSection | None = None
