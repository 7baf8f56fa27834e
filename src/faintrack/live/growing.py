"""Files that grow and folders that fill, of every kind of data: frames as images, lines of bearings or returns.

Whatever reads a kind's files reads them again when they have changed, and the one loop goes on from where it stood with
the scans that are new. Nothing here knows a kind by name. A scan is complete when the next has begun, so that a half
line or a half image is not taken in; the last is taken in when the watch ends. The step that is compiled is that of
the first scans: what is chosen by the data is chosen once. Every look reads the files from their beginning, so that it
takes longer the longer they are; after a look and its scans as much time passes before the next.
"""

import re
import shutil
import sys
import tempfile
import threading
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from faintrack.errors import InputError
from faintrack.kinds.door import Moment, opened
from faintrack.kinds.kind import Plan
from faintrack.kinds.loop import Checkpoint, advance
from faintrack.kinds.promise import keeping
from faintrack.live.lines import event_of
from faintrack.live.watch import Tell
from faintrack.numerics.compiled import keep_compilations

OPENING = 16
"""Scans from which what is compiled is made."""

POLL = 0.1
"""Seconds between looks at whether files have changed, at least."""


def watch_growing(path: Path, scenario: Any, *, tell: Tell, stop: threading.Event) -> int:
    """Watch a file that grows, or a folder that fills, until it is stopped; the number of scans that were taken in.

    Parameters
    ----------
    path : of the file or folder.
    scenario : as `faintrack.track`.
    tell : is called with each event, a dictionary of plain values.
    stop : event at which it ends, with the last scan.

    Raises
    ------
    InputError : the files cannot be read when it ends, or scenario and data do not fit together.
    """
    count = 0
    tell({"event": "start", "source": str(path)})
    for moment in growing(path, scenario, stop, tell):
        tell(event_of(moment))
        count += 1
    tell({"event": "end", "scans": count})
    return count


def growing(path: Path, scenario: Any, stop: threading.Event, tell: Tell = lambda event: None) -> Iterator[Moment]:
    """Yield what is known after every scan of files that grow; the numbers are those of `faintrack.track`.

    Parameters
    ----------
    path, scenario, stop, tell : as `watch_growing`.

    Raises
    ------
    InputError : as `watch_growing`.
    """
    keep_compilations()
    first: Plan | None = None
    checkpoint: Checkpoint | None = None
    seen, reason = None, ""
    said: dict[str, str] = {}
    while True:
        last = stop.is_set()
        now = _signature(path)
        if now == seen and not last:
            stop.wait(POLL)
            continue
        seen, begun = now, time.monotonic()
        try:
            plan, remarks = _plan(path, scenario)
        except InputError as error:
            if last:
                raise
            if str(error) != reason:
                reason = str(error)
                tell({"event": "awaited", "text": reason})
            stop.wait(POLL)
            continue
        assert plan.length is not None
        complete = plan.length if last else plan.length - 1
        if first is None and complete < OPENING and not last:
            continue
        if first is None:
            first, checkpoint = plan, Checkpoint(plan.state, 0)
            _tell("remark", plan.checks, said, tell)
        assert checkpoint is not None
        if complete > checkpoint.scans:
            some = replace(plan, step=first.step, scenario=first.scenario, length=complete)
            for after, rows in advance(some, checkpoint, 1):
                checkpoint = after
                yield Moment(rows, after)
            _tell("misfit", some.misfits(), said, tell, last)
            _tell("remark", (*remarks, *some.remarks()), said, tell, last)
        if last:
            return
        stop.wait(max(POLL, min(time.monotonic() - begun, 60.0)))


def _tell(event: str, sentences: Iterable[str], said: dict[str, str], tell: Tell, again: bool = False) -> None:
    """Tell sentences that are new: those that only count further are told once, and again at the end."""
    for text in sentences:
        what = re.sub(r"[0-9][0-9.,e+-]*", "", text)
        if what not in said or (again and said[what] != text):
            tell({"event": event, "text": text})
        said[what] = text


def kept_lines(suffix: str, folder: Path) -> tuple[Path, threading.Thread]:
    """A file that standard input is written to as it comes, and the thread that writes it, which ends with the input.

    Parameters
    ----------
    suffix : of the file, ".csv".
    folder : that it lies in.
    """
    file = folder / f"standard_input{suffix}"
    file.touch()

    def copy() -> None:
        with file.open("wb") as out:
            for line in sys.stdin.buffer:
                out.write(line)
                out.flush()

    thread = threading.Thread(target=copy, name="standard input", daemon=True)
    thread.start()
    return file, thread


def watch_lines(scenario: Any, *, tell: Tell, stop: threading.Event) -> int:
    """Watch lines of CSV on standard input until it ends or the watch is stopped; arguments as `watch_growing`.

    Raises
    ------
    InputError : as `watch_growing`; a kind of data that is not read from CSV is watched as a folder that fills.
    """
    folder = Path(tempfile.mkdtemp(prefix="faintrack-"))
    try:
        file, writing = kept_lines(".csv", folder)

        def end() -> None:
            writing.join()
            stop.set()

        threading.Thread(target=end, name="end of input", daemon=True).start()

        def tell_of_input(event: Mapping[str, Any]) -> None:
            tell({name: _as_input(value, file) if isinstance(value, str) else value for name, value in event.items()})

        try:
            return watch_growing(file, scenario, tell=tell_of_input, stop=stop)
        except InputError as error:
            raise InputError(_as_input(str(error), file)) from error
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _as_input(text: str, file: Path) -> str:
    """A sentence that names what a user has given, not where it is kept."""
    return text.replace(str(file), "standard input (lines of CSV)")


def _plan(path: Path, scenario: Any) -> tuple[Plan, tuple[str, ...]]:
    """Plan of the data so far, and what was left out or assumed as they were read."""
    kind, data, what_to_run = opened(path, scenario, {})
    return kind.plan(data, keeping(kind, what_to_run)), tuple(getattr(data, "remarks", ()))


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
