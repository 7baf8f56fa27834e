"""The commands, one function each; the docstring is what `--help` shows."""

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object for programs.")]
ArrayFile = Annotated[Path | None, typer.Option(help="TOML or Acoular XML with the channels' positions.")]
Band = Annotated[tuple[float, float] | None, typer.Option(metavar="LOW HIGH", help="Frequencies to use; Hz.")]
Frame = Annotated[float | None, typer.Option(metavar="SECONDS", help="Between scans; 1 s where not given.")]
ScenarioFile = Annotated[Path | None, typer.Option(help="TOML file with everything else.")]
Method = Annotated[
    str | None, typer.Option(help="bernoulli, track before detect; cfar, detect and track; the scenario's else.")
]


def demo(
    out: Annotated[Path, typer.Option(help="Folder for recording, array file and result.")] = Path("demo"),
) -> None:
    """Simulate a faint source, track it from the file, and leave a report.

    32 towed hydrophones hear three minutes; after one minute a source at -30 dB appears, far below what a frame can
    show.

    Example: [bold]faintrack demo --out demo[/bold]
    """
    from importlib.resources import files

    from faintrack.cli.running import run_simulation, run_track
    from faintrack.cli.tables import print_findings
    from faintrack.io import read, read_array
    from faintrack.io.arrays import array_toml
    from faintrack.io.results import make_folder
    from faintrack.scenario import read as read_scenario
    from faintrack.scenario.simulate import simulated_array

    scenario = read_scenario(Path(str(files("faintrack.scenario") / "demo.toml")))
    array = simulated_array(scenario, Path())
    make_folder(out)
    recording_file, array_file = out / "recording.wav", out / "array.toml"
    array_file.write_text(array_toml(array))
    run_simulation(scenario, array, recording_file)
    result = run_track(read(recording_file), read_array(array_file), scenario, out / "result", quiet=False)
    print_findings(result)
    print(f"recording  {recording_file}")
    print(f"report     {out / 'result' / 'report.html'}")


def simulate(
    scenario: Annotated[Path, typer.Argument(help="TOML file with [array] and [simulation].")],
    out: Annotated[Path, typer.Option(help="Recording to write: .h5 (as Acoular), .wav or .zarr.")],
) -> None:
    """Draw the samples of an array that hears moving sources in noise.

    Example: [bold]faintrack simulate scenario.toml --out recording.h5[/bold]
    """
    from faintrack.cli.running import run_simulation
    from faintrack.errors import naming
    from faintrack.scenario import read as read_scenario
    from faintrack.scenario.simulate import simulated_array

    what = read_scenario(scenario)
    with naming(scenario):
        run_simulation(what, simulated_array(what, scenario.parent), out)
    print(f"recording  {out}")


def track(
    recording: Annotated[
        list[Path],
        typer.Argument(
            help="WAV, FLAC, HDF5, Zarr, SAC, miniSEED; channels of several files are put side by side. "
            "Or frames: TIFF, npz, a folder of PNG; MAT, Zarr with a scenario that has \\[frames]. "
            "Or returns of an active sonar: CSV, Zarr with a scenario that has \\[sonar]. "
            "Or one record (npz, HDF5, Zarr, CSV) or recording for each array of a scenario that has \\[\\[stations]]. "
            "Or sets of bearings: CSV, Zarr with a scenario that has \\[bearings]."
        ),
    ],
    array: ArrayFile = None,
    band: Band = None,
    frame: Frame = None,
    scenario: ScenarioFile = None,
    method: Method = None,
    truth: Annotated[
        Path | None, typer.Option(help="AIS reports of ships, CSV or NMEA, to lay over the tracks of several arrays.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for result and report.")] = None,
    as_json: Json = False,
) -> None:
    """Find and follow the sources in a recording, the targets in frames, sonar returns, bearings, several arrays.

    Example: [bold]faintrack track night.wav --array array.toml --band 100 1500 --out night[/bold]

    Example: [bold]faintrack track frames.tif --out frames[/bold]

    Example: [bold]faintrack track returns.csv --scenario scenario.toml --out returns[/bold]

    Example: [bold]faintrack track bearings.csv --scenario scenario.toml --out bearings[/bold]

    Example: [bold]faintrack track south.npz east.npz --scenario stations.toml --out tracks[/bold]
    """
    from faintrack.cli import running
    from faintrack.cli.tables import print_tracks
    from faintrack.errors import InputError
    from faintrack.io import match_channels, read, read_bearings, read_returns

    only_array = {"--array": array, "--band": band, "--frame": frame, "--method": method}
    alone = running.scenario_without_array(recording, scenario, only_array)
    if truth is not None and (alone is None or alone.stations is None):
        raise InputError(f"there is --truth {truth}; expected a --scenario FILE with [[stations]] with it.")
    if alone is not None and alone.stations is not None:
        assert scenario is not None
        result = running.run_track_records(recording, scenario, alone, truth, out, quiet=as_json)
    elif alone is not None and alone.sonar is not None:
        result = running.run_track_returns(read_returns(recording[0]), alone, out, quiet=as_json)
    elif alone is not None and alone.bearings is not None:
        result = running.run_track_bearings(read_bearings(recording[0]), alone, out, quiet=as_json)
    elif alone is not None:
        result = running.run_track_frames(running.open_sequence(recording[0], alone), alone, out, quiet=as_json)
    else:
        what, geometry = running.scenario_and_array(scenario, array, band, frame, method)
        samples = read(*recording)
        result = running.run_track(samples, match_channels(geometry, samples), what, out, quiet=as_json)
    if as_json:
        print(json.dumps(result.summary()))
    else:
        print_tracks(result)
        if out is not None:
            print(f"report     {out / 'report.html'}")


