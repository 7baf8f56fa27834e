"""The commands, one function each; the docstring is what `--help` shows."""

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from faintrack.kinds import KINDS
from faintrack.results.exports import FORMATS, format_named

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object for programs.")]
Files = Annotated[list[Path], typer.Argument(help="Files of one kind of data, or a folder of images.")]


def _kinds() -> list[str]:
    return list(KINDS)


KindName = Annotated[
    str | None,
    typer.Option("--kind", autocompletion=_kinds, help="Kind of data, where files and scenario do not tell."),
]
ScenarioFile = Annotated[Path | None, typer.Option(help="TOML file of what to run; faintrack init writes one.")]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="SECTION.FIELD=VALUE", help="A field of the scenario; may be given several times."),
]
ArrayFile = Annotated[Path | None, typer.Option(help="TOML or Acoular XML with the channels' positions.")]
HeadingFile = Annotated[
    Path | None, typer.Option(help="CSV with time_s and heading_deg, of an array that turns; bearings become true.")
]
Band = Annotated[tuple[float, float] | None, typer.Option(metavar="LOW HIGH", help="Frequencies to use; Hz.")]
Frame = Annotated[float | None, typer.Option(metavar="SECONDS", help="Between scans of a recording; 1 s if not given.")]
FalseTracks = Annotated[
    str | None, typer.Option(metavar="N/h", help="False tracks that are promised, an hour or a day: 1/h, 0.5/day.")
]


def _methods() -> list[str]:
    """Values of `--method`, as the scenarios of recordings know them."""
    from faintrack.kinds.explain import explain

    return explain("tracker.method")[0].values.split(", ")


def _fields(incomplete: str) -> list[str]:
    """Fields of scenarios that begin so, with their sections."""
    from faintrack.kinds.explain import field_names

    return [name for name in field_names() if name.startswith(incomplete)]


Method = Annotated[
    str | None,
    typer.Option(
        autocompletion=_methods, help="bernoulli, track before detect; cfar, detect and track; the scenario's else."
    ),
]


def demo(
    out: Annotated[Path, typer.Option(help="Folder for recording, scenario and result.")] = Path("demo"),
    live: Annotated[bool, typer.Option("--live", help="Play it as if it came now, and show a page.")] = False,
    speed: Annotated[float, typer.Option(help="Of --live: seconds of the recording a second.")] = 1.0,
    port: Annotated[int, typer.Option(help="Of the page of --live.")] = 8080,
) -> None:
    """Simulate a faint source, track it from the file, and leave a report; or watch it come.

    32 towed hydrophones hear three minutes; after one minute a source at -30 dB appears, far below what a frame can
    show.

    Example: [bold]faintrack demo --out demo[/bold]

    Example: [bold]faintrack demo --live --speed 5[/bold]
    """
    from importlib.resources import files

    from faintrack import Scenario, simulate, track
    from faintrack.cli.progress import progress_bar
    from faintrack.cli.tables import print_result
    from faintrack.io.arrays import array_toml
    from faintrack.results.folder import make_folder
    from faintrack.scenario.array import build

    scenario: Any = Scenario.read(Path(str(files("faintrack.scenario") / "demo.toml")))
    make_folder(out)
    recording, array = out / "recording.wav", out / "array.toml"
    array.write_text(array_toml(build(scenario.array)), encoding="utf-8")
    simulate(scenario, recording)
    if live:
        from faintrack.cli.live import watch_source

        watch_source(["replay", str(recording)], scenario, speed=speed, port=port)
        return
    with progress_bar("tracking", quiet=False) as advance:
        result = track(recording, scenario, array=array, truth=scenario, out=out / "result", progress=advance)
    print_result(result)
    print(f"recording  {recording}")
    print(f"report     {out / 'result' / 'report.html'}")


def simulate(
    scenario: Annotated[Path, typer.Argument(help=r"TOML file with \[simulation].")],
    out: Annotated[Path, typer.Option(help="File to write; .zarr holds every kind of data.")],
    settings: Settings = None,
) -> None:
    """Draw data with the targets that a scenario describes.

    Example: [bold]faintrack simulate scenario.toml --out recording.h5[/bold]
    """
    from faintrack import simulate as draw
    from faintrack.cli.options import sections_of

    draw(scenario, out, **sections_of(settings))
    print(f"written    {out}")


