"""Sections of a scenario for the recording of an array."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from faintrack.kinds.scenario import Scenario
from faintrack.scenario.alarm import Alarms
from faintrack.scenario.array import ArraySection
from faintrack.scenario.section import FilePath, Pair, Section
from faintrack.scenario.sections import AnalysisSection, ManySection, ParticlesSection, TargetSection


class FilesSection(Section):
    """How files are read.

    Attributes
    ----------
    start_pattern : how their names tell the start in UTC: "%Y%m%d_%H%M%S"; what they tell themselves where not given.
    """

    start_pattern: str | None = None


class SourceTargetSection(TargetSection):
    """What is known of targets before any scan.

    Attributes
    ----------
    arrival_rate : of an absent target; per second.
    departure_rate : of a present target; per second.
    bearing_rate_deg : new targets turn at most this fast, either way; degrees a second.
    bearing_rate_noise_deg : density of the bearing acceleration; degrees a second per root second.
    snr_db : lowest and highest SNR of a target at one channel, in the band; dB. Where not given, from the SNR at
        which a frame tells 0.02 nats of a target, to 20 dB. Of a tone that over the noise in 1 Hz, 50 dB from the
        faintest that a frame tells of.
    snr_noise_db : random walk of the SNR; dB per root second.
    elevation_deg : lowest and highest elevation of a source above the horizon, which an array that is no line can
        tell: the speed of sound over the cosine of it is the trace velocity; degrees. All waves are level where not
        given.
    elevation_noise_deg : random walk of the elevation; degrees per root second.
    frequency_noise : of a tone: random walk of its frequency; Hz per root second.
    """

    bearing_rate_deg: float = Field(default=0.5, ge=0)
    bearing_rate_noise_deg: float = Field(default=0.05, ge=0)
    snr_db: Pair | None = None
    snr_noise_db: float = Field(default=0.5, ge=0)
    elevation_deg: Pair | None = None
    elevation_noise_deg: float = Field(default=0.1, ge=0)
    frequency_noise: float = Field(default=0.02, ge=0)

    @model_validator(mode="after")
    def _ordered(self) -> "SourceTargetSection":
        if self.snr_db is not None and not self.snr_db[0] < self.snr_db[1]:
            raise ValueError("snr_db: expected the lowest SNR first")
        if self.elevation_deg is not None and not -89 <= self.elevation_deg[0] < self.elevation_deg[1] <= 89:
            raise ValueError("elevation_deg: expected the lowest first, both from -89 to 89")
        return self


class LikelihoodSection(Section):
    """Which likelihood reads the scans.

    Attributes
    ----------
    kind : "unknown_noise", the noise power of every frequency and frame integrated out; "known_noise"; "lobe_width"; or
        "tone", a target is a tone of unknown frequency (`faintrack.likelihoods.unknown_tone`).
    noise_power : for "known_noise": variance of the noise in one sample of a channel, the same at all frequencies.
    noise_seconds : for "known_noise", instead: the noise power of each frequency is measured over the first seconds.
    exponent : for "lobe_width": to which the beam power is raised.
    isotropic : for "unknown_noise" of several targets: whether noise that arrives from all directions alike, and is so
        correlated between channels, has a share that is fitted as the data come (`faintrack.signal.array_background`);
        otherwise the noise of channels is independent.
    """

    kind: Literal["unknown_noise", "known_noise", "lobe_width", "tone"] = "unknown_noise"
    noise_power: float | None = Field(default=None, gt=0)
    noise_seconds: float | None = Field(default=None, gt=0)
    exponent: float = Field(default=5.0, gt=0)
    isotropic: bool = True

    @model_validator(mode="after")
    def _noise_is_known(self) -> "LikelihoodSection":
        given = (self.noise_power is not None) + (self.noise_seconds is not None)
        if given != (self.kind == "known_noise"):
            raise ValueError('kind "known_noise" takes exactly one of noise_power and noise_seconds, the others none')
        return self


class GuidedSection(ParticlesSection):
    """What carries the belief: particles.

    Attributes
    ----------
    particles : that follow a target.
    births : newborn particles a scan.
    guided : whether newborn particles are drawn where the scan points, which loud sources need; otherwise everywhere.
    seed : of the random numbers.
    """

    guided: bool = True


class TaperedSection(AnalysisSection):
    """How samples become scans; see `faintrack.signal.beamformer.beamformer`.

    Attributes
    ----------
    taper : whether snapshots overlap by half under Hann's window, where a frame holds several: what a loud source
        leaves of a faint one beside it is heard then. It takes twice as many transforms.
    """

    taper: bool = True


class MethodSection(ManySection):
    """How tracks come about.

    Attributes
    ----------
    method : "bernoulli", track before detect; or "cfar", the classical baseline (`faintrack.baselines`), which reads no
        likelihood and no particle filter.
    targets, silence, declare, drop, false_tracks, calibration : see `faintrack.scenario.sections.ManySection`; "cfar"
        follows one target.
    """

    method: Literal["bernoulli", "cfar"] = "bernoulli"


class CfarSection(Section):
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


class SourceSection(Section):
    """A source that moves at a constant bearing rate and is heard from `start` to `end`.

    Attributes
    ----------
    snr_db : variance of its signal over variance of the noise at one channel; dB.
    tone : frequency of the sine that it sends, Hz; white noise where not given.
    bearing_deg : at `start`; degrees, from the axis of a line array or clockwise from north.
    bearing_rate_deg : degrees a second.
    elevation_deg : above the horizon; degrees.
    start, end : seconds from the start of the recording; to its end where not given.
    """

    snr_db: float
    tone: float | None = Field(default=None, gt=0)
    bearing_deg: float
    bearing_rate_deg: float = 0.0
    elevation_deg: float = Field(default=0.0, gt=-90, lt=90)
    start: float = Field(default=0.0, ge=0)
    end: float | None = None


class SimulationSection(Section):
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

    duration: float = Field(gt=0, examples=[180.0])
    sample_rate: float = Field(gt=0, examples=[4000.0])
    seed: int = Field(default=0, ge=0, lt=2**32)
    noise_power: float = Field(default=1.0, gt=0)
    noise_slope_db: float = Field(default=0.0, ge=-24, le=24)
    sources: Annotated[tuple[SourceSection, ...], Field(strict=False)] = ()


class RecordingScenario(Scenario):
    """What to run with the recording of an array.

    Attributes
    ----------
    array : positions of the channels, as in a file of its own or the name of one; see `faintrack.scenario.array`.
    heading : CSV file with the columns time_s and heading_deg, of an array that turns (`faintrack.io.headings`); what
        the array has as its own directions is then at heading 0, and bearings of a simulation are true.
    alarm : when `faintrack live` calls someone; see `faintrack.scenario.alarm`.
    """

    kind: Literal["recording"] = "recording"
    array: ArraySection | None = None
    heading: FilePath | None = None
    files: FilesSection = FilesSection()
    analysis: TaperedSection = TaperedSection()
    target: SourceTargetSection = SourceTargetSection()
    likelihood: LikelihoodSection = LikelihoodSection()
    filter: GuidedSection = GuidedSection()
    tracker: MethodSection = MethodSection()
    cfar: CfarSection = CfarSection()
    alarm: Alarms | None = None
    simulation: SimulationSection | None = None

    @model_validator(mode="after")
    def _tones_are_sought(self) -> "RecordingScenario":
        if self.likelihood.kind != "tone":
            return self
        if self.tracker.method != "bernoulli":
            raise ValueError(
                f'likelihood.kind "tone": tracker.method is "{self.tracker.method}", which knows of no frequency; '
                'expected "bernoulli"'
            )
        if self.analysis.snapshot is not None:
            raise ValueError('likelihood.kind "tone" looks at whole frames; expected analysis.frame, and no snapshot')
        return self

    @model_validator(mode="after")
    def _elevation_is_read(self) -> "RecordingScenario":
        if self.target.elevation_deg is not None:
            if self.likelihood.kind != "unknown_noise":
                raise ValueError(
                    f'target.elevation_deg: likelihood.kind is "{self.likelihood.kind}", which hears level waves only; '
                    'expected "unknown_noise"'
                )
            if self.tracker.method != "bernoulli":
                raise ValueError(
                    f'target.elevation_deg: tracker.method is "{self.tracker.method}", which hears level waves only; '
                    'expected "bernoulli"'
                )
        return self

    @model_validator(mode="after")
    def _heading_is_read(self) -> "RecordingScenario":
        if self.heading is not None and self.tracker.method != "bernoulli":
            raise ValueError(
                f'heading: tracker.method is "{self.tracker.method}", which knows of no turns; expected "bernoulli"'
            )
        return self
