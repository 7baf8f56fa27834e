"""Runs with progress: simulation to a file, recording to a result."""

from collections.abc import Iterator, Mapping
from pathlib import Path

import xarray as xr

from faintrack.cli.progress import progress, progress_bar
from faintrack.data.bearings import Bearings
from faintrack.data.recording import Recording
from faintrack.data.returns import Returns
from faintrack.data.sequence import Sequence
from faintrack.errors import InputError, naming
from faintrack.io import read_array, read_sequence, write_recording
from faintrack.io.ais import read_ships
from faintrack.io.results import read_result, result_folder, write_result
from faintrack.io.returns import holds_returns
from faintrack.io.sequences import holds_frames
from faintrack.io.stations import located, open_stations
from faintrack.kinds.calibration import Calibrated, calibrate
from faintrack.kinds.session import collect, track_blocks, with_analysis, with_method
from faintrack.kinds.session_bearings import track_bearing_blocks
from faintrack.kinds.session_frames import track_frame_blocks, with_frames
from faintrack.kinds.session_returns import track_ping_blocks
from faintrack.kinds.session_stations import put_together, track_record_blocks
from faintrack.kinds.truth_ships import beside, ships_dataset
from faintrack.plots.report import write_report
from faintrack.results.result import Result
from faintrack.scenario import read as read_scenario
from faintrack.scenario.array import build
from faintrack.scenario.model import Scenario
from faintrack.scenario.simulate import simulated_samples
from faintrack.sensors.array import SensorArray
from faintrack.studies.running import keep_compilations


def scenario_and_array(
    scenario: Path | None,
    array: Path | None,
    band: tuple[float, float] | None,
    frame: float | None,
    method: str | None,
) -> tuple[Scenario, SensorArray]:
    """What the options ask for: the scenario's file with what is given beside it, and the array of either."""
    base = None if scenario is None else read_scenario(scenario)
    if array is not None:
        geometry = read_array(array)
    elif base is not None and scenario is not None and base.array is not None:
        with naming(scenario):
            geometry = build(base.array, scenario.parent)
    else:
        raise InputError("no array was given; expected --array FILE, or a --scenario FILE with [array].")
    return with_method(with_analysis(base, band, frame), method), geometry


def run_calibration(
    scenario: Scenario,
    array: SensorArray,
    sample_rate: float,
    probability: float,
    duration: float,
    runs: int | None,
    seed: int,
    quiet: bool,
) -> Calibrated:
    """Threshold of a scenario, with progress."""
    keep_compilations()
    with progress_bar("calibrating", quiet) as advance:
        return calibrate(scenario, array, sample_rate, probability, duration, runs, seed, advance)


def run_track(recording: Recording, array: SensorArray, scenario: Scenario, out: Path | None, quiet: bool) -> Result:
    """Result of a recording; where `out` is given it is kept there with its report."""
    frames = int(recording.duration / scenario.analysis.frame)
    return _run_blocks(track_blocks(recording, array, scenario), frames, scenario, array, out, quiet)


def run_track_frames(sequence: Sequence, scenario: Scenario, out: Path | None, quiet: bool) -> Result:
    """Result of a sequence of frames; where `out` is given it is kept there with its report."""
    return _run_blocks(track_frame_blocks(sequence, scenario), sequence.length, scenario, None, out, quiet)


def run_track_returns(returns: Returns, scenario: Scenario, out: Path | None, quiet: bool) -> Result:
    """Result of the returns of a sonar; where `out` is given it is kept there with its report."""
    return _run_blocks(track_ping_blocks(returns, scenario), returns.length, scenario, None, out, quiet)


def run_track_records(
    files: list[Path], scenario: Path, what: Scenario, truth: Path | None, out: Path | None, quiet: bool
) -> Result:
    """Result of the records or recordings of several arrays; where `out` is given it is kept there with its report."""
    what = located(what, scenario.parent)
    inputs = open_stations(files, what, scenario.parent)
    together = put_together(inputs.records, what)
    blocks = track_record_blocks(inputs.records, what, inputs.paths, inputs.arrays)
    if truth is not None:
        if what.region is None:
            raise InputError(f"{scenario} has no [region]; expected it with --truth, which tells where ships are.")
        blocks = beside(blocks, ships_dataset(read_ships(truth), together, what, str(truth)))
    return _run_blocks(blocks, together.length, what, None, out, quiet)


def run_track_bearings(bearings: Bearings, scenario: Scenario, out: Path | None, quiet: bool) -> Result:
    """Result of sets of bearings; where `out` is given it is kept there with its report."""
    return _run_blocks(track_bearing_blocks(bearings, scenario), bearings.length, scenario, None, out, quiet)


def scenario_without_array(paths: list[Path], scenario: Path | None, options: Mapping[str, object]) -> Scenario | None:
    """Scenario for what is no recording of one array, where it has a table of it or the file can be nothing else.

    Parameters
    ----------
    paths : what is to be tracked in.
    scenario : file.
    options : those that only recordings of an array take, by name; None where not given.

    Raises
    ------
    InputError : a path that does not exist; returns or bearings without a scenario; any of the three with options of an
        array, or in several files.
    """
    for path in paths:
        if not path.exists():
            raise InputError(f"{path} does not exist.")
    what = None if scenario is None else read_scenario(scenario)
    given = [name for name, value in options.items() if value is not None]
    kinds = ("stations", "bearings", "sonar", "frames")
    table = None if what is None else next((name for name in kinds if getattr(what, name)), None)
    if table is None:
        lone = next(filter(holds_returns, paths), None)
        if lone is not None:
            raise InputError(
                f"{lone} holds returns of a sonar or a record, or bearings; expected a --scenario FILE with [sonar] "
                "and [grid], with [bearings], or with [[stations]]."
            )
        if given or (what is not None and what.array is not None) or not all(map(holds_frames, paths)):
            return None
    if given:
        raise InputError(f"{scenario} has [{table}]; expected no {given[0]}, which is for recordings of an array.")
    if len(paths) > 1 and table != "stations":
        told = {
            "sonar": "returns were given; expected one file",
            "bearings": "bearings were given; expected one file, observers in rows of their own",
        }.get(str(table), "frames were given; expected one file, or one folder of PNG files")
        raise InputError(f"{len(paths)} files of {told}.")
    return what if table in ("sonar", "bearings", "stations") else with_frames(what)


def open_sequence(path: Path, scenario: Scenario) -> Sequence:
    """Frames of a file as the scenario names them."""
    table = scenario.frames
    assert table is not None
    return read_sequence(path, table.variable, table.dims, table.frame_interval)


def _run_blocks(
    blocks: Iterator[xr.Dataset],
    frames: int,
    scenario: Scenario,
    array: SensorArray | None,
    out: Path | None,
    quiet: bool,
) -> Result:
    keep_compilations()
    blocks = progress(blocks, "tracking", frames, lambda block: block.sizes.get("time", 0), quiet)
    if out is None:
        # Only tables are printed: without the pictures, a frame is a few bytes.
        return collect(
            (block.drop_vars(["record", "surface", "frame"], errors="ignore") for block in blocks), scenario, array
        )
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
