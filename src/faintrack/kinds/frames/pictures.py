"""A sequence of frames with its tracks: pictures, likelihood ratio surface, existence, position."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec

from faintrack.results.pictures import COLUMNS, TRACK, draw_component, draw_existence, draw_paths, ends, until
from faintrack.results.result import Result
from faintrack.results.schema import places

ACROSS = 4
"""Images side by side."""

PIXELS = 300
"""Cells of a surface along each side of a small picture at most; of more the largest are drawn."""


def draw(result: Result) -> Figure:
    """Figure of a result of frames: images or the whole matrix, surfaces, existence, position over time.

    Returns
    -------
    A matplotlib figure that belongs to no window.
    """
    data = result.data
    names = places(data)
    profiles = "record" in data
    bands = 2 if profiles else 2 * -(-data.sizes["snapshot"] // ACROSS)
    heights = [2.6] * bands + [1.5] * (1 + len(names))
    figure = Figure(figsize=(11, sum(heights) + 1), layout="constrained")
    rows = figure.add_gridspec(len(heights), 1 if profiles else ACROSS, height_ratios=heights)
    below = [figure.add_subplot(rows[bands, :])]
    below += [figure.add_subplot(rows[bands + 1 + number, :], sharex=below[0]) for number in range(len(names))]
    if profiles:
        record, surface = (figure.add_subplot(rows[number, 0], sharex=below[0]) for number in range(2))
        draw_matrix(record, data.record, "value over\nwhat is expected")
        draw_matrix(surface, data.surface, "log of the\nlikelihood ratio")
        for axes in (record, surface):
            draw_paths(axes, data, "time", names[0])
    elif bands:
        # A watch that does not know its length has no snapshots.
        draw_snapshots(figure, rows, data)
    draw_existence(below[0], result)
    for axes, name in zip(below[1:], names, strict=True):
        draw_component(axes, data, name)
    below[-1].set_xlabel("time from the first frame (s)")
    return figure


def draw_snapshots(figure: Figure, rows: GridSpec, data: xr.Dataset) -> None:
    """Images, then the surfaces after each of them; the target of the moment in a circle."""
    dims = tuple(map(str, data.frame.dims[1:]))
    steps = {name: -(-data.sizes[name] // PIXELS) for name in dims}
    surface = data.surface.coarsen(steps, boundary="pad").max() if max(steps.values()) > 1 else data.surface
    bands = -(-data.sizes["snapshot"] // ACROSS)
    for first, values, label in (
        (0, data.frame, "value in the file"),
        (bands, surface, "log of the likelihood\nratio of a cell"),
    ):
        low, high = _colours(values)
        panels = []
        for number, shot in enumerate(values):
            band, column = divmod(number, ACROSS)
            axes = figure.add_subplot(rows[first + band, column])
            shown = np.maximum(shot.values, low)
            axes.imshow(shown, extent=_extent(data, dims), aspect="auto", cmap="cividis", vmin=low, vmax=high)
            _mark(axes, data, float(shot.snapshot), dims)
            axes.set_title(f"{float(shot.snapshot):.4g} s", fontsize=9, pad=2)
            axes.tick_params(labelsize=7)
            if column == 0:
                axes.set_ylabel(_label(data, dims[0]), fontsize=8)
            if band == bands - 1:
                axes.set_xlabel(_label(data, dims[1]), fontsize=8)
            panels.append(axes)
        figure.colorbar(panels[0].images[0], ax=panels, label=label, pad=0.01)


def draw_matrix(axes: Axes, values: xr.DataArray, label: str) -> None:
    """Profiles over time; of long ones the largest value in each picture's column."""
    step = -(-values.sizes["time"] // COLUMNS)
    shown = values.astype(np.float32)
    shown = shown.coarsen(time=step, boundary="pad").max() if step > 1 else shown
    matrix = shown.values.T
    low, high = _colours(values)
    time, name = values.time.values, values.dims[1]
    half = (time[-1] - time[0]) / max(len(time) - 1, 1) / 2 or 0.5
    bottom, top = ends(values[name].values)
    drawn = axes.imshow(
        np.maximum(np.where(np.isnan(matrix), low, matrix), low),
        origin="lower",
        aspect="auto",
        extent=(time[0] - half, time[0] - half + 2 * half * step * matrix.shape[1], bottom, top),
        cmap="cividis",
        vmin=low,
        vmax=high,
        interpolation="nearest",
    )
    axes.set_xlim(time[0] - half, time[-1] + half)
    axes.set_ylabel(f"{values[name].attrs['long_name']} ({values[name].attrs['units']})")
    axes.figure.colorbar(drawn, ax=axes, label=label, pad=0.01)


def _mark(axes: Axes, data: xr.Dataset, time: float, dims: tuple[str, ...]) -> None:
    """Ways of the tracks in hand up to now, and a circle around each target."""
    for track, number in until(data, time):
        y, x = (track.mean[name.removeprefix("axis_")][:number] for name in dims)
        axes.plot(x, y, color=TRACK, linewidth=0.8)
        axes.plot(x[-1], y[-1], "o", markersize=14, markerfacecolor="none", markeredgecolor=TRACK, markeredgewidth=1.2)


def _extent(data: xr.Dataset, dims: tuple[str, ...]) -> tuple[float, float, float, float]:
    """Edges of an image whose first row is at the top."""
    top, bottom = ends(data[dims[0]].values)
    left, right = ends(data[dims[1]].values)
    return left, right, bottom, top


def _colours(values: xr.DataArray) -> tuple[float, float]:
    """Ends of the colours: nearly all of what frames hold; of a surface the upper part, its peaks included."""
    finite = values.values[np.isfinite(values.values)].astype(float)
    if not finite.size:
        return 0.0, 1.0
    low, high = np.percentile(finite, [30, 100] if values.name == "surface" else [1, 99.8])
    return float(low), float(max(high, low + 1e-9))


def _label(data: xr.Dataset, name: str) -> str:
    return f"{data[name].attrs['long_name'].replace('_', ' ')} ({data[name].attrs['units']})"
