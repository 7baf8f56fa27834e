"""Pieces of pictures that results of several kinds share: tracks, existence, components over time."""

from collections.abc import Iterator

import numpy as np
import xarray as xr
from jaxtyping import Int
from matplotlib.axes import Axes
from matplotlib.ticker import MultipleLocator

from faintrack.results.result import Result
from faintrack.results.schema import units
from faintrack.results.track import Track, tracks_of

TRACK = "#D55E00"
LINE = "#0072B2"
GREY = "#666666"
COLUMNS = 2000
"""Scans in a picture at most; more are drawn by their largest value."""


def mark_label(
    axes: Axes, label: int, place: tuple[float, float], size: float | None = None, colour: str = TRACK
) -> None:
    """Number of a track at its start."""
    axes.annotate(
        str(label),
        place,
        xytext=(-3, 5),
        textcoords="offset points",
        ha="right",
        color="white",
        weight="bold",
        fontsize=size,
        bbox={"boxstyle": "round,pad=0.2", "color": colour},
    )


def jumps(track: Track, *names: str) -> Int[np.ndarray, " jump"]:
    """Scans of a track that no line may lead to: after a gap, or across the ends of the circle.

    Parameters
    ----------
    track : of a result.
    names : components that are drawn.
    """
    time = np.diff(track.time)
    far = time > 2.5 * np.median(time) if time.size else np.zeros(0, bool)
    for name in names:
        if track.units.get(name) == "degree":
            far = far | (np.abs(np.diff(track.mean[name])) > 180)
    return np.flatnonzero(far) + 1


def draw_paths(
    axes: Axes,
    data: xr.Dataset,
    across: str,
    up: str,
    deviations: bool = False,
    colour: str = TRACK,
    style: str = "-",
) -> None:
    """Each track as a line with its label at its start.

    Parameters
    ----------
    axes : to draw on.
    data : of a result.
    across, up : component on each axis, or `time`.
    deviations : whether thin lines tell where `up` is two standard deviations away.
    colour, style : of the lines.
    """
    for track in tracks_of(data):
        x, y = (np.asarray(track.time if name == "time" else track.mean[name], float) for name in (across, up))
        breaks = jumps(track, across, up)
        offsets = ((0, 1.6), (-2, 0.7), (2, 0.7)) if deviations else ((0, 1.0),)
        for offset, width in offsets:
            line = np.insert(y + offset * track.std[up] if offset else y, breaks, np.nan)
            axes.plot(np.insert(x, breaks, np.nan), line, color=colour, linewidth=width, linestyle=style)
        mark_label(axes, track.label, (x[0], y[0]), None if deviations else 8, colour)


def draw_existence(axes: Axes, result: Result) -> None:
    """Probability of existence in each slot, with the thresholds that begin and end a track."""
    data, tracker = result.data, result.scenario.tracker
    existence = data.existence.values
    for slot in range(existence.shape[1]):
        if np.any(existence[:, slot] > 0):
            axes.plot(data.time, existence[:, slot], color=LINE, linewidth=1.2)
    for name, level in (("declare", tracker.declare), ("drop", tracker.drop)):
        axes.axhline(level, color=GREY, linestyle="--", linewidth=0.8)
        axes.text(
            0.003, level - 0.09, f"{name} {level:g}", transform=axes.get_yaxis_transform(), fontsize=8, color=GREY
        )
    axes.set_ylim(-0.02, 1.05)
    axes.set_ylabel("probability of\nexistence" + (", unsure" if result.misfits else ""))
    axes.grid(alpha=0.3)


def draw_component(axes: Axes, data: xr.Dataset, name: str, colour: str = LINE, deviations: float = 2) -> None:
    """A component of the tracks over time, with a band of so many standard deviations."""
    for track in tracks_of(data):
        breaks = jumps(track, name)
        time, middle, std = (
            np.insert(np.asarray(values, float), breaks, np.nan)
            for values in (track.time, track.mean[name], deviations * track.std[name])
        )
        axes.plot(time, middle, color=colour, linewidth=1.2)
        axes.fill_between(time, middle - std, middle + std, color=colour, alpha=0.25, linewidth=0)
    axes.set_ylabel(f"{name.replace('_', ' ')} ({units(data)[name]})")
    axes.grid(alpha=0.3)


def until(data: xr.Dataset, time: float) -> Iterator[tuple[Track, int]]:
    """Tracks in hand at a time, each with the number of its scans up to then."""
    nearest = float(data.time.sel(time=time, method="nearest"))
    for track in tracks_of(data):
        number = int(np.searchsorted(track.time, nearest, side="right"))
        if number and track.time[number - 1] == nearest:
            yield track, number


def ends(values: np.ndarray) -> tuple[float, float]:
    """Where the first cell of an axis begins and the last one ends."""
    half = (values[-1] - values[0]) / max(len(values) - 1, 1) / 2 or 0.5
    return float(values[0] - half), float(values[-1] + half)


def draw_record(axes: Axes, data: xr.Dataset) -> None:
    """Beam power over time and bearing; colours from the 2nd to the 99.7th percentile."""
    step = -(-data.sizes["time"] // COLUMNS)
    record = data.record.coarsen(time=step, boundary="pad").max() if step > 1 else data.record
    values = record.values.T
    low, high = np.nanpercentile(values, [2, 99.7])
    frame, beam = _spacing(data.time.values, 1.0), _spacing(data.beam.values, 1.0)
    edges = (
        float(data.time[0] - frame / 2),
        float(data.time[0] - frame / 2 + frame * step * values.shape[1]),
        float(data.beam[0] - beam / 2),
        float(data.beam[-1] + beam / 2),
    )
    axes.imshow(
        values,
        origin="lower",
        aspect="auto",
        extent=edges,
        cmap="cividis",
        vmin=low,
        vmax=high,
        interpolation="nearest",
    )
    axes.set_xlim(edges[0], float(data.time[-1] + frame / 2))
    axes.set_ylim(edges[2:])
    axes.yaxis.set_major_locator(MultipleLocator(60 if edges[3] - edges[2] > 200 else 30))
    axes.set_ylabel(f"bearing (degrees\n{data.beam.attrs['reference']})")


def _spacing(values: np.ndarray, alone: float) -> float:
    return float(values[1] - values[0]) if len(values) > 1 else alone
