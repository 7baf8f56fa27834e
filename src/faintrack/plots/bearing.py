"""A bearing-time record with its tracks, existence and SNR."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator

from faintrack.results.result import Result

TRACK = "#D55E00"
LINE = "#0072B2"
GREY = "#666666"
COLUMNS = 2000
"""Frames in a picture at most; more are drawn by their largest value."""


def draw_result(result: Result) -> Figure:
    """Figure of a result: record with tracks over existence over SNR, on one time axis.

    Returns
    -------
    A matplotlib figure that belongs to no window.
    """
    figure = Figure(figsize=(11, 8.5), layout="constrained")
    record, existence, snr = figure.subplots(3, 1, sharex=True, height_ratios=[3, 1, 1])
    draw_record(record, result.data)
    figure.colorbar(record.images[0], ax=record, label="beam power over\nsum of channels (dB)", pad=0.01)
    draw_tracks(record, result.data)
    draw_existence(existence, result)
    draw_snr(snr, result.data)
    snr.set_xlabel("time from the start of the recording (s)")
    return figure


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


def draw_tracks(axes: Axes, data: xr.Dataset) -> None:
    """Each track as a line between two thin ones, two standard deviations away, with its label at its start."""
    for number, mine in each_track(data):
        time, bearing, std = (mine[name].values for name in ("time", "bearing", "bearing_std"))
        # A line that jumps across the ends of the circle would cross the picture.
        jumps = np.flatnonzero(np.abs(np.diff(bearing)) > 180) + 1
        for offset, width in ((0, 1.6), (-2, 0.7), (2, 0.7)):
            line = np.insert(bearing + offset * std, jumps, np.nan)
            axes.plot(np.insert(time, jumps, np.nan), line, color=TRACK, linewidth=width)
        axes.annotate(
            str(number),
            (time[0], bearing[0]),
            xytext=(-3, 5),
            textcoords="offset points",
            ha="right",
            color="white",
            weight="bold",
            bbox={"boxstyle": "round,pad=0.2", "color": TRACK},
        )


def draw_existence(axes: Axes, result: Result) -> None:
    """Probability of existence, with the thresholds that begin and end a track."""
    data = result.data
    axes.plot(data.time, data.existence, color=LINE, linewidth=1.2)
    for name in ("declare", "drop"):
        level = getattr(result.scenario.tracker, name)
        axes.axhline(level, color=GREY, linestyle="--", linewidth=0.8)
        axes.text(
            0.003, level - 0.09, f"{name} {level:g}", transform=axes.get_yaxis_transform(), fontsize=8, color=GREY
        )
    axes.set_ylim(-0.02, 1.05)
    axes.set_ylabel("probability of\nexistence")
    axes.grid(alpha=0.3)


def draw_snr(axes: Axes, data: xr.Dataset) -> None:
    """SNR of the tracks with a band of one standard deviation."""
    for _, mine in each_track(data):
        axes.plot(mine.time, mine.snr, color=TRACK, linewidth=1.2)
        axes.fill_between(
            mine.time, mine.snr - mine.snr_std, mine.snr + mine.snr_std, color=TRACK, alpha=0.25, linewidth=0
        )
    axes.set_ylabel("SNR at one\nchannel (dB)")
    axes.grid(alpha=0.3)


def each_track(data: xr.Dataset) -> list[tuple[int, xr.Dataset]]:
    """Labels of the tracks in the data of a result, each with its frames."""
    label = data.label.values
    return [(int(number), data.isel(time=np.flatnonzero(label == number))) for number in np.unique(label[label > 0])]


def _spacing(values: np.ndarray, alone: float) -> float:
    return float(values[1] - values[0]) if len(values) > 1 else alone
