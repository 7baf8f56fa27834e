"""How long a burn-in has to be: a tracker begun later beside one that never stopped.

The state of a tracker forgets how it began. At seams along a recording a tracker is begun so many seconds before; a
seam is right where both have the same targets in hand at it, matched as `faintrack.archive.joining` matches them. The
shortest burn-in at which all seams are right is long enough for such recordings; how sure that is follows from how
many seams there were.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from faintrack.archive.joining import matches
from faintrack.archive.tables import states_of
from faintrack.data.recording import Recording
from faintrack.kinds import kind_named
from faintrack.kinds.loop import datasets
from faintrack.kinds.stretches import of_recording
from faintrack.metrics.intervals import binomial_interval
from faintrack.results.schema import joined


@dataclass(frozen=True)
class BurnIn:
    """What a burn-in of some length does.

    Attributes
    ----------
    seconds : its length.
    right : seams at which both trackers have the same targets in hand.
    seams : that were looked at.
    targets : in hand at them, of the tracker that never stopped.
    """

    seconds: float
    right: int
    seams: int
    targets: int

    @property
    def interval(self) -> tuple[float, float]:
        """Of the share of right seams, 95 %."""
        low, high = binomial_interval(self.right, self.seams)
        return float(low), float(high)


def measured(recording: Recording, scenario: Any, lengths: Sequence[float], seams: Sequence[float]) -> list[BurnIn]:
    """What burn-ins of some lengths do.

    Parameters
    ----------
    recording : of a station, with a start time.
    scenario : of the kind recording.
    lengths : of burn-ins; s.
    seams : times in the recording, none earlier than the longest burn-in; s.

    Raises
    ------
    InputError : recording and scenario do not fit together.
    """
    whole, within = _tracked(recording, scenario)
    frame, start = scenario.analysis.frame, pd.Timestamp(recording.start_time, tz="UTC")
    found = []
    for length in lengths:
        right = targets = 0
        for seam in seams:
            began, ended = (start + pd.Timedelta(seconds=time) for time in (seam - length, seam))
            mine = whole[(whole["utc"] >= began) & (whole["utc"] < ended)]
            theirs, _ = _tracked(of_recording(recording, seam - length, seam), scenario)
            held, begun = (_held_at(states, ended, frame) for states in (mine, theirs))
            # Label in the tracker that never stopped by label in the one that was begun.
            same = matches(mine, theirs, within, frame)
            right += {same.get(label) for label in begun} == held and len(begun) == len(held)
            targets += len(held)
        found.append(BurnIn(length, right, len(seams), targets))
    return found


def _tracked(recording: Recording, scenario: Any) -> tuple[pd.DataFrame, float]:
    """States of the tracks in a recording, and what counts as near."""
    plan = kind_named("recording").plan(recording, scenario)
    return states_of(joined(list(datasets(plan)))), plan.within


def _held_at(states: pd.DataFrame, time: pd.Timestamp, frame: float) -> set[int]:
    """Labels in the last scan before a time."""
    return set(states["label"][states["utc"] > time - pd.Timedelta(seconds=frame)])
