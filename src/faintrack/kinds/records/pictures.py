"""Several arrays: the map with region, detectors, arrays and tracks, the records with the tracks in them, detection."""

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse, Rectangle
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator

from faintrack.kinds.records.dataset import reference
from faintrack.results.pictures import COLUMNS, GREY, LINE, draw_record
from faintrack.results.result import Result
from faintrack.results.track import tracks_of
from faintrack.sensors.stations import Fans, Stations
from faintrack.targets.states import PlanarState

COLOURS = ("#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
"""Of the tracks, in turn; distinct to those who see no red or green (Okabe and Ito)."""

ELLIPSES = 6
"""Ellipses along a track."""

DEVIATIONS = 3.0
"""Standard deviations from the middle of an ellipse to its rim."""

KM = 1e-3


def draw(result: Result) -> Figure:
    """Figure of a result of several arrays: map, a record for each array, probability of detection, number of tracks.

    An array by itself has no map.

    Returns
    -------
    A matplotlib figure that belongs to no window.
    """
    data = result.data
    arrays = data.sizes["array"]
    alone = result.scenario.region is None
    heights = [4.0, 1.4, 1.2] if alone else [_map_height(data), *(2.2,) * arrays, 1.4, 1.2]
    figure = Figure(figsize=(11, sum(heights) + 0.9), layout="constrained")
    grid = figure.add_gridspec(len(heights), 1, height_ratios=heights)
    rows = [figure.add_subplot(grid[number]) for number in range(len(heights))]
    if not alone:
        draw_map(rows.pop(0), data)
        figure.legend(handles=_legend(data), loc="outside upper center", ncols=6, fontsize=8, frameon=False)
    *records, detection, number_of = rows
    for axes in rows[1:]:
        axes.sharex(rows[0])
    for number, axes in enumerate(records):
        draw_heard(axes, data, number)
        axes.tick_params(labelbottom=False)
    bar = figure.colorbar(records[0].images[0], ax=records, pad=0.01)
    estimated = result.scenario.energies.absent is None
    bar.set_label("energy of the beam" + (" (standard\ndeviations above the median)" if estimated else ""), fontsize=9)
    draw_detection(detection, result)
    detection.tick_params(labelbottom=False)
    draw_number(number_of, result)
    number_of.set_xlabel("time from the first scan (s)")
    return figure


def draw_map(axes: Axes, data: xr.Dataset) -> None:
    """Region and detectors, arrays with the paths that they take, tracks with covariance ellipses; km, equal scales."""
    width, height = (KM * data.attrs[f"detector_{name}"] for name in ("width", "height"))
    corners = list(zip(KM * data.detector_x.values, KM * data.detector_y.values, strict=True))
    for corner in corners:
        axes.add_patch(Rectangle(corner, width, height, fill=False, edgecolor=GREY, linewidth=0.6, linestyle=":"))
    low, high = np.min(corners, axis=0), np.max(corners, axis=0) + np.array([width, height])
    axes.add_patch(Rectangle(tuple(low), *(high - low), fill=False, edgecolor=GREY, linewidth=1.2))
    reach = 0.05 * max(high - low)
    for number, name in enumerate(data.array.values):
        x, y = (KM * data[f"station_{axis}"].values[:, number] for axis in "xy")
        axes.plot(x, y, color="black", linewidth=0.8)
        axes.plot(x[-1], y[-1], "s", color="black", markersize=5)
        if bool(data.line.values[number]):
            heading = np.radians(float(data.station_heading[-1, number]))
            along = reach * np.array([np.sin(heading), np.cos(heading)])
            axes.plot([x[-1] - along[0], x[-1] + along[0]], [y[-1] - along[1], y[-1] + along[1]], color="black")
        axes.annotate(str(name), (x[-1], y[-1]), xytext=(4, -11), textcoords="offset points", fontsize=8)
    if "truth_x" in data:
        axes.plot(KM * data.truth_x.values, KM * data.truth_y.values, color="black", linewidth=0.8, linestyle="--")
    for track in tracks_of(data):
        x, y = KM * track.mean["x"], KM * track.mean["y"]
        axes.plot(x, y, color=colour(track.label), linewidth=1.4)
        for scan in np.unique(np.linspace(0, len(x) - 1, ELLIPSES).astype(int)):
            place = float(x[scan]), float(y[scan])
            axes.add_patch(_ellipse(place, KM**2 * track.covariance[scan, :2, :2], colour(track.label)))
        _name(axes, track.label, (float(x[0]), float(y[0])))
    west, east, south, north = extent(data)
    axes.set_xlim(west, east)
    axes.set_ylim(south, north)
    axes.set_aspect("equal")
    axes.set_xlabel("east (km)")
    axes.set_ylabel("north (km)")
    axes.grid(alpha=0.3)


def draw_heard(axes: Axes, data: xr.Dataset, number: int) -> None:
    """Record of one array, and the bearings at which it should hear the tracks."""
    used = np.isfinite(data.beam_bearing.values[number])
    bearing = data.beam_bearing.values[number][used]
    line = bool(data.line.values[number])
    row = xr.Dataset(
        {"record": (("time", "beam"), data.record[:, number, : used.sum()].values.astype(np.float32))},
        {"time": data.time, "beam": ("beam", bearing, {"reference": reference(line)})},
    )
    draw_record(axes, row)
    for track in tracks_of(data):
        if "x" in data:
            scans = np.searchsorted(data.time.values, track.time)
            values = bearings_of(data.isel(time=scans), number, track.mean["x"][:, None], track.mean["y"][:, None])[
                :, 0
            ]
        else:
            # Beams may be counted from elsewhere.
            first = float(bearing[0] - (bearing[1] - bearing[0]) / 2)
            values = track.mean["bearing"] if line else first + (track.mean["bearing"] - first) % 360
            _name(axes, track.label, (float(track.time[0]), float(values[0])))
        jumps = np.flatnonzero(np.abs(np.diff(values)) > 180) + 1
        axes.plot(
            np.insert(track.time, jumps, np.nan),
            np.insert(values, jumps, np.nan),
            color=colour(track.label),
            linewidth=1.2,
            path_effects=[withStroke(linewidth=2.4, foreground="white")],
        )
    axes.set_ylabel(f"{data.array.values[number]}: bearing\n(degrees {reference(line)})", fontsize=8)


def draw_detection(axes: Axes, result: Result) -> None:
    """Target-present probability of every detector, and the threshold at which its target is handed over."""
    data = result.data
    step = -(-data.sizes["time"] // COLUMNS)
    shown = data.detection.coarsen(time=step, boundary="pad").max() if step > 1 else data.detection
    axes.plot(shown.time, shown, color=LINE, linewidth=0.8, alpha=0.7)
    level = result.scenario.several.detect
    axes.axhline(level, color=GREY, linestyle="--", linewidth=0.8)
    axes.text(0.003, level - 0.13, f"detect {level:g}", transform=axes.get_yaxis_transform(), fontsize=8, color=GREY)
    axes.set_ylim(-0.02, 1.05)
    axes.set_ylabel("probability of\na target, each\ndetector", fontsize=8)
    axes.grid(alpha=0.3)


def draw_number(axes: Axes, result: Result) -> None:
    """Number of declared tracks and of targets in hand, with the number of slots where it is reached."""
    data = result.data
    for values, colour_of, name in (
        ((data.existence > 0).sum("slot"), GREY, "in hand"),
        ((data.label > 0).sum("slot"), LINE, "declared"),
    ):
        axes.plot(data.time, values, color=colour_of, linewidth=1.2, drawstyle="steps-post", label=name)
    most = max(int((data.existence > 0).sum("slot").max()), 1)
    if bool(data.full.any()):
        axes.axhline(data.sizes["slot"], color=GREY, linestyle="--", linewidth=0.8)
    axes.set_ylim(0, most + 0.6)
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_ylabel("targets")
    axes.legend(loc="upper left", fontsize=7, frameon=False, ncols=2)
    axes.grid(alpha=0.3)


def bearings_of(data: xr.Dataset, number: int, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Bearings at which an array hears places, one row of them a scan; degrees, as the array counts."""
    bearing = data.beam_bearing.values[number]
    bearing = bearing[np.isfinite(bearing)]
    first, step = np.radians(bearing[0]), np.radians(bearing[1] - bearing[0])
    line = bool(data.line.values[number])
    fans = Fans((float(first),), (float(step),), (len(bearing),), (line,))
    east, north, heading = (data[f"station_{name}"].values[:, number, None] for name in ("x", "y", "heading"))
    stations = Stations(jnp.asarray(east), jnp.asarray(north), jnp.radians(heading))
    states = PlanarState(jnp.asarray(x), jnp.asarray(y), jnp.zeros(x.shape), jnp.zeros(x.shape))
    heard = np.degrees(np.asarray(jax.vmap(fans.bearings)(stations, states))[:, 0])
    return heard if line else bearing[0] + (heard - bearing[0]) % 360


def _map_height(data: xr.Dataset) -> float:
    """Of the map, as wide as the figure; inches."""
    west, east, south, north = extent(data)
    return min(max(9.0 * (north - south) / (east - west), 3.0), 8.5)


def extent(data: xr.Dataset) -> tuple[float, float, float, float]:
    """West, east, south and north end of the map: region, arrays and tracks; km."""
    ends = []
    for axis, side in (("x", "width"), ("y", "height")):
        corners = data[f"detector_{axis}"].values
        seen = [corners, corners + data.attrs[f"detector_{side}"], data[f"station_{axis}"].values.ravel()]
        held = data[axis].values[data.label.values > 0]
        low, high = (KM * pick(np.concatenate([*seen, held])) for pick in (np.min, np.max))
        ends += [low - 0.06 * (high - low), high + 0.06 * (high - low)]
    return ends[0], ends[1], ends[2], ends[3]


def colour(label: int) -> str:
    """Colour of a track, the same in all panels."""
    return COLOURS[(label - 1) % len(COLOURS)]


def _name(axes: Axes, label: int, place: tuple[float, float]) -> None:
    axes.annotate(
        str(label),
        place,
        xytext=(-3, 5),
        textcoords="offset points",
        ha="right",
        color="white",
        weight="bold",
        fontsize=9,
        bbox={"boxstyle": "round,pad=0.2", "color": colour(label)},
    )


def _ellipse(place: tuple[float, float], covariance: np.ndarray, edge: str) -> Ellipse:
    """Ellipse of `DEVIATIONS` about a place."""
    values, vectors = np.linalg.eigh(covariance.astype(float))
    width, height = 2 * DEVIATIONS * np.sqrt(np.maximum(values[::-1], 0))
    angle = np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1]))
    return Ellipse(place, width, height, angle=angle, fill=False, edgecolor=edge, linewidth=0.8)


def _legend(data: xr.Dataset) -> list[Line2D]:
    handles = [
        Line2D([], [], color=GREY, label="region"),
        Line2D([], [], color=GREY, linestyle=":", label="detectors"),
        Line2D([], [], color="black", marker="s", markersize=5, label="arrays"),
        Line2D([], [], color=COLOURS[0], label="tracks, by colour"),
        Line2D(
            [],
            [],
            color=COLOURS[0],
            marker="o",
            markersize=9,
            markerfacecolor="none",
            linestyle="none",
            label=f"{DEVIATIONS:g} standard deviations",
        ),
    ]
    if "truth_x" in data:
        handles.append(Line2D([], [], color="black", linestyle="--", label="truth"))
    return handles
