"""Tables as a terminal shows them."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

from faintrack.kinds.truth import false_tracks, findings, main_lobe_deg
from faintrack.kinds.truth_ships import sightings, unexplained
from faintrack.results.result import Result, position_units
from faintrack.scenario.simulate import sources_of

if TYPE_CHECKING:
    from faintrack.bench import Row


BEARING_COLUMNS = (
    ("label", "track", "d"),
    ("start_s", "start s", ".1f"),
    ("end_s", "end s", ".1f"),
    ("bearing_deg", "bearing deg", ".1f"),
    ("bearing_std_deg", "std deg", ".1f"),
    ("snr_db", "SNR dB", ".1f"),
    ("existence_max", "existence", ".4f"),
)
"""Field of a track, heading, format."""


def print_tracks(result: Result) -> None:
    """Tracks of a result, and how fast it came."""
    if result.tracks:
        tracks = [track.as_dict() for track in result.tracks]
        columns = BEARING_COLUMNS if result.kind == "recording" else _position_columns(position_units(result.data))
        rows = ([format(track[field], form) for field, _, form in columns] for track in tracks)
        _print([heading for _, heading, _ in columns], rows)
    if "ship" in result.data.sizes:
        print_sightings(result)
    summary = result.summary()
    masked = f", {summary['masked_frames']} with masked channels" if summary.get("masked_frames") else ""
    full = f", {summary['full_scans']} without a free slot" if summary.get("full_scans") else ""
    scans = f"{result.scan}s"
    print(
        f"{len(result.tracks)} tracks in {summary[scans]} {scans}{masked}{full}; "
        f"{summary['seconds']:.1f} s, {summary['realtime_factor']:.0f} times real time"
    )


def print_sightings(result: Result) -> None:
    """What was found of the ships that are known to have been there."""
    columns = ("ship", "from s", "to s", "declared s", "tracks", "rmse m", "followed")
    region = result.scenario.region
    assert region is not None, "ships are seen in a region"
    rows = []
    for found in sightings(result.data, region.cell):
        declared = "never" if found.declared_s is None else f"{found.declared_s:.5g}"
        rmse = "" if found.rmse_m is None else f"{found.rmse_m:.3g}"
        labels = " ".join(map(str, found.tracks))
        span = (f"{found.from_s:.5g}", f"{found.to_s:.5g}")
        rows.append((found.ship, *span, declared, labels, rmse, f"{100 * found.followed:.0f} %"))
    _print(columns, rows)
    print(f"tracks of no ship: {len(unexplained(result.data, region.cell))}")


def print_findings(result: Result) -> None:
    """What was found of the sources of a simulated recording, beside the truth."""
    table = result.scenario.simulation
    assert table is not None, "found against true needs a simulation"
    assert result.array is not None, "what is simulated is an array's recording"
    sources = sources_of(table)
    circular = result.array.circular
    lobe = main_lobe_deg(result.array, result.scenario.analysis.band, table.sample_rate)
    columns = ("source", "appears s", "declared s", "bearing error deg", "SNR dB", "found dB", "followed")
    rows = []
    for number, found in enumerate(findings(result.data, sources, lobe, circular), start=1):
        declared = "never" if found.declared_s is None else f"{found.declared_s:.1f}"
        error = "" if found.bearing_rmse_deg is None else f"{found.bearing_rmse_deg:.2f}"
        snr_db = "" if found.found_snr_db is None else f"{found.found_snr_db:.1f}"
        followed = f"{100 * found.followed:.0f} %"
        rows.append((str(number), f"{found.start_s:.1f}", declared, error, f"{found.snr_db:.1f}", snr_db, followed))
    print_tracks(result)
    _print(columns, rows)
    false = false_tracks(result.data, sources, lobe, circular)
    print(f"main lobe  {lobe:.2f} degrees; false tracks: {len(false)}")


def print_bench(rows: "Sequence[Row]") -> None:
    """Rows of the benchmark, then what each of them measures."""
    columns = ("name", "unit", "ours", "peer", "ratio", "limit", "target", "compile s")

    def number(value: float | None) -> str:
        return "" if value is None else f"{value:.3g}"

    def numbers(row: "Row") -> list[str]:
        values = (row.ours, row.peer, row.ratio, row.limit, row.target, row.compile_seconds)
        return [row.name, row.unit, *map(number, values)]

    _print(columns, map(numbers, rows), text=("name", "unit"))
    print("\nTimes, the least of many repeats; ratio: how many times faster than the peer; limit: the machine's own.")
    for row in rows:
        print(f"{row.name}: {row.note}")


def print_study(summary: dict[str, Any]) -> None:
    """Numbers of a study beside the paper's."""

    def number(value: float | None) -> str:
        return "" if value is None else f"{value:.4g}"

    rows = (
        (row["key"], row["unit"], number(row["paper"]), number(row["ours"]), _interval(row["interval"]))
        for row in summary["rows"]
    )
    _print(("key", "unit", "paper", "ours", "95 %"), rows, text=("key", "unit"))
    print()
    for row in summary["rows"]:
        print(f"{row['key']}: {row['name']}")
    print(f"{sum(summary['runs'].values())} runs, seed {summary['seed']}, {summary['seconds']:.0f} s")


def _position_columns(units: dict[str, str]) -> list[tuple[str, str, str]]:
    """Columns of tracks in a plane, a picture or a profile, whose positions have these units."""
    units = {name: unit.replace("degree", "deg") for name, unit in units.items()}
    unit = next(iter(units.values()))
    # In latitude and longitude the metres would only fill the line.
    shown = {name: of for name, of in units.items() if name in ("latitude", "longitude")}
    form = ".4f" if shown else ".5g"
    places = [
        (f"{name}_{side}", f"{name} {side} {of}", ".1f" if name == "bearing" else form)
        for side in ("start", "end")
        for name, of in (shown or units).items()
    ]
    return [
        ("label", "track", "d"),
        ("start_s", "start s", ".5g"),
        ("end_s", "end s", ".5g"),
        *places,
        ("speed", "rate deg/s", ".3g") if unit == "deg" else ("speed", f"speed {unit}/s", ".5g"),
        ("existence_max", "existence", ".4f"),
    ]


def _interval(bounds: list[float | None]) -> str:
    low, high = bounds
    if low is None and high is None:
        return ""
    return f"{'?' if low is None else f'{low:.4g}'} to {'?' if high is None else f'{high:.4g}'}"


def _print(columns: Sequence[str], rows: Iterable[Sequence[str]], text: Sequence[str] = ()) -> None:
    table = Table(box=None, header_style="bold", pad_edge=False)
    for column in columns:
        table.add_column(column, justify="left" if column in text else "right", no_wrap=True)
    for row in rows:
        table.add_row(*row)
    Console().print(table)
