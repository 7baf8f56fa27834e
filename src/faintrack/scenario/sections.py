"""Sections that scenarios of several kinds have, or build on."""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from faintrack.errors import InputError
from faintrack.scenario.promise import per_second
from faintrack.scenario.section import Pair, Section


def _rate(text: str) -> str:
    try:
        per_second(text)
    except InputError as error:
        raise ValueError(str(error).partition("; ")[2].rstrip(".")) from error
    return text


Rate = Annotated[str, AfterValidator(_rate)]
"""A rate of false tracks: "1/h", "0.5/day"."""


class TargetSection(Section):
    """How often targets come and go.

    Attributes
    ----------
    arrival_rate : of an absent target; per second.
    departure_rate : of a present target; per second.
    """

    arrival_rate: float = Field(default=0.001, gt=0)
    departure_rate: float = Field(default=0.005, gt=0)


class SeedSection(Section):
    """What carries the belief.

    Attributes
    ----------
    seed : of the random numbers.
    """

    seed: int = Field(default=0, ge=0, lt=2**32)


class ParticlesSection(SeedSection):
    """What carries the belief: particles.

    Attributes
    ----------
    particles : that follow a target.
    births : newborn particles a scan.
    seed : of the random numbers.
    """

    particles: int = Field(default=1000, ge=10, le=1_000_000)
    births: int = Field(default=250, ge=10, le=1_000_000)


Source = Literal["quiet stretches", "surrogates"]
"""Of data without a target: what a user calls quiet, or what is made of data (`faintrack.kinds.surrogates`)."""


class CalibrationSection(Section):
    """How a threshold was found on data without a target; `faintrack calibrate` writes it.

    Attributes
    ----------
    false_tracks : that the threshold keeps.
    declare : the threshold on existence.
    by : what the data were: "quiet stretches", or "surrogates" made of data with targets.
    hours : of such data.
    per_hour : times that existence passes the threshold in an hour of them.
    interval : of that number; 95 %.
    extrapolated : whether the data are too short to count so few.
    """

    false_tracks: Rate
    declare: float = Field(gt=0, lt=1)
    by: Source
    hours: float = Field(gt=0)
    per_hour: float = Field(ge=0)
    interval: Pair
    extrapolated: bool


class TrackerSection(Section):
    """How tracks come about.

    Attributes
    ----------
    declare : existence at which a track begins; follows from `false_tracks` where that is given.
    drop : existence of the track's own below which it ends.
    false_tracks : an hour or a day that are promised, "1/h"; by `calibration` where there is one, else by the model.
    calibration : how the threshold was found on data without a target; `faintrack calibrate` writes it.
    """

    declare: float = Field(default=0.97, gt=0, lt=1)
    drop: float = Field(default=0.3, gt=0, lt=1)
    false_tracks: Rate | None = None
    calibration: CalibrationSection | None = None

    @model_validator(mode="after")
    def _hysteresis(self) -> "TrackerSection":
        if not self.drop < self.declare:
            raise ValueError("drop: expected less than declare")
        return self


class ManySection(TrackerSection):
    """How tracks of several targets come about.

    Attributes
    ----------
    targets : in hand at once at most; 1 is the filter of the papers, of one target at a time. Where not given, 6, or 1
        with a likelihood that knows of no others.
    silence : scans after which a target that is not heard any more is given up, about; a pulsed one or one that fades
        is one track if it is heard again before.
    declare : existence at which a track begins; follows from `false_tracks` where that is given.
    drop : existence of the track's own below which it ends.
    false_tracks : an hour or a day that are promised, "1/h"; by `calibration` where there is one, else by the model.
    calibration : how the threshold was found on data without a target; `faintrack calibrate` writes it.
    """

    targets: int | None = Field(default=None, ge=1, le=64)
    silence: float = Field(default=10.0, gt=0, le=1e6)


class AnalysisSection(Section):
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