def track(
    files: Files,
    scenario: ScenarioFile = None,
    kind: KindName = None,
    array: ArrayFile = None,
    heading: HeadingFile = None,
    band: Band = None,
    frame: Frame = None,
    method: Method = None,
    settings: Settings = None,
    false_tracks: FalseTracks = None,
    truth: Annotated[
        Path | None, typer.Option(help="Where targets were, to lay beside: CSV, AIS reports, TOML of a simulation.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for result and report.")] = None,
    as_json: Json = False,
) -> None:
    """Find and follow the targets in recordings, frames, sonar returns, bearings, records of several arrays.

    Example: [bold]faintrack track night.wav --array array.toml --band 100 1500 --out night[/bold]

    Example: [bold]faintrack track frames.tif --out frames[/bold]

    Example: [bold]faintrack track returns.csv --scenario scenario.toml --out returns[/bold]

    Example: [bold]faintrack track south.npz east.npz --scenario stations.toml --out tracks[/bold]
    """
    from faintrack import track as run
    from faintrack.cli.options import sections_of
    from faintrack.cli.progress import progress_bar
    from faintrack.cli.tables import print_result

    sections = sections_of(settings, kind, array, band, frame, method, heading)
    said: list[str] = []

    def tell(sentence: str) -> None:
        said.append(sentence)
        if not as_json:
            print(f"remark     {sentence}", flush=True)

    with progress_bar("tracking", quiet=as_json) as advance:
        # Without a folder only tables are printed: what pictures need is not kept.
        result = run(
            files,
            scenario,
            out=out,
            truth=truth,
            false_tracks=false_tracks,
            progress=advance,
            tell=tell,
            pictures=out is not None,
            **sections,
        )
    if as_json:
        print(json.dumps(result.summary()))
    else:
        print_result(result, said)
        if out is not None:
            print(f"report     {out / 'report.html'}")


