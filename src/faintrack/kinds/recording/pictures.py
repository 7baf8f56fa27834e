"""A bearing-time record with its tracks, existence and SNR."""

from matplotlib.figure import Figure

from faintrack.results.pictures import TRACK, draw_component, draw_existence, draw_paths, draw_record
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
    draw_existence(existence, result)
    draw_component(snr, result.data, "snr_db", TRACK, deviations=1)
    snr.set_ylabel("SNR at one\nchannel (dB)")
    snr.set_xlabel("time from the start of the recording (s)")
    return figure
