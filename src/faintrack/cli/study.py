"""Studies on the command line."""

import contextlib
import json
import sys
import time
from pathlib import Path
from typing import Annotated, Any

import typer

from faintrack.cli.commands import Json
from faintrack.cli.progress import progress

app = typer.Typer(help="Monte Carlo studies: what a paper says, beside what comes out.", no_args_is_help=True)


@app.command("list")
def list_studies(as_json: Json = False) -> None:
    """List the studies that come with the package.

    Example: [bold]faintrack study list[/bold]
    """
    from faintrack.studies.study import STUDIES, load

    studies = [load(name) for name in sorted(STUDIES)]
    if as_json:
        print(json.dumps({"studies": [{"study": s.name, "title": s.title} for s in studies]}))
    for study in () if as_json else studies:
        runs = sum(setting.runs for setting in study.settings)
        print(f"{study.name}  {study.title}; {len(study.settings)} settings, {runs} runs")


@app.command("run")
def run(
    name: Annotated[str, typer.Argument(help="Study of `faintrack study list`, or module:attribute of your own.")],
    quick: Annotated[bool, typer.Option("--quick", help="Fewer runs: minutes instead of hours.")] = False,
    runs: Annotated[int | None, typer.Option(min=1, help="Runs of each setting, instead of the study's own.")] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Of all runs; 0 where not given.")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for runs, numbers and figures; the study's name.")] = None,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Processes on this machine; one a core where not given.")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Dask scheduler to use instead, such as tcp://host:8786.")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with what is in the folder.")] = False,
    as_json: Json = False,
) -> None:
    """Run a study and print its numbers beside the paper's.

    An interrupted study loses nothing but the batches in hand; --resume goes on.

    Example: [bold]faintrack study run bosser2022 --quick[/bold]
    """
    from faintrack.cli.tables import print_study
    from faintrack.errors import InputError
    from faintrack.studies.study import load

    if workers is not None and scheduler is not None:
        raise InputError("--workers and --scheduler were both given; expected one of them.")
    study = load(name)
    folder = out or Path(f"{study.name}-quick" if quick else study.name)
    try:
        summary = run_study(name, folder, seed, quick, runs, resume, workers, scheduler, quiet=as_json)
    except KeyboardInterrupt:
        print(f"faintrack: interrupted; finished runs are kept in {folder}, --resume goes on.", file=sys.stderr)
        raise typer.Exit(130) from None
    if as_json:
        print(json.dumps(summary))
    else:
        print_study(summary)
        print(f"figures    {folder}")


def run_study(
    where: str,
    out: Path,
    seed: int | None,
    quick: bool,
    runs: int | None,
    resume: bool,
    workers: int | None,
    scheduler: str | None,
    quiet: bool,
) -> dict[str, Any]:
    """Compute what a study's folder lacks, then its rows and figures; the summary is what `--json` prints."""
    from faintrack.numerics.compiled import keep_compilations
    from faintrack.studies.folder import open_folder
    from faintrack.studies.running import connect, run_missing
    from faintrack.studies.study import load

    keep_compilations()
    start = time.perf_counter()
    study = load(where)
    with open_folder(out, study, seed, quick, runs, resume) as folder:
        missing = {setting.name: len(folder.missing(setting)) * setting.batch for setting in study.settings}
        if any(missing.values()):
            scans = sum(missing[setting.name] * setting.scans for setting in study.settings)
            # A brief one is over before workers have started.
            here = study.brief and folder.plan.quick and workers is None and scheduler is None
            with contextlib.nullcontext() if here else connect(workers, scheduler) as client:
                done = run_missing(client, where, folder)
                for _ in progress(done, study.name, scans, lambda pair: pair[1] * pair[0].scans, quiet):
                    pass
        rows = [row.as_dict() for row in study.rows(folder.results)]
        study.figures(folder.results, out)
        seconds = round(time.perf_counter() - start, 1)
        summary = {"study": study.name, "runs": folder.plan.runs, "seed": folder.plan.seed, "seconds": seconds}
        summary["rows"] = rows
        folder.keep("rows.json", json.dumps(summary, indent=2) + "\n")
    return summary
