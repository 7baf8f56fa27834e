"""Sections of a scenario for the returns of an active sonar: its bins and responses, and the grid that is searched."""

import itertools
import math
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError, model_validator

from faintrack.kinds.scenario import Scenario
from faintrack.scenario.alarm import Alarms
from faintrack.scenario.array import ArraySection
from faintrack.scenario.moving import PlanarTargets
from faintrack.scenario.section import FilePath, Pair, Section, problem
from faintrack.scenario.sections import ManySection, SeedSection, TargetSection


class PulseSection(Section):
    """What an active sonar transmits; see `faintrack.sensors.active.Pulse`.

    Attributes
    ----------
    frequency : in its middle; Hz.
    duration : s.
    bandwidth : of a linear sweep; Hz; 0 for a pulse of constant frequency.
    factor : of the sinc's argument: pi for the matched filter of an ideal pulse, 1 as aughenbaugh2010 has it.
    sweep : "linear" or "hyperbolic"; only the matched filter knows of it, what is expected of an echo is the first's.
    code : signs of the chips of a coded pulse, for the matched filter; `bandwidth` is then one over a chip.
    replica : file of samples of the pulse, for the matched filter, in place of all that.
    """

    frequency: float = Field(gt=0)
    duration: float = Field(gt=0)
    bandwidth: float = Field(default=0.0, ge=0)
    factor: float = Field(default=math.pi, gt=0)
    sweep: Literal["linear", "hyperbolic"] = "linear"
    code: Annotated[tuple[Literal[-1, 1], ...], Field(strict=False, min_length=2, max_length=10_000)] | None = None
    replica: FilePath | None = None

    @model_validator(mode="after")
    def _one_form(self) -> "PulseSection":
        if self.bandwidth >= 2 * self.frequency:
            raise ValueError(f"bandwidth is {self.bandwidth:g} Hz: expected less than twice the frequency")
        if (self.sweep != "linear") + (self.code is not None) + (self.replica is not None) > 1:
            raise ValueError("expected at most one of a hyperbolic sweep, a code and a replica")
        return self


Bins = Annotated[int, Field(ge=1, le=1_000_000)]
Reach = Annotated[
    tuple[
        Annotated[int, Field(ge=0, le=12)],
        Annotated[int, Field(ge=0, le=12)],
        Annotated[int, Field(ge=0, le=12)],
    ],
    Field(strict=False),
]
Finer = Annotated[
    tuple[
        Annotated[int, Field(ge=1, le=8)],
        Annotated[int, Field(ge=1, le=8)],
        Annotated[int, Field(ge=1, le=8)],
    ],
    Field(strict=False),
]
"""Bins or points along delay, bearing and Doppler; their tables grow with the product of all."""


class SonarSection(Section):
    """An active sonar whose returns are tracked; see `faintrack.sensors.active` and `faintrack.likelihoods.guided`.

    Attributes
    ----------
    pulse : what is transmitted; of `[[sources]]` each may have its own.
    delay : middles of the first and the last bin; s. What is blanked after the pulse lies before the first.
    delay_bins, delay_step : number of the bins, or from one to the next in s; exactly one of them.
    beams : evenly around the receiver, the first to the east.
    beam_width_deg : first zeros of a beam lie pi times this from its middle.
    doppler : middles of the first and the last bin; Hz. Where not given, Doppler is not measured.
    doppler_bins, doppler_step : as those of the delay.
    source, receiver : where they stand still: metres east and north. The columns of the returns take their place.
    sound_speed : m/s.
    threshold_db : that returns exceed, over the mean power of the noise.
    snr_db : mean power of a target's echo in its bin, over that of the noise.
    fading : "bin": every bin of an echo draws its amplitude for itself, as published; "ping": one amplitude in a ping.
        Where not given, "ping" with `[reception]`, otherwise "bin".
    reach : bins of delay, bearing and Doppler from its place in which an echo is heard; in bearing all around at most.
    swath : bins from a return in which the likelihood is sampled; likewise.
    finer : samples a bin.
    """

    pulse: PulseSection | None = Field(
        default=None, examples=[{"frequency": 2000.0, "duration": 1.0, "bandwidth": 10.0}]
    )
    delay: Pair = Field(examples=[(3.0, 22.9)])
    delay_bins: Bins | None = None
    delay_step: float | None = Field(default=None, gt=0, examples=[0.1])
    beams: int = Field(ge=3, le=7200, examples=[24])
    beam_width_deg: float = Field(gt=0, le=180, examples=[6.0])
    doppler: Pair | None = None
    doppler_bins: Bins | None = None
    doppler_step: float | None = Field(default=None, gt=0)
    source: Pair | None = Field(default=None, examples=[(0.0, 0.0)])
    receiver: Pair | None = Field(default=None, examples=[(500.0, 1000.0)])
    sound_speed: float = Field(default=1500.0, gt=0)
    threshold_db: float = Field(gt=0, le=60, examples=[9.0])
    snr_db: float = Field(ge=-40, le=80, examples=[12.0])
    fading: Literal["bin", "ping"] | None = None
    reach: Reach = (10, 6, 6)
    swath: Reach = (5, 3, 3)
    finer: Finer = (1, 4, 1)

    @model_validator(mode="after")
    def _bins_fit(self) -> "SonarSection":
        if self.delay[0] < 0:
            raise ValueError(f"delay begins at {self.delay[0]:g} s: expected at least 0")
        _require_bins("delay", self.delay, self.delay_bins, self.delay_step)
        _require_bins("doppler", self.doppler, self.doppler_bins, self.doppler_step)
        return self


