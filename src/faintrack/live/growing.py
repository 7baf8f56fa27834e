"""Files that grow and folders that fill, of every kind of data: frames as images, lines of bearings or returns.

Whatever reads a kind's files reads them again when they have changed, and the one loop goes on from where it stood with
the scans that are new. Nothing here knows a kind by name. A scan is complete when the next has begun, so that a half
line or a half image is not taken in; the last is taken in when the watch ends, and again, whole, by a run that goes on.
The step that is compiled is that of the first scans: what is chosen by the data is chosen once, and kept. Every look
reads the files from their beginning, so that it takes longer the longer they are; after a look and its scans as much
time passes before the next.
"""

import itertools
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import xarray as xr

from faintrack.errors import InputError
from faintrack.kinds import kind_named
from faintrack.kinds.door import Moment, opened
from faintrack.kinds.kind import Kind, Plan
from faintrack.kinds.loop import Checkpoint, advance
from faintrack.kinds.promise import keeping
from faintrack.live.csvlines import connected_lines, kept, standard_lines
from faintrack.live.doubts import without_numbers
from faintrack.live.keeping import Since
from faintrack.live.sources import address_of
from faintrack.live.watching import Status, Tell
from faintrack.numerics.compiled import keep_compilations

OPENING = 16
"""Scans from which what is compiled is made."""

POLL = 0.1
"""Seconds between looks at whether files have changed, at least."""


class Look(NamedTuple):
    """What files hold at a time.

    Attributes
    ----------
    plan : of the data so far.
    complete : scans that are whole.
    last : whether it is the last look, with all scans.
    remarks : what was left out or assumed as the data were read.
    """

    plan: Plan
    complete: int
    last: bool
    remarks: tuple[str, ...]


@dataclass
class GrowingWatch:
    """A file that grows, or a folder that fills, on its way through the loop.

    Attributes
    ----------
    path : of the file or folder.
    scenario : what to run.
    tell : is called with events.
    stop : event at which it ends, with the last scan.
    since : an earlier run that is gone on with.
    source : the name of what the file holds, for messages; its path where not given.

    Raises
    ------
    InputError : the files cannot be read when it ends, or scenario, data and the earlier run do not fit together.
    """

    path: Path
    scenario: Any
    tell: Tell = lambda event: None
    stop: threading.Event = field(default_factory=threading.Event)
    since: Since | None = None
    source: str = ""
    status: Status = field(default_factory=Status)

    def __post_init__(self) -> None:
        keep_compilations()
        self.source = self.source or str(self.path)
        self.kind: Kind = kind_named(self.scenario.kind)
        self._given = self.scenario.model_dump_json(exclude={"alarm"})
        if self.since is not None:
            if self.since.facts.get("given") != self._given:
                raise InputError("the earlier run had another scenario; expected the same, or another name for --out.")
            # What was chosen for the first scans is chosen for all.
            self.scenario = self.since.scenario
        self.opening = None
        self.counts: Mapping[str, int] = {}
        self._remarks: tuple[str, ...] = ()
        self._misfits: dict[str, str] = {}
        self._looks = self._look()
        self._first = next(self._looks)
        self.plan = self._first.plan
        began = Checkpoint(self.plan.state, 0)
        self._now = began if self.since is None else self.since.load(self.plan)
        # What few scans chose is not kept: a later run begins anew.
        self._lasts = self.since is not None or self._first.complete >= OPENING
        self.checkpoint: Checkpoint | None = self._now if self._lasts else None

    def start(self) -> dict[str, Any]:
        """Event with which the watch begins."""
        begun = {"event": "start", "source": self.source, "kind": self.kind.name}
        return begun if self.since is None else {**begun, "goes_on": {"scan": self.since.scans}}

    def facts(self) -> dict[str, Any]:
        """Plain values that a later run needs beside the checkpoint."""
        return {"given": self._given}

    def moments(self) -> Iterator[Moment]:
        """Yield what is known after every scan until it is stopped; the numbers are those of `faintrack.track`.

        Raises
        ------
        InputError : the files cannot be read when it ends, or hold fewer scans than before.
        """
        begun = self.plan
        for look in itertools.chain((self._first,), self._looks):
            self._remarks = look.remarks
            self.plan = replace(look.plan, step=begun.step, scenario=begun.scenario, length=look.complete)
            if look.complete <= self._now.scans:
                continue
            for after, rows in advance(self.plan, self._now, 1):
                self._now = after
                # The last scan may be a half: a run that goes on takes it in again.
                if self._lasts and not (look.last and after.scans == look.complete):
                    self.checkpoint = after
                self.status.scans += 1
                self.status.behind_s = (look.complete - after.scans) * float(rows.attrs["scan_interval"])
                yield Moment(rows, after)
            self._misfits |= {without_numbers(text): text for text in self.plan.misfits()}

    def remarks(self) -> tuple[str, ...]:
        """What a reader of the result must know, one sentence each."""
        return tuple(dict.fromkeys((*self._remarks, *self.plan.checks, *self.plan.remarks())))

    def misfits(self) -> tuple[str, ...]:
        """Where the data are not as the model has them, one sentence each."""
        return tuple((self._misfits | {without_numbers(text): text for text in self.plan.misfits()}).values())

    def close(self, state: Any) -> xr.Dataset | None:
        """What is known after a scan beside the scans themselves, as `Plan.close`.

        Of snapshots, which lie evenly in a length that is known beforehand, there are none.
        """
        if self.plan.close is None:
            return None
        closed = self.plan.close(state)
        return closed.isel(snapshot=slice(0)) if "snapshot" in closed.dims else closed

    def _look(self) -> Iterator[Look]:
        """Yield what the files hold whenever they have changed; the last look is at the end."""
        seen, reason = None, ""
        least = OPENING if self.since is None else 1
        while True:
            last = self.stop.is_set()
            now = _signature(self.path)
            if now == seen and not last:
                self.stop.wait(POLL)
                continue
            seen, begun = now, time.monotonic()
            try:
                plan, remarks = self._plan()
            except InputError as error:
                text = str(error).replace(str(self.path), self.source)
                if last:
                    raise InputError(text) from error
                if text != reason:
                    reason = text
                    self.tell({"event": "awaited", "text": text})
                self.stop.wait(POLL)
                continue
            assert plan.length is not None
            complete = plan.length if last else plan.length - 1
            if complete < least and not last:
                continue
            least = 1
            yield Look(plan, complete, last, remarks)
            if last:
                return
            self.stop.wait(max(POLL, min(time.monotonic() - begun, 60.0)))

    def _plan(self) -> tuple[Plan, tuple[str, ...]]:
        """Plan of the data so far, and what was left out or assumed as they were read."""
        kind, data, what_to_run = opened(self.path, self.scenario, {})
        plan = kind.plan(data, keeping(kind, what_to_run))
        if self.since is not None and plan.length is not None and plan.length < self.since.scans:
            raise InputError(
                f"{self.path} holds {plan.length} scans, of which an earlier run took in {self.since.scans}; expected "
                "the same data and what has come to them, or another name for --out."
            )
        return plan, tuple(text.replace(str(self.path), self.source) for text in getattr(data, "remarks", ()))


