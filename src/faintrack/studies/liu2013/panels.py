"""The paper's figures 1 to 4, drawn from the runs, and what goes beyond them."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from faintrack.studies.liu2013 import scene
from faintrack.studies.liu2013.report import LABELS, bound, declared, methods, probabilities, squares
from faintrack.studies.liu2013.settings import BIRTHS, DETECTION, FALSE, PARTICLES
from faintrack.studies.study import Results

COLOURS = {"particle": "#0072B2", "bernoulli": "#009E73", "ipda": "#D55E00", "immpda": "#CC79A7"}
TRUTH, GREY = "#000000", "#999999"

THRESHOLDS = np.concatenate([np.geomspace(1e-6, 0.1, 60), np.linspace(0.1, 0.9, 60), 1 - np.geomspace(0.1, 1e-6, 60)])
"""Of declaration, along the receiver operating curves."""


def figures(results: Results, folder: Path) -> list[Path]:
    """Figures of the paper by its numbers; those of settings that have not run are left out."""
    start = list(methods(results, "start"))
    drawn = []
    if start:
        run = start[-1][2].isel(run=0)
        drawn = [
            _save(folder / "figure_1.png", 2, lambda axes: _bearings(axes, run), share=True),
            _save(folder / "figure_2.png", 1, lambda axes: _paths(axes[0], run)),
            _save(folder / "figure_3.png", 2, lambda axes: _existence(axes, start)),
            _save(folder / "figure_4.png", 1, lambda axes: _errors(axes[0], start)),
        ]
    curves = {name: list(methods(results, name)) for name in BIRTHS}
    curves = {name: found for name, found in curves.items() if found}
    if curves:
        drawn.append(_save(folder / "roc.png", len(curves), lambda axes: _operating(axes, curves)))
    influence: list[tuple[str, list[float], list[str]]] = [
        ("false bearings a scan", [1, int(scene.FALSE_PER_SCAN), 20], ["false_1", "start", "false_20"]),
        ("probability of detection", [0.7, 0.9, 1.0], ["detection_70", "detection_90", "start"]),
    ]
    names = {*(f"false_{value}" for value in FALSE), *(f"detection_{value}" for value in DETECTION)}
    if all(any(True for _ in methods(results, name)) for name in names):
        drawn.append(_save(folder / "influence.png", 2, lambda axes: _influence(axes, results, influence)))
    if start and all(any(True for _ in methods(results, f"particles_{count}")) for count in PARTICLES):
        drawn.append(_save(folder / "particles.png", 2, lambda axes: _particles(axes, results)))
    return drawn


def _save(path: Path, columns: int, draw: Callable[[list[Axes]], None], share: bool = False) -> Path:
    figure = Figure(figsize=(5 * columns + 1, 4.2), layout="constrained")
    draw(list(figure.subplots(1, columns, squeeze=False, sharey=share)[0]))
    figure.savefig(path, dpi=80)
    return path


def _bearings(axes: list[Axes], run: xr.Dataset) -> None:
    """Figure 1: the bearings of a run, with the target's joined and without."""
    observer = scene.observer()
    there, present = run.there.values, scene.present()
    true = np.arctan2(run.y.values - np.asarray(observer.y), run.x.values - np.asarray(observer.x))
    nearest = np.where(there, np.abs(run.bearing.values - true[:, None]), np.inf).argmin(axis=1)
    scan, entry = np.nonzero(there)
    for axis in axes:
        axis.plot(scene.TIME[scan], np.degrees(run.bearing.values[scan, entry]), "o", color=GREY, ms=4)
        axis.set(xlabel="time (s)", xlim=(0, scene.SCANS + 1), ylim=(-180, 180), yticks=range(-180, 181, 90))
        axis.grid(alpha=0.3)
    found = np.degrees(run.bearing.values[np.arange(scene.SCANS), nearest])
    axes[0].plot(scene.TIME[present], found[present], "-o", color=COLOURS["particle"], ms=4, label="the target's")
    axes[0].set(title="who sent them", ylabel="bearing, anticlockwise from east (degree)")
    axes[0].legend(fontsize=8)
    axes[1].set_title("what is received")


def _paths(axis: Axes, run: xr.Dataset) -> None:
    """Figure 2: observer and target."""
    observer, present = scene.observer(), scene.present()
    for name, x, y, colour in (
        ("observer", observer.x, observer.y, GREY),
        ("target", run.x.values[present], run.y.values[present], COLOURS["ipda"]),
    ):
        axis.plot(x, y, "-o", color=colour, ms=2, label=name)
        axis.plot(x[0], y[0], "o", color=colour, ms=8, mfc="none")
    axis.set(xlabel="east (m)", ylabel="north (m)", aspect="equal", title="circles: where they start")
    axis.grid(alpha=0.3)
    axis.legend(fontsize=8)


