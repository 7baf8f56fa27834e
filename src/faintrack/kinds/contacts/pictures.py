"""Contacts with their tracks: which contacts were the target's over time, existence, map with source and receiver."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure

from faintrack.results.pictures import GREY, TRACK, draw_existence
from faintrack.results.result import Result
from faintrack.results.track import tracks_of

MOST = 20_000
"""Contacts in a picture at most; of more, the surest are shown."""

KM = 1e-3


def draw(result: Result) -> Figure:
    """Figure of a result of contacts: their distance and bearing over time, existence, and a map.

    Returns
    -------
    A matplotlib figure that belongs to no window.
    """
    data = result.data
    figure = Figure(figsize=(14, 7.5), layout="constrained")
    rows = figure.add_gridspec(3, 2, height_ratios=[2, 2, 1.2])
    distance = figure.add_subplot(rows[0, 0])
    bearing, existence = (figure.add_subplot(rows[number, 0], sharex=distance) for number in (1, 2))
    place = figure.add_subplot(rows[:, 1])
    scan = np.broadcast_to(data.time.values[:, None, None], data.distance.shape)
    points = draw_contacts(distance, data, scan, data.distance.values)
    draw_contacts(bearing, data, scan, data.reported.values)
    bar = figure.colorbar(points, ax=place, location="bottom", shrink=0.6, aspect=40, pad=0.01)
    bar.set_label("probability that the contact is a target's")
    unit = data.distance.attrs["units"]
    distance.set_ylabel(f"{'range' if unit == 'm' else 'delay'} ({unit})")
    bearing.set_ylabel("bearing (degrees\nclockwise from north)")
    bearing.set_ylim(0, 360)
    bearing.set_yticks(range(0, 361, 90))
    for axes in (distance, bearing):
        axes.grid(alpha=0.3)
    draw_existence(existence, result)
    existence.set_xlabel("time from the first ping (s)")
    draw_map(place, result)
    return figure


def draw_contacts(axes: Axes, data: xr.Dataset, across: np.ndarray, up: np.ndarray) -> PathCollection:
    """All contacts, coloured by their probability of being a target's, the surest above."""
    there = np.isfinite(data.distance.values)
    chance = np.clip(data.association.values[there], 0, 1)
    order = np.argsort(chance)[-MOST:]
    chance = chance[order]
    return axes.scatter(
        across[there][order],
        up[there][order],
        c=chance,
        s=6 + 18 * chance,
        cmap="cividis_r",
        vmin=0,
        vmax=1,
        linewidths=0,
    )


def draw_map(axes: Axes, result: Result) -> None:
    """Map of all contacts, the tracks, and the ways of source and receiver."""
    data, section = result.data, result.scenario.contacts
    draw_contacts(axes, data, KM * data.contact_x.values, KM * data.contact_y.values)
    for platform, marker in (("source", "^"), ("receiver", "s")):
        for number in range(data.sizes["pair"]):
            x, y = (KM * data[f"{platform}_{name}"].values[:, number] for name in "xy")
            known = np.isfinite(x)
            axes.plot(x[known], y[known], color=GREY, linewidth=1.0)
            label = platform if number == 0 else None
            axes.plot(x[known][-1:], y[known][-1:], marker, color=GREY, markersize=7, linestyle="none", label=label)
    for count, track in enumerate(tracks_of(data)):
        x, y = KM * track.mean["x"], KM * track.mean["y"]
        axes.plot(x, y, color=TRACK, linewidth=1.6, label="track" if count == 0 else None)
        axes.plot(x[-1:], y[-1:], "o", color=TRACK, markersize=5)
        axes.annotate(str(track.label), (x[-1], y[-1]), xytext=(5, 5), textcoords="offset points", color=TRACK)
    axes.set_xlim(KM * section.x[0], KM * section.x[1])
    axes.set_ylim(KM * section.y[0], KM * section.y[1])
    axes.set_aspect("equal")
    axes.set_xlabel("east (km); dots and numbers: where a track ends, and its label")
    axes.set_ylabel("north (km)")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, loc="upper right")
