"""The loop over a stream: scan after scan as its samples come, with what could not be taken in told and counted.

Scans are numbered from the first sample of the watch, so that a scan's number is its time. Short gaps are taken in as
what they are, frames of missing samples, and say nothing; of a long one, and where the machine was too slow, whole
frames are passed over: motion and existence are carried forward over any interval, so that a hole in time needs no
arithmetic of its own.
"""

import threading
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import xarray as xr
from jaxtyping import Float

from faintrack.data.recording import Recording
from faintrack.errors import InputError
from faintrack.kinds import kind_named
from faintrack.kinds.door import Moment
from faintrack.kinds.kind import Kind, Plan
from faintrack.kinds.loop import Checkpoint, advance
from faintrack.kinds.promise import keeping
from faintrack.live.buffer import FAR, LOOKAHEAD, MOST_VALUES, Buffer
from faintrack.live.bytestream import Raw, now
from faintrack.live.keeping import Since
from faintrack.live.sources import is_stored, opened_stream
from faintrack.live.stream import Stream
from faintrack.live.watching import Status, Tell
from faintrack.numerics.compiled import keep_compilations

TAKEN_IN = 60
"""Frames on end without a sample that are taken in; of more, all but the last are passed over."""

OPENING = 11.0
"""Seconds of samples that a plan looks at, and a little more."""


@dataclass
class Watch:
    """A stream on its way through the loop.

    Attributes
    ----------
    stream : of samples.
    scenario : what to run, of a kind whose data are samples.
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
        self.kind: Kind = kind_named(self.scenario.kind)
        self._goes_on: dict[str, Any] = {}
        self.buffer = Buffer(self.stream, self.base, self.opening, self.stop)
        self.frame = round(self.scenario.analysis.frame * self.stream.sample_rate)
        # A recorder does not wait until programs are compiled; a replay does.
        if self.stream.pace == 1:
            self.buffer.start()
        _compile(self.kind, self.stream, self.scenario)
        if self.stream.pace != 1:
            self.buffer.start()
        self.plan: Plan = self.kind.plan(self.buffer.recording(), self.scenario)
        self.opening = self.buffer.opening()
        self.checkpoint = Checkpoint(self.plan.state, 0)

    @property
    def source(self) -> str:
        """Where the samples come from, for messages."""
        return self.stream.source

    @property
    def counts(self) -> Mapping[str, int]:
        """What went wrong on the way, by name."""
        return self.stream.counts

    def start(self) -> dict[str, Any]:
        """Event with which the watch begins."""
        start = self.stream.start_time
        return {
            "event": "start",
            "source": self.source,
            "channels": len(self.stream.channel_names),
            "sample_rate": self.stream.sample_rate,
            "start_time": None if start is None else f"{start}Z",
            "now": f"{now()}Z",
            **self._goes_on,
        }

    def facts(self) -> dict[str, Any]:
        """Plain values that a later run needs beside the checkpoint."""
        start = self.stream.start_time
        return {
            "frame": self.frame,
            "sample_rate": self.stream.sample_rate,
            "start_time": None if start is None else str(start),
        }

    def go_on(self, since: Since) -> None:
        """Take up an earlier run."""
        earlier = since.load(self.plan)
        number = max(earlier.scans, -(-self.base // self.frame))
        self.checkpoint = replace(earlier, scans=number)
        gap = (number - earlier.scans) * self.frame / self.stream.sample_rate
        self.status.gaps, self.status.missing_s = int(gap > 0), gap
        self._goes_on = {"goes_on": {"scan": earlier.scans, "gap_s": gap}}

    def moments(self) -> Iterator[Moment]:
        """Yield what is known after every scan, until the stream ends or it is stopped.

        Raises
        ------
        InputError : the stream broke, or ended before the first scan.
        """
        rate = self.stream.sample_rate
        # What went wrong before the first scan is told with it.
        counted: dict[str, int] = {}
        while not self.stop.is_set():
            number = self.checkpoint.scans
            whole = (number + 1) * self.frame
            if not self.buffer.wait(whole + LOOKAHEAD) and (self.stop.is_set() or self.buffer.end < whole):
                if not (self.status.scans or self._goes_on or self.stop.is_set()):
                    frame = self.scenario.analysis.frame
                    raise InputError(f"{self.source} ended before one frame of {frame:g} s had come.")
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

    def misfits(self) -> tuple[str, ...]:
        """Where the data are not as the model has them, one sentence each."""
        return self.plan.misfits()

    def close(self, state: Any) -> xr.Dataset | None:
        """What is known after a scan beside the scans themselves, as `Plan.close`."""
        return None if self.plan.close is None else self.plan.close(state)


def _compile(kind: Kind, stream: Stream, scenario: Any) -> None:
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
    next(advance(kind.plan(recording, scenario), None, 1))


def watched_stream(
    words: Sequence[str],
    scenario: Any,
    *,
    since: Since | None,
    tell: Tell,
    stop: threading.Event,
    raw: Raw | None = None,
    speed: float | None = None,
) -> Watch | None:
    """Watch of a source of samples, or None where it was stopped before its plan could be made.

    Parameters
    ----------
    words, raw, speed : as `faintrack.live.sources.opened_stream`.
    scenario, tell, stop : as `Watch`.
    since : an earlier run that is gone on with.

    Raises
    ------
    InputError : source and scenario do not fit together or to the earlier run, or the stream broke.
    """
    if scenario.array is None:
        raise InputError("no array was given; expected --array FILE, or [array] in the scenario.")
    scenario = keeping(kind_named(scenario.kind), scenario)
    start = since.scans * int(since.facts["frame"]) if since is not None and is_stored(words) else 0
    stream, base = opened_stream(words, scenario, stop, raw, speed, start), 0
    if since is not None:
        base, stream = _gone_on(since, stream, start if is_stored(words) else None)
    opening = None if since is None else since.opening
    try:
        watch = Watch(stream, scenario, tell, stop, base, opening)
    except Exception:
        # Of the few samples of a stream that was stopped too early nothing can be said, whatever they lead to.
        if stop.is_set():
            return None
        raise
    if since is not None:
        watch.go_on(since)
    return watch


def _gone_on(since: Since, stream: Stream, start: int | None) -> tuple[int, Stream]:
    """Number of the first sample of a stream that an earlier run goes on with, and the stream on that run's clock.

    Parameters
    ----------
    since : the earlier run.
    stream : as opened now.
    start : of a source that is stored; by the clock where None.
    """
    assert since.opening is not None
    if since.opening.shape[1] != len(stream.channel_names) or since.facts["sample_rate"] != stream.sample_rate:
        raise InputError(
            f"{stream.source} has {len(stream.channel_names)} channels at {stream.sample_rate:g} Hz, the earlier run "
            f"{since.opening.shape[1]} at {since.facts['sample_rate']:g} Hz; expected another name for --out."
        )
    begun = since.start_time
    last = since.scans * int(since.facts["frame"])
    if start is None and begun is not None and stream.start_time is not None:
        passed = float((stream.start_time - begun) / np.timedelta64(1, "ns")) * 1e-9
        # A clock that was set back tells nothing of the gap; numbers never go back.
        start = max(last, round(passed * stream.sample_rate))
    return last if start is None else start, replace(stream, start_time=begun)
