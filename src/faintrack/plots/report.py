"""A report of one file that a person can mail: summary, picture, table of tracks."""

import base64
import html
import io
from pathlib import Path

import numpy as np
import xarray as xr

from faintrack.kinds.truth_ships import WITHIN_CELLS, sightings, unexplained
from faintrack.plots.bearing import draw_result
from faintrack.plots.bearings import draw_bearings
from faintrack.plots.frames import draw_frames
from faintrack.plots.returns import draw_returns
from faintrack.plots.stations import DEVIATIONS, draw_records
from faintrack.results.result import Result, position_units
from faintrack.scenario import to_toml
from faintrack.scenario.build_returns import expected_returns, sonar_axes

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 72rem; margin: 2rem auto; padding: 0 1rem; color: #1a1a1a;
background: #fff; } h1 { font-size: 1.5rem; margin-bottom: 0.25rem; } h2 { font-size: 1.1rem; margin-top: 2rem; }
img { width: 100%; height: auto; }
table { border-collapse: collapse; } th, td { padding: 0.25rem 0.9rem; border-bottom: 1px solid #ddd; text-align:
right; }
th { text-align: right; font-weight: 600; } pre { background: #f5f5f5; padding: 0.8rem; overflow-x: auto; font-size:
13px; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: 0.1rem 1.2rem; } dt { color: #555; } dd { margin: 0; }
"""

BEARING_COLUMNS = (
    ("label", "track", "{:d}"),
    ("start_s", "start (s)", "{:.1f}"),
    ("end_s", "end (s)", "{:.1f}"),
    ("bearing_deg", "bearing (deg)", "{:.1f}"),
    ("bearing_std_deg", "std (deg)", "{:.1f}"),
    ("snr_db", "SNR (dB)", "{:.1f}"),
    ("existence_max", "largest existence", "{:.4f}"),
)
"""Field of a track, heading, format."""


def write_report(path: str | Path, result: Result) -> Path:
    """Write the report of a result as one self-contained HTML file, beside its place first and then renamed.

    Returns
    -------
    The path.
    """
    path = Path(path)
    partial = path.with_name(path.name + ".partial")
    try:
        partial.write_text(report(result), encoding="utf-8")
        partial.rename(path)
    finally:
        partial.unlink(missing_ok=True)
    return path


def report(result: Result) -> str:
    """HTML text of a report."""
    facts = ABOUT[result.kind](result)
    alone = result.kind == "records" and result.scenario.region is None
    shown = "Record, detection" if alone else SHOWN[result.kind]
    rows = "".join(f"<dt>{html.escape(name)}</dt><dd>{html.escape(value)}</dd>" for name, value in facts.items())
    source = result.data.attrs["source"]
    files = source.split(" and ") if result.kind == "records" else [source]
    name = html.escape(" and ".join(Path(file).name for file in files))
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>faintrack: {name}</title><style>{STYLE}</style></head><body>
<h1>{_count(len(result.tracks))} in {name}</h1>
<dl>{rows}</dl>
<h2>Tracks</h2>{_table(result)}{_truth(result)}
<h2>{shown}</h2>
<img alt="{shown}, with the tracks" src="{_picture(result)}">
<h2>Scenario</h2><details><summary>What was run</summary><pre>{html.escape(to_toml(result.scenario))}</pre></details>
</body></html>
"""


def _about_recording(result: Result) -> dict[str, str]:
    data, array, analysis = result.data, result.array, result.scenario.analysis
    assert array is not None
    masked = int((data.masked_channels > 0).sum())
    band = analysis.band
    return {
        "recording": data.attrs["source"],
        "start": data.attrs["start_time"] or "not known",
        "frames": f"{data.sizes['time']} of {analysis.frame:g} s",
        "band": "all frequencies" if band is None else f"{band[0]:g} to {band[1]:g} Hz",
        "array": f"{int(array.alive.sum())} of {len(array.alive)} channels in use, {array.sound_speed:g} m/s",
        "bearings": f"degrees {data.beam.attrs['reference']}",
        "frames with masked channels": f"{masked} (samples that are not finite)" if masked else "none",
    }


def _about_sequence(result: Result) -> dict[str, str]:
    data = result.data
    axes = [name for name in data.surface.dims if name not in ("time", "snapshot")]
    return {
        "frames": data.attrs["source"],
        "number": f"{data.sizes['time']}, {data.attrs['frame_interval']:g} s apart",
        "first frame": f"{data.attrs['first_frame_time']:g} s; times are from there",
        **{
            f"axis {name}": f"{data.sizes[name]} cells, {float(data[name][0]):g} to {float(data[name][-1]):g} "
            f"{data[name].attrs['units']}"
            for name in axes
        },
    }


def _about_returns(result: Result) -> dict[str, str]:
    data, sonar = result.data, result.scenario.sonar
    assert sonar is not None
    delay, doppler = sonar_axes(sonar)
    sweep = f"sweep of {sonar.pulse.bandwidth:g} Hz" if sonar.pulse.bandwidth else "constant frequency"
    bins = [f"{delay.count} delays from {delay.first:g} to {delay.last:g} s", f"{sonar.beams} beams"]
    bins.append(
        "no Doppler" if doppler is None else f"{doppler.count} shifts from {doppler.first:g} to {doppler.last:g} Hz"
    )
    return {
        "returns": data.attrs["source"],
        "pings": f"{data.sizes['time']}, {data.attrs['ping_interval']:g} s apart",
        "first ping": f"{data.attrs['first_ping_time']:g} s; times are from there",
        "returns a ping": f"{float(data.returns.mean()):.4g} on average, {int(data.returns.max())} at most; "
        f"{expected_returns(sonar):.4g} expected of noise alone",
        "pulse": f"{sonar.pulse.frequency:g} Hz, {sonar.pulse.duration:g} s, {sweep}",
        "bins": ", ".join(bins),
        "threshold": f"{sonar.threshold_db:g} dB, for a target of {sonar.snr_db:g} dB",
        **{name: _place(data, name) for name in ("source", "receiver")},
        "grid": " and ".join(
            f"{data.sizes[x]} x {data.sizes[y]} cells of {_cell(data[x])} x {_cell(data[y])}"
            for x, y in (("x", "y"), ("vx", "vy"))
        ),
    }


def _about_records(result: Result) -> dict[str, str]:
    data, region, target = result.data, result.scenario.region, result.scenario.target
    fastest = f"{target.bearing_rate_deg:g} degrees a second" if region is None else f"{region.speed:g} m/s"
    wide = "" if region is None else f", {region.cell:g} m wide"
    silent = data.record.isnull().all("beam").sum("time").values
    levels = result.scenario.energies.levels
    cells = " x ".join(str(count) for count in data.attrs["cells"])
    return {
        "records": data.attrs["source"],
        "start": data.attrs["start_time"] or "not known",
        "scans": f"{data.sizes['time']}, {data.attrs['scan_interval']:.6g} s apart",
        "first scan": f"{data.attrs['first_scan_time']:.10g} s on the clock of the records; times are from there",
        "arrays": "; ".join(
            f"{name}, {'a line' if line else 'all around'}, {int(np.isfinite(beams).sum())} beams"
            + (f", {missing} scans without a row" if missing else "")
            for name, line, beams, missing in zip(
                data.array.values, data.line.values, data.beam_bearing.values, silent, strict=True
            )
        ),
        "energies": "mean {:g} and standard deviation {:g} without a target, {:g} and {:g} with one".format(
            *levels[0], *levels[1]
        )
        + (", in standard deviations above each scan's median" if result.scenario.energies.absent is None else ""),
        "detectors": f"{data.sizes['detector']} of {cells} cells{wide}, up to {fastest}",
        "slots": f"{data.sizes['slot']}"
        + (f"; in {int(data.full.sum())} scans a target was found and no slot was free" if data.full.any() else ""),
    } | ({} if region is None else {"ellipses": f"{DEVIATIONS:g} standard deviations"})


def _about_bearings(result: Result) -> dict[str, str]:
    data, table = result.data, result.scenario.bearings
    assert table is not None
    count = int(np.isfinite(data.heard).sum())
    sector = "all around" if table.sector_deg is None else "{:g} to {:g} degrees clockwise".format(*table.sector_deg)
    return {
        "bearings": data.attrs["source"],
        "scans": f"{data.sizes['time']}, {data.attrs['scan_interval']:.4g} s apart on average",
        "first scan": f"{data.attrs['first_scan_time']:g} s; times are from there",
        "observers": f"{data.sizes['observer']}, with {count / data.sizes['time']:.3g} bearings a scan",
        "detector": f"error {table.error_deg:g} degrees, detection probability {table.detection_probability:g}, "
        f"{table.false_per_scan:g} false bearings a scan and observer",
        "sector": sector,
    }


def _place(data: xr.Dataset, platform: str) -> str:
    """Where a platform is, or from where to where it moves."""
    x, y = (data[f"{platform}_{name}"].values.astype(float) / 1000 for name in "xy")
    places = [f"{east:.4g} km east, {north:.4g} km north" for east, north in ((x[0], y[0]), (x[-1], y[-1]))]
    return places[0] if np.ptp(x) == np.ptp(y) == 0 else f"from {places[0]} to {places[1]}"


def _cell(axis: xr.DataArray) -> str:
    """Width of a cell with its unit."""
    return f"{float(axis[1] - axis[0]) if axis.size > 1 else 0:.4g} {axis.attrs['units']}"


def _position_columns(result: Result) -> tuple[tuple[str, str, str], ...]:
    units = position_units(result.data)
    unit = next(iter(units.values()))
    places = [
        (f"{name}_{side}", f"{name} at {side} ({of})", "{:.5f}" if name in ("latitude", "longitude") else "{:.1f}")
        for side in ("start", "end")
        for name, of in units.items()
    ]
    return (
        ("label", "track", "{:d}"),
        ("start_s", "start (s)", "{:.5g}"),
        ("end_s", "end (s)", "{:.5g}"),
        *places,
        ("speed", f"speed ({unit}/s)", "{:.3g}"),
        ("existence_max", "largest existence", "{:.4f}"),
    )


def _count(number: int) -> str:
    return "No track" if number == 0 else f"{number} track{'s' if number > 1 else ''}"


def _table(result: Result) -> str:
    if not result.tracks:
        several, told = result.scenario.several, f"{result.scenario.tracker.declare:g}"
        if result.kind == "records":
            told = f"{several.declare:g} in a target that had been in hand for {several.hold} scans"
        return f"<p>Existence never reached {told}.</p>"
    columns = BEARING_COLUMNS if result.kind == "recording" else _position_columns(result)
    head = "".join(f"<th>{heading}</th>" for _, heading, _ in columns)
    body = "".join(
        "<tr>" + "".join(f"<td>{form.format(track.as_dict()[field])}</td>" for field, _, form in columns) + "</tr>"
        for track in result.tracks
    )
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _truth(result: Result) -> str:
    """Table of the ships that are known to have been there, and what was found of them."""
    if "ship" not in result.data.sizes or result.scenario.region is None:
        return ""
    cell = result.scenario.region.cell
    headings = ("ship", "in the region from (s)", "to (s)", "declared (s)", "tracks", "rmse (m)", "followed")
    head = "".join(f"<th>{heading}</th>" for heading in headings)
    body = ""
    for found in sightings(result.data, cell):
        declared = "never" if found.declared_s is None else f"{found.declared_s:.5g}"
        rmse = "" if found.rmse_m is None else f"{found.rmse_m:.3g}"
        labels = ", ".join(map(str, found.tracks))
        values = (html.escape(found.ship), f"{found.from_s:.5g}", f"{found.to_s:.5g}", declared, labels, rmse)
        body += "<tr>" + "".join(f"<td>{value}</td>" for value in (*values, f"{100 * found.followed:.0f} %")) + "</tr>"
    others = unexplained(result.data, cell)
    told = f"Tracks that are never within {WITHIN_CELLS * cell:g} m of a ship: {', '.join(map(str, others)) or 'none'}."
    table = f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
    return f"<h2>Ships known to have been there</h2>{table}<p>{told}</p>"


def _picture(result: Result) -> str:
    buffer = io.BytesIO()
    DRAW[result.kind](result).savefig(buffer, format="png", dpi=130)
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()


ABOUT = {
    "recording": _about_recording,
    "frames": _about_sequence,
    "returns": _about_returns,
    "records": _about_records,
    "bearings": _about_bearings,
}
SHOWN = {
    "recording": "Record, existence, SNR",
    "frames": "Frames, existence, position",
    "returns": "Position, velocity, existence, returns",
    "records": "Map, records, detection",
    "bearings": "Bearings, existence, position",
}
DRAW = {
    "recording": draw_result,
    "frames": draw_frames,
    "returns": draw_returns,
    "records": draw_records,
    "bearings": draw_bearings,
}
"""By what was tracked in: facts, heading of the picture, picture."""