def _require_bins(name: str, ends: Pair | None, bins: int | None, step: float | None) -> None:
    """Refuse bins whose number does not follow from what is given."""
    if ends is None:
        if bins is not None or step is not None:
            raise ValueError(f"there are bins of {name}: expected {name} with the first and the last")
        return
    if (bins is None) == (step is None):
        raise ValueError(f"expected exactly one of {name}_bins and {name}_step")
    first, last = ends
    if not first < last:
        raise ValueError(f"{name}: expected the first bin below the last")
    if bins == 1:
        raise ValueError(f"{name}_bins is 1: expected at least 2")
    if step is not None:
        steps = (last - first) / step
        if abs(steps - round(steps)) > 0.01 or not 1 <= round(steps) < 1_000_000:
            raise ValueError(f"{name}_step is {step:g}: expected to fit a whole number of times, not {steps:.6g}")


class BinsSection(Section):
    """Fields of `[sonar]` that may differ between receivers or sources; in place of those of `[sonar]` where given.

    Attributes
    ----------
    delay, delay_bins, delay_step, beams, beam_width_deg, doppler, doppler_bins, doppler_step : as of `[sonar]`.
    threshold_db, snr_db, reach, swath, finer : as of `[sonar]`.
    """

    delay: Pair | None = None
    delay_bins: Bins | None = None
    delay_step: float | None = Field(default=None, gt=0)
    beams: int | None = Field(default=None, ge=3, le=7200)
    beam_width_deg: float | None = Field(default=None, gt=0, le=180)
    doppler: Pair | None = None
    doppler_bins: Bins | None = None
    doppler_step: float | None = Field(default=None, gt=0)
    threshold_db: float | None = Field(default=None, gt=0, le=60)
    snr_db: float | None = Field(default=None, ge=-40, le=80)
    reach: Reach | None = None
    swath: Reach | None = None
    finer: Finer | None = None


Name = Annotated[str, Field(pattern=r"^\S(.{0,58}\S)?$")]
"""One to sixty characters, no space at the ends."""


class SourceSection(BinsSection):
    """A source of a multistatic sonar.

    Attributes
    ----------
    name : as in the column `source` of the returns.
    place : where it stands still: metres east and north. The columns of the returns take its place.
    pulse : what it transmits; where not given, that of `[sonar]`.
    delay, delay_bins, delay_step, beams, beam_width_deg, doppler, doppler_bins, doppler_step : of what receivers hear
        of it, in place of those of `[sonar]`.
    threshold_db, snr_db, reach, swath, finer : likewise.
    """

    name: Name = Field(examples=["ship"])
    place: Pair | None = Field(default=None, examples=[(0.0, 0.0)])
    pulse: PulseSection | None = None


class ReceiverSection(BinsSection):
    """A receiver of a multistatic sonar.

    Attributes
    ----------
    name : as in the column `receiver` of the returns.
    place : where it stands still: metres east and north. The columns of the returns take its place.
    delay, delay_bins, delay_step, beams, beam_width_deg, doppler, doppler_bins, doppler_step : of what it hears, in
        place of those of its source and of `[sonar]`.
    threshold_db, snr_db, reach, swath, finer : likewise.
    """

    name: Name = Field(examples=["buoy 1"])
    place: Pair | None = Field(default=None, examples=[(500.0, 1000.0)])


Every = Annotated[
    tuple[
        Annotated[int, Field(ge=1, le=64)],
        Annotated[int, Field(ge=1, le=64)],
        Annotated[int, Field(ge=1, le=64)],
    ],
    Field(strict=False),
]


