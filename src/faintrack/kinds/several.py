"""From the section of a tracker to one of many targets, or of one."""

from typing import Any, TypeVar

from faintrack.errors import InputError
from faintrack.likelihoods.protocols import Beside
from faintrack.scenario.section import Section
from faintrack.scenario.sections import ManySection
from faintrack.targets.silence import Silence
from faintrack.trackers.many import Carrying, ManyTargetsTracker
from faintrack.trackers.single import SingleTargetTracker

TARGETS = 6
"""In hand at once at most, by default."""

FALLS = 0.02
"""Probability a scan that a target in hand falls silent."""

RETURNS = 0.8
"""Share of silences that end by the target being heard again."""

Tracker = ManyTargetsTracker | SingleTargetTracker


Chosen = TypeVar("Chosen", bound=Section)


def with_targets(scenario: Chosen, tracker: Any) -> Chosen:
    """Scenario with the number of targets of its tracker filled in; that of a tracker of another method is left."""
    if not isinstance(tracker, Tracker):
        return scenario
    targets = tracker.targets if isinstance(tracker, ManyTargetsTracker) else 1
    section: Any = getattr(scenario, "tracker")  # noqa: B009
    return scenario.model_copy(update={"tracker": section.model_copy(update={"targets": targets})})


def about_targets(table: ManySection, tracker: Any) -> tuple[str, ...]:
    """What a user must know of how many targets are followed."""
    if table.targets is None and isinstance(tracker, SingleTargetTracker):
        return (
            "This likelihood knows of one target: of several at once the strongest is followed, and the others "
            "move it.",
        )
    return ()


def number_of_targets(likelihood: Any, table: ManySection) -> int:
    """Targets in hand at once, that of a scenario or its default.

    Raises
    ------
    InputError : several are asked for, and the likelihood knows of one.
    """
    able = isinstance(likelihood, Beside)
    if table.targets is None:
        return TARGETS if able else 1
    if table.targets > 1 and not able:
        raise InputError(
            f"tracker.targets is {table.targets}, and this likelihood knows of one target; expected 1, or another "
            "likelihood."
        )
    return table.targets


def build_several(
    filter: Carrying, likelihood: Any, table: ManySection, interval: float, guided: bool = False, finer: Any = None
) -> Tracker:
    """Tracker of as many targets as a scenario says.

    Parameters
    ----------
    filter, likelihood, guided, finer : see `faintrack.trackers.many.ManyTargetsTracker`.
    table : of a scenario.
    interval : from scan to scan; seconds.

    Raises
    ------
    InputError : several targets are asked for, and the likelihood knows of one.
    """
    targets = number_of_targets(likelihood, table)
    if targets == 1:
        return SingleTargetTracker(filter, likelihood, table.declare, table.drop, guided)
    # Of ten scans of silence without a return: the odds are down to those of `drop`, about.
    changes = 2.5 / (table.silence * interval)
    silence = Silence(FALLS / interval, RETURNS * changes, (1 - RETURNS) * changes)
    return ManyTargetsTracker(filter, likelihood, silence, targets, table.declare, table.drop, guided, finer)
