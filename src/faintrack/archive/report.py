"""One page of a whole archive: tracks in hand and existence by bearing over time, and what was left out.

The page is one file that asks nobody for anything; its cells open the reports of their segments beside it. A month of a
station is a strip: a column a segment, bars for the tracks in hand, and below for every `BEARINGS` degrees the mean
over the scans of the existence of tracks there.
"""

import base64
import html
import io
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from faintrack.archive.cut import stamped
from faintrack.archive.pieces import SECOND
from faintrack.archive.status import Status, status
from faintrack.archive.store import Store, opened
from faintrack.archive.tables import read_table
from faintrack.errors import InputError
from faintrack.results.folder import replaced
from faintrack.results.report import STYLE, table
from faintrack.results.schema import NORTH

if TYPE_CHECKING:
    import pandas as pd

BEARINGS = 5.0
"""Degrees of a row."""

MOST_COLUMNS = 1000
"""Columns of a strip."""

OWN_STYLE = """
.strip { display: grid; grid-template-columns: 4.5rem 1fr; gap: 2px 0.6rem; margin: 0.3rem 0 1.2rem; font-size: 12px; }
.strip svg { width: 100%; display: block; background: #e8e8e8; } .strip .y { text-align: right; color: #555;
display: flex; flex-direction: column; justify-content: space-between; } .x { display: flex;
justify-content: space-between; color: #555; } image { image-rendering: pixelated; } a:hover rect { fill: #D55E00;
fill-opacity: 0.4; }
"""


def write_report(path: str | Path, out: str | Path | None = None) -> Path:
    """Write the page of an archive; returns its path.

    Parameters
    ----------
    path : of the store.
    out : HTML file; `report.html` in the store where not given. Cells of a page that lies elsewhere open nothing.

    Raises
    ------
    InputError : there is no store, or the page cannot be written.
    """
    store = opened(path)
    file = store.path / "report.html" if out is None else Path(out)
    if file.exists() and not file.is_file():
        raise InputError(f"{file} cannot be written: it is no file.")
    text = page(store, status(path))
    replaced(file, lambda beside: beside.write_text(text, encoding="utf-8"))
    return file


