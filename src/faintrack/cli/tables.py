"""Tables as a terminal shows them."""

import textwrap
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

from faintrack.archive.cut import stamped
from faintrack.kinds.explain import Explanation
from faintrack.results.compare import Comparison
from faintrack.results.compare_report import comparison_facts, comparison_tables
from faintrack.results.lofargrams import HEADINGS, line_rows
from faintrack.results.report import track_headings, track_rows
from faintrack.results.result import Result
from faintrack.results.truth import finding_table, unexplained
from faintrack.signal.lofar import Lofargram

if TYPE_CHECKING:
    from faintrack.archive.plan import ArchivePlan
    from faintrack.archive.status import Status
    from faintrack.bench import Row

SAID = 20
"""Files that are listed one by one at most."""


def print_result(result: Result, said: Sequence[str] = ()) -> None:
    """Tracks of a result, what was found of known targets, remarks that were not said yet, and how fast it came."""
    if result.tracks:
        _print([heading for _, heading, _ in track_headings(result)], track_rows(result))
    if "known" in result.data.sizes:
        _print(*finding_table(result.data), text=("target",))
        print(f"tracks of no known target: {len(unexplained(result.data))}")
    for misfit in result.misfits:
        print(f"misfit     {misfit}")
    for remark in result.remarks:
        if remark not in said:
            print(f"remark     {remark}")
    summary = result.summary()
    counts = [
        f", {value} {name.replace('_', ' ')}" for name, value in summary.items() if name.endswith("_scans") and value
    ]
    print(
        f"{len(result.tracks)} tracks in {summary['scans']} scans{''.join(counts)}; "
        f"{summary['seconds']:.1f} s, {summary['realtime_factor']:.0f} times real time"
    )


def print_lines(record: Lofargram) -> None:
    """Lines of a spectrum, with the series that they belong to."""
    step = float(record.frequency[1] - record.frequency[0])
    if record.lines:
        _print(HEADINGS, line_rows(record.lines))
    print(
        f"{len(record.lines)} lines above {record.threshold_db:.2g} dB; {len(record.times)} rows of "
        f"{len(record.frequency)} bins of {step:.4g} Hz"
    )


def print_comparison(comparison: Comparison) -> None:
    """Two results beside each other."""
    for name, text in comparison_facts(comparison).items():
        print(f"{name:<19}{text}")
    for title, headings, rows in comparison_tables(comparison):
        print(f"\n{title}")
        _print(headings, rows, text=("field", "first", "second") if headings[0] == "field" else ())


def print_explanations(explanations: Sequence[Explanation]) -> None:
    """What is known of fields, a paragraph each."""
    for number, one in enumerate(explanations):
        facts = {
            "": one.meaning,
            "unit": one.unit,
            "values": one.values,
            "default": "must be given" if one.required else one.default or "none; see above",
            "kinds": ", ".join(one.kinds),
        }
        print(f"{chr(10) if number else ''}{one.field}")
        for name, text in facts.items():
            lines = textwrap.wrap(text, 66) or []
            for place, line in enumerate(lines):
                print(f"  {'' if place else name:<9}{line}" if name else f"  {line}")


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


def print_archive_plan(plan: "ArchivePlan", seconds: float | None, workers: int) -> None:
    """What an archive consists of, what is left out, and how long it will take."""
    columns = ("station", "files", "from", "hours", "gaps", "gap h", "channels", "GB", "segments")
    rows = (
        (
            *(station.station, str(station.files), stamped(station.start)[:8], f"{station.hours:.5g}"),
            *(str(station.gaps), f"{station.gap_hours:.4g}", str(station.channels)),
            *(f"{station.size / 1e9:.3g}", str(station.segments)),
        )
        for station in plan.stations
    )
    _print(columns, rows, text=("station", "from"))
    for station in plan.stations:
        if station.overlaps:
            print(
                f"overlaps   {station.station}: {station.overlaps}, {station.overlap_s:.4g} s recorded twice, read once"
            )
    _print_left_out({path: why for path, _, why in plan.left_out})
    if seconds is not None:
        by = "process" if workers == 1 else "processes"
        print(f"about {seconds / 3600:.2g} hours by {workers} {by}, of {plan.seconds / 3600:.5g} hours with burn-ins")


def print_archive_status(status: "Status") -> None:
    """How an archive stands."""
    columns = ("station", "segments", "done", "hours", "done h", "tracks", "took h")
    rows = (
        (
            *(one.station, str(one.segments), str(one.done), f"{one.hours:.5g}", f"{one.hours_done:.5g}"),
            *(str(one.tracks), f"{one.took / 3600:.3g}"),
        )
        for one in status.stations
    )
    _print(columns, rows, text=("station",))
    _print_left_out(status.left_out)
    for name, why in status.failed.items():
        print(f"failed     {name}: {why}")
    print("a run writes to it now" if status.running else "whole" if status.whole else "not whole; run again to go on")


def _print_left_out(left_out: dict[str, str]) -> None:
    for path, why in list(left_out.items())[:SAID]:
        print(f"left out   {path}: {why}")
    if len(left_out) > SAID:
        print(f"left out   {len(left_out) - SAID} files more")


def _interval(bounds: list[float | None]) -> str:
    low, high = bounds
    if low is None and high is None:
        return ""
    return f"{'?' if low is None else f'{low:.4g}'} to {'?' if high is None else f'{high:.4g}'}"


def _print(columns: Sequence[str], rows: Iterable[Sequence[str]], text: Sequence[str] = ()) -> None:
    """A table; what does not fit beside each other stands below, the first column again before it."""
    console, body = Console(), [list(row) for row in rows]
    wide = [
        max(len(line) for cell in (title, *(row[number] for row in body)) for line in cell.split("\n")) + 2
        for number, title in enumerate(columns)
    ]
    parts: list[list[int]] = [[0]]
    for number in range(1, len(columns)):
        fits = sum(wide[one] for one in (*parts[-1], number)) - 2 <= console.width
        # A text may be folded instead.
        if fits or columns[number] in text or len(parts[-1]) == 1:
            parts[-1].append(number)
        else:
            parts.append([0, number])
    for part in parts:
        table = Table(box=None, header_style="bold", pad_edge=False)
        for number in part:
            left = columns[number] in text
            table.add_column(columns[number], justify="left" if left else "right", no_wrap=not left, overflow="fold")
        for row in body:
            table.add_row(*(row[number] for number in part))
        console.print(table)
