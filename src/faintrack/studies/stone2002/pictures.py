"""The paper's figures, drawn from the runs."""

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from faintrack.studies.stone2002 import simulation
from faintrack.studies.stone2002.report import finished
from faintrack.studies.study import Results

Draw = Callable[[Any], None]


def figures(results: Results, folder: Path) -> list[Path]:
    """Figures of the paper by its numbers; those of settings that have not run are left out."""
    return [*_surfaces(results, folder)]


def save(folder: Path, name: str, draw: Draw, width: float = 6.4, height: float = 4.2) -> Path:
    """Draw one picture."""
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(width, height), layout="constrained")
    draw(figure)
    path = folder / f"{name}.png"
    figure.savefig(path, dpi=100)
    plt.close(figure)
    return path


def _surfaces(results: Results, folder: Path) -> list[Path]:
    """Figures 4 to 7."""
    data = finished(results, "surfaces")
    if data is None:
        return []
    surface = data.surface.values[0]

    def draw(time: int, figure: Any) -> None:
        axis = figure.add_subplot(projection="3d")
        position, velocity = np.meshgrid(
            np.arange(1, simulation.CELLS + 1), simulation.VELOCITIES.values, indexing="ij"
        )
        height = np.where(np.isfinite(surface[time]), surface[time], np.nan)
        axis.plot_surface(position, velocity, height, cmap="viridis", rstride=1, cstride=1, lw=0)
        truth = simulation.START + simulation.VELOCITY * time
        axis.scatter([truth], [simulation.VELOCITY], [np.nanmax(height) + 3], marker="v", color="#D55E00")
        axis.set(xlabel="position (cell)", ylabel="velocity (cells a scan)", zlabel="log ratio", title=f"t = {time}")
        axis.view_init(30, -65)

    return [
        save(folder, f"figure_{number}", functools.partial(draw, time), height=5)
        for number, time in ((4, 0), (5, 5), (6, 10), (7, 15))
    ]
