"""Runs with progress: simulation to a file, recording to a result."""

import os
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TypeVar

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
