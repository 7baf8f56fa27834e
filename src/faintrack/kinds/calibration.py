"""The threshold on existence at which a scenario declares a false track as rarely as is wished.

Every kind can draw data without a target; the highest existence of each of many such runs is kept, and the threshold is
the quantile that as many runs exceed as are wanted (`faintrack.metrics.thresholds`). A kind that has a faster way, such
as Wald's identity for likelihood ratios whose data are drawn within the compiled program, brings its own.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import logit

from faintrack.errors import InputError
from faintrack.kinds import kind_named
from faintrack.kinds.door import scenario_given
from faintrack.kinds.kind import Kind
from faintrack.kinds.loop import advance
from faintrack.kinds.scenario import scenario_of
from faintrack.metrics.thresholds import Threshold, counted_threshold
from faintrack.numerics.compiled import keep_compilations

EXCEEDING = 20
"""Runs on noise that are wanted above the threshold where their number is not given."""

MOST_RUNS = 10_000_000
"""Runs on noise at most: more would not end."""

Progress = Callable[[int, int], None]
"""Is called with the runs drawn just now, and the number of all."""


@dataclass(frozen=True)
class Calibrated:
    """A threshold and how it was found.

    Attributes
    ----------
    threshold : on the probability of existence, with its 95 % interval.
    by : "Wald's identity" or "counting".
    runs : that were drawn.
    """

    threshold: Threshold
    by: str
    runs: int


def calibrate(
    scenario: Any = None,
    probability: float = 1e-3,
    duration: float = 180.0,
    runs: int | None = None,
    seed: int = 0,
    progress: Progress = lambda drawn, total: None,
    **sections: Any,
) -> Calibrated:
    """Threshold of a scenario for a probability of a false track in a stated time.

    Parameters
    ----------
    scenario, sections : as `faintrack.track`; the kind is told by the sections. With a `[simulation]` that lasts as
        long, where the kind counts runs on its own data.
    probability : of a false track in `duration`.
    duration : s.
    runs : to draw; where not given, enough of them.
    seed : of the random numbers.
    progress : is called while runs are drawn.

    Raises
    ------
    InputError : probability, duration or runs out of range; the scenario does not tell what is to be drawn.
    """
    if runs is not None and runs < 2:
        raise InputError(f"runs is {runs}; expected at least 2.")
    if not 0 < probability < 1:
        raise InputError(f"probability is {probability:g}; expected a number between 0 and 1.")
    if not 0 < duration < np.inf:
        raise InputError(f"duration is {duration:g} s; expected a number above 0.")
    keep_compilations()
    given = scenario_given(scenario, sections)
    what_to_run = scenario_of(given.sections, given.source, given.folder)
    kind = kind_named(what_to_run.kind)
    if kind.calibrate is not None:
        calibrated: Calibrated = kind.calibrate(what_to_run, probability, duration, runs, seed, progress)
        return calibrated
    count = counted_runs(probability, runs)
    highest = np.empty(count)
    for run in range(count):
        highest[run] = _highest(kind, what_to_run, duration, seed + run)
        progress(1, count)
    return Calibrated(counted_threshold(highest, probability), "counting", count)


def counted_runs(probability: float, runs: int | None) -> int:
    """Runs on noise to draw.

    Raises
    ------
    InputError : they are too many.
    """
    count = round(EXCEEDING / probability) if runs is None else runs
    if count > MOST_RUNS:
        raise InputError(f"probability is {probability:g}; counted it takes more than {MOST_RUNS:,} runs.")
    return count


def _highest(kind: Kind, scenario: Any, duration: float, seed: int) -> float:
    """Highest log odds of existence in one run without a target."""
    plan = kind.plan(kind.silence(scenario, seed), scenario)
    highest, last = -np.inf, 0.0
    for _, rows in advance(plan):
        existence = rows.existence.values[rows.time.values < duration]
        # Existence in single precision is below 1 by 6e-8 or not at all.
        highest = max(highest, float(logit(np.clip(existence, 1e-7, 1 - 1e-7)).max(initial=-np.inf)))
        last = float(rows.time.values[-1]) + float(rows.attrs["scan_interval"])
        if last >= duration:
            return highest
    raise InputError(f"the simulation lasts {last:g} s; expected at least the duration, {duration:g} s.")
