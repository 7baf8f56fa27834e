"""Sets of bearings with their tracks: which bearings were the target's, existence, map with observers."""

import numpy as np
import xarray as xr
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure

from faintrack.results.pictures import GREY, TRACK, draw_existence
from faintrack.results.result import Result
from faintrack.results.track import Track, tracks_of

ELLIPSES = 12
"""Ellipses of a track on the map at most."""

SIGMAS = 2.0
"""Standard deviations to an ellipse."""

MOST = 20_000
"""Bearings in a picture at most; of more, the surest are shown."""


def draw(result: Result) -> Figure:
    """Figure of a result of bearings: the bearings over time, existence, and a map.

    Returns
    -------
    A matplotlib figure that belongs to no window.
    """
    figure = Figure(figsize=(11, 11), layout="constrained")
    reported, existence, place = figure.subplots(3, 1, height_ratios=[2.2, 1, 3.2])
    existence.sharex(reported)
    points = draw_reported(reported, result.data)
    figure.colorbar(points, ax=reported, label="probability that the\nbearing is the target's", pad=0.01)
    draw_existence(existence, result)
    existence.set_xlabel("time from the first scan (s)")
    draw_place(place, result.data)
    return figure


def draw_reported(axes: Axes, data: xr.Dataset) -> PathCollection:
    """All bearings over time, coloured by their probability of being the target's; a marker for each observer."""
    for number, marker in zip(range(data.sizes["observer"]), "osD^v<>pPX" * 7, strict=False):
        bearing, chance = data.reported.values[:, number], data.association.values[:, number]
        scan, entry = np.nonzero(np.isfinite(bearing))
        order = np.argsort(chance[scan, entry])[-MOST:]
        scan, entry = scan[order], entry[order]
        chance = np.clip(chance[scan, entry], 0, 1)
        shown = axes.scatter(
            data.time.values[scan],
            bearing[scan, entry],
            c=chance,
            s=8 + 24 * chance,
            marker=marker,
            cmap="cividis_r",
            vmin=0,
            vmax=1,
            linewidths=0,
        )
    axes.set_ylabel("bearing (degrees\nclockwise from north)")
    axes.set_ylim(0, 360)
    axes.set_yticks(range(0, 361, 90))
    axes.grid(alpha=0.3)
    return shown


def draw_place(axes: Axes, data: xr.Dataset) -> None:
    """Map: ways of the observers, tracks, and ellipses of two standard deviations along them."""
    for number in range(data.sizes["observer"]):
        x, y = (data[f"observer_{name}"].values[:, number] for name in "xy")
        known = np.isfinite(x)
        axes.plot(x[known], y[known], color=GREY, linewidth=1.2, label="observer" if number == 0 else None)
        axes.plot(x[known][:1], y[known][:1], "^", color=GREY, markersize=7)
    for count, track in enumerate(tracks_of(data)):
        x, y = track.mean["x"], track.mean["y"]
        axes.plot(x, y, color=TRACK, linewidth=1.4, label="track" if count == 0 else None)
        axes.plot(x[:1], y[:1], "o", color=TRACK, markersize=6)
        for scan in np.unique(np.linspace(0, len(x) - 1, ELLIPSES).astype(int)).tolist():
            axes.plot(*ellipse(track, scan), color=TRACK, linewidth=0.7, alpha=0.6)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel(f"east (m); marks: where they start; ellipses: {SIGMAS:g} standard deviations")
    axes.set_ylabel("north (m)")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)


def ellipse(track: Track, scan: int) -> Float[np.ndarray, "2 point"]:
    """Points of the ellipse about the mean position in one scan of a track."""
    names = list(track.mean)
    x, y = names.index("x"), names.index("y")
    values, vectors = np.linalg.eigh(track.covariance[scan][np.ix_([x, y], [x, y])].astype(float))
    angle = np.linspace(0, 2 * np.pi, 73)
    circle = SIGMAS * np.sqrt(np.maximum(values, 0))[:, None] * np.stack([np.cos(angle), np.sin(angle)])
    middle = np.array([[track.mean["x"][scan]], [track.mean["y"][scan]]], float)
    return np.asarray(middle + vectors @ circle)
