"""A report of one file that a person can mail: summary, picture, table of tracks."""

import base64
import html
import io
import math
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from faintrack.errors import InputError
from faintrack.results.folder import OURS
from faintrack.results.result import Result
from faintrack.results.schema import column, places, rates, units
from faintrack.results.track import DEGREES
from faintrack.results.truth import finding_table, unexplained
from faintrack.scenario.section import to_toml

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 72rem; margin: 2rem auto; padding: 0 1rem; color: #1a1a1a;
background: #fff; } h1 { font-size: 1.5rem; margin-bottom: 0.25rem; } h2 { font-size: 1.1rem; margin-top: 2rem; }
img { width: 100%; height: auto; }
table { border-collapse: collapse; display: block; overflow-x: auto; }
th, td { padding: 0.25rem 0.9rem; border-bottom: 1px solid #ddd; text-align: right; }
th { font-weight: 600; } .words { text-align: left; min-width: 8rem; overflow-wrap: anywhere; }
pre { background: #f5f5f5; padding: 0.8rem; overflow-x: auto; font-size: 13px; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: 0.1rem 1.2rem; } dt { color: #555; } dd { margin: 0; }
"""

UNSURE = "unsure"
"""Shown for existence where data are not as the model has them."""


def track_headings(result: Result) -> list[tuple[str, str, str]]:
    """What a table shows of tracks: name in `Track.summary`, heading, format."""
    data = result.data
    of, place = units(data), places(data)
    earth = [name for name in DEGREES if name in data]
    shown = [("label", "track", "d"), ("start_s", "start\ns", ".5g"), ("end_s", "end\ns", ".5g")]
    for end in ("start", "end"):
        # In latitude and longitude the metres would only fill the line.
        for name in earth or place:
            unit = "degree" if earth else of[name]
            title = column(name, unit)
            form = ".4f" if earth else (".1f" if unit == "degree" else ".5g")
            shown.append((f"{title}_{end}", f"{name}\n{end} {_short(unit)}", form))
    if len(place) == 1:
        shown.append((f"{column(place[0], of[place[0]])}_std", f"std\n{_short(of[place[0]])}", ".2g"))
    rate = f"{of[place[0]]}/s"
    shown.append((column("speed", rate), f"speed\n{_short(rate)}", ".3g"))
    shown += [
        (column(name, unit), f"{name.replace('_', ' ')}\n{_short(unit)}", ".1f" if unit == "degree" else ".4g")
        for name, unit in of.items()
        if name not in (*place, *rates(data).values()) and unit != "dB"
    ]
    shown += [
        (column(name, unit), f"{name.removesuffix('_db').upper()}\ndB", ".1f")
        for name, unit in of.items()
        if unit == "dB"
    ]
    return [*shown, ("existence_max", "existence", ".4f")]


def track_rows(result: Result) -> list[list[str]]:
    """Rows of a table of tracks, as `track_headings` names their columns."""
    headings = track_headings(result)
    unsure = {"existence_max": UNSURE} if result.misfits else {}
    rows = ({**track.summary(), **unsure} for track in result.tracks)
    return [[_text(row[name], form) for name, _, form in headings] for row in rows]


def track_table(result: Result) -> str:
    """Tracks as a table of HTML."""
    if not result.tracks:
        return "<p>No track was declared.</p>"
    return table([heading for _, heading, _ in track_headings(result)], track_rows(result))


def table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table of HTML; texts are escaped."""
    # Words stand on the left, numbers on the right.
    side = ["" if _are_numbers(texts) else ' class="words"' for texts in zip(*rows, strict=True)] or [""] * len(
        headings
    )
    head = "".join(f"<th{at}>{html.escape(heading)}</th>" for heading, at in zip(headings, side, strict=True))
    body = "".join(
        "<tr>" + "".join(f"<td{at}>{html.escape(text)}</td>" for text, at in zip(row, side, strict=True)) + "</tr>"
        for row in rows
    )
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _are_numbers(texts: Sequence[str]) -> bool:
    """Whether most texts of a column are numbers, or stand for one."""
    return 2 * sum((not text[:1].isalpha() and "/" not in text) or text == UNSURE for text in texts) >= len(texts)


def write_report(path: str | Path, result: Result) -> Path:
    """Write the report of a result as one self-contained HTML file; returns its path.

    Raises
    ------
    InputError : as `write_html`.
    """
    require_file(path)
    return write_html(path, report(result, _beside(Path(path))))


def _beside(path: Path) -> list[str]:
    """Files of a result that lie beside its report."""
    names = [name for name in OURS if name not in ("report.html", "result.zarr")]
    whole = (path.parent / "result.zarr").is_dir()
    return [name for name in names if whole and (path.parent / name).is_file()]


def require_file(path: str | Path) -> None:
    """Refuse a path that is something else than a file.

    Raises
    ------
    InputError : it is.
    """
    if Path(path).exists() and not Path(path).is_file():
        raise InputError(f"{path} cannot be written: it is no file.")


def write_html(path: str | Path, text: str) -> Path:
    """Write a page, beside its place first and then renamed; returns its path.

    Raises
    ------
    InputError : the file cannot be written.
    """
    require_file(path)
    path = Path(path)
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".partial", dir=path.parent)
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror}).") from error
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        Path(name).chmod(0o644)
        Path(name).replace(path)
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror or error}).") from error
    finally:
        Path(name).unlink(missing_ok=True)
    return path


