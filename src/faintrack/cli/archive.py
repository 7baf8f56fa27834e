"""Archives on the command line."""

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from faintrack.cli.commands import Json

app = typer.Typer(help="Archives: months of recordings of many stations.", no_args_is_help=True)

ScenarioPath = Annotated[
    str, typer.Argument(metavar="SCENARIO", help="TOML file of what to run; {station} in it stands for the station.")
]
Sources = Annotated[
    list[str], typer.Argument(metavar="SOURCE", help="Folders, files, patterns of names, lists (CSV), s3://bucket/...")
]
Pattern = Annotated[
    str | None,
    typer.Option(metavar="TEXT", help="Where paths tell station and start: {station}/%Y%m%d_%H%M%S; else the files."),
]
StorePath = Annotated[Path, typer.Argument(metavar="STORE", help="Folder that faintrack archive run wrote.")]
Workers = Annotated[int | None, typer.Option(min=0, help="Processes on this machine; one a core, 0 for this one.")]
Scheduler = Annotated[
    str | None, typer.Option(metavar="ADDRESS", help="Dask scheduler to use instead, such as tcp://host:8786.")
]
SegmentSeconds = Annotated[float | None, typer.Option("--segment", metavar="SECONDS", help="Of a segment; an hour.")]
ChainSeconds = Annotated[
    float | None, typer.Option("--chain", metavar="SECONDS", help="Through which the state is passed on; a day.")
]
BurnIn = Annotated[float | None, typer.Option(metavar="SECONDS", help="Before a chain begins; 600.")]


@app.command("plan")
def plan(
    scenario: ScenarioPath,
    sources: Sources,
    pattern: Pattern = None,
    segment: SegmentSeconds = None,
    chain: ChainSeconds = None,
    burn_in: BurnIn = None,
    out: Annotated[Path | None, typer.Option(help="Store whose files belong to the archive too.")] = None,
    workers: Annotated[int, typer.Option(min=1, help="Processes that the time is told for.")] = 1,
    as_json: Json = False,
) -> None:
    """Tell what would be read: hours, gaps, overlaps, bytes, what is left out, and how long it will take.

    Example: [bold]faintrack archive plan scenario.toml recordings --pattern "{station}/%Y%m%d_%H%M%S"[/bold]
    """
    from faintrack.archive.duration import duration
    from faintrack.archive.plan import planned, trial
    from faintrack.archive.store import opened
    from faintrack.cli.tables import print_archive_plan
    from faintrack.numerics.compiled import keep_compilations

    keep_compilations()
    store = None if out is None or not out.exists() else opened(out)
    found = planned(sources, scenario, _cut(segment, chain, burn_in), pattern, store)
    takes = None
    if found.chains:
        first = found.chains[0][-1]
        speed = trial(first, found.scenarios[first.station])
        takes = duration([[speed * one.seconds for one in chain] for chain in found.chains], workers)
    if as_json:
        print(json.dumps({**found.as_dict(), "seconds": takes}))
    else:
        print_archive_plan(found, takes, workers)


@app.command("run")
def run(
    scenario: ScenarioPath,
    sources: Sources,
    out: Annotated[Path, typer.Option(help="Folder of the store; one that is there is gone on with.")],
    pattern: Pattern = None,
    segment: SegmentSeconds = None,
    chain: ChainSeconds = None,
    burn_in: BurnIn = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    as_json: Json = False,
) -> None:
    """Track an archive on all cores or on a cluster; interrupted, it goes on where it stopped.

    Example: [bold]faintrack archive run scenario.toml recordings --out store --pattern "{station}/%Y%m%d_%H%M%S"[/bold]
    """
    from faintrack.archive.run import run as run_archive

    options = {"pattern": pattern, "cut": _cut(segment, chain, burn_in)}
    _run(lambda **given: run_archive(scenario, sources, out, **options, **given), out, workers, scheduler, as_json)


@app.command("retry")
def retry(store: StorePath, workers: Workers = None, scheduler: Scheduler = None, as_json: Json = False) -> None:
    """Look at files that were left out again, and compute what failed.

    Example: [bold]faintrack archive retry store[/bold]
    """
    from faintrack.archive.run import retry as retry_archive

    _run(lambda **given: retry_archive(store, **given), store, workers, scheduler, as_json)


@app.command("status")
def status(store: StorePath, as_json: Json = False) -> None:
    """Tell what is done, what was left out and what failed.

    Example: [bold]faintrack archive status store[/bold]
    """
    from faintrack.archive.status import status as tell

    _print_status(tell(store), as_json)


@app.command("report")
def report(
    store: StorePath,
    out: Annotated[Path | None, typer.Option(help="HTML file; report.html in the store where not given.")] = None,
) -> None:
    """Draw one page of the whole archive: tracks an hour, existence by bearing, what was left out.

    Example: [bold]faintrack archive report store[/bold]
    """
    from faintrack.archive.report import write_report

    print(f"report     {write_report(store, out)}")


def _cut(segment: float | None, chain: float | None, burn_in: float | None) -> Any:
    """Cut of a new store; None where nothing was asked for."""
    from faintrack.archive.cut import Cut

    asked = {"segment": segment, "chain": chain, "burn_in": burn_in}
    given = {name: value for name, value in asked.items() if value is not None}
    return Cut(**given) if given else None


def _run(call: Any, out: Path, workers: int | None, scheduler: str | None, as_json: bool) -> None:
    from faintrack.cli.progress import progress_bar
    from faintrack.errors import InputError

    if workers is not None and scheduler is not None:
        raise InputError("--workers and --scheduler were both given; expected one of them.")

    def tell(sentence: str) -> None:
        print(f"remark     {sentence}", file=sys.stderr, flush=True)

    try:
        with progress_bar("tracking", quiet=as_json) as advance:
            found = call(workers=workers, scheduler=scheduler, progress=advance, tell=tell)
    except KeyboardInterrupt:
        print(f"faintrack: interrupted; finished segments are kept in {out}, run again to go on.", file=sys.stderr)
        raise typer.Exit(130) from None
    _print_status(found, as_json)


def _print_status(found: Any, as_json: bool) -> None:
    from faintrack.cli.tables import print_archive_status

    if as_json:
        print(json.dumps(found.as_dict()))
    else:
        print_archive_status(found)
