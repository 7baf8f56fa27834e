"""The threshold on existence that keeps a rate of false tracks on a user's own data.

The tracker runs on data without a target: stretches that the user calls quiet, or surrogates made of all of the data
(`faintrack.kinds.surrogates`). It declares nothing there, so existence rises and falls as the background has it, and
each excursion above the threshold at which a track ends counts with its peak (`faintrack.metrics.false_tracks`).
Where a target is declared only after it has been watched for some scans (`hold`), existence counts from then on.

Existence is that of a target anywhere, and a track begins where that much of it lies at one place: the rate of false
tracks is the counted one or a smaller one.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.special import logit

from faintrack.errors import InputError
from faintrack.kinds.door import opened
from faintrack.kinds.kind import Kind
from faintrack.kinds.loop import advance
from faintrack.kinds.promise import LEAST
from faintrack.metrics.false_tracks import HOUR, LARGEST, Exceedances, Kept, exceedances
from faintrack.numerics.compiled import keep_compilations
from faintrack.results.schema import covered_seconds
from faintrack.scenario.promise import per_second, tracker_table
from faintrack.scenario.sections import CalibrationSection, Source

DRAWS = 4
"""Surrogates that are drawn where their number is not given."""

SINGLE = 1e-7
"""Existence in single precision is below 1 by this or not at all."""

Stretches = Sequence[tuple[float, float]]
"""Starts and ends; seconds from the first scan."""


@dataclass(frozen=True)
class CalibratedOnData:
    """A threshold that keeps a rate of false tracks, and how it was found.

    Attributes
    ----------
    scenario : what is to be run, with the threshold and how it was found in it.
    kept : threshold and rate, with their intervals.
    exceedances : peaks of existence that it was found from.
    by : "quiet stretches" or "surrogates".
    remarks : what the user must know; one sentence each.
    """

    scenario: Any
    kept: Kept
    exceedances: Exceedances
    by: Source
    remarks: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for programs."""
        kept, table = self.kept, _table(self.scenario)[1]
        return {
            "threshold": kept.threshold.value,
            "interval": [kept.threshold.low, kept.threshold.high],
            "false_tracks": table.false_tracks,
            "per_hour": kept.rate * HOUR,
            "per_hour_interval": [kept.low * HOUR, kept.high * HOUR],
            "by": self.by,
            "hours": self.exceedances.seconds / HOUR,
            "peaks": len(self.exceedances.peaks),
            "extrapolated": kept.extrapolated,
            "remarks": list(self.remarks),
        }


def calibrate_on(
    what: Any,
    scenario: Any = None,
    *,
    false_tracks: str,
    quiet: Stretches | None = None,
    draws: int = DRAWS,
    seed: int = 0,
    progress: Any = lambda scans, total: None,
    **sections: Any,
) -> CalibratedOnData:
    """Threshold that false tracks pass at a rate, from a user's own data.

    Parameters
    ----------
    what, scenario, sections : as `faintrack.track`.
    false_tracks : promised: "1/h", "0.5/day".
    quiet : stretches without a target; where not given, surrogates are made of all of the data.
    draws : surrogates.
    seed : of the surrogates.
    progress : is called with the scans that were just taken in, and the number of all.

    Raises
    ------
    InputError : the rate is none, a stretch lies outside the data, data and scenario do not fit together, no threshold
        keeps the rate.

    Examples
    --------
    >>> import numpy as np
    >>> import faintrack as ft
    >>> noise = np.random.default_rng(0).normal(size=(12, 10, 12))
    >>> found = ft.calibrate_on(ft.from_frames(noise), tracker={"targets": 1}, false_tracks="60/h", draws=1)
    >>> found.by, found.scenario.tracker.calibration.hours * 3600, found.kept.extrapolated
    ('surrogates', 12.0, True)
    """
    rate = per_second(false_tracks)
    if draws < 1:
        raise InputError(f"draws is {draws}; expected at least 1.")
    keep_compilations()
    kind, data, complete = opened(what, scenario, sections)
    name, table = _table(complete)
    held = "hold" in type(table).model_fields
    # Nothing is declared; where a track takes some scans, all are that may.
    least = table.drop + 1e-3 * (1 - table.drop)
    undecided = table.model_copy(
        update={"declare": least if held else LARGEST, "false_tracks": None, "calibration": None}
    )
    silent = complete.model_copy(update={name: undecided})
    parts = _quiet(kind, data, quiet) if quiet is not None else _surrogates(kind, data, silent, draws, seed)
    runs, seconds = [], 0.0
    number = len(quiet) if quiet is not None else draws
    for part in parts:
        run, covered = _existence(kind, part, silent, held, number, progress)
        runs.append(run)
        seconds += covered
    found = exceedances(runs, seconds, table.drop)
    kept = found.kept(rate, max(LEAST, least))
    by: Source = "surrogates" if quiet is None else "quiet stretches"
    calibration = CalibrationSection(
        false_tracks=false_tracks,
        declare=kept.threshold.value,
        by=by,
        hours=seconds / HOUR,
        per_hour=kept.rate * HOUR,
        interval=(kept.low * HOUR, kept.high * HOUR),
        extrapolated=kept.extrapolated,
    )
    promised = {"declare": kept.threshold.value, "false_tracks": false_tracks, "calibration": calibration}
    result = complete.model_copy(update={name: table.model_copy(update=promised)})
    return CalibratedOnData(result, kept, found, by, tuple(_remarks(rate, kept, found, by)))


