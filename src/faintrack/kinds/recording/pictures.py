"""A bearing-time record with its tracks, existence and SNR."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator

from faintrack.results.pictures import COLUMNS, TRACK, draw_component, draw_existence, draw_paths
from faintrack.results.result import Result


def draw(result: Result) -> Figure:
    """Figure of a result: record with tracks over existence over SNR, on one time axis.

    Returns
    -------
    A matplotlib figure that belongs to no window.
    """
    figure = Figure(figsize=(11, 8.5), layout="constrained")
    record, existence, snr = figure.subplots(3, 1, sharex=True, height_ratios=[3, 1, 1])
    draw_record(record, result.data)
    figure.colorbar(record.images[0], ax=record, label="beam power over\nsum of channels (dB)", pad=0.01)
    draw_paths(record, result.data, "time", "bearing", deviations=True)
    draw_existence(existence, result.data, result.scenario.tracker.declare, result.scenario.tracker.drop)
    draw_component(snr, result.data, "snr_db", TRACK, deviations=1)
    snr.set_ylabel("SNR at one\nchannel (dB)")
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


def _spacing(values: np.ndarray, alone: float) -> float:
    return float(values[1] - values[0]) if len(values) > 1 else alone
