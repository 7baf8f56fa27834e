"""A comparison of two results as tables, and as one HTML file that a person can mail."""

import base64
import html
import io
from pathlib import Path

from matplotlib.figure import Figure

from faintrack.results.compare import Comparison
from faintrack.results.pictures import LINE, TRACK, draw_paths
from faintrack.results.report import STYLE, table, write_html
from faintrack.results.result import Result
from faintrack.results.schema import places, units

Table = tuple[str, list[str], list[list[str]]]


def comparison_facts(comparison: Comparison) -> dict[str, str]:
    """Facts by name."""
    unit = comparison.unit.replace("degree", "deg")
    return {
        "scans of both": str(comparison.scans),
        "the same within": f"{comparison.within:.3g} {unit}",
        "GOSPA": f"{comparison.gospa:.3g} {unit}, root mean square over scans",
        "of pairs": f"{comparison.localisation:.3g} {unit}",
        "only in the first": f"{comparison.missing:.3g} {unit}; tracks {_labels(comparison.only_first)}",
        "only in the second": f"{comparison.extra:.3g} {unit}; tracks {_labels(comparison.only_second)}",
    }


def comparison_tables(comparison: Comparison) -> list[Table]:
    """Title, headings and rows of every table that has a row."""
    unit = comparison.unit.replace("degree", "deg")
    pairs = [
        [
            f"{pair.first}",
            f"{pair.second}",
            f"{pair.scans}",
            f"{pair.from_s:.5g}",
            f"{pair.to_s:.5g}",
            f"{pair.rms:.3g}",
        ]
        for pair in comparison.pairs
    ]
    differences = [
        [f"{one.from_s:.5g}", f"{one.to_s:.5g}", _labels(one.only_first), _labels(one.only_second)]
        for one in comparison.differences
    ]
    fields = [[name, *values] for name, values in comparison.fields.items()]
    tables = [
        ("Tracks that are the same", ["first", "second", "scans", "from s", "to s", f"apart {unit}"], pairs),
        ("Where they differ", ["from s", "to s", "only in the first", "only in the second"], differences),
        ("What was run differently", ["field", "first", "second"], fields),
    ]
    return [one for one in tables if one[2]]


def write_comparison(path: str | Path, comparison: Comparison, first: Result, second: Result) -> Path:
    """Write a comparison as one self-contained HTML file; returns its path.

    Raises
    ------
    InputError : the file cannot be written.
    """
    facts = "".join(
        f"<dt>{html.escape(name)}</dt><dd>{html.escape(text)}</dd>"
        for name, text in comparison_facts(comparison).items()
    )
    tables = "".join(
        f"<h2>{html.escape(title)}</h2>{table(heads, rows)}" for title, heads, rows in comparison_tables(comparison)
    )
    text = f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>faintrack: two results</title><style>{STYLE}</style></head><body>
<h1>Two results beside each other</h1>
<dl><dt>first</dt><dd>{html.escape(str(first.data.attrs["source"]))}</dd>
<dt>second</dt><dd>{html.escape(str(second.data.attrs["source"]))}</dd>{facts}</dl>
<h2>Places over time</h2><img alt="places of all tracks over time" src="{_picture(first, second)}">
{tables}
</body></html>
"""
    return write_html(path, text)


def _labels(labels: tuple[int, ...]) -> str:
    return " ".join(map(str, labels)) or "none"


def _picture(first: Result, second: Result) -> str:
    names = places(first.data)
    figure = Figure(figsize=(11, 1.5 + 2.5 * len(names)), layout="constrained")
    for axes, name in zip(figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0], names, strict=True):
        # Where both are the same, one shows between the dashes of the other.
        for result, colour, style, said in ((first, LINE, "-", "first"), (second, TRACK, "--", "second")):
            draw_paths(axes, result.data, "time", name, colour=colour, style=style)
            axes.plot([], [], color=colour, linestyle=style, label=said)
        axes.set_ylabel(f"{name} ({units(first.data)[name]})")
        axes.grid(alpha=0.3)
    axes.set_xlabel("time (s)")
    axes.legend()
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()