def stretches_of(text: str) -> list[tuple[float, float]]:
    """Starts and ends of stretches, from a text such as "0:600,1200:1800"; seconds.

    Raises
    ------
    InputError : it is no such text.

    Examples
    --------
    >>> stretches_of("0:600, 1200:1800.5")
    [(0.0, 600.0), (1200.0, 1800.5)]
    """
    number = r"\s*(\d+(?:\.\d*)?)\s*"
    found = [re.fullmatch(f"{number}:{number}", part) for part in text.split(",")]
    if None in found:
        raise InputError(f"quiet is {text!r}; expected starts and ends in seconds, such as 0:600,1200:1800.")
    return [(float(one[1]), float(one[2])) for one in found if one is not None]


def _table(scenario: Any) -> tuple[str, Any]:
    named = tracker_table(scenario)
    if named is None:
        raise InputError(f"a scenario of {scenario.kind} has no threshold on existence.")
    return named


def _quiet(kind: Kind, data: Any, stretches: Stretches) -> Iterator[Any]:
    if kind.stretch is None:
        raise InputError(f"{kind.name}: no stretch can be taken; expected data without a target.")
    if not stretches:
        raise InputError("there is no quiet stretch; expected a start and an end in seconds.")
    cut = kind.stretch
    # All of them first: what lies outside is refused before a long run.
    return iter([cut(data, start, stop) for start, stop in stretches])


def _surrogates(kind: Kind, data: Any, scenario: Any, draws: int, seed: int) -> Iterator[Any]:
    if kind.surrogate is None:
        raise InputError(f"{kind.name}: no surrogate can be made; expected quiet stretches (--quiet START:END).")
    made = kind.surrogate
    return (made(data, scenario, seed + draw) for draw in range(draws))


def _existence(
    kind: Kind, data: Any, scenario: Any, held: bool, parts: int, progress: Any
) -> tuple[Float[np.ndarray, " scan"], float]:
    """Log odds of existence after every scan of a run, and the seconds that it covers."""
    plan = kind.plan(data, scenario)
    runs, seconds = [], 0.0
    for _, rows in advance(plan):
        existence = rows.existence.values.astype(float)
        if held:
            existence = np.where(rows.label.values > 0, existence, 0)
        runs.append(logit(np.clip(existence.max(axis=1), SINGLE, 1 - SINGLE)))
        seconds += covered_seconds(rows)
        progress(rows.sizes["time"], None if plan.length is None else parts * plan.length)
    return np.concatenate([*runs, np.zeros(0)]), seconds


def _remarks(rate: float, kept: Kept, found: Exceedances, by: Source) -> Iterator[str]:
    hours = found.seconds / HOUR
    if kept.extrapolated:
        yield (
            f"Extrapolated: {hours:.3g} h without a target have {found.count(kept.threshold.value)} peaks above the "
            f"threshold and {len(found.peaks)} in all, and {rate * found.seconds:.2g} false tracks are promised in "
            "them; from ten on they are counted."
        )
    if by == "surrogates":
        yield (
            "Surrogates keep what every channel, cell or scan reports and lose what the noise itself has in common "
            "between channels and from scan to scan; where that matters, give quiet stretches."
        )