def info(
    files: Files,
    scenario: ScenarioFile = None,
    kind: KindName = None,
    array: ArrayFile = None,
    settings: Settings = None,
    check: Annotated[
        bool, typer.Option("--check", help="Look for reversed, exchanged or louder channels of an array.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Tell what files hold, what was assumed, and the command that tracks them.

    Example: [bold]faintrack info night.wav[/bold]
    """
    from faintrack import info as tell
    from faintrack.cli.options import sections_of

    about = tell(*files, scenario=scenario, check=check, **sections_of(settings, kind, array))
    print(json.dumps(about.as_dict()) if as_json else about)


def init(
    kind: Annotated[str, typer.Argument(autocompletion=_kinds, help=f"Kind of data: {', '.join(KINDS)}.")],
    out: Annotated[Path | None, typer.Option(help="File to write; printed where not given.")] = None,
) -> None:
    """Write a scenario of a kind of data with every field, its default and what it means.

    Example: [bold]faintrack init frames --out scenario.toml[/bold]
    """
    from faintrack.kinds.commented import commented_scenario

    text = commented_scenario(kind)
    if out is None:
        print(text, end="")
        return
    from faintrack.errors import InputError

    if out.exists():
        raise InputError(f"{out} exists; expected another name for --out.")
    try:
        out.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"{out} cannot be written ({error.strerror}).") from error
    print(f"scenario   {out}")


def explain(
    field: Annotated[
        str,
        typer.Argument(
            help="Of a scenario, as declare or tracker.declare; a section, as tracker, for all that is in it.",
            autocompletion=_fields,
        ),
    ],
    kind: KindName = None,
    as_json: Json = False,
) -> None:
    """Explain a field of a scenario: meaning, unit, bounds, default.

    Example: [bold]faintrack explain tracker.declare[/bold]

    Example: [bold]faintrack explain frames --kind frames[/bold]
    """
    from dataclasses import asdict

    from faintrack.cli.tables import print_explanations
    from faintrack.errors import InputError
    from faintrack.kinds import kind_named
    from faintrack.kinds.explain import explain as explanations

    wanted = None if kind is None else kind_named(kind).name
    known = [one for one in explanations(field) if wanted is None or wanted in one.kinds]
    if not known:
        raise InputError(f"there is no field {field} in a scenario of {wanted}; faintrack init {wanted} prints all.")
    if as_json:
        print(json.dumps({"fields": [asdict(one) for one in known]}))
    else:
        print_explanations(known)


def report(
    folder: Annotated[Path, typer.Argument(help="Folder that faintrack track --out wrote.")],
    other: Annotated[Path | None, typer.Argument(help="Another one, to compare the two.")] = None,
    out: Annotated[Path | None, typer.Option(help="HTML file; report.html in the folder where not given.")] = None,
    within: Annotated[
        float | None, typer.Option(help="Of two: distance up to which tracks are the same; unit of the place.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Draw the report of a result again, or compare two: tracks matched, GOSPA, where they differ.

    Example: [bold]faintrack report night[/bold]

    Example: [bold]faintrack report night night_cfar --out comparison.html[/bold]
    """
    from faintrack import read_result

    result = read_result(folder)
    if other is None:
        if within is not None:
            from faintrack.errors import InputError

            raise InputError("--within was given with one result; expected two.")
        written = result.report(out or folder / "report.html")
        print(json.dumps(result.summary()) if as_json else f"report     {written}")
        return
    from faintrack.cli.tables import print_comparison
    from faintrack.results.compare import compare
    from faintrack.results.compare_report import write_comparison

    second = read_result(other)
    comparison = compare(result, second, within)
    if as_json:
        print(json.dumps(comparison.as_dict()))
    else:
        print_comparison(comparison)
    if out is not None:
        write_comparison(out, comparison, result, second)
        if not as_json:
            print(f"report     {out}")


def export(
    folder: Annotated[Path, typer.Argument(metavar="RESULT", help="Folder that faintrack track --out wrote.")],
    to: Annotated[
        str | None,
        typer.Option(
            metavar="FORMAT",
            help=f"{', '.join(FORMATS)}; as the end of --out tells where not given.",
            autocompletion=lambda: [(name, one.title) for name, one in FORMATS.items()],
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="File to write; beside the folder where not given.")] = None,
) -> None:
    """Write the tracks of a result for another program: a globe, MATLAB, sound, images, tables.

    Example: [bold]faintrack export night --to raven[/bold]

    Example: [bold]faintrack export tracks --out tracks.kml[/bold]
    """
    from faintrack import read_result
    from faintrack.errors import InputError

    if out is None:
        if to is None:
            raise InputError(f"expected --to FORMAT, one of {', '.join(FORMATS)}, or --out FILE.")
        out = folder.parent / (folder.resolve().name + format_named(to).suffix)
    print(f"written    {read_result(folder).export(out, to)}")


def calibrate(
    files: Annotated[
        list[Path] | None, typer.Argument(help="Data to find the threshold on, for --false-tracks.")
    ] = None,
    scenario: ScenarioFile = None,
    kind: KindName = None,
    array: ArrayFile = None,
    band: Band = None,
    frame: Frame = None,
    method: Method = None,
    settings: Settings = None,
    false_tracks: FalseTracks = None,
    quiet: Annotated[
        str | None,
        typer.Option(metavar="START:END,...", help="Seconds without a target; surrogates are made where not given."),
    ] = None,
    draws: Annotated[int, typer.Option(min=1, help="Surrogates.")] = 4,
    out: Annotated[Path | None, typer.Option(help="Scenario to write, with the threshold found on data.")] = None,
    probability: Annotated[float, typer.Option(help="Of a false track in the duration.")] = 1e-3,
    duration: Annotated[float, typer.Option(metavar="SECONDS", help="Time that the probability is for.")] = 180.0,
    runs: Annotated[int | None, typer.Option(min=2, help="Runs to draw; enough where not given.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the random numbers.")] = 0,
    sample_rate: Annotated[
        float | None, typer.Option(metavar="HZ", help="Of recordings; 2.5 times the band where not given.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Find the threshold that noise passes as rarely as is wished, in your data or in the model's noise.

    Example: [bold]faintrack calibrate night.wav --array array.toml --false-tracks 1/h --out night.toml[/bold]

    Example: [bold]faintrack calibrate --array array.toml --band 100 1500 --probability 0.01 --duration 3600[/bold]
    """
    from faintrack.cli.options import sections_of
    from faintrack.cli.progress import progress_bar

    sections = sections_of(settings, kind, array, band, frame, method)
    if files or false_tracks is not None:
        _calibrate_on(files or [], scenario, sections, false_tracks, quiet, draws, seed, out, as_json)
        return
    if quiet is not None or out is not None:
        from faintrack.errors import InputError

        raise InputError(f"{'--quiet' if out is None else '--out'} was given without data; expected files.")
    from faintrack import calibrate as find

    if sample_rate is not None:
        sections["simulation"] = {"duration": duration, **sections.get("simulation", {}), "sample_rate": sample_rate}
    with progress_bar("calibrating", quiet=as_json) as advance:
        calibrated = find(scenario, probability, duration, runs, seed, advance, **sections)
    threshold = calibrated.threshold
    if as_json:
        interval = [threshold.low, threshold.high]
        plain = {"threshold": threshold.value, "interval": interval, "by": calibrated.by, "runs": calibrated.runs}
        print(json.dumps({**plain, "probability": probability, "duration": duration}))
    else:
        print(f"threshold  {threshold.value:.5f}, 95 % interval {threshold.low:.5f} to {threshold.high:.5f}")
        print(f"for        a false track in {duration:g} s with probability {probability:g}")
        print(f"found by   {calibrated.by}, {calibrated.runs} runs")
        print(f"scenario   [tracker] declare = {threshold.value:.5f}")


def _calibrate_on(
    files: list[Path],
    scenario: Path | None,
    sections: dict[str, Any],
    false_tracks: str | None,
    quiet: str | None,
    draws: int,
    seed: int,
    out: Path | None,
    as_json: bool,
) -> None:
    """Find the threshold on data and print it."""
    from faintrack import InputError, calibrate_on
    from faintrack.cli.progress import progress_bar
    from faintrack.kinds.false_tracks import stretches_of

    if not files:
        raise InputError(
            "--false-tracks was given without data; expected files, or faintrack track FILES --false-tracks N/h, which "
            "takes the threshold of the model."
        )
    if false_tracks is None:
        raise InputError("data were given without a rate; expected --false-tracks N/h, such as 1/h.")
    if out is not None and out.exists():
        raise InputError(f"{out} exists; expected another name for --out.")
    stretches = None if quiet is None else stretches_of(quiet)
    with progress_bar("calibrating", quiet=as_json) as advance:
        found = calibrate_on(
            files,
            scenario,
            false_tracks=false_tracks,
            quiet=stretches,
            draws=draws,
            seed=seed,
            progress=advance,
            **sections,
        )
    if out is not None:
        try:
            found.scenario.save(out)
        except OSError as error:
            raise InputError(f"{out} cannot be written ({error.strerror}).") from error
    plain = found.as_dict()
    if as_json:
        print(json.dumps(plain))
        return
    low, high = plain["interval"]
    fewest, most = plain["per_hour_interval"]
    print(f"threshold  {plain['threshold']:.5f}, 95 % interval {low:.5f} to {high:.5f}")
    print(f"for        {false_tracks}; passed {plain['per_hour']:.3g} times an hour, {fewest:.2g} to {most:.2g}")
    print(f"found by   {plain['peaks']} peaks of existence in {plain['hours']:.3g} h of {plain['by']}")
    for remark in plain["remarks"]:
        print(f"remark     {remark}")
    print(
        f"scenario   {out}"
        if out is not None
        else f"scenario   tracker.declare = {plain['threshold']:.5f}; --out FILE writes it"
    )


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