def page(store: Store, found: Status) -> str:
    """HTML text of an archive."""
    rows = [
        [one.station, f"{one.done} of {one.segments}", f"{one.hours_done:.5g}", f"{one.took / 3600:.3g}"]
        for one in found.stations
    ]
    strips = "".join(_station(store, station, list(group)) for station, group in _by_station(store))
    name = html.escape(store.path.absolute().name)
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>faintrack: {name}</title><style>{STYLE}{OWN_STYLE}</style></head><body>
<h1>Archive {name}</h1>
{table(["station", "segments", "hours", "hours of computing"], rows)}
{strips}
{_listed("Left out", found.left_out)}{_listed("Without a result", found.failed)}
</body></html>
"""


def cells(
    segments: list[dict[str, Any]], states: "pd.DataFrame", low: float, high: float
) -> tuple[Float[np.ndarray, "row segment"], Float[np.ndarray, " segment"]]:
    """Mean existence by bearing in each segment, and the tracks in hand in it.

    Parameters
    ----------
    segments : facts of each, by time.
    states : of one station; columns `utc`, `track`, `existence`, `bearing_deg`.
    low, high : ends of the bearings; degrees.

    Examples
    --------
    >>> import pandas as pd
    >>> segments = [{"start": k * 10 * SECOND, "stop": (k + 1) * 10 * SECOND, "scans": 2} for k in range(2)]
    >>> states = pd.DataFrame({"utc": pd.to_datetime([1, 2, 12], unit="s", utc=True), "track": ["a", "a", "b"],
    ...                        "existence": [0.5, 1.0, 1.0], "bearing_deg": [1.0, 1.0, 8.0]})
    >>> existence, tracks = cells(segments, states, 0.0, 10.0)
    >>> existence.tolist(), tracks.tolist()
    ([[0.75, 0.0], [0.0, 0.5]], [1.0, 1.0])
    """
    rows = round((high - low) / BEARINGS)
    existence, tracks = np.zeros((rows, len(segments))), np.zeros(len(segments))
    times = states["utc"].to_numpy("datetime64[ns]").astype(np.int64)
    columns = np.searchsorted([segment["start"] for segment in segments], times, side="right") - 1
    bearing = np.clip(((states["bearing_deg"].to_numpy(float) - low) // BEARINGS).astype(int), 0, rows - 1)
    np.add.at(existence, (bearing, columns), states["existence"].to_numpy(float))
    for column, names in states["track"].groupby(columns):
        tracks[int(column)] = names.nunique()
    return existence / np.array([max(segment["scans"], 1) for segment in segments]), tracks


def _by_station(store: Store) -> Iterator[tuple[str, Iterator[dict[str, Any]]]]:
    ordered = sorted(store.segments(), key=lambda facts: (facts["station"], facts["start"]))
    return groupby(ordered, key=lambda facts: str(facts["station"]))


def _station(store: Store, station: str, segments: list[dict[str, Any]]) -> str:
    """Strips of a station, a month each."""
    text = [f"<h2>{html.escape(station)}</h2>"]
    months = groupby(segments, key=lambda facts: stamped(facts["start"])[:6])
    for month, group in months:
        # Scans of a burn-in belong to the chain before.
        mine = [facts | {"scans": _own_scans(facts)} for facts in group]
        states = _states(store, station, month, mine)
        for first in range(0, len(mine), MOST_COLUMNS):
            text.append(_strip(mine[first : first + MOST_COLUMNS], states))
    return "".join(text)


def _own_scans(facts: dict[str, Any]) -> int:
    before = max(0, round((facts["chain"] - facts["origin"]) / SECOND / facts["frame_s"]))
    return sum(max(0, stop - max(first, before)) for first, stop in facts["ranges"])


def _states(store: Store, station: str, month: str, segments: list[dict[str, Any]]) -> "pd.DataFrame":
    import pandas as pd

    columns = ["track", "utc", "existence", "bearing_deg"]
    folder = store.path / "states" / f"station={station}"
    files = sorted(folder.glob(f"day={month[:4]}-{month[4:]}-*/*.parquet"))
    if not files:
        # A table of a segment without tracks has the columns too.
        return read_table(store.path / "segments" / segments[0]["name"] / "states.parquet")[:0].assign(track="")
    return pd.concat([read_table(file, columns) for file in files], ignore_index=True)


def _strip(segments: list[dict[str, Any]], states: "pd.DataFrame") -> str:
    low, high = (-180.0, 180.0) if segments[0]["reference"] == NORTH else (0.0, 180.0)
    start, stop = segments[0]["start"], segments[-1]["stop"]
    inside = states["utc"].to_numpy("datetime64[ns]").astype(np.int64)
    existence, tracks = cells(segments, states[(inside >= start) & (inside < stop)], low, high)
    length = segments[0]["stop"] - segments[0]["start"]
    count = max(1, round((stop - start) / length))
    places = [round((facts["start"] - start) / length) for facts in segments]
    picture = np.full((existence.shape[0], count), np.nan)
    picture[:, places] = existence
    tall, most = existence.shape[0], max(1.0, float(tracks.max()))
    bars = "".join(
        f'<rect x="{x}" y="{20 * (1 - n / most):.2f}" width="1" height="{20 * n / most:.2f}" fill="#0072B2"/>'
        for x, n in zip(places, tracks, strict=True)
    )
    links = "".join(_link(facts, x, int(n), tall) for facts, x, n in zip(segments, places, tracks, strict=True))
    ends = html.escape(f"{low:g}°"), html.escape(f"{high:g}° {segments[0]['reference']}")
    return f"""<div class="strip">
<div class="y"><span>{most:g} tracks</span><span>0</span></div>
<svg viewBox="0 0 {count} 20" height="60" preserveAspectRatio="none">{bars}</svg>
<div class="y"><span>{ends[1]}</span><span>{ends[0]}</span></div>
<svg viewBox="0 0 {count} {tall}" height="{4 * tall}" preserveAspectRatio="none">
<image href="{_picture(picture)}" width="{count}" height="{tall}" preserveAspectRatio="none"/>{links}</svg>
<div></div><div class="x"><span>{_moment(start)}</span><span>{_moment(stop)}</span></div></div>
"""


def _link(facts: dict[str, Any], place: int, tracks: int, tall: int) -> str:
    about = f"{_moment(facts['start'])}, {tracks} track{'' if tracks == 1 else 's'}"
    about += "" if not facts["misfits"] else f"; {facts['misfits'][0]}"
    address = html.escape(f"segments/{facts['name']}/report.html", quote=True)
    title = f"<title>{html.escape(about)}</title>"
    return f'<a href="{address}"><rect x="{place}" width="1" height="{tall}" fill-opacity="0">{title}</rect></a>'


def _picture(values: Float[np.ndarray, "row column"]) -> str:
    """Values from 0 to 1 as a PNG of a pixel each, the first row below; grey where there are none."""
    import matplotlib
    from PIL import Image

    colours = matplotlib.colormaps["cividis"](np.clip(np.nan_to_num(values), 0, 1), bytes=True)
    colours[np.isnan(values)] = (232, 232, 232, 255)
    buffer = io.BytesIO()
    Image.fromarray(colours[::-1]).save(buffer, "PNG")
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()


def _moment(time: int) -> str:
    return np.datetime_as_string(np.datetime64(time, "ns"), unit="m").replace("T", " ") + " UTC"


def _listed(heading: str, said: dict[str, str]) -> str:
    if not said:
        return ""
    return f"<h2>{heading}</h2>{table(['what', 'why'], [[name, why] for name, why in said.items()])}"