class BackgroundSection(Section):
    """What returns there are without a target; see `faintrack.signal.returns_background`.

    Attributes
    ----------
    learn : for several targets: whether rate and excess of returns are learnt as the data come; otherwise the noise is
        exponential with mean 1.
    shape : of the tail, where it is not to be fitted: 0 for exponential noise of any level, 1/N after a normaliser over
        N cells.
    every : bins of delay, bearing and Doppler from one to the next that is independent of it, for bins finer than the
        resolution; the others are not read. Where not given, the returns tell (`faintrack.signal.resolution`).
    """

    learn: bool = True
    shape: float | None = Field(default=None, ge=0, le=0.5)
    every: Every | None = None

    @model_validator(mode="after")
    def _shape_is_read(self) -> "BackgroundSection":
        if self.shape is not None and not self.learn:
            raise ValueError("a shape is given and learn is false: expected learn = true, or no shape")
        return self


class ReceptionSection(Section):
    """How samples of hydrophones become returns; see `faintrack.signal.matched_filter`.

    Attributes
    ----------
    interval : from ping to ping, the first at `first_ping`; s. Or `ping_times`, one of both.
    first_ping : s from the start of the recording.
    ping_times : of transmission; s from the start of the recording.
    guard, window : of the normaliser, bins of delay on either side that are left out, and averaged beyond them.
    compensation_db : of range, before the normaliser: dB per decade of delay.
    sample_rate : of a simulation; Hz.
    """

    interval: float | None = Field(default=None, gt=0, examples=[60.0])
    first_ping: float = Field(default=0.0, ge=0)
    ping_times: Annotated[tuple[float, ...], Field(strict=False, min_length=2)] | None = None
    guard: int = Field(default=2, ge=0, le=1000)
    window: int = Field(default=16, ge=2, le=10_000)
    compensation_db: float = Field(default=0.0, ge=-100, le=100)
    sample_rate: float | None = Field(default=None, gt=0)

    @model_validator(mode="after")
    def _pings_are_known(self) -> "ReceptionSection":
        if (self.interval is None) == (self.ping_times is None):
            raise ValueError("expected exactly one of interval and ping_times")
        times = self.ping_times or ()
        if any(b <= a for a, b in itertools.pairwise(times)) or (times and times[0] < 0):
            raise ValueError("ping_times: expected ascending seconds from the start of the recording")
        return self


class GridSection(Section):
    """Cells over which a target is looked for.

    Attributes
    ----------
    x, y : where the grid begins and ends, east and north; m.
    cells : number along x and y.
    speed : targets move at most this fast along each axis, either way; m/s.
    speeds : number of cells along each axis of the velocity, from -`speed` to `speed`.
    """

    x: Pair = Field(examples=[(-15e3, 15e3)])
    y: Pair = Field(examples=[(-15e3, 15e3)])
    cells: Annotated[
        tuple[Annotated[int, Field(ge=2, le=10_000)], Annotated[int, Field(ge=2, le=10_000)]], Field(strict=False)
    ] = Field(examples=[(12, 12)])
    speed: float = Field(gt=0, examples=[9.0])
    speeds: int = Field(default=7, ge=1, le=99)

    @model_validator(mode="after")
    def _ordered(self) -> "GridSection":
        for name, (low, high) in (("x", self.x), ("y", self.y)):
            if not low < high:
                raise ValueError(f"{name} goes from {low:g} to {high:g} m: expected the lower end first")
        return self


class ShipSection(TargetSection):
    """What is known of targets before any ping.

    Attributes
    ----------
    arrival_rate : of an absent target; per second.
    departure_rate : of a present target; per second.
    velocity_noise : density of the acceleration along each axis; m/s per root second. In the long run it spreads each
        component of the velocity by `velocity_noise` times the root of half the relaxation; where not given, by 0.4
        `grid.speed`.
    relaxation : time in which a velocity decays to 1/e; s.
    """

    velocity_noise: float | None = Field(default=None, ge=0)
    relaxation: float = Field(default=36_000.0, gt=0)


class SimulationSection(Section):
    """Returns to draw; source and receiver stand where the sonar has them.

    Attributes
    ----------
    pings : number of them.
    interval : from ping to ping; s.
    seed : of the random numbers.
    targets : that echo with `sonar.snr_db`.
    """

    pings: int = Field(ge=2, le=1_000_000, examples=[30])
    interval: float = Field(gt=0, examples=[120.0])
    seed: int = Field(default=0, ge=0, lt=2**32)
    targets: PlanarTargets = Field(default=(), examples=[[{"x": -9000.0, "y": 6000.0, "vx": 6.0, "vy": -3.0}]])


