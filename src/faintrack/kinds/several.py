"""From the section of a tracker to one of many targets, or of one."""

from typing import Any

from faintrack.errors import InputError
from faintrack.likelihoods.protocols import Beside
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
    filter: Carrying, likelihood: Any, table: ManySection, interval: float, guided: bool = False
) -> Tracker:
    """Tracker of as many targets as a scenario says.

    Parameters
    ----------
    filter, likelihood, guided : see `faintrack.trackers.many.ManyTargetsTracker`.
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
    return ManyTargetsTracker(filter, likelihood, silence, targets, table.declare, table.drop, guided)
