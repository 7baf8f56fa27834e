"""A promised rate of false tracks: the threshold that keeps it, and what a result says of it.

By the model the threshold follows from how often targets arrive (`faintrack.metrics.false_tracks`); otherwise it was
found on data without a target (`faintrack.kinds.false_tracks`) and stands in the scenario. Whether the model's bound
may be trusted shows in the scans themselves: where existence rises far more often than it can under the model, and
falls again, the background is another one.
"""

from typing import Any

import numpy as np
import xarray as xr
from scipy.special import expit, logit

from faintrack.errors import InputError
from faintrack.kinds.kind import Kind
from faintrack.metrics.false_tracks import bounded_threshold, odds_rate, rises
from faintrack.results.schema import covered_seconds
from faintrack.scenario.promise import per_second, promise_of, tracker_table

LEAST = 0.5
"""Threshold at least: a target is not declared where it is likelier not there."""

RISES = 5.0
"""Rises of existence at most, in the mean under the model, to a level at which they are counted."""

TOO_MANY = 20
"""Rises from which on the background is said to be another one: four times the most that the model has."""


def gained_by_target(scenario: Any) -> float:
    """What the odds of existence of one target gain in a second at most; see `faintrack.kinds.kind.Kind`."""
    return odds_rate(scenario.target.arrival_rate, scenario.target.departure_rate)


def keeping(kind: Kind, scenario: Any, false_tracks: str | None = None) -> Any:
    """Scenario with the threshold that keeps what it promises.

    Parameters
    ----------
    kind, scenario : what is to be run.
    false_tracks : promised, in place of the scenario's own.

    Raises
    ------
    InputError : the threshold does not follow from the model, or was found for another rate, or lies below `drop`.
    """
    named = tracker_table(scenario)
    promised = false_tracks if false_tracks is not None or named is None else named[1].false_tracks
    if promised is None:
        return scenario
    if named is None:
        raise InputError(f"a scenario of {kind.name} has no threshold on existence, so no false_tracks.")
    name, table = named[0], named[1].model_copy(update={"false_tracks": promised})
    rate, gained = per_second(table.false_tracks), kind.gained(scenario)
    calibration = table.calibration
    if calibration is not None and not np.isclose(per_second(calibration.false_tracks), rate, rtol=1e-9):
        raise InputError(
            f"{name}.false_tracks is {table.false_tracks} and {name}.calibration was made for "
            f"{calibration.false_tracks}; expected the same: faintrack calibrate DATA --false-tracks "
            f"{table.false_tracks}."
        )
    if calibration is not None:
        declare = calibration.declare
    elif gained is not None:
        declare = max(bounded_threshold(rate, gained), LEAST)
    else:
        raise InputError(
            f"{name}.false_tracks is {table.false_tracks}, and with this method no threshold follows from the model; "
            f"expected one that is found on data: faintrack calibrate DATA --false-tracks {table.false_tracks}."
        )
    if not table.drop < declare < 1:
        raise InputError(
            f"{name}.false_tracks {table.false_tracks} declares at existence {declare:.6g}; expected {name}.drop, "
            f"{table.drop:g}, below it."
        )
    return scenario.model_copy(update={name: table.model_copy(update={"declare": declare})})


def about_false_tracks(kind: Kind, scenario: Any, found: xr.Dataset) -> tuple[str, ...]:
    """How many false tracks are expected in a result; one sentence at most."""
    promise = promise_of(scenario, kind.gained(scenario), covered_seconds(found))
    return () if promise is None else (promise.sentence(),)


def about_rises(kind: Kind, scenario: Any, found: xr.Dataset) -> tuple[str, ...]:
    """Of existence that rises and falls more often than the model has it, where a promise rests on that."""
    gained = kind.gained(scenario)
    promise = promise_of(scenario, gained, covered_seconds(found))
    if promise is None or promise.by != "model" or gained is None:
        return ()
    seconds = covered_seconds(found)
    odds = 2 * gained * seconds / RISES
    # The last slot is that of the target that is sought, or the only one.
    existence = found.existence.values[:, -1].astype(float)
    with np.errstate(divide="ignore"):
        counted = rises(logit(existence), np.log(odds / 2), np.log(odds))
    if counted < TOO_MANY:
        return ()
    return (
        f"Existence rose to {expit(np.log(odds)):.2g} {counted} times, and with the model's background does so at most "
        f"{RISES + 1:g} times in the mean: more false tracks are to be expected than promised; find the threshold on "
        "the data (faintrack calibrate DATA --false-tracks).",
    )
