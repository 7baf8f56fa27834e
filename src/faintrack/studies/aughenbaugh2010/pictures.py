"""The paper's figures 4 to 12, drawn from the runs."""

from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from faintrack.metrics.accuracy import rmse
from faintrack.studies.aughenbaugh2010 import scene
from faintrack.studies.aughenbaugh2010.report import LABELS, probability, whole
from faintrack.studies.aughenbaugh2010.settings import BEYOND, METHODS, PULSES
from faintrack.studies.study import Results

COLOURS = {
    "guided": "#0072B2",
    "random1": "#D55E00",
    "random5": "#E69F00",
    "guided_fine": "#56B4E9",
    "random1_fine": "#CC79A7",
    "reduced": "#009E73",
    "cell_particles": "#009E73",
    "stationary_birth": "#E69F00",
    "unknown_snr": "#CC79A7",
    "particles": "#D55E00",
    "particles_guided": "#000000",
}
DASHED = ("guided_fine", "random1_fine", "reduced", "particles_guided")

WIDEST = {"position": 12.0, "velocity": 16.0}
"""Largest errors shown; km and m/s."""


def figures(results: Results, folder: Path) -> list[Path]:
    """Figures of the paper by its numbers; those of settings that have not run are left out."""
    drawn = []
    for pulse, name in zip(PULSES, ("figure_4_to_7", "figure_8_to_11"), strict=True):
        data = _found(results, pulse, METHODS)
        if data:
            drawn.append(_four(folder / f"{name}.png", pulse, data))
    reduced = {pulse: _found(results, pulse, ("guided", "reduced")) for pulse in PULSES}
    if all("reduced" in data for data in reduced.values()):
        drawn.append(_sensitivity(folder / "figure_12.png", reduced))
    beyond = _found(results, "fm", ("guided", *BEYOND))
    if len(beyond) > 1:
        drawn.append(_four(folder / "beyond.png", "fm", beyond))
    return drawn


def _found(results: Results, pulse: str, methods: tuple[str, ...]) -> dict[str, xr.Dataset]:
    found = {method: whole(results, f"{pulse}_{method}") for method in methods}
    return {method: data for method, data in found.items() if data is not None}


def _four(path: Path, pulse: str, methods: dict[str, xr.Dataset]) -> Path:
    """Error of the position, its standard deviation, error of the velocity, target probability, over the scans."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, 2, figsize=(11, 7.4), sharex=True, layout="constrained")
    cell = 2 * scene.POSITION / scene.BASE[0] / 1e3
    panels = (
        ("position error (km)", lambda data: rmse(data.error.values) / 1e3, WIDEST["position"]),
        ("std of position error (km)", lambda data: data.error.values.std(axis=0) / 1e3, WIDEST["position"]),
        ("velocity error (m/s)", lambda data: rmse(data.velocity_error.values), WIDEST["velocity"]),
        ("target probability", lambda data: probability(data).mean(axis=0), 1.02),
    )
    for axis, (label, read, top) in zip(axes.ravel(), panels, strict=True):
        for method, data in methods.items():
            _line(axis, method, read(data))
        _shade(axis, pulse)
        axis.set(ylabel=label, ylim=(0, top))
    for axis in axes[0]:
        axis.axhline(cell / 2**0.5, color="#555555", linewidth=0.8, linestyle=":")
    for axis in axes[1]:
        axis.set_xlabel("scan")
    runs = min(data.sizes["run"] for data in methods.values())
    title = f"{pulse.upper()}, {runs} runs or more a method; grey: not in view; dotted: corner of a base cell"
    figure.suptitle(title, fontsize=10)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=8)
    figure.savefig(path, dpi=80)
    plt.close(figure)
    return path


def _sensitivity(path: Path, pulses: dict[str, dict[str, xr.Dataset]]) -> Path:
    """Position error with the published swath and with a smaller one."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(11, 3.6), sharey=True, layout="constrained")
    for axis, (pulse, methods) in zip(axes, pulses.items(), strict=True):
        for method, data in methods.items():
            _line(axis, method, rmse(data.error.values) / 1e3)
        _shade(axis, pulse)
        axis.set(title=pulse.upper(), xlabel="scan", ylim=(0, 4))
        axis.legend(fontsize=8)
    axes[0].set_ylabel("position error (km)")
    figure.savefig(path, dpi=80)
    plt.close(figure)
    return path


def _line(axis: Axes, method: str, values: np.ndarray) -> None:
    style = "--" if method in DASHED else "-"
    axis.plot(np.arange(1, len(values) + 1), values, style, color=COLOURS[method], linewidth=1.4, label=LABELS[method])


def _shade(axis: Axes, pulse: str) -> None:
    """Grey where the target is not in view."""
    seen = scene.in_view(pulse)
    for number in np.flatnonzero(~seen) + 1:
        axis.axvspan(number - 0.5, number + 0.5, color="#000000", alpha=0.1, linewidth=0)
    axis.set_xlim(1, len(seen))
    axis.grid(alpha=0.3)
