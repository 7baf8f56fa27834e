"""Sweeps with their tracks: a plan-position picture, and existence over time."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from faintrack.results.pictures import GREY, TRACK, draw_existence, mark_label
from faintrack.results.result import Result
from faintrack.results.track import tracks_of

RINGS = 4
"""Rings of equal range, about."""

CELLS = 700
"""Cells along each side of the picture."""


def draw(result: Result) -> Figure:
    """Figure of a result of sweeps: the mean of all around the antenna, north up, with the tracks; existence.

    Returns
    -------
    A matplotlib figure that belongs to no window.
    """
    data = result.data
    figure = Figure(figsize=(9, 11), layout="constrained")
    plan, below = figure.subplots(2, 1, height_ratios=(5, 1))
    draw_plan(plan, data)
    draw_existence(below, result)
    below.set_xlabel("time from the first sweep (s)")
    return figure


def draw_plan(axes: Axes, data: xr.Dataset) -> None:
    """Plan-position picture: mean of all sweeps about the place of the antenna in the last one, rings, tracks."""
    east, north = float(data.antenna_x[-1]), float(data.antenna_y[-1])
    furthest = float(data.axis_range[-1])
    heading = float(data.antenna_heading[-1])
    across = np.linspace(-furthest, furthest, CELLS)
    x, y = np.meshgrid(across, across)
    azimuth = np.degrees(np.arctan2(x, y)) - heading
    distance = np.hypot(x, y)
    rows, samples = data.record.shape
    row = np.floor((azimuth - float(data.axis_azimuth[0])) / 360 * rows + 0.5).astype(int) % rows
    step = float(data.axis_range[1] - data.axis_range[0])
    sample = np.round((distance - float(data.axis_range[0])) / step).astype(int)
    values = data.record.values.astype(float)
    shown = np.where((sample >= 0) & (sample < samples), values[row, np.clip(sample, 0, samples - 1)], np.nan)
    extent = (east - furthest, east + furthest, north - furthest, north + furthest)
    top = float(np.nanmax(values)) or 1.0
    axes.imshow(shown, origin="lower", extent=extent, cmap="gray_r", vmin=0, vmax=0.6 * top)
    around = np.linspace(0, 2 * np.pi, 361)
    for radius in _rings(furthest):
        axes.plot(east + radius * np.sin(around), north + radius * np.cos(around), color=GREY, linewidth=0.5)
        label = f"{radius / 1000:g} km" if radius >= 1000 else f"{radius:g} m"
        axes.annotate(label, (east, north + radius), fontsize=7, color=GREY, ha="center", va="bottom")
    axes.plot(data.antenna_x, data.antenna_y, color=GREY, linewidth=0.8)
    axes.plot(east, north, "+", color=GREY)
    for track in tracks_of(data):
        place = np.array([track.mean["x"], track.mean["y"]])
        axes.plot(*place, color=TRACK, linewidth=1.2)
        axes.plot(*place[:, -1], "o", ms=12, mfc="none", mec=TRACK, mew=1.2)
        # A way of minutes is too short to be seen in a picture of miles: the line tells where it leads.
        velocity = np.array([track.mean["vx"][-1], track.mean["vy"][-1]])
        speed = np.hypot(*velocity)
        ahead = place[:, -1] + velocity / (speed or 1.0) * furthest / 15
        tip, tail = ((float(point[0]), float(point[1])) for point in (ahead, place[:, -1]))
        axes.annotate("", tip, tail, arrowprops={"arrowstyle": "->", "color": TRACK, "linewidth": 1.2})
        mark_label(axes, track.label, (float(place[0, -1]), float(place[1, -1])), 8)
    axes.set_aspect("equal")
    axes.set_xlim(extent[0], extent[1])
    axes.set_ylim(extent[2], extent[3])
    axes.set_xlabel("east (m)")
    axes.set_ylabel("north (m)")


def _rings(furthest: float) -> np.ndarray:
    """Radii of rings: about `RINGS` round numbers up to the furthest."""
    rough = furthest / RINGS
    power = 10 ** np.floor(np.log10(rough))
    step = power * max(factor for factor in (1, 2, 5) if factor * power <= rough)
    return np.arange(1, int(furthest / step) + 1) * step
