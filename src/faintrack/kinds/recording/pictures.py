"""A bearing-time record with its tracks, existence and SNR."""

from matplotlib.figure import Figure

from faintrack.results.pictures import TRACK, draw_component, draw_existence, draw_paths, draw_record
from faintrack.results.result import Result


def draw(result: Result) -> Figure:
    """Figure of a result: record with tracks over existence, SNR and the frequency of tones, on one time axis.

    Returns
    -------
    A matplotlib figure that belongs to no window.
    """
    data = result.data
    tones = "frequency" in data
    heights = [3, 1, 1, *([1.5] if tones else [])]
    figure = Figure(figsize=(11, 8.5 + 2 * tones), layout="constrained")
    record, existence, snr, *frequency = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
    draw_record(record, data)
    shown = "loudest tone over\nthe noise around (dB)" if tones else "beam power over\nsum of channels (dB)"
    figure.colorbar(record.images[0], ax=record, label=shown, pad=0.01)
    draw_paths(record, data, "time", "bearing", deviations=True)
    draw_existence(existence, result)
    draw_component(snr, data, "snr_db", TRACK, deviations=1)
    snr.set_ylabel("SNR in 1 Hz at\none channel (dB)" if tones else "SNR at one\nchannel (dB)")
    for axes in frequency:
        draw_component(axes, data, "frequency", TRACK, deviations=1)
    (snr, *frequency)[-1].set_xlabel("time from the start of the recording (s)")
    return figure
