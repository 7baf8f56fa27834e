"""Pictures of a study: panels in lines and columns, written beside and renamed.

A study's `panels` module says what is drawn; how a picture is laid out and kept, how shares and intervals look, and the
colours, which people who see colours otherwise can tell apart, are the same for all.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from faintrack.metrics.intervals import binomial_interval
from faintrack.studies.study import Row

BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"
BLACK = "#000000"
COLOURS = BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY
"""Of curves one after the other."""

Panel = tuple[str, dict[str, Any], Callable[[Axes], None]]
"""Title, options of its axes (such as a projection), and what draws it."""


def picture(
    path: Path,
    draw: Callable[..., None],
    size: tuple[float, float],
    lines: int = 1,
    columns: int = 1,
    dpi: int = 80,
    **shared: Any,
) -> Path:
    """Draw axes of one kind.

    Parameters
    ----------
    path : of the picture, a PNG file.
    draw : takes the axes, line by line.
    size : width and height; inches.
    lines, columns : of axes.
    dpi : dots an inch.
    shared : which axes share their ends, as `matplotlib.figure.Figure.subplots` takes it.
    """
    figure = Figure(figsize=size, layout="constrained")
    draw(*figure.subplots(lines, columns, squeeze=False, **shared).flat)
    return _keep(figure, path, dpi)


def mosaic(path: Path, panels: Sequence[Panel], columns: int) -> Path:
    """Draw panels of many kinds, line by line."""
    lines = -(-len(panels) // columns)
    figure = Figure(figsize=(3.4 * columns + 1, 3.2 * lines + 0.4), layout="constrained")
    for number, (title, options, draw) in enumerate(panels):
        axis = figure.add_subplot(lines, columns, number + 1, **options)
        draw(axis)
        axis.set_title(title, fontsize=10)
    return _keep(figure, path, 80)


def _keep(figure: Figure, path: Path, dpi: int) -> Path:
    beside = path.with_name(f".{path.name}.part")
    figure.savefig(beside, format="png", dpi=dpi)
    return beside.replace(path)


def finish(axis: Axes, legend: dict[str, Any] | None = None, **labels: Any) -> None:
    """Labels and ends, a grid, and a legend where its options are given."""
    axis.set(**labels)
    axis.grid(alpha=0.3)
    if legend is not None:
        axis.legend(**{"fontsize": 8, **legend})


def legend_below(axis: Axes, columns: int, **options: Any) -> None:
    """Legend of one of the axes, below all of them."""
    handles, labels = axis.get_legend_handles_labels()
    axis.figure.legend(handles, labels, loc="outside lower center", ncols=columns, **options)


def draw_share(axis: Axes, at: ArrayLike, hits: np.ndarray, runs: ArrayLike, colour: str, **line: Any) -> None:
    """Shares of runs as a line, their intervals as a band around it."""
    axis.plot(at, hits / np.asarray(runs), color=colour, **line)
    axis.fill_between(at, *binomial_interval(hits, runs), color=colour, alpha=0.2, lw=0)


def draw_rows(axis: Axes, at: Sequence[float], rows: Sequence[Row], colour: str, label: str) -> None:
    """Rows as points, their intervals as error bars."""
    ours = np.array([row.ours for row in rows], float)
    bounds = np.array([[np.nan if bound is None else bound for bound in row.interval] for row in rows], float)
    axis.errorbar(at, ours, np.abs(bounds.T - ours), fmt="-o", color=colour, ms=4, lw=1.2, capsize=2, label=label)
