"""GOSPA over time, and one run beside the truth."""

from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from faintrack.studies.panels import BLACK, BLUE, VERMILION, finish, legend_below, picture
from faintrack.studies.study import Results, ran
from faintrack.studies.superposed import scene
from faintrack.studies.superposed.rows import FOUND, LABELS, parts

COLOURS = {1: VERMILION, 2: BLUE}


def figures(results: Results, folder: Path) -> list[Path]:
    """Two pictures: root mean square over the runs, scan by scan; the first run of each setting."""
    finished = ran(results, {1: "births1", 2: "births2"})
    if not finished:
        return []
    time = np.arange(1, scene.SCANS + 1)

    def draw_distance(axis: Axes) -> None:
        for births, run in finished.items():
            rms = np.sqrt(parts(run).sum(axis=2).mean(axis=0))
            axis.plot(time, rms, color=COLOURS[births], label=LABELS[births])
        finish(axis, {}, xlabel="time (s)", ylabel="RMS GOSPA (m)", ylim=(0, None))

    def draw_runs(*axes: Axes) -> None:
        for axis, (births, run) in zip(axes, finished.items(), strict=True):
            _draw_run(axis, run)
            finish(
                axis, title=LABELS[births], xlabel="x (m)", xlim=(0, scene.SIDE), ylim=(0, scene.SIDE), aspect="equal"
            )
        axes[0].set_ylabel("y (m)")
        legend_below(axes[0], 3)

    return [
        picture(folder / "gospa.png", draw_distance, (6.5, 3.6)),
        picture(folder / "run.png", draw_runs, (4.4 * len(finished), 5.3), 1, len(finished), sharey=True),
    ]


def _draw_run(axis: Axes, run: xr.Dataset) -> None:
    whole, network = scene.truth(), scene.network()
    axis.plot(np.asarray(network.x), np.asarray(network.y), ".", color=BLACK, alpha=0.2, ms=3, label="sensors")
    lines = axis.plot(whole.x, whole.y, color=BLACK, lw=0.8)
    lines[0].set_label("targets")
    first = run.isel(run=0)
    found = first.existence.values > FOUND
    axis.plot(first.x.values[found], first.y.values[found], "o", color=VERMILION, ms=2.5, alpha=0.6, label="found")
