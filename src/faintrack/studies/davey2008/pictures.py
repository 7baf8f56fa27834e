"""Probability of detection and error of the position, frame by frame."""

from pathlib import Path

import numpy as np

from faintrack.metrics.accuracy import rmse
from faintrack.metrics.intervals import binomial_interval
from faintrack.studies.davey2008 import scene
from faintrack.studies.davey2008.report import LABELS, declared
from faintrack.studies.davey2008.settings import SNR_DB
from faintrack.studies.study import Results

COLOURS = {"grid": "#0072B2", "viterbi": "#E69F00", "particle": "#D55E00"}

FEW, WORST = 10, 1.5
"""Runs in which a target has to be found for an error to be drawn; largest error shown, pixels."""


def figures(results: Results, folder: Path) -> list[Path]:
    """One picture, a column for each signal to noise ratio that has run."""
    import matplotlib.pyplot as plt

    found = {
        snr_db: {method: each for method in scene.METHODS if (each := declared(results, method, snr_db)) is not None}
        for snr_db in SNR_DB
    }
    found = {snr_db: methods for snr_db, methods in found.items() if methods}
    if not found:
        return []
    shape = 2, len(found)
    figure, axes = plt.subplots(
        *shape, figsize=(3.7 * len(found) + 0.5, 5.6), sharex=True, sharey="row", layout="constrained", squeeze=False
    )
    frames = np.arange(scene.SCANS)
    for column, (snr_db, methods) in enumerate(found.items()):
        above, below = axes[:, column]
        for method, each in methods.items():
            hits, runs = each.found.sum(axis=0), len(each.found)
            above.fill_between(frames, *binomial_interval(hits, runs), color=COLOURS[method], alpha=0.15, linewidth=0)
            above.plot(frames, hits / runs, color=COLOURS[method], label=LABELS[method])
            error = [
                rmse(each.error[each.found[:, frame], frame]) if hits[frame] >= FEW else np.nan for frame in frames
            ]
            there = (frames >= scene.APPEARS) & (frames < scene.LEAVES)
            below.plot(frames[there], np.array(error)[there], color=COLOURS[method])
        for axis in (above, below):
            axis.axvspan(scene.APPEARS - 0.5, scene.LEAVES - 0.5, color="#000000", alpha=0.06, linewidth=0)
            axis.grid(alpha=0.3)
        above.set(title=f"{snr_db} dB", ylim=(0, 1.02))
        below.set(xlabel="frame", ylim=(0, WORST))
    axes[0, 0].set_ylabel("share of runs that find the target")
    axes[1, 0].set_ylabel("error of the position (pixels)")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    path = folder / "detection.png"
    figure.savefig(path, dpi=80)
    plt.close(figure)
    return [path]
