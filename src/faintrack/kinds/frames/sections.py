"""Sections of a scenario for frames: images, range profiles, range-Doppler matrices."""

from typing import Annotated, Literal

from pydantic import Field

from faintrack.kinds.scenario import Scenario
from faintrack.scenario.alarm import Alarms
from faintrack.scenario.section import Section
from faintrack.scenario.sections import ManySection, ParticlesSection, TargetSection


class FramesSection(Section):
    """Which frames are read from a file, and what is seen in them without a target.

    Attributes
    ----------
    variable : name of the array that holds the frames; see `faintrack.io.read_sequence` where not given.
    dims : names of its axes in the order of the file, one of them time.
    frame_interval : s from frame to frame; the file's own times where not given.
    coordinates : names of the arrays that hold the values along an axis: {range = "rng"}.
    select : which place to take of an axis that is no part of a frame: {channel = 0}.
    start_pattern : how the names of images tell their time: "%Y%m%d_%H%M%S".
    background : "whiten", a scene of unknown brightness before which the target moves; "clutter", power of echoes with
        an unknown level in every cell; "none", noise of the level `cells.noise`. Where not given, "whiten" for images
        and "clutter" for all else.
    memory : frames after which "whiten" and "clutter" forget; 0 with "whiten" remembers none. Where not given, 30 of
        a scene, which moves, and 200 of clutter, whose level a target would otherwise raise.
    """

    variable: str | None = None
    dims: Annotated[tuple[str, ...], Field(strict=False)] | None = None
    frame_interval: float | None = Field(default=None, gt=0)
    coordinates: dict[str, str] | None = None
    select: dict[str, Annotated[int, Field(ge=0)]] | None = None
    start_pattern: str | None = None
    background: Literal["whiten", "clutter", "none"] | None = None
    memory: float | None = Field(default=None, ge=0)


class CellsSection(Section):
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
    dark : targets are darker than what is behind them, and lower the values of their cells; "gaussian" and "student".
    """

    amplitude: Literal["gaussian", "student", "swerling0", "swerling1", "rayleigh"] | None = None
    noise: float = Field(default=1.0, gt=0)
    levels: Annotated[tuple[Annotated[float, Field(gt=0)], ...], Field(strict=False, min_length=1)] | None = None
    width: float | None = Field(default=None, ge=0, le=10)
    dark: bool = False


class MovingTargetSection(TargetSection):
    """What is known of targets before any frame.

    Attributes
    ----------
    arrival_rate : of an absent target; per second.
    departure_rate : of a present target; per second.
    speed : new targets move at most this fast along each axis, either way; units of the axis (pixels, metres) a
        second. One cell a frame where not given.
    velocity_noise : density of the acceleration along each axis; units of the axis a second per root second. Where not
        given, in one frame it changes the way of the next by a tenth of a cell.
    """

    speed: float | None = Field(default=None, gt=0)
    velocity_noise: float | None = Field(default=None, ge=0)


class FilterSection(ParticlesSection):
    """What carries the belief.

    Attributes
    ----------
    kind : "grid", whose cells are those of the sensor, or "particles".
    particles : that follow a target.
    births : newborn particles a scan.
    seed : of the random numbers.
    speeds : of the grid, along each axis from -`target.speed` to `target.speed`.
    """

    kind: Literal["particles", "grid"] = "grid"
    speeds: int = Field(default=3, ge=1, le=99)


class SimulatedTargetSection(Section):
    """A target that moves at a constant velocity and is seen from `start` to `end`.

    Attributes
    ----------
    level : at its peak, as `cells.levels`.
    place : at `start`, along the axes of `simulation.shape`; cells from the first.
    velocity : along the same axes; cells a second.
    start, end : seconds from the first frame; to the last where not given.
    """

    level: float = Field(gt=0)
    place: Annotated[tuple[float, ...], Field(strict=False, min_length=1, max_length=2)]
    velocity: Annotated[tuple[float, ...], Field(strict=False, min_length=1, max_length=2)]
    start: float = Field(default=0.0, ge=0)
    end: float | None = None


class SimulationSection(Section):
    """Frames to draw: targets in noise of the level `cells.noise` about a flat scene.

    Attributes
    ----------
    frames : number of them.
    shape : cells along y and x of an image, or along the range of a profile.
    seed : of the random numbers.
    targets : what is seen.
    """

    frames: int = Field(gt=0, le=1_000_000, examples=[100])
    shape: Annotated[
        tuple[Annotated[int, Field(ge=2, le=10_000)], ...], Field(strict=False, min_length=1, max_length=2)
    ] = Field(examples=[(64, 64)])
    seed: int = Field(default=0, ge=0, lt=2**32)
    targets: Annotated[tuple[SimulatedTargetSection, ...], Field(strict=False)] = ()


class FramesScenario(Scenario):
    """What to run with frames."""

    kind: Literal["frames"] = "frames"
    frames: FramesSection = FramesSection()
    cells: CellsSection = CellsSection()
    target: MovingTargetSection = MovingTargetSection()
    filter: FilterSection = FilterSection()
    tracker: ManySection = ManySection()
    alarm: Alarms | None = None
    simulation: SimulationSection | None = None
