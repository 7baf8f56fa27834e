"""The loop over a stream: scan after scan as its samples come, with what could not be taken in told and counted.

Scans are numbered from the first sample of the watch, so that a scan's number is its time. Short gaps are taken in as
what they are, frames of missing samples, and say nothing; of a long one, and where the machine was too slow, whole
frames are passed over: motion and existence are carried forward over any interval, so that a hole in time needs no
arithmetic of its own.
"""

import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from faintrack.data.recording import Recording
from faintrack.kinds import kind_named
from faintrack.kinds.door import Moment
from faintrack.kinds.kind import Plan
from faintrack.kinds.loop import Checkpoint, advance
from faintrack.live.buffer import FAR, LOOKAHEAD, MOST_VALUES, Buffer
from faintrack.live.stream import Stream
from faintrack.numerics.compiled import keep_compilations

TAKEN_IN = 60
"""Frames on end without a sample that are taken in; of more, all but the last are passed over."""

OPENING = 11.0
"""Seconds of samples that a plan looks at, and a little more."""

Tell = Callable[[Mapping[str, Any]], None]
"""Is called with each event: a dictionary of plain values whose `event` is its name."""


@dataclass
class Status:
    """How a watch stands.

    Attributes
    ----------
    scans : taken in by this process.
    behind_s : seconds of samples that have come and were not taken in yet.
    gaps : stretches of missing samples.
    missing_s : their length; seconds.
    left_out : scans that were passed over because the machine was too slow.
    """

    scans: int = 0
    behind_s: float = 0.0
    gaps: int = 0
    missing_s: float = 0.0
    left_out: int = 0


@dataclass
class Watch:
    """A stream on its way through the loop.

    Attributes
    ----------
    stream : of samples.
    scenario : what to run, of the kind recording.
    tell : is called with events.
    stop : event at which it ends.
    base : number of the first sample of the stream since the watch began.
    opening : samples that an earlier run began with, and made its plan from.
    """

    stream: Stream
    scenario: Any
    tell: Tell = lambda event: None
    stop: threading.Event = field(default_factory=threading.Event)
    base: int = 0
    opening: Float[np.ndarray, "sample channel"] | None = None
    status: Status = field(default_factory=Status)

    def __post_init__(self) -> None:
        keep_compilations()
        self.buffer = Buffer(self.stream, self.base, self.opening, self.stop)
        self.frame = round(self.scenario.analysis.frame * self.stream.sample_rate)
        # A recorder does not wait until programs are compiled; a replay does.
        if self.stream.pace == 1:
            self.buffer.start()
        _compile(self.stream, self.scenario)
        if self.stream.pace != 1:
            self.buffer.start()
        self.plan: Plan = kind_named("recording").plan(self.buffer.recording(), self.scenario)
        self.opening = self.buffer.opening()
        self.checkpoint = Checkpoint(self.plan.state, 0)

    def moments(self) -> Iterator[Moment]:
        """Yield what is known after every scan, until the stream ends or it is stopped.

        Raises
        ------
        InputError : the stream broke.
        """
        rate = self.stream.sample_rate
        # What went wrong before the first scan is told with it.
        counted: dict[str, int] = {}
        while not self.stop.is_set():
            number = self.checkpoint.scans
            whole = (number + 1) * self.frame
            if not self.buffer.wait(whole + LOOKAHEAD) and (self.stop.is_set() or self.buffer.end < whole):
                return
            passed = self._passed_over(number)
            if passed:
                self.checkpoint = replace(self.checkpoint, scans=number + passed)
                continue
            self.checkpoint, rows = next(advance(self.plan, self.checkpoint, 1))
            self.buffer.discard(whole - LOOKAHEAD)
            self._tell_gaps(whole)
            if counted != self.stream.counts:
                counted = dict(self.stream.counts)
                self.tell({"event": "packets", "time": whole / rate, **counted})
            self.status.scans += 1
            self.status.behind_s = max(0.0, (self.buffer.end - whole) / rate)
            yield Moment(rows, self.checkpoint)

    def _passed_over(self, number: int) -> int:
        """Frames from a number on that are not taken in."""
        first = number * self.frame
        left_out = -(-self.buffer.left_out_before // self.frame) - number
        if left_out > 0:
            self.status.left_out += left_out
            self.tell(
                {
                    "event": "too_slow",
                    "time": first / self.stream.sample_rate,
                    "scans": left_out,
                    "scans_in_all": self.status.left_out,
                }
            )
            return left_out
        empty = (self.buffer.next_held(first) - first) // self.frame
        return empty if empty > TAKEN_IN else 0

    def _tell_gaps(self, before: int) -> None:
        rate = self.stream.sample_rate
        for first, length in self.buffer.gaps(before):
            self.status.gaps += 1
            self.status.missing_s += length / rate
            self.tell({"event": "gap", "time": first / rate, "seconds": length / rate})

    def remarks(self) -> tuple[str, ...]:
        """What a reader of the result must know, one sentence each."""
        status, said = self.status, []
        if status.gaps:
            said.append(f"{status.missing_s:.6g} s in {status.gaps} stretches did not come; they are missing.")
        if status.left_out:
            said.append(f"The machine was too slow: {status.left_out} whole scans were left out.")
        said += [f"Of the packets {count} were {name.replace('_', ' ')}." for name, count in self.stream.counts.items()]
        return tuple(dict.fromkeys((*self.plan.checks, *self.plan.remarks(), *said)))


def _compile(stream: Stream, scenario: Any) -> None:
    """Compile what the first scan needs, on noise, while the stream's own first seconds are still to come.

    Raises
    ------
    InputError : stream and scenario do not fit together.
    """
    rate, channels = stream.sample_rate, len(stream.channel_names)
    length = min(max(2 * round(scenario.analysis.frame * rate), round(OPENING * rate)), MOST_VALUES // channels)
    noise = np.random.default_rng(0).normal(size=(length, channels)).astype(np.float32)
    recording = Recording(
        lambda start, stop: noise[start:stop], FAR, rate, stream.channel_names, source=stream.source, live=True
    )
    next(advance(kind_named("recording").plan(recording, scenario), None, 1))


def watched(stream: Stream, scenario: Any, **options: Any) -> Watch | None:
    """A watch, or None where it was stopped before its plan could be made.

    Parameters
    ----------
    stream, scenario, options : as `Watch`.

    Raises
    ------
    InputError : stream and scenario do not fit together, or the stream broke.
    """
    stop = options.setdefault("stop", threading.Event())
    try:
        return Watch(stream, scenario, **options)
    except Exception:
        # Of the few samples of a stream that was stopped too early nothing can be said, whatever they lead to.
        if stop.is_set():
            return None
        raise
