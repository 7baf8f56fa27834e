"""Runs with progress: simulation to a file, recording to a result."""

import json
import os
import sys
import time as clock
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, TypeVar

import jax

from faintrack.io import write_recording
from faintrack.io.results import read_result, result_folder, write_result
from faintrack.plots.report import write_report
from faintrack.recording import Recording
from faintrack.result import Result
from faintrack.scenario.model import Scenario
from faintrack.scenario.simulate import simulated_samples
from faintrack.sensors.array import SensorArray
from faintrack.session import collect, track_blocks
from faintrack.studies.folder import open_folder
from faintrack.studies.running import connect, run_missing
from faintrack.studies.study import load

Item = TypeVar("Item")


def run_track(recording: Recording, array: SensorArray, scenario: Scenario, out: Path | None, quiet: bool) -> Result:
    """Result of a recording; where `out` is given it is kept there with its report."""
    keep_compilations()
    frames = int(recording.duration / scenario.analysis.frame)
    blocks = track_blocks(recording, array, scenario)
    blocks = progress(blocks, "tracking", frames, lambda block: block.sizes["time"], quiet)
    if out is None:
        # Only tables are printed: without the record, a frame is a few bytes.
        return collect((block.drop_vars("record") for block in blocks), scenario, array)
    with result_folder(out) as folder:
        result = write_result(folder, blocks, scenario, array)
        write_report(folder / "report.html", result)
    return read_result(out)


def run_simulation(scenario: Scenario, array: SensorArray, out: Path) -> None:
    """Draw the samples of a scenario and write them."""
    table = scenario.simulation
    blocks = simulated_samples(scenario, array)
    if table is not None:
        blocks = progress(blocks, "simulating", round(table.duration * table.sample_rate), len, quiet=False)
        write_recording(out, blocks, table.sample_rate, array.channel_names)


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
    start = clock.perf_counter()
    study = load(where)
    with open_folder(out, study, seed, quick, runs, resume) as folder:
        missing = {setting.name: len(folder.missing(setting)) * setting.batch for setting in study.settings}
        if any(missing.values()):
            scans = sum(missing[setting.name] * setting.scans for setting in study.settings)
            with connect(workers, scheduler) as client:
                done = run_missing(client, where, folder)
                for _ in progress(done, study.name, scans, lambda pair: pair[1] * pair[0].scans, quiet):
                    pass
        rows = [row.as_dict() for row in study.rows(folder.results)]
        study.figures(folder.results, out)
        seconds = round(clock.perf_counter() - start, 1)
        summary = {"study": study.name, "runs": folder.plan.runs, "seed": folder.plan.seed, "seconds": seconds}
        summary["rows"] = rows
        folder.keep("rows.json", json.dumps(summary, indent=2) + "\n")
    return summary


def progress(items: Iterable[Item], label: str, total: int, size: Callable[[Item], int], quiet: bool) -> Iterator[Item]:
    """Yield items while a bar on standard error shows how much is done; silent where nobody looks."""
    if quiet or not sys.stderr.isatty():
        yield from items
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(label, total=total)
        for item in items:
            yield item
            bar.advance(task, size(item))


def keep_compilations() -> None:
    """Let JAX keep what it compiles between runs, in the user's cache folder unless the user has named another."""
    if "JAX_COMPILATION_CACHE_DIR" in os.environ:
        return
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "faintrack"
    jax.config.update("jax_compilation_cache_dir", str(cache))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.1)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", 0)
