"""One call that watches a source: what the command does."""

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from faintrack.data.recording import Recording
from faintrack.errors import InputError
from faintrack.kinds import kind_named
from faintrack.kinds.door import Moment
from faintrack.live.alarms import require_components, restored
from faintrack.live.bytestream import Raw
from faintrack.live.doubts import Doubts
from faintrack.live.growing import watched_files
from faintrack.live.keeping import PART, Keeping
from faintrack.live.lines import event_of
from faintrack.live.watch import watched_stream
from faintrack.live.watching import Tell, Watching
from faintrack.live.webhook import Webhooks, secret_of

PATIENCE = 10.0
"""Seconds that alarms have to be sent in when the watch ends."""

See = Callable[[Watching, Moment, Mapping[str, Any]], None]
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
    words : the source: of samples, see `faintrack.live.sources.opened_stream`; of every other kind of data, see
        `faintrack.live.growing.watched_files`.
    scenario : what to run.
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
    # A kind of one's own may have no alarms.
    rules = getattr(scenario, "alarm", None) or ()
    secrets = {str(rule.secret_file): secret_of(rule.secret_file) for rule in rules if rule.secret_file}
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

        watch: Watching | None
        if kind_named(scenario.kind).data is Recording:
            watch = watched_stream(words, scenario, since=since, tell=told, stop=stop, raw=raw, speed=speed)
        else:
            _require_no_samples(scenario.kind, raw, speed)
            folder = _temporary(held) if keeping is None else keeping.state
            watch = watched_files(words, scenario, since=since, tell=told, stop=stop, folder=folder)
        if watch is None:
            return 0
        doubts = Doubts(watch, told)
        told(watch.start())
        doubts.tell_remarks(watch.plan.checks)
        if keeping is not None and since is None:
            keeping.save_beginning(watch)

        bell = restored(rules, {} if since is None else since.facts["alarms"])
        webhooks = Webhooks(told)

        def seen() -> Iterator[Moment]:
            for moment in watch.moments():
                event = event_of(moment)
                if watch.status.scans == 1:
                    require_components(bell.rules, moment.data)
                told(event)
                see(watch, moment, event)
                alarms = list(bell.take(event))
                for rule, alarm in alarms:
                    told(alarm)
                    if rule.webhook is not None:
                        webhooks.send(rule.webhook, secrets[str(rule.secret_file)], alarm)
                # An alarm that was given is not given again by a run that goes on after a loss of power.
                if keeping is not None and (alarms or keeping.due()):
                    keeping.save(watch, {"alarms": bell.saved()})
                doubts.look(moment, part)
                yield moment

        moments = seen()
        last: Moment | None = None
        try:
            for moment in moments:
                last = moment
                if keeping is not None:
                    keeping.part(watch, moments, moment)
                    doubts.tell_all()
            if keeping is None and last is not None:
                watch.close(last.checkpoint.state)
                doubts.tell_all()
        finally:
            if keeping is not None and watch.status.scans:
                keeping.save(watch, {"alarms": bell.saved()})
            webhooks.finish(PATIENCE)
            told({"event": "end", "scans": watch.status.scans})
        return watch.status.scans


def _require_no_samples(kind: str, raw: Raw | None, speed: float | None) -> None:
    for option, value in {"--speed": speed, "--channels": raw}.items():
        if value is not None:
            raise InputError(f"{option} is of samples; the source holds {kind}.")


def _temporary(held: ExitStack) -> Path:
    """Folder that is removed when the watch ends, also where a thread writes to it still."""
    return Path(held.enter_context(TemporaryDirectory(prefix="faintrack-", ignore_cleanup_errors=True)))