def report(result: Result, beside: Sequence[str] = ()) -> str:
    """HTML text of a report.

    Parameters
    ----------
    result : of a run.
    beside : names of files that lie beside it; they are linked.
    """
    # Views read tracks, tables and pictures; a program that only tables are asked of does without.
    from faintrack.results.views import script

    links = ", ".join(f'<a href="{html.escape(name)}">{html.escape(name)}</a>' for name in beside)
    data = f"<p>Data: {links}</p>" if links else ""
    facts = {**result.kind.about(result), **_counts(result)}
    rows = "".join(f"<dt>{html.escape(name)}</dt><dd>{html.escape(value)}</dd>" for name, value in facts.items())
    files = str(result.data.attrs["source"]).split(" and ")
    name = html.escape(" and ".join(Path(file).name for file in files))
    shown = html.escape(result.kind.shown)
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>faintrack: {name}</title><style>{STYLE}</style></head><body>
<h1>{_count(len(result.tracks))} in {name}</h1>
<dl>{rows}</dl>{_listed("Not as the model has it", result.misfits)}{_listed("Assumed, left out", result.remarks)}
<h2>Tracks</h2>{track_table(result)}{data}{_truth(result)}
<h2>To look closer</h2>{script(result)}
<h2>{shown}</h2>
<img alt="{shown}, with the tracks" src="{_picture(result)}">
<h2>Scenario</h2><details><summary>What was run</summary><pre>{html.escape(to_toml(result.scenario))}</pre></details>
</body></html>
"""


def _listed(heading: str, sentences: Sequence[str]) -> str:
    items = "".join(f"<li>{html.escape(sentence)}</li>" for sentence in sentences)
    return f"<h2>{heading}</h2><ul>{items}</ul>" if items else ""


def _truth(result: Result) -> str:
    """Table of the targets that are known to have been there, and what was found of them."""
    if "known" not in result.data.sizes:
        return ""
    others = ", ".join(map(str, unexplained(result.data))) or "none"
    near = html.escape(f"{float(result.data.attrs['truth_within']):.3g} {units(result.data)[places(result.data)[0]]}")
    sentence = f"<p>Tracks that are never within {near} of one of these: {html.escape(others)}.</p>"
    return f"<h2>Targets known to have been there</h2>{table(*finding_table(result.data))}{sentence}"


def _counts(result: Result) -> dict[str, str]:
    """Scans in which something happened that a reader must know."""
    counts = {}
    for values in result.data.data_vars.values():
        if "counted" in values.attrs:
            number = int((values > 0).sum())
            counts[str(values.attrs["counted"]).replace("_", " ")] = f"{number} ({values.attrs['long_name']})"
    return counts


def _short(unit: str) -> str:
    return unit.replace("degree", "deg")


def _text(value: Any, form: str) -> str:
    if isinstance(value, str):
        return value
    return "" if isinstance(value, float) and math.isnan(value) else format(value, form)


def _count(number: int) -> str:
    return "No track" if number == 0 else f"{number} track{'s' if number > 1 else ''}"


def _picture(result: Result) -> str:
    buffer = io.BytesIO()
    result.plot().savefig(buffer, format="png", dpi=130)
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()
