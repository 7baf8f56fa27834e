"""Probability of detection and error of the position, frame by frame."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from faintrack.metrics.accuracy import rmse
from faintrack.studies.davey2008 import runs, scene
from faintrack.studies.davey2008.rows import LABELS, Declared, declared
from faintrack.studies.davey2008.settings import SNR_DB
from faintrack.studies.panels import BLACK, BLUE, GREEN, ORANGE, VERMILION, draw_share, finish, legend_below, picture
from faintrack.studies.study import Results

COLOURS = {"grid": BLUE, "viterbi": ORANGE, "particle": VERMILION, "pmht": GREEN}

FEW, WORST = 10, 1.5
"""Runs in which a target has to be found for an error to be drawn; largest error shown, pixels."""

FRAMES = np.arange(scene.SCANS)


def figures(results: Results, folder: Path) -> list[Path]:
    """One picture, a column for each signal to noise ratio that has run."""
    tables = {snr_db: {method: declared(results, method, snr_db) for method in runs.METHODS} for snr_db in SNR_DB}
    ran = {
        f"{snr_db} dB": {method: track for method, track in methods.items() if track is not None}
        for snr_db, methods in tables.items()
        if any(methods.values())
    }
    if not ran:
        return []

    def draw(*axes: Axes) -> None:
        above, below = axes[: len(ran)], axes[len(ran) :]
        for upper, lower, (title, methods) in zip(above, below, ran.items(), strict=True):
            _column(upper, lower, title, methods)
        above[0].set_ylabel("share of runs that find the target")
        below[0].set_ylabel("error of the position (pixels)")
        legend_below(above[0], len(LABELS))

    size = 3.7 * len(ran) + 0.5, 5.6
    return [picture(folder / "detection.png", draw, size, 2, len(ran), sharex=True, sharey="row")]


def _column(above: Axes, below: Axes, title: str, methods: dict[str, Declared]) -> None:
    seen = (FRAMES >= scene.APPEARS) & (FRAMES < scene.LEAVES)
    for method, track in methods.items():
        hits = track.right.sum(axis=0)
        draw_share(above, FRAMES, hits, len(track.right), COLOURS[method], label=LABELS[method])
        errors = [rmse(track.error[track.right[:, frame], frame]) if hits[frame] >= FEW else np.nan for frame in FRAMES]
        below.plot(FRAMES[seen], np.array(errors)[seen], color=COLOURS[method])
    for axis in (above, below):
        axis.axvspan(scene.APPEARS - 0.5, scene.LEAVES - 0.5, color=BLACK, alpha=0.06, linewidth=0)
    finish(above, title=title, ylim=(0, 1.02))
    finish(below, xlabel="frame", ylim=(0, WORST))
