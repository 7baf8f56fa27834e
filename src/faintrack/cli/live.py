"""The command that watches: a stream in, lines, a folder and a page out."""

import json
import signal
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import FrameType
from typing import Annotated, Any

import typer

from faintrack.cli.commands import ArrayFile, Band, Frame, KindName, ScenarioFile, Settings

Source = Annotated[
    list[str],
    typer.Argument(
        metavar="SOURCE",
        help="- for standard input; a named pipe; a file that grows; a folder that fills; udp://ADDRESS:PORT; "
        "tcp://ADDRESS:PORT; replay FILE.",
    ),
]


def live(
    source: Source,
    scenario: ScenarioFile = None,
    array: ArrayFile = None,
    band: Band = None,
    frame: Frame = None,
    settings: Settings = None,
    kind: KindName = None,
    channels: Annotated[int | None, typer.Option(help="Of raw samples.")] = None,
    rate: Annotated[float | None, typer.Option(metavar="HZ", help="Sample rate of raw samples.")] = None,
    format: Annotated[str | None, typer.Option(help="Of raw samples: float32, int16; little-endian.")] = None,
    speed: Annotated[float | None, typer.Option(help="Of a replay; 1 where not given, inf for at once.")] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for lines, results and state; goes on where it is one.")
    ] = None,
    port: Annotated[int | None, typer.Option(help="Of the page, such as 8080; no page where not given.")] = None,
    host: Annotated[str, typer.Option(metavar="ADDRESS", help="That the page listens at.")] = "127.0.0.1",
    token_file: Annotated[
        Path | None, typer.Option(help="File with the token that watchers must know; needed beyond this machine.")
    ] = None,
    nmea: Annotated[
        str | None, typer.Option(metavar="WHERE", help="udp://ADDRESS:PORT or file that tracks go to as $RATTM.")
    ] = None,
) -> None:
    """Track data while they come; print one line of JSON a scan.

    Example: [bold]faintrack live udp://127.0.0.1:9000 --array array.toml --out watch[/bold]

    Example: [bold]recorder | faintrack live - --channels 32 --rate 4000 --array array.toml[/bold]

    Example: [bold]faintrack live replay night.wav --speed 10 --array array.toml[/bold]

    Example: [bold]faintrack live images/ --scenario scenario.toml[/bold]
    """
    from faintrack.cli.options import sections_of
    from faintrack.kinds.door import scenario_given
    from faintrack.live.sources import kind_of_source, raw_of

    given = scenario_given(scenario, sections_of(settings, kind, array, band, frame))
    raw = raw_of(channels, rate, format)
    what = given.of(kind_of_source(source, given))
    watch_source(source, what, out=out, raw=raw, speed=speed, port=port, host=host, token_file=token_file, nmea=nmea)


def watch_source(
    source: list[str],
    scenario: Any,
    *,
    out: Path | None = None,
    raw: Any = None,
    speed: float | None = None,
    port: int | None = None,
    host: str = "127.0.0.1",
    token_file: Path | None = None,
    nmea: str | None = None,
) -> None:
    """Watch a source until it ends or a signal comes: lines on standard output or in a folder, and a page.

    Parameters
    ----------
    source, scenario, out, raw, speed : see `faintrack.live.run.run`.
    port, host, token_file : of the page; none without a port.
    nmea : where `$RATTM` are sent to, see `faintrack.live.nmea.sender`.
    """
    from faintrack.kinds.door import Moment
    from faintrack.live.lines import line
    from faintrack.live.metrics import exposition
    from faintrack.live.nmea import sender, target_messages
    from faintrack.live.page.feed import greeting, scan_message
    from faintrack.live.page.guard import guard_of
    from faintrack.live.page.server import Page
    from faintrack.live.run import run
    from faintrack.live.watching import Watching

    guard = None if port is None and token_file is None else guard_of(host, token_file)
    with ExitStack() as held:
        stop = held.enter_context(stopped_by_signals())
        page = None if guard is None or port is None else held.enter_context(Page(port, guard))
        send = None if nmea is None else held.enter_context(sender(nmea))
        if page is not None:
            print(f"{'page':<10} {page.url}", file=sys.stderr, flush=True)

        def tell(event: Mapping[str, Any]) -> None:
            if out is None:
                print(line(event), flush=True)
            if page is not None and event["event"] in ("alarm", "misfit", "remark"):
                page.send(line(event))
            if event["event"] != "scan":
                print(_sentence(event), file=sys.stderr, flush=True)

        def see(watch: Watching, moment: Moment, event: Mapping[str, Any]) -> None:
            if page is not None:
                page.greet(greeting(watch, moment))
                page.send(scan_message(watch, moment, event))
                page.measure(exposition(watch.status, watch.counts, event))
            if send is not None:
                _require_north(moment)
                for message in target_messages(event):
                    send(message)

        run(source, scenario, out=out, raw=raw, speed=speed, tell=tell, see=see, stop=stop)


def _require_north(moment: Any) -> None:
    """Refuse to send bearings that are from an axis."""
    from faintrack.errors import InputError
    from faintrack.results.schema import NORTH

    if "bearing" not in moment.data:
        raise InputError(f"--nmea sends bearings; tracks of {moment.data.attrs['kind']} have none.")
    if moment.data.bearing.attrs["reference"] != NORTH:
        raise InputError("--nmea needs bearings from north; those of a line array are from its axis, on either side.")


def _sentence(event: Mapping[str, Any]) -> str:
    """An event for a person."""
    facts = {name: value for name, value in event.items() if name != "event"}
    return f"{event['event']:<10} " + (str(facts["text"]) if "text" in facts else json.dumps(facts))


@contextmanager
def stopped_by_signals() -> Iterator[threading.Event]:
    """Event that the first interruption or SIGTERM sets, for a clean end; the second ends at once."""
    stop = threading.Event()
    before: dict[int, Any] = {}

    def ask(number: int, frame: FrameType | None) -> None:
        if stop.is_set():
            signal.signal(number, before[number])
            signal.raise_signal(number)
        stop.set()

    for each in (signal.SIGINT, signal.SIGTERM):
        before[each] = signal.signal(each, ask)
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
