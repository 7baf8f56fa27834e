"""One call that watches a source: what the command does."""

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from faintrack.errors import InputError
from faintrack.kinds import kind_named
from faintrack.kinds.door import Moment
from faintrack.kinds.promise import keeping as promised
from faintrack.live.alarms import AlarmBell, restored
from faintrack.live.bytestream import Raw, now
from faintrack.live.keeping import PART, Keeping, Since
from faintrack.live.lines import event_of
from faintrack.live.sources import is_stored, opened_stream
from faintrack.live.stream import Stream
from faintrack.live.watch import Tell, Watch, watched
from faintrack.live.webhook import Webhooks, secret_of

PATIENCE = 10.0
"""Seconds that alarms have to be sent in when the watch ends."""

See = Callable[[Watch, Moment, Mapping[str, Any]], None]
"""Is called with the watch, each scan, and the event of it."""


def run(
    words: Sequence[str],
    scenario: Any,
    *,
    out: Path | None = None,
    raw: Raw | None = None,
    speed: float | None = None,
    tell: Tell = lambda event: None,
    see: See = lambda watch, moment, event: None,
    stop: threading.Event | None = None,
    part: float = PART,
) -> int:
    """Watch a source until it ends or is stopped.

    Parameters
    ----------
    words : the source, see `faintrack.live.sources.opened_stream`.
    scenario : of the kind recording.
    out : folder of the watch; an earlier run in it is gone on with.
    raw, speed : of the source.
    tell : is called with each event, a dictionary of plain values.
    see : is called with each scan.
    stop : event at which it ends.
    part : seconds of a part of the folder.

    Returns
    -------
    Scans that were taken in.

    Raises
    ------
    InputError : source, scenario or folder cannot be used, or the stream broke; what came before is whole.
    """
    stop = threading.Event() if stop is None else stop
    if scenario.array is None:
        raise InputError("no array was given; expected --array FILE, or [array] in the scenario.")
    scenario = promised(kind_named("recording"), scenario)
    secrets = {str(rule.secret_file): secret_of(rule.secret_file) for rule in scenario.alarm or () if rule.secret_file}
    with ExitStack() as held:
        keeping = None if out is None else held.enter_context(Keeping(out, part))
        since = None if keeping is None else keeping.since()

        speaking = threading.Lock()

        def told(event: Mapping[str, Any]) -> None:
            # A webhook that failed is told from its own thread.
            with speaking:
                if keeping is not None:
                    keeping.tell(event)
                tell(event)

        stored = is_stored(words)
        start = since.scans * round(_frame_of(since) or 0) if since is not None and stored else 0
        stream = opened_stream(words, scenario, stop, raw, speed, start)
        base = 0
        if since is not None:
            base, stream = _gone_on(since, stream, start if stored else None)
        opening = None if since is None else since.opening
        watch = watched(stream, scenario, tell=told, stop=stop, base=base, opening=opening)
        if watch is None:
            return 0
        _begin(watch, since, base, told)
        if keeping is not None and since is None and watch.opening is not None:
            keeping.save_beginning(watch.opening, watch.plan)

        bell = restored(scenario.alarm or (), {} if since is None else since.facts["alarms"])
        webhooks = Webhooks(told)

        def seen() -> Iterator[Moment]:
            for moment in watch.moments():
                event = event_of(moment)
                told(event)
                see(watch, moment, event)
                for rule, alarm in bell.take(event):
                    told(alarm)
                    if rule.webhook is not None:
                        webhooks.send(rule.webhook, secrets[str(rule.secret_file)], alarm)
                if keeping is not None and keeping.due():
                    _save(keeping, watch, bell)
                yield moment

        moments = seen()
        try:
            for moment in moments:
                if keeping is not None:
                    keeping.part(watch.plan, moments, moment, watch.remarks)
                    _tell_misfits(watch, told)
            if keeping is None and watch.status.scans:
                _tell_misfits(watch, told)
        finally:
            if keeping is not None and watch.status.scans:
                _save(keeping, watch, bell)
            webhooks.finish(PATIENCE)
            told({"event": "end", "scans": watch.status.scans})
        if not (watch.status.scans or since or stop.is_set()):
            raise InputError(f"{stream.source} ended before one frame of {scenario.analysis.frame:g} s had come.")
        return watch.status.scans


def _frame_of(since: Since | None) -> float | None:
    return None if since is None else float(since.facts["frame"])


def _tell_misfits(watch: Watch, told: Tell) -> None:
    """Tell where the data so far are not as the model has them."""
    for misfit in watch.plan.misfits():
        told({"event": "misfit", "text": misfit})


def _save(keeping: Keeping, watch: Watch, bell: AlarmBell) -> None:
    facts = {"frame": watch.frame, "sample_rate": watch.stream.sample_rate, "alarms": bell.saved()}
    keeping.save(watch.checkpoint, watch.stream.start_time, facts)


def _gone_on(since: Since, stream: Stream, start: int | None) -> tuple[int, Stream]:
    """Number of the first sample of a stream that an earlier run goes on with, and the stream on that run's clock.

    Parameters
    ----------
    since : the earlier run.
    stream : as opened now.
    start : of a source that is stored; by the clock where None.
    """
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


def _begin(watch: Watch, since: Since | None, base: int, told: Tell) -> None:
    """Take up an earlier run, and tell how the watch begins."""
    rate = watch.stream.sample_rate
    start = watch.stream.start_time
    event: dict[str, Any] = {
        "event": "start",
        "source": watch.stream.source,
        "channels": len(watch.stream.channel_names),
        "sample_rate": rate,
        "start_time": None if start is None else f"{start}Z",
        "now": f"{now()}Z",
    }
    if since is not None:
        earlier = since.load(watch.plan)
        number = max(earlier.scans, -(-base // watch.frame))
        watch.checkpoint = replace(earlier, scans=number)
        gap = (number - earlier.scans) * watch.frame / rate
        watch.status.gaps, watch.status.missing_s = int(gap > 0), gap
        event["goes_on"] = {"scan": earlier.scans, "gap_s": gap}
    told(event)
    for remark in watch.plan.checks:
        told({"event": "remark", "text": remark})
