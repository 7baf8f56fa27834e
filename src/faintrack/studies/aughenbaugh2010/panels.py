"""The paper's figures 4 to 12, drawn from the runs."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from faintrack.metrics.accuracy import rmse
from faintrack.studies.aughenbaugh2010 import scene
from faintrack.studies.aughenbaugh2010.rows import LABELS, probability, whole
from faintrack.studies.aughenbaugh2010.settings import BEYOND, METHODS, PULSES
from faintrack.studies.panels import BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION, finish, legend_below, picture
from faintrack.studies.study import Results

COLOURS = {
    "guided": BLUE,
    "random1": VERMILION,
    "random5": ORANGE,
    "guided_fine": SKY,
    "random1_fine": PURPLE,
    "reduced": GREEN,
    "cell_particles": GREEN,
    "stationary_birth": ORANGE,
    "unknown_snr": PURPLE,
    "particles": VERMILION,
    "particles_guided": BLACK,
}
DASHED = ("guided_fine", "random1_fine", "reduced", "particles_guided")

WIDEST = {"position": 12.0, "velocity": 16.0}
"""Largest errors shown; km and m/s."""


def figures(results: Results, folder: Path) -> list[Path]:
    """Figures of the paper by its numbers; those of settings that have not run are left out."""
    drawn = []
    for pulse, name in zip(PULSES, ("figure_4_to_7", "figure_8_to_11"), strict=True):
        methods = _ran(results, pulse, METHODS)
        if methods:
            drawn.append(_four(folder / f"{name}.png", pulse, methods))
    reduced = {pulse: _ran(results, pulse, ("guided", "reduced")) for pulse in PULSES}
    if all("reduced" in methods for methods in reduced.values()):
        path = folder / "figure_12.png"
        drawn.append(picture(path, lambda *axes: _sensitivity(axes, reduced), (11, 3.6), columns=2, sharey=True))
    beyond = _ran(results, "fm", ("guided", *BEYOND))
    if len(beyond) > 1:
        drawn.append(_four(folder / "beyond.png", "fm", beyond))
    return drawn


def _ran(results: Results, pulse: str, methods: tuple[str, ...]) -> dict[str, xr.Dataset]:
    """Runs of the methods that have run."""
    settings = {method: whole(results, f"{pulse}_{method}") for method in methods}
    return {method: data for method, data in settings.items() if data is not None}


def _four(path: Path, pulse: str, methods: dict[str, xr.Dataset]) -> Path:
    """Error of the position, its standard deviation, error of the velocity, target probability, over the scans."""
    cell = 2 * scene.POSITION / scene.BASE[0] / 1e3
    panels = (
        ("position error (km)", lambda data: rmse(data.error.values) / 1e3, WIDEST["position"]),
        ("std of position error (km)", lambda data: data.error.values.std(axis=0) / 1e3, WIDEST["position"]),
        ("velocity error (m/s)", lambda data: rmse(data.velocity_error.values), WIDEST["velocity"]),
        ("target probability", lambda data: probability(data).mean(axis=0), 1.02),
    )
    runs = min(data.sizes["run"] for data in methods.values())
    title = f"{pulse.upper()}, {runs} runs or more a method; grey: not in view; dotted: corner of a base cell"

    def draw(*axes: Axes) -> None:
        for axis, (label, read, top) in zip(axes, panels, strict=True):
            for method, data in methods.items():
                _line(axis, method, read(data))
            _shade(axis, pulse)
            finish(axis, ylabel=label, ylim=(0, top))
        for above, below in zip(axes[:2], axes[2:], strict=True):
            above.axhline(cell / 2**0.5, color="#555555", linewidth=0.8, linestyle=":")
            below.set_xlabel("scan")
        axes[0].figure.suptitle(title, fontsize=10)
        legend_below(axes[0], 3, fontsize=8)

    return picture(path, draw, (11, 7.4), 2, 2, sharex=True)


def _sensitivity(axes: Sequence[Axes], pulses: dict[str, dict[str, xr.Dataset]]) -> None:
    """Position error with the published swath and with a smaller one."""
    for axis, (pulse, methods) in zip(axes, pulses.items(), strict=True):
        for method, data in methods.items():
            _line(axis, method, rmse(data.error.values) / 1e3)
        _shade(axis, pulse)
        finish(axis, legend={}, title=pulse.upper(), xlabel="scan", ylim=(0, 4))
    axes[0].set_ylabel("position error (km)")


def _line(axis: Axes, method: str, values: np.ndarray) -> None:
    style = "--" if method in DASHED else "-"
    axis.plot(np.arange(1, len(values) + 1), values, style, color=COLOURS[method], linewidth=1.4, label=LABELS[method])


def _shade(axis: Axes, pulse: str) -> None:
    """Grey where the target is not in view."""
    seen = scene.in_view(pulse)
    for number in np.flatnonzero(~seen) + 1:
        axis.axvspan(number - 0.5, number + 0.5, color=BLACK, alpha=0.1, linewidth=0)
    axis.set_xlim(1, len(seen))
