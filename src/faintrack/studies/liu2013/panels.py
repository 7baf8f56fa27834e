"""The paper's figures 1 to 4, drawn from the runs, and what goes beyond them."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from faintrack.studies.liu2013 import scene
from faintrack.studies.liu2013.rows import LABELS, bound, declared, methods, probabilities, squares
from faintrack.studies.liu2013.settings import BIRTHS, DETECTION, FALSE, PARTICLES
from faintrack.studies.panels import BLACK, BLUE, GREEN, PURPLE, VERMILION, finish, picture
from faintrack.studies.study import Results

COLOURS = {"particle": BLUE, "bernoulli": GREEN, "ipda": VERMILION, "immpda": PURPLE}
GREY = "#999999"

Method = tuple[str, str, xr.Dataset]
"""Kind, form, and runs."""

THRESHOLDS = np.concatenate([np.geomspace(1e-6, 0.1, 60), np.linspace(0.1, 0.9, 60), 1 - np.geomspace(0.1, 1e-6, 60)])
"""Of declaration, along the receiver operating curves."""


def figures(results: Results, folder: Path) -> list[Path]:
    """Figures of the paper by its numbers; those of settings that have not run are left out."""
    start = list(methods(results, "start"))
    drawn: list[Path] = []

    def save(name: str, columns: int, draw: Callable[..., None], sharey: bool = False) -> None:
        size = 5 * columns + 1, 4.2
        drawn.append(picture(folder / f"{name}.png", draw, size, columns=columns, sharey=sharey))

    if start:
        run = start[-1][2].isel(run=0)
        save("figure_1", 2, lambda *axes: _bearings(axes, run), sharey=True)
        save("figure_2", 1, lambda axis: _paths(axis, run))
        save("figure_3", 2, lambda *axes: _existence(axes, start))
        save("figure_4", 1, lambda axis: _errors(axis, start))
    settings = {name: list(methods(results, name)) for name in BIRTHS}
    curves = {name: ran for name, ran in settings.items() if ran}
    if curves:
        save("roc", len(curves), lambda *axes: _operating(axes, curves))
    if _have_run(results, [*(f"false_{value}" for value in FALSE), *(f"detection_{value}" for value in DETECTION)]):
        save("influence", 2, lambda *axes: _influence(axes, results))
    if start and _have_run(results, [f"particles_{count}" for count in PARTICLES]):
        save("particles", 2, lambda *axes: _particles(axes, results))
    return drawn


def _have_run(results: Results, names: list[str]) -> bool:
    return all(any(True for _ in methods(results, name)) for name in names)


def _bearings(axes: Sequence[Axes], run: xr.Dataset) -> None:
    """Figure 1: the bearings of a run, with the target's joined and without."""
    observer = scene.observer()
    reported, present = run.there.values, scene.present()
    true = np.arctan2(run.y.values - np.asarray(observer.y), run.x.values - np.asarray(observer.x))
    nearest = np.where(reported, np.abs(run.bearing.values - true[:, None]), np.inf).argmin(axis=1)
    scan, entry = np.nonzero(reported)
    ends: dict[str, Any] = {"xlim": (0, scene.SCANS + 1), "ylim": (-180, 180), "yticks": range(-180, 181, 90)}
    for axis in axes:
        axis.plot(scene.TIME[scan], np.degrees(run.bearing.values[scan, entry]), "o", color=GREY, ms=4)
        finish(axis, xlabel="time (s)", **ends)
    targets = np.degrees(run.bearing.values[np.arange(scene.SCANS), nearest])
    axes[0].plot(scene.TIME[present], targets[present], "-o", color=COLOURS["particle"], ms=4, label="the target's")
    finish(axes[0], {}, title="who sent them", ylabel="bearing, anticlockwise from east (degree)")
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
    finish(axis, {}, xlabel="east (m)", ylabel="north (m)", aspect="equal", title="circles: where they start")


def _existence(axes: Sequence[Axes], start: list[Method]) -> None:
    """Figure 3: mean existence over the runs."""
    for axis, form, title in zip(axes, ("", "_full"), ("published likelihood", "full likelihood"), strict=True):
        axis.step(scene.TIME, scene.present(), where="mid", color=BLACK, lw=1, ls=":", label="truth")
        for kind, data in ((kind, data) for kind, of, data in start if of == form):
            chance = 0.5 * (1 + np.tanh(data.log_odds.values / 2))
            axis.plot(scene.TIME, chance.mean(axis=0), "-o", color=COLOURS[kind], ms=3, lw=1.3, label=LABELS[kind])
        finish(axis, xlabel="time (s)", ylim=(-0.02, 1.05), xlim=(1, scene.SCANS), title=title)
    axes[0].set_ylabel(f"existence, mean of {start[0][2].sizes['run']} runs")
    axes[0].legend(fontsize=8, loc="lower center")