def report(
    folder: Annotated[Path, typer.Argument(help="Folder that `faintrack track --out` wrote.")],
    out: Annotated[Path | None, typer.Option(help="HTML file; report.html in the folder where not given.")] = None,
) -> None:
    """Draw the report of a result again.

    Example: [bold]faintrack report night[/bold]
    """
    from faintrack.io.results import read_result
    from faintrack.plots.report import write_report

    result = read_result(folder)
    print(f"report     {write_report(out or folder / 'report.html', result)}")


def calibrate(
    array: ArrayFile = None,
    band: Band = None,
    frame: Frame = None,
    scenario: ScenarioFile = None,
    method: Method = None,
    sample_rate: Annotated[
        float | None, typer.Option(metavar="HZ", help="Of the recordings; 2.5 times the band where not given.")
    ] = None,
    probability: Annotated[float, typer.Option(help="Of a false track in the duration.")] = 1e-3,
    duration: Annotated[float, typer.Option(metavar="SECONDS", help="Time that the probability is for.")] = 180.0,
    runs: Annotated[int | None, typer.Option(min=2, help="Runs to draw; enough where not given.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the random numbers.")] = 0,
    as_json: Json = False,
) -> None:
    """Find the threshold that noise passes as rarely as is wished.

    Example: [bold]faintrack calibrate --array array.toml --band 100 1500 --probability 0.01 --duration 3600[/bold]
    """
    from faintrack.cli.running import run_calibration, scenario_and_array
    from faintrack.errors import InputError

    what, geometry = scenario_and_array(scenario, array, band, frame, method)
    if sample_rate is None:
        if what.analysis.band is None:
            raise InputError("no sample rate was given; expected --sample-rate HZ, or a --band to take it from.")
        sample_rate = 2.5 * what.analysis.band[1]
    found = run_calibration(what, geometry, sample_rate, probability, duration, runs, seed, quiet=as_json)
    threshold = found.threshold
    if as_json:
        interval = [threshold.low, threshold.high]
        told = {"threshold": threshold.value, "interval": interval, "by": found.by, "runs": found.runs}
        print(json.dumps({**told, "probability": probability, "duration": duration}))
    else:
        print(f"threshold  {threshold.value:.5f}, 95 % interval {threshold.low:.5f} to {threshold.high:.5f}")
        print(f"for        a false track in {duration:g} s with probability {probability:g}")
        print(f"found by   {found.by}, {found.runs} runs")
        print(f"scenario   [tracker] declare = {threshold.value:.5f}")


def bench(
    rows: Annotated[
        list[str] | None, typer.Argument(help="Rows to measure; all that this machine is for where none is named.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Measure speed against peers and against the machine's own limit, all in this run.

    Example: [bold]faintrack bench several_sea_trial several_synthetic[/bold]
    """
    from faintrack.bench import chosen, run
    from faintrack.cli.tables import print_bench

    names = chosen(rows or None)
    measured = []
    for row in run(names):
        measured.append(row)
        # A bar that redraws itself would take its share of the times.
        if sys.stderr.isatty() and not as_json:
            print(f"{len(measured)} of {len(names)}: {row.name} {row.ours:.3g} {row.unit}", file=sys.stderr)
    if as_json:
        print(json.dumps({"rows": [row.as_dict() for row in measured]}))
    else:
        print_bench(measured)
