"""Sections of a scenario for contacts of an active sonar: what the detector reports, and where targets are sought."""

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from faintrack.kinds.scenario import Scenario
from faintrack.scenario.alarm import Alarms
from faintrack.scenario.moving import PlanarTargets
from faintrack.scenario.section import Pair, Section, require_sector
from faintrack.scenario.sections import ManySection, ParticlesSection, TargetSection


class ContactsSection(Section):
    """Contacts that are tracked in; see `faintrack.sensors.contact_sets`.

    Attributes
    ----------
    delay : first and last delay at which contacts are reported, where the file tells delays; s.
    delay_std : standard deviation of the delay of a target's contact; s.
    range : instead, where the file tells ranges: the nearest and the farthest; m.
    range_std : standard deviation of the range; m.
    bearing_std_deg : standard deviation of the bearing; degrees.
    sector_deg : from its first bearing clockwise to its last; degrees clockwise from north. Everywhere where not given.
    doppler : lowest and highest shift that is reported; Hz. Where not given, Doppler is not measured.
    doppler_std : standard deviation of the shift; Hz.
    frequency : of the pulse, Hz; only with Doppler.
    detection_probability : that a target is reported in a ping.
    false_per_ping : expected number of false contacts of a source and a receiver in a ping. Where not given, the mean
        number of contacts in the data, those of targets among them.
    source, receiver : where they stand still: metres east and north. Columns of the contacts take their place, and
        `[[sources]]` and `[[receivers]]` where there are several.
    sound_speed : m/s.
    x, y : targets are looked for in this region, east and north; m.
    speed : new targets move at most this fast along each axis, either way; m/s.
    """

    delay: Pair | None = None
    delay_std: float | None = Field(default=None, gt=0)
    range: Pair | None = Field(default=None, examples=[(200.0, 10_000.0)])
    range_std: float | None = Field(default=None, gt=0, examples=[20.0])
    bearing_std_deg: float = Field(gt=0, le=45, examples=[1.5])
    sector_deg: Pair | None = None
    doppler: Pair | None = None
    doppler_std: float | None = Field(default=None, gt=0)
    frequency: float | None = Field(default=None, gt=0)
    detection_probability: float = Field(gt=0, le=1, examples=[0.8])
    false_per_ping: float | None = Field(default=None, gt=0, le=10_000)
    source: Pair | None = Field(default=None, examples=[(0.0, 0.0)])
    receiver: Pair | None = Field(default=None, examples=[(0.0, 0.0)])
    sound_speed: float = Field(default=1500.0, gt=0)
    x: Pair = Field(examples=[(-10e3, 10e3)])
    y: Pair = Field(examples=[(-10e3, 10e3)])
    speed: float = Field(gt=0, examples=[10.0])

    @model_validator(mode="after")
    def _distances(self) -> "ContactsSection":
        told = [name for name in ("delay", "range") if getattr(self, name) is not None]
        stated = [name for name in ("delay", "range") if getattr(self, f"{name}_std") is not None]
        if len(told) != 1 or told != stated:
            raise ValueError("how far: expected either delay and delay_std, or range and range_std")
        given = [getattr(self, name) is not None for name in ("doppler", "doppler_std", "frequency")]
        if any(given) and not all(given):
            raise ValueError("Doppler: expected doppler, doppler_std and frequency together, or none of them")
        return self

    @model_validator(mode="after")
    def _ordered(self) -> "ContactsSection":
        for name in ("delay", "range", "doppler", "x", "y"):
            ends = getattr(self, name)
            if ends is not None and not ends[0] < ends[1]:
                raise ValueError(f"{name} goes from {ends[0]:g} to {ends[1]:g}: expected the lower end first")
        for name in ("delay", "range"):
            ends = getattr(self, name)
            if ends is not None and ends[0] < 0:
                raise ValueError(f"{name} begins at {ends[0]:g}: expected at least 0")
        return self

    @model_validator(mode="after")
    def _sector(self) -> "ContactsSection":
        require_sector(self.sector_deg)
        return self


class PlatformSection(Section):
    """A source or a receiver, where there are several.

    Attributes
    ----------
    name : as in the column of the contacts.
    place : where it stands still: metres east and north. The columns of the contacts take its place.
    """

    name: Annotated[str, Field(pattern=r"^\S(.{0,58}\S)?$", examples=["north"])]
    place: Pair | None = Field(default=None, examples=[(0.0, 0.0)])


class EchoingSection(TargetSection):
    """What is known of targets before any ping.

    Attributes
    ----------
    arrival_rate : of an absent target; per second.
    departure_rate : of a present target; per second.
    velocity_noise : density of the acceleration along each axis; m/s per root second. Where not given, it adds up to a
        tenth of `contacts.speed` in ten minutes.
    """

    arrival_rate: float = Field(default=1e-4, gt=0)
    departure_rate: float = Field(default=1e-4, gt=0)
    velocity_noise: float | None = Field(default=None, ge=0)


class ContactParticlesSection(ParticlesSection):
    """What carries the belief: particles.

    Attributes
    ----------
    particles : that seek, and that follow a target.
    births : newborn particles a ping.
    seed : of the random numbers.
    """

    particles: int = Field(default=16_000, ge=10, le=1_000_000)
    births: int = Field(default=16_000, ge=10, le=1_000_000)


class SimulationSection(Section):
    """Contacts to draw, as `[contacts]` says that they are reported.

    Attributes
    ----------
    pings : number of them.
    interval : from ping to ping; s.
    seed : of the random numbers.
    targets : that are detected.
    """

    pings: int = Field(ge=2, le=1_000_000, examples=[40])
    interval: float = Field(gt=0, examples=[20.0])
    seed: int = Field(default=0, ge=0, lt=2**32)
    targets: PlanarTargets = Field(default=(), examples=[[{"x": -4000.0, "y": 3000.0, "vx": 6.0, "vy": -3.0}]])


class ContactsScenario(Scenario):
    """What to run with contacts of an active sonar."""

    kind: Literal["contacts"] = "contacts"
    contacts: ContactsSection
    sources: Annotated[tuple[PlatformSection, ...], Field(strict=False, min_length=1, max_length=16)] | None = None
    receivers: Annotated[tuple[PlatformSection, ...], Field(strict=False, min_length=1, max_length=16)] | None = None
    target: EchoingSection = EchoingSection()
    filter: ContactParticlesSection = ContactParticlesSection()
    tracker: ManySection = ManySection()
    alarm: Alarms | None = None
    simulation: SimulationSection | None = None

    @model_validator(mode="before")
    @classmethod
    def _whole(cls, values: Any) -> Any:
        if values.get("contacts") is None:
            raise ValueError(
                "there is no [contacts]: expected it with what the detector reports and where targets are looked for "
                "(--scenario FILE)"
            )
        return values

    @model_validator(mode="after")
    def _names_differ(self) -> "ContactsScenario":
        for platform in ("sources", "receivers"):
            names = [each.name for each in getattr(self, platform) or ()]
            for number, name in enumerate(names):
                if name in names[:number]:
                    raise ValueError(
                        f"{platform}[{number}].name is {name!r}, that of {platform}[{names.index(name)}]: "
                        "expected names that differ"
                    )
        return self