def _errors(axis: Axes, start: list[Method]) -> None:
    """Figure 4: root mean square error of the position, and its bound."""
    time = scene.TIME[scene.present()]
    for kind, data in ((kind, data) for kind, form, data in start if not form):
        errors = squares(data)[:, scene.present()]
        known = ~np.isnan(errors).all(axis=0)
        rms = np.full(len(time), np.nan)
        rms[known] = np.sqrt(np.nanmean(errors[:, known], axis=0))
        axis.plot(time, rms, "-o", color=COLOURS[kind], ms=3, lw=1.3, label=LABELS[kind])
    alone, among = bound(start[0][2])
    axis.plot(time, alone, color=BLACK, lw=1.3, label="bound, bearing known")
    axis.plot(time, among, "--", color=BLACK, lw=1.3, label="bound, among false bearings")
    labels = {"xlabel": "time (s)", "ylabel": "RMS error of the position (m)", "title": "published likelihood"}
    finish(axis, {}, ylim=(0, None), **labels)


def _style(kind: str, form: str) -> dict[str, Any]:
    """A method's line: solid and named for the full likelihood, dashed for the published one."""
    return {"color": COLOURS[kind], "ls": "-" if form else "--", "label": LABELS[kind] if form else None}


def _operating(axes: Sequence[Axes], curves: dict[str, list[Method]]) -> None:
    """Detections against false alarms as the threshold of declaration varies."""
    titles = {"start": "births about the start", "region": "births over the region", "along": "births along bearings"}
    for axis, (births, ran) in zip(axes, curves.items(), strict=True):
        for kind, form, data in ran:
            points = np.array([probabilities(declared(data, threshold)) for threshold in THRESHOLDS])
            axis.plot(*points.T, lw=1.3, **_style(kind, form))
            axis.plot(*probabilities(declared(data)), "o", color=COLOURS[kind], ms=5, mfc="none" if not form else None)
        finish(axis, xscale="log", xlim=(1e-4, 1), ylim=(0, 1.02), xlabel="scans with a false alarm (share)")
        axis.set_title(titles[births], fontsize=10)
    axes[0].set_ylabel("scans with a detection (share)")
    axes[0].legend(fontsize=8, title="solid: full likelihood, dots: threshold 0.6", title_fontsize=8, loc="lower right")


def _influence(axes: Sequence[Axes], results: Results) -> None:
    """Detections and false alarms as the sensor gets worse."""
    false: dict[float, str] = {1: "false_1", scene.FALSE_PER_SCAN: "start", 20: "false_20"}
    detection = {0.7: "detection_70", 0.9: "detection_90", 1.0: "start"}
    labels = "false bearings a scan", "probability of detection"
    for axis, label, settings in zip(axes, labels, (false, detection), strict=True):
        series: dict[tuple[str, str], list[np.ndarray]] = {}
        for name in settings.values():
            for kind, form, data in methods(results, name):
                series.setdefault((kind, form), []).append(probabilities(declared(data)))
        for (kind, form), points in series.items():
            alarms, detections = np.array(points).T
            style = _style(kind, form)
            axis.plot(list(settings), detections, marker="o", ms=4, **style)
            axis.plot(list(settings), alarms, marker="v", ms=4, **style | {"label": None})
        finish(axis, xlabel=label, ylim=(0, 1.02))
    axes[0].set(xscale="log", xticks=[1, 5, 20], xticklabels=["1", "5", "20"])
    axes[0].set_ylabel("share of scans: detections (circles), false alarms (triangles)", fontsize=8)
    axes[0].legend(fontsize=8, title="solid: full, dashed: published", title_fontsize=8, loc="center")


def _particles(axes: Sequence[Axes], results: Results) -> None:
    """What more particles give."""
    counts = sorted((*PARTICLES, scene.PARTICLES))
    names = ["start" if count == scene.PARTICLES else f"particles_{count}" for count in counts]
    for kind in ("particle", "bernoulli"):
        ran = [
            next(data for of, form, data in methods(results, name) if of == kind and form == "_full") for name in names
        ]
        detections = [probabilities(declared(data))[1] for data in ran]
        errors = [np.sqrt(np.nanmean(squares(data)[:, scene.LAST - 13 : scene.LAST])) for data in ran]
        for axis, values in zip(axes, (detections, errors), strict=True):
            axis.plot(counts, values, "-o", color=COLOURS[kind], ms=4, label=LABELS[kind])
    for axis, label in zip(axes, ("scans with a detection (share)", "RMS error, scans 20 to 32 (m)"), strict=True):
        finish(axis, xscale="log", xlabel="particles", ylabel=label)
    axes[0].legend(fontsize=8, title="full likelihood", title_fontsize=8)
