"""A promise in false tracks an hour: how it is written, and what a result may say of it."""

import math
from dataclasses import dataclass
from typing import Any

from faintrack.errors import InputError
from faintrack.metrics.false_tracks import HOUR, bounded_rate

UNITS = {"h": HOUR, "day": 24 * HOUR}
"""Seconds of the times that a rate may be told in."""


def per_second(text: str) -> float:
    """False tracks a second, from a text such as "1/h" or "0.5/day".

    Raises
    ------
    InputError : it is no such text, or no number above 0.

    Examples
    --------
    >>> per_second("36/h"), per_second("0.5 / day") * 86400
    (0.01, 0.5)
    """
    number, _, unit = str(text).partition("/")
    try:
        value = float(number)
    except ValueError:
        value = math.nan
    if unit.strip() not in UNITS or not 0 < value < math.inf:
        raise InputError(
            f"false_tracks is {str(text)[:60]!r}; expected a number an hour or a day, such as 1/h or 2/day."
        )
    return value / UNITS[unit.strip()]


def tracker_table(scenario: Any) -> tuple[str, Any] | None:
    """Name and section of a scenario that tells how tracks come about; None where it has none."""
    from faintrack.scenario.sections import TrackerSection

    tables = {name: getattr(scenario, name) for name in type(scenario).model_fields}
    return next(((name, table) for name, table in tables.items() if isinstance(table, TrackerSection)), None)


@dataclass(frozen=True)
class Promise:
    """What was promised, and what is expected in a result.

    Attributes
    ----------
    text : of the scenario.
    by : "model", at most so many; "quiet stretches" or "surrogates", counted on data without a target.
    per_hour : false tracks an hour at the threshold.
    interval : of that number, where it was counted; 95 %.
    hours : of the result.
    counted_hours : of data without a target.
    extrapolated : whether those were too short to count so few.
    declare : the threshold.
    """

    text: str
    by: str
    per_hour: float
    interval: tuple[float, float] | None
    hours: float
    counted_hours: float | None
    extrapolated: bool
    declare: float

    @property
    def expected(self) -> float:
        """False tracks in the result; at most, by the model."""
        return self.per_hour * self.hours

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for programs."""
        return {
            "promised": self.text,
            "by": self.by,
            "per_hour": self.per_hour,
            "interval": None if self.interval is None else list(self.interval),
            "extrapolated": self.extrapolated,
            "expected": self.expected,
        }

    def sentence(self) -> str:
        """What a user must know."""
        rate = f"{self.per_hour:.2g} an hour"
        head = f"{self.expected:.2g} false tracks are expected in these {self.hours:.3g} h"
        if self.interval is None:
            return (
                f"At most {head}, if the background is the model's: {self.text} was promised, and existence of "
                f"{self.declare:.4g} is passed {rate} at most."
            )
        low, high = self.interval
        how = ", extrapolated" if self.extrapolated else ""
        return (
            f"{head}, {self.expected * low / self.per_hour:.2g} to {self.expected * high / self.per_hour:.2g}: "
            f"{self.text} was promised, and existence of {self.declare:.4g} is passed {rate} "
            f"in {self.counted_hours:.3g} h of {self.by}{how}."
        )


def promise_of(scenario: Any, gained: float | None, seconds: float) -> Promise | None:
    """What a result may say of false tracks; None where nothing was promised.

    Parameters
    ----------
    scenario : that was run.
    gained : what the odds of existence gain in a second at most (`faintrack.metrics.false_tracks.odds_rate`).
    seconds : of the result.
    """
    named = tracker_table(scenario)
    if named is None or named[1].false_tracks is None:
        return None
    table, hours = named[1], seconds / HOUR
    calibration = table.calibration
    if calibration is None:
        if gained is None:
            return None
        bound = bounded_rate(table.declare, gained) * HOUR
        return Promise(table.false_tracks, "model", bound, None, hours, None, False, table.declare)
    return Promise(
        table.false_tracks,
        calibration.by,
        calibration.per_hour,
        calibration.interval,
        hours,
        calibration.hours,
        calibration.extrapolated,
        table.declare,
    )