def _existence(axes: list[Axes], start: list[tuple[str, str, xr.Dataset]]) -> None:
    """Figure 3: mean existence over the runs."""
    for axis, form, title in zip(axes, ("", "_full"), ("published likelihood", "full likelihood"), strict=True):
        axis.step(scene.TIME, scene.present(), where="mid", color=TRUTH, lw=1, ls=":", label="truth")
        for kind, data in ((kind, data) for kind, of, data in start if of == form):
            chance = 0.5 * (1 + np.tanh(data.log_odds.values / 2))
            axis.plot(scene.TIME, chance.mean(axis=0), "-o", color=COLOURS[kind], ms=3, lw=1.3, label=LABELS[kind])
        axis.set(xlabel="time (s)", ylim=(-0.02, 1.05), xlim=(1, scene.SCANS), title=title)
        axis.grid(alpha=0.3)
    axes[0].set_ylabel(f"existence, mean of {start[0][2].sizes['run']} runs")
    axes[0].legend(fontsize=8, loc="lower center")


def _errors(axis: Axes, start: list[tuple[str, str, xr.Dataset]]) -> None:
    """Figure 4: root mean square error of the position, and its bound."""
    time = scene.TIME[scene.present()]
    for kind, data in ((kind, data) for kind, form, data in start if not form):
        found = squares(data)[:, scene.present()]
        heard = ~np.isnan(found).all(axis=0)
        rms = np.full(len(time), np.nan)
        rms[heard] = np.sqrt(np.nanmean(found[:, heard], axis=0))
        axis.plot(time, rms, "-o", color=COLOURS[kind], ms=3, lw=1.3, label=LABELS[kind])
    alone, among = bound(start[0][2])
    axis.plot(time, alone, color=TRUTH, lw=1.3, label="bound, bearing known")
    axis.plot(time, among, "--", color=TRUTH, lw=1.3, label="bound, among false bearings")
    axis.set(xlabel="time (s)", ylabel="RMS error of the position (m)", ylim=(0, None), title="published likelihood")
    axis.grid(alpha=0.3)
    axis.legend(fontsize=8)


def _operating(axes: list[Axes], curves: dict[str, list[tuple[str, str, xr.Dataset]]]) -> None:
    """Detections against false alarms as the threshold of declaration varies."""
    titles = {"start": "births about the start", "region": "births over the region", "along": "births along bearings"}
    for axis, (births, found) in zip(axes, curves.items(), strict=True):
        for kind, form, data in found:
            points = np.array([probabilities(declared(data, threshold)) for threshold in THRESHOLDS])
            style = "-" if form else "--"
            axis.plot(*points.T, style, color=COLOURS[kind], lw=1.3, label=LABELS[kind] if form else None)
            axis.plot(*probabilities(declared(data)), "o", color=COLOURS[kind], ms=5, mfc="none" if not form else None)
        axis.set(xscale="log", xlim=(1e-4, 1), ylim=(0, 1.02), xlabel="scans with a false alarm (share)")
        axis.set_title(titles[births], fontsize=10)
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("scans with a detection (share)")
    axes[0].legend(fontsize=8, title="solid: full likelihood, dots: threshold 0.6", title_fontsize=8, loc="lower right")


def _influence(axes: list[Axes], results: Results, influence: list[tuple[str, list[float], list[str]]]) -> None:
    """Detections and false alarms as the sensor gets worse."""
    for axis, (label, values, names) in zip(axes, influence, strict=True):
        series: dict[tuple[str, str], list[np.ndarray]] = {}
        for name in names:
            for kind, form, data in methods(results, name):
                series.setdefault((kind, form), []).append(probabilities(declared(data)))
        for (kind, form), points in series.items():
            false, found = np.array(points).T
            style = "-" if form else "--"
            axis.plot(values, found, style, marker="o", color=COLOURS[kind], ms=4, label=LABELS[kind] if form else None)
            axis.plot(values, false, style, marker="v", color=COLOURS[kind], ms=4)
        axis.set(xlabel=label, ylim=(0, 1.02))
        axis.grid(alpha=0.3)
    axes[0].set(xscale="log", xticks=[1, 5, 20], xticklabels=["1", "5", "20"])
    axes[0].set_ylabel("share of scans: detections (circles), false alarms (triangles)", fontsize=8)
    axes[0].legend(fontsize=8, title="solid: full, dashed: published", title_fontsize=8, loc="center")


def _particles(axes: list[Axes], results: Results) -> None:
    """What more particles give."""
    counts = sorted((*PARTICLES, scene.PARTICLES))
    for kind in ("particle", "bernoulli"):
        told, wrong = [], []
        for count in counts:
            name = "start" if count == scene.PARTICLES else f"particles_{count}"
            data = next(data for of, form, data in methods(results, name) if of == kind and form == "_full")
            told.append(probabilities(declared(data))[1])
            wrong.append(np.sqrt(np.nanmean(squares(data)[:, scene.LAST - 13 : scene.LAST])))
        for axis, values in zip(axes, (told, wrong), strict=True):
            axis.plot(counts, values, "-o", color=COLOURS[kind], ms=4, label=LABELS[kind])
    for axis, label in zip(axes, ("scans with a detection (share)", "RMS error, scans 20 to 32 (m)"), strict=True):
        axis.set(xscale="log", xlabel="particles", ylabel=label)
        axis.grid(alpha=0.3)
    axes[0].legend(fontsize=8, title="full likelihood", title_fontsize=8)
