"""Figures 2 and 3 of the paper, and the two ways to a threshold."""

import functools
from collections.abc import Callable
from pathlib import Path

import numpy as np
from jaxtyping import Bool
from matplotlib.axes import Axes
from scipy.special import expit, logit

from faintrack.metrics.accuracy import rmse
from faintrack.metrics.thresholds import declaration_probability
from faintrack.studies.bosser2022 import measures
from faintrack.studies.bosser2022.measures import FALSE_TRACK_PROBABILITY, LABELS, PRESENT
from faintrack.studies.bosser2022.scene import LOBE, METHODS, approach_snr_db
from faintrack.studies.bosser2022.settings import SNR_DB, scenario_name
from faintrack.studies.panels import BLACK, BLUE, ORANGE, PURPLE, draw_share, picture
from faintrack.studies.study import Results, finished

COLOURS = {"wgsml": BLUE, "lwl": ORANGE, "cfar": BLACK, "integrated": PURPLE}
MARKERS = {"wgsml": "o", "lwl": "s", "cfar": "^", "integrated": "D"}

FEW = 10
"""Runs that have to detect the target for an error to be drawn."""

IN_APPROACH = np.ones(len(approach_snr_db()), bool)
"""Scans of scenario II with a target: all."""

Levels = dict[str, float]


def figures(results: Results, folder: Path) -> list[Path]:
    """Figures of the paper by its numbers; those of settings that have not run are left out."""
    if finished(results, "noise") is None:
        return []
    pictures: dict[str, tuple[str, Callable[..., None]]] = {
        "figure_2a": ("noise", _detection),
        "figure_2b": (scenario_name(-27), functools.partial(_ospa, setting=scenario_name(-27), present=PRESENT)),
        "figure_2c": ("noise", _bearing),
        "figure_3a": ("approach", _approach),
        "figure_3b": ("approach", functools.partial(_ospa, setting="approach", present=IN_APPROACH)),
        "thresholds": ("noise", _thresholds),
    }
    given = {"results": results, "level": measures.levels(results)}
    return [
        picture(folder / f"{name}.png", functools.partial(draw, **given), (6.4, 4.2), dpi=120)
        for name, (setting, draw) in pictures.items()
        if finished(results, setting) is not None
    ]


def _detection(axis: Axes, results: Results, level: Levels) -> None:
    """Share of runs detected against the SNR."""
    best = {snr_db: measures.best_odds(data) for snr_db, data in measures.scenario_one(results).items()}
    runs = np.array([len(odds) for odds in best.values()])
    for column, method in enumerate(METHODS):
        hits = np.array([np.sum(odds[:, column] > level[method]) for odds in best.values()])
        draw_share(axis, list(best), hits, runs, COLOURS[method], marker=MARKERS[method], ms=4, label=LABELS[method])
    axis.axhline(0.5, color="0.7", lw=0.8)
    axis.set(xlabel="SNR (dB)", ylabel="probability of detection", ylim=(0, 1.02))
    axis.legend()


def _bearing(axis: Axes, results: Results, level: Levels) -> None:
    """Error of the bearing at detection against the SNR, and what the tracker takes it to be."""
    ran = measures.scenario_one(results)
    for method in METHODS:
        first = {snr_db: measures.at_detection(data, method, level[method]) for snr_db, data in ran.items()}
        points = [
            (snr_db, np.degrees(rmse(errors)), np.degrees(rmse(stds)))
            for snr_db, (errors, stds) in first.items()
            if len(errors) >= FEW
        ]
        if points:
            snr_db, error, std = np.array(points).T
            axis.plot(snr_db, error, color=COLOURS[method], marker=MARKERS[method], ms=4, label=LABELS[method])
            axis.plot(snr_db, std, color=COLOURS[method], ls="--", lw=1)
    axis.axhline(np.degrees(LOBE), color="0.7", lw=0.8)
    axis.annotate("main lobe", (SNR_DB[-1], np.degrees(LOBE)), ha="right", va="bottom", color="0.4")
    axis.set(xlabel="SNR (dB)", ylabel="bearing error at detection (degree)", yscale="log")
    axis.legend(title="dashed: told by the tracker")


def _ospa(axis: Axes, results: Results, level: Levels, setting: str, present: Bool[np.ndarray, " scan"]) -> None:
    """Mean OSPA against time."""
    data = results(setting)
    for method in METHODS:
        mean = np.degrees(measures.ospa(data, method, level[method], present).mean(axis=0))
        axis.plot(np.arange(1, len(mean) + 1), mean, color=COLOURS[method], label=LABELS[method])
    axis.set(xlabel="time (s)", ylabel="mean OSPA, cutoff 180 (degree)")
    axis.legend()


def _approach(axis: Axes, results: Results, level: Levels) -> None:
    """Share of runs of scenario II that are detected by an SNR."""
    data = results("approach")
    for method in METHODS:
        share = np.maximum.accumulate(measures.detected(data, method, level[method]), axis=1).mean(axis=0)
        axis.plot(approach_snr_db(), share, color=COLOURS[method], label=LABELS[method])
    axis.axhline(0.5, color="0.7", lw=0.8)
    axis.set(xlabel="SNR at the earliest detection (dB)", ylabel="share of runs detected", ylim=(0, 1.02))
    axis.legend()


def _thresholds(axis: Axes, results: Results, level: Levels) -> None:
    """Probability of a false track against the threshold, counted and by Wald's identity."""
    highest, odds = results("noise").highest.values, np.linspace(-1, 8, 120)
    for column, method in enumerate(METHODS):
        hits = (highest[:, column][:, None] > odds).sum(axis=0)
        seen = hits > 0
        label = f"{LABELS[method]}, counted"
        draw_share(axis, odds[seen], hits[seen], len(highest), COLOURS[method], label=label)
    for method, drawn in measures.strata(results).items():
        value = np.array([declaration_probability(drawn, float(expit(at)))[0] for at in odds])
        axis.plot(odds, value, color=COLOURS[method], ls="--", label=f"{LABELS[method]}, Wald")
    axis.axhline(FALSE_TRACK_PROBABILITY, color="0.7", lw=0.8)
    ticks = np.array([0.5, 0.9, 0.97, 0.99, 0.999])
    axis.set_xticks(logit(ticks), [f"{tick:g}" for tick in ticks])
    axis.set(xlabel="threshold on existence", ylabel="probability of a false track in 180 s", yscale="log")
    axis.set_ylim(1e-5, 1)
    axis.legend(fontsize=8)