def _signature(path: Path) -> tuple[Any, ...]:
    """What changes when a file grows or a folder fills."""
    if not path.is_dir():
        return _size(path)
    return tuple(sorted((entry.name, *_size(entry)) for entry in path.iterdir() if entry.is_file()))


def _size(path: Path) -> tuple[int, int]:
    try:
        found = path.stat()
    except OSError:
        return (0, 0)
    return found.st_size, found.st_mtime_ns


def watched_files(
    words: Sequence[str],
    scenario: Any,
    *,
    since: Since | None,
    tell: Tell,
    stop: threading.Event,
    folder: Path,
) -> GrowingWatch:
    """Watch of a file that grows, a folder that fills, or lines of CSV as they come.

    Parameters
    ----------
    words : one: a path, - for lines on standard input, or tcp://ADDRESS:PORT for lines of a sender that listens.
    scenario, tell, stop, since : as `GrowingWatch`.
    folder : that lines are kept in.

    Raises
    ------
    InputError : it is no such source, or as `GrowingWatch`.
    """
    word = words[0]
    if len(words) > 1 or word.startswith(("udp://", "tcp-listen://")):
        raise InputError(
            f"{' '.join(words)} is a source of samples and the scenario of {scenario.kind}; expected a file that "
            "grows, a folder that fills, or - or tcp://ADDRESS:PORT for lines of CSV."
        )
    if word != "-" and not word.startswith("tcp://"):
        return GrowingWatch(Path(word), scenario, tell, stop, since)
    name = "standard input" if word == "-" else word
    file = folder / "lines.csv"
    kept(standard_lines() if word == "-" else connected_lines(*address_of(word, "tcp")), file, stop)
    return GrowingWatch(file, scenario, tell, stop, since, f"{name} (lines of CSV)")
