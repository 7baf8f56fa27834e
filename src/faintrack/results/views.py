"""What the report shows that can be zoomed: values of the tracks, the record and a map, as plain data for a canvas.

The page asks nobody for anything: script and data stand in it. Scans are thinned to `POINTS` a track, the record to
`pictures.COLUMNS` scans, by its largest value, and one byte a cell.
"""

import base64
import json
from importlib.resources import files
from typing import Any

import numpy as np
import xarray as xr

from faintrack.results.coast import coast_lines
from faintrack.results.exports.ellipse import outline
from faintrack.results.pictures import COLUMNS, jumps
from faintrack.results.result import Result
from faintrack.results.schema import places, units
from faintrack.results.track import Track

POINTS = 3000
"""Scans of a track that are shown at most."""

ELLIPSES = 12
"""Of a track on the map."""

_METRES = [("x", "m"), ("y", "m")]

MARGIN = 0.35
"""Of the map around the tracks, as a share of its size; 2 km at least."""


def views(result: Result) -> dict[str, Any]:
    """Views of a result as plain data: `start` of time 0 in UTC or None, `panels` over time, and `map` or None."""
    data = result.data
    of = units(data)
    names = places(data)
    panels = [_panel(result, name, of[name].replace("degree", "deg")) for name in names]
    # A record is over the bearing, and its picture lies behind it.
    if "record" in data and data.record.dims == ("time", "beam") and names[0] == "bearing":
        panels[0]["image"] = _image(data)
    existence = _panel(result, "existence", "")
    existence["range"] = [0.0, 1.0]
    return {
        "start": data.attrs.get("start_time") or None,
        "span": [float(data.time[0]), float(data.time[-1])],
        "panels": [*panels, existence],
        "map": _map(result) if result.tracks and [(name, of[name]) for name in names] == _METRES else None,
    }


def script(result: Result) -> str:
    """HTML of the views: canvases, data, and the script that draws them."""
    # "<" ends no script when it is written so.
    text = json.dumps(views(result), allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    code = (files("faintrack.results") / "views.js").read_text(encoding="utf-8")
    return (
        '<div id="views"></div><p id="said" role="status">Turn the wheel or pinch to zoom, drag to move, click twice '
        f"for all; point at a track for its values.</p><script>\nconst VIEWS = {text};\n{code}</script>"
    )


def _panel(result: Result, name: str, unit: str) -> dict[str, Any]:
    return {"name": name, "unit": unit, "tracks": [_line(track, name) for track in result.tracks]}


def _line(track: Track, name: str) -> dict[str, Any]:
    """Times, values and two deviations of a track; null where no line may lead to."""
    chosen = _thinned(track)
    values = track.existence if name == "existence" else track.mean[name]
    std = np.zeros(len(values)) if name == "existence" else track.std[name]
    breaks = np.zeros(0, int) if name == "existence" else jumps(track, name)
    cut = np.flatnonzero(np.diff(np.searchsorted(breaks, chosen, side="right"))) + 1
    return {
        "label": track.label,
        "time": _rounded(track.time[chosen], 3),
        "value": _rounded(values[chosen], 4),
        "std": _rounded(std[chosen], 4),
        "cut": cut.tolist(),
    }


def _thinned(track: Track) -> np.ndarray:
    return np.unique(np.linspace(0, len(track.time) - 1, min(len(track.time), POINTS)).round().astype(int))


def _rounded(values: Any, digits: int) -> list[float | None]:
    return [round(float(value), digits) if np.isfinite(value) else None for value in values]


def _image(data: xr.Dataset) -> dict[str, Any]:
    """The record in bytes, scan after scan, from the 2nd to the 99.7th percentile."""
    step = -(-data.sizes["time"] // COLUMNS)
    record = data.record.coarsen(time=step, boundary="pad").max() if step > 1 else data.record
    values = np.asarray(record.values, float)
    low, high = np.nanpercentile(values, [2, 99.7])
    levels = np.nan_to_num((values - low) / max(high - low, 1e-9) * 255).clip(0, 255).astype(np.uint8)
    times = np.asarray(record.time.values, float)
    beams = np.asarray(data.beam.values, float)
    half = float(data.attrs["scan_interval"]) * step / 2
    between = float(beams[1] - beams[0]) / 2 if len(beams) > 1 else 0.5
    return {
        "bytes": base64.b64encode(levels.tobytes()).decode(),
        "shape": list(levels.shape),
        "time": [float(times[0]) - half, float(times[-1]) + half],
        "beam": [float(beams[0]) - between, float(beams[-1]) + between],
    }


def _map(result: Result) -> dict[str, Any]:
    """Ways in the plane or on earth, with ellipses, and coast lines where there is a place on earth."""
    earth = "latitude" in result.data
    lines, rings = [], []
    middle = float(result.tracks[0].earth["longitude"][0]) if earth else 0.0
    for track in result.tracks:
        chosen = _thinned(track)
        across, up = (
            (track.earth["longitude"], track.earth["latitude"]) if earth else (track.mean["x"], track.mean["y"])
        )
        across = _turned(np.asarray(across, float), middle) if earth else across
        digits = 6 if earth else 2
        lines.append(
            {
                "label": track.label,
                "x": _rounded(across[chosen], digits),
                "y": _rounded(up[chosen], digits),
                "time": _rounded(track.time[chosen], 3),
            }
        )
        if earth:
            for scan in np.unique(np.linspace(0, len(track.time) - 1, ELLIPSES).round().astype(int)):
                ring = outline(track, int(scan))
                ring[:, 0] = _turned(ring[:, 0], middle)
                rings.append(ring.round(5).tolist())
    x, y = (np.concatenate([np.array(line[name], float) for line in lines]) for name in ("x", "y"))
    stretch = float(np.cos(np.radians(y.mean()))) if earth else 1.0
    least = 2 / 111.2 if earth else 0.0
    high = max(float(np.ptp(y)), float(np.ptp(x)) * stretch, least) * (0.5 + MARGIN)
    wide = high / stretch
    centre = (x.min() + x.max()) / 2, (y.min() + y.max()) / 2
    box = [centre[0] - wide, centre[0] + wide, max(centre[1] - high, -90.0), min(centre[1] + high, 90.0)]
    # A page is wider than high, and a reader looks around.
    seen = (centre[0] - 3 * wide, centre[0] + 3 * wide), (centre[1] - 2 * high, centre[1] + 2 * high)
    coast = coast_lines(*seen) if earth else []
    return {
        "lines": lines,
        "rings": rings,
        "box": [round(float(edge), 6) for edge in box],
        "stretch": round(stretch, 6),
        "unit": "deg" if earth else "m",
        "coast": [line.round(4).tolist() for line in coast],
    }


def _turned(longitude: np.ndarray, middle: float) -> np.ndarray:
    """Longitudes within half a turn of a middle, so that a map across 180 degrees is one."""
    return middle + (longitude - middle + 180) % 360 - 180