class ReturnsScenario(Scenario):
    """What to run with the returns of an active sonar.

    Attributes
    ----------
    array : positions of the hydrophones, where samples are given in place of returns.
    """

    kind: Literal["returns"] = "returns"
    array: ArraySection | None = None
    sonar: SonarSection
    reception: ReceptionSection | None = None
    sources: Annotated[tuple[SourceSection, ...], Field(strict=False, min_length=1, max_length=16)] | None = None
    receivers: Annotated[tuple[ReceiverSection, ...], Field(strict=False, min_length=1, max_length=16)] | None = None
    background: BackgroundSection = BackgroundSection()
    grid: GridSection
    target: ShipSection = ShipSection()
    filter: SeedSection = SeedSection()
    tracker: ManySection = ManySection()
    alarm: Alarms | None = None
    simulation: SimulationSection | None = None

    @model_validator(mode="before")
    @classmethod
    def _whole(cls, values: Any) -> Any:
        lacking = [name for name in ("sonar", "grid") if values.get(name) is None]
        if lacking:
            raise ValueError(
                f"there is no [{lacking[0]}]: expected [sonar] with what transmits and listens, and [grid] with where "
                "to look (--scenario FILE)"
            )
        return values

    @model_validator(mode="after")
    def _several_fit(self) -> "ReturnsScenario":
        for platform in ("source", "receiver"):
            listed = getattr(self, f"{platform}s")
            if listed is None:
                continue
            if getattr(self.sonar, platform) is not None:
                raise ValueError(
                    f"there are sonar.{platform} and [[{platform}s]]: expected one of them, with the place in each of "
                    f"[[{platform}s]]"
                )
            names = [each.name for each in listed]
            for number, name in enumerate(names):
                if name in names[:number]:
                    raise ValueError(
                        f"{platform}s[{number}].name is {name!r}, as that of {platform}s[{names.index(name)}]: "
                        "expected names that differ"
                    )
        if self.sonar.pulse is None and any(each.pulse is None for each in self.sources or (self.sonar,)):
            also = ", or a pulse in each of [[sources]]" if self.sources else ""
            raise ValueError(f"sonar.pulse is missing: expected what is transmitted{also}")
        for source in range(len(self.sources or (None,))):
            for receiver in range(len(self.receivers or (None,))):
                self.of_pair(source, receiver)
        return self

    def of_pair(self, source: int, receiver: int) -> SonarSection:
        """Sonar of one source and one receiver, by their numbers: `[sonar]` with what they have of their own.

        Raises
        ------
        ValueError : their bins do not fit together.
        """
        fields = self.sonar.model_dump(exclude_none=True)
        where = []
        for platform, number in (("source", source), ("receiver", receiver)):
            listed = getattr(self, f"{platform}s")
            if listed is None:
                continue
            where.append(f"{platform}s[{number}]")
            own = listed[number].model_dump(exclude_none=True, exclude={"name"})
            for axis in ("delay", "doppler"):
                # Of number and step of the bins one is given: that of the own takes the place of either.
                if any(f"{axis}_{name}" in own for name in ("bins", "step")):
                    fields = {name: value for name, value in fields.items() if not name.startswith(f"{axis}_")}
            if "place" in own:
                own[platform] = own.pop("place")
            fields |= own
        try:
            return SonarSection.model_validate(fields)
        except ValidationError as error:
            raise ValueError(f"{' and '.join(where) or 'sonar'}: {problem(error).removesuffix('.')}") from error

    @property
    def pairs(self) -> dict[tuple[str, str], SonarSection]:
        """Sonar of every source and receiver, by their names; of one without a name the name is empty."""
        sources, receivers = ([each.name for each in listed or ()] or [""] for listed in (self.sources, self.receivers))
        return {
            (source, receiver): self.of_pair(*place)
            for place, (source, receiver) in zip(
                itertools.product(range(len(sources)), range(len(receivers))),
                itertools.product(sources, receivers),
                strict=True,
            )
        }

    @model_validator(mode="after")
    def _background_fits(self) -> "ReturnsScenario":
        every = self.background.every
        beams = {table.beams for table in self.pairs.values()}
        wrong = [count for count in sorted(beams) if every is not None and (count % every[1] or count < 3 * every[1])]
        if every is not None and wrong:
            raise ValueError(
                f"background.every has {every[1]} for the bearing: expected a divisor of the {wrong[0]} beams "
                "that leaves 3 beams at least"
            )
        if self.background.shape is not None and self.tracker.targets == 1:
            raise ValueError(
                "background.shape is given and tracker.targets is 1: expected several, which learn the background"
            )
        return self
