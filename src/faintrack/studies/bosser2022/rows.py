"""What is read off the runs: thresholds, detection, OSPA, bearing errors; the study's rows and the paper's figures."""

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from jaxtyping import Bool, Float
from scipy.special import expit, logit

from faintrack.errors import InputError
from faintrack.metrics.accuracy import rmse
from faintrack.metrics.intervals import binomial_interval, bootstrap_interval, quantile_interval
from faintrack.metrics.sets import single_ospa
from faintrack.metrics.thresholds import (
    Stratum,
    Threshold,
    counted_threshold,
    declaration_probability,
    wald_threshold,
)
from faintrack.simulation.model import birth_probability
from faintrack.studies.bosser2022.runs import (
    APPEARS,
    LOBE,
    METHODS,
    NOISE_SCANS,
    SCANS,
    VARIANTS,
    approach_snr_db,
    make_filter,
)
from faintrack.studies.bosser2022.settings import SNR_DB, scenario_name
from faintrack.studies.study import Results, Row

FALSE_TRACK_PROBABILITY = 1e-3
"""In 180 scans of noise."""

PAPER: dict[str, dict[str, float]] = {
    "threshold": {"wgsml": 0.968, "lwl": 0.981, "cfar": 0.999},
    "snr50": {"wgsml": -31.0, "lwl": -31.0, "cfar": -27.0},
    "bearing_rmse_deg": {"lwl": 2.12},
}

LABELS = {"wgsml": "WGSML", "lwl": "LWL", "cfar": "CFAR and Kalman filter", "integrated": "noise integrated out"}
COLOURS = {"wgsml": "#0072B2", "lwl": "#E69F00", "cfar": "#000000", "integrated": "#CC79A7"}
MARKERS = {"wgsml": "o", "lwl": "s", "cfar": "^", "integrated": "D"}

BOOTSTRAPS = 400
"""Draws of runs for an interval."""


def rows(results: Results) -> list[Row]:
    """The study's numbers; a setting that has not run leaves its rows out."""
    found: list[Row] = []
    if _load(results, "noise") is None:
        return found
    thresholds = _thresholds(results)
    for method, threshold in thresholds.items():
        found.append(_row("threshold", method, "threshold on existence, by counting", "1", _three(threshold)))
    for method in ("wgsml", "integrated"):
        try:
            by_wald = wald_threshold(_strata(results, method), FALSE_TRACK_PROBABILITY)
        except InputError:
            continue
        found.append(
            Row(
                f"threshold_{method}_wald",
                f"threshold, {LABELS[method]}, by Wald's identity",
                "1",
                PAPER["threshold"].get(method),
                by_wald.value,
                (by_wald.low, by_wald.high),
            )
        )
    levels = {method: float(logit(threshold.value)) for method, threshold in thresholds.items()}
    best = {snr_db: data for snr_db in SNR_DB if (data := _best_odds(results, snr_db)) is not None}
    drawn = _drawn_snr50(results, best)
    for column, method in enumerate(METHODS):
        found.append(
            _row("snr50", method, "SNR at which half of the runs are detected", "dB", _of_draws(drawn[:, column]))
        )
    cost, low, high = _of_draws(drawn[:, METHODS.index("integrated")] - drawn[:, METHODS.index("wgsml")])
    found.append(
        Row("unknown_noise_cost_db", "what not knowing the noise costs in detection", "dB", None, cost, (low, high))
    )
    loud = _load(results, scenario_name(-27))
    if loud is not None:
        found.append(_lag(loud, levels))
    loud = _load(results, scenario_name(-15))
    if loud is not None:
        for method in METHODS:
            errors, _ = _at_detection(loud, method, levels[method])
            value = (None, None, None) if len(errors) < 2 else _bootstrapped(lambda e: np.degrees(rmse(e)), errors)
            found.append(_row("bearing_rmse_deg", method, "bearing error at detection, -15 dB", "degree", value))
    loud = _load(results, "guided_15")
    if loud is not None:
        errors, _ = _at_detection(loud, "wgsml", levels["wgsml"])
        name = "bearing error at detection, -15 dB, WGSML with guided newborn particles"
        value, low, high = _bootstrapped(lambda e: np.degrees(rmse(e)), errors)
        found.append(Row("bearing_rmse_deg_guided", name, "degree", None, value, (low, high)))
    coming = _load(results, "approach")
    if coming is not None:
        for method in METHODS:
            found.append(
                _row(
                    "approach_snr50",
                    method,
                    "SNR by which half of the approaching targets are detected",
                    "dB",
                    _approach_snr50(coming, method, levels[method]),
                )
            )
    found.extend(_variants(results))
    return found


def figures(results: Results, folder: Path) -> list[Path]:
    """Figures 2 and 3 of the paper, and the two ways to a threshold."""
    import matplotlib.pyplot as plt

    drawn: list[Path] = []
    if _load(results, "noise") is None:
        return drawn
    levels = {method: float(logit(threshold.value)) for method, threshold in _thresholds(results).items()}

    def save(name: str, draw: Any, width: float = 6.4) -> None:
        figure, axis = plt.subplots(figsize=(width, 4.2), layout="constrained")
        draw(axis)
        path = folder / f"{name}.png"
        figure.savefig(path, dpi=120)
        plt.close(figure)
        drawn.append(path)

    best = {snr_db: odds for snr_db in SNR_DB if (odds := _best_odds(results, snr_db)) is not None}
    at_detection = {
        snr_db: {method: _at_detection(data, method, levels[method]) for method in METHODS}
        for snr_db in SNR_DB
        if (data := _load(results, scenario_name(snr_db))) is not None
    }

    def detection(axis: Any) -> None:
        for column, method in enumerate(METHODS):
            hits = np.array([np.sum(odds[:, column] > levels[method]) for odds in best.values()])
            runs = np.array([len(odds) for odds in best.values()])
            axis.plot(
                list(best), hits / runs, color=COLOURS[method], marker=MARKERS[method], ms=4, label=LABELS[method]
            )
            axis.fill_between(list(best), *binomial_interval(hits, runs), color=COLOURS[method], alpha=0.2, lw=0)
        axis.axhline(0.5, color="0.7", lw=0.8)
        axis.set(xlabel="SNR (dB)", ylabel="probability of detection", ylim=(0, 1.02))
        axis.legend()

    def bearing(axis: Any) -> None:
        for method in METHODS:
            points = [
                (snr_db, np.degrees(rmse(error)), np.degrees(rmse(std)))
                for snr_db, (error, std) in ((snr_db, found[method]) for snr_db, found in at_detection.items())
                if len(error) >= 10
            ]
            if points:
                snr, found, told = np.array(points).T
                axis.plot(snr, found, color=COLOURS[method], marker=MARKERS[method], ms=4, label=LABELS[method])
                axis.plot(snr, told, color=COLOURS[method], ls="--", lw=1)
        axis.axhline(np.degrees(LOBE), color="0.7", lw=0.8)
        axis.annotate("main lobe", (SNR_DB[-1], np.degrees(LOBE)), ha="right", va="bottom", color="0.4")
        axis.set(xlabel="SNR (dB)", ylabel="bearing error at detection (degree)", yscale="log")
        axis.legend(title="dashed: told by the tracker")

    save("figure_2a", detection)
    loud = _load(results, scenario_name(-27))
    if loud is not None:
        save("figure_2b", lambda axis: _draw_ospa(axis, loud, levels, np.arange(SCANS) >= APPEARS, "time (s)"))
    save("figure_2c", bearing)
    coming = _load(results, "approach")
    if coming is not None:
        snr_db = approach_snr_db()

        def approaching(axis: Any) -> None:
            for method in METHODS:
                share = np.maximum.accumulate(_detected(coming, method, levels[method]), axis=1).mean(axis=0)
                axis.plot(snr_db, share, color=COLOURS[method], label=LABELS[method])
            axis.axhline(0.5, color="0.7", lw=0.8)
            axis.set(xlabel="SNR at the earliest detection (dB)", ylabel="share of runs detected", ylim=(0, 1.02))
            axis.legend()

        save("figure_3a", approaching)
        save("figure_3b", lambda axis: _draw_ospa(axis, coming, levels, np.ones(len(snr_db), bool), "time (s)"))
    save("thresholds", lambda axis: _draw_thresholds(axis, results))
    return drawn


def _draw_ospa(axis: Any, data: xr.Dataset, levels: dict[str, float], present: Any, label: str) -> None:
    for method in METHODS:
        mean = np.degrees(_ospa(data, method, levels[method], present).mean(axis=0))
        axis.plot(np.arange(1, len(mean) + 1), mean, color=COLOURS[method], label=LABELS[method])
    axis.set(xlabel=label, ylabel="mean OSPA, cutoff 180 (degree)")
    axis.legend()


def _draw_thresholds(axis: Any, results: Results) -> None:
    data = _load(results, "noise")
    level = np.linspace(-1, 8, 120)
    if data is not None:
        highest = data.highest.values
        for method in METHODS:
            hits = (highest[:, METHODS.index(method)][:, None] > level).sum(axis=0)
            seen = hits > 0
            low, high = binomial_interval(hits, len(highest))
            axis.plot(level[seen], hits[seen] / len(highest), color=COLOURS[method], label=f"{LABELS[method]}, counted")
            axis.fill_between(level[seen], low[seen], high[seen], color=COLOURS[method], alpha=0.2, lw=0)
    for method in ("wgsml", "integrated"):
        try:
            strata = _strata(results, method)
        except InputError:
            continue
        value = np.array([declaration_probability(strata, float(expit(at)))[0] for at in level])
        axis.plot(level, value, color=COLOURS[method], ls="--", label=f"{LABELS[method]}, Wald")
    axis.axhline(FALSE_TRACK_PROBABILITY, color="0.7", lw=0.8)
    ticks = np.array([0.5, 0.9, 0.97, 0.99, 0.999])
    axis.set_xticks(logit(ticks), [f"{tick:g}" for tick in ticks])
    axis.set(xlabel="threshold on existence", ylabel="probability of a false track in 180 s", yscale="log")
    axis.set_ylim(1e-5, 1)
    axis.legend(fontsize=8)


def _load(results: Results, name: str) -> xr.Dataset | None:
    try:
        data = results(name)
    except InputError:
        return None
    return data if data.sizes["run"] else None


def _thresholds(results: Results) -> dict[str, Threshold]:
    highest = results("noise").highest.values
    return {
        method: counted_threshold(highest[:, column], FALSE_TRACK_PROBABILITY) for column, method in enumerate(METHODS)
    }


def _strata(results: Results, method: str) -> list[Stratum]:
    share = birth_probability(make_filter().target, 1.0, NOISE_SCANS)
    column = ("wgsml", "integrated").index(method)
    strata = []
    for name, probability in (("modelled_born", share), ("modelled_none", 1 - share)):
        data = results(name)
        strata.append(Stratum(probability, data.log_odds.values[:, :, column], data.log_ratio.values[:, :, column]))
    return strata


def _best_odds(results: Results, snr_db: int) -> Float[np.ndarray, "run method"] | None:
    """Highest log odds of each run while the bearing was within a lobe of the target; it is detected above a level."""
    data = _load(results, scenario_name(snr_db))
    if data is None:
        return None
    near = (np.abs(data.error.values) < LOBE) & (np.arange(SCANS) >= APPEARS)[None, :, None]
    return np.where(near, data.log_odds.values, -np.inf).max(axis=1)


def _detected(data: xr.Dataset, method: str, level: float) -> Bool[np.ndarray, "run scan"]:
    column = METHODS.index(method)
    return (data.log_odds.values[..., column] > level) & (np.abs(data.error.values[..., column]) < LOBE)


def _at_detection(data: xr.Dataset, method: str, level: float) -> tuple[np.ndarray, np.ndarray]:
    """Bearing error and the tracker's standard deviation where existence first passes the level with a target there."""
    column = METHODS.index(method)
    declared = (data.log_odds.values[..., column] > level) & (np.arange(SCANS) >= APPEARS)
    first, found = declared.argmax(axis=1), declared.any(axis=1)
    rows = np.flatnonzero(found)
    at = rows, first[rows], column
    return data.error.values[at], data.bearing_std.values[at]


def _ospa(data: xr.Dataset, method: str, level: float, present: Any) -> Float[np.ndarray, "run scan"]:
    column = METHODS.index(method)
    return single_ospa(
        data.log_odds.values[..., column] > level, np.abs(data.error.values[..., column]), present, np.pi
    )


def _crossing(snr_db: np.ndarray, share: np.ndarray) -> float:
    """SNR at which a rising share passes one half, on straight lines between the points."""
    rising = np.maximum.accumulate(share)
    above = np.flatnonzero(rising >= 0.5)
    if above.size == 0 or above[0] == 0:
        return np.nan
    at = above[0]
    low, high = rising[at - 1], rising[at]
    return float(snr_db[at - 1] + (snr_db[at] - snr_db[at - 1]) * (0.5 - low) / (high - low))


def _drawn_snr50(results: Results, best: dict[int, np.ndarray]) -> Float[np.ndarray, "draw method"]:
    """SNR of half detection for bootstrapped runs of noise and target; the first row is of those as they are.

    Runs are drawn anew together for all methods, which heard the same spectra.
    """
    rng = np.random.default_rng(0)
    highest = results("noise").highest.values
    snr_db = np.array(sorted(best), float)
    found = np.empty((BOOTSTRAPS + 1, len(METHODS)))
    for draw in range(BOOTSTRAPS + 1):

        def picked(runs: np.ndarray, as_they_are: bool = draw == 0) -> np.ndarray:
            return runs if as_they_are else runs[rng.integers(len(runs), size=len(runs))]

        level = np.quantile(picked(highest), 1 - FALSE_TRACK_PROBABILITY, axis=0, method="higher")
        curve = np.array([(picked(best[value]) > level).mean(axis=0) for value in sorted(best)])
        found[draw] = [_crossing(snr_db, share) for share in curve.T]
    return found


def _of_draws(values: Float[np.ndarray, " draw"]) -> tuple[float, float, float]:
    """The first, and the interval of the others."""
    low, high = np.nanpercentile(values[1:], [2.5, 97.5])
    return float(values[0]), float(low), float(high)


def _lag(data: xr.Dataset, levels: dict[str, float]) -> Row:
    """Largest time by which the mean OSPA of one method reaches a value later than that of another."""
    present = np.arange(SCANS) >= APPEARS
    early, late = (_ospa(data, method, levels[method], present) for method in ("wgsml", "lwl"))

    def lag(first: np.ndarray, second: np.ndarray) -> float:
        curves = [np.minimum.accumulate(runs.mean(axis=0)[APPEARS:]) for runs in (first, second)]
        top, bottom = min(curve[0] for curve in curves), max(curve[-1] for curve in curves)
        values = np.linspace(bottom + 0.1 * (top - bottom), top - 0.1 * (top - bottom), 60)
        times = [np.interp(-values, -curve, np.arange(len(curve))) for curve in curves]
        return float(np.max(times[1] - times[0]))

    low, high = bootstrap_interval(lag, (early, late), BOOTSTRAPS)
    return Row(
        "ospa_lag_lwl_s",
        "most that LWL lags behind WGSML in mean OSPA, -27 dB",
        "s",
        10.0,
        lag(early, late),
        (float(low), float(high)),
    )


def _approach_snr50(data: xr.Dataset, method: str, level: float) -> tuple[Any, Any, Any]:
    detected = _detected(data, method, level)
    first = np.where(detected.any(axis=1), detected.argmax(axis=1), np.inf)
    snr_db = approach_snr_db()

    def at(scan: float) -> float:
        return float(snr_db[int(scan)]) if np.isfinite(scan) else np.nan

    low, high = quantile_interval(first, 0.5)
    return at(np.median(first)), at(low), at(high)


def _variants(results: Results) -> list[Row]:
    """Threshold and detection at -31 dB with one thing changed in what the paper leaves out."""
    found = []
    share = birth_probability(make_filter().target, 1.0, NOISE_SCANS)
    for name in VARIANTS:
        drawn, runs = (_load(results, f"variant_{name}_{which}") for which in ("wald", "scenario1"))
        if drawn is None or runs is None:
            continue
        # Draws without a target add at most one part in thirty at such thresholds; see the module on thresholds.
        stratum = Stratum(share, drawn.log_odds.values[..., 0], drawn.log_ratio.values[..., 0])
        threshold = wald_threshold([stratum], FALSE_TRACK_PROBABILITY)
        near = (np.abs(runs.error.values[..., 0]) < LOBE) & (np.arange(SCANS) >= APPEARS)
        odds = np.where(near, runs.log_odds.values[..., 0], -np.inf).max(axis=1)
        hits = int((odds > logit(threshold.value)).sum())
        low, high = binomial_interval(hits, len(odds))
        label = name.replace("_", " ")
        found.append(
            Row(
                f"variant_{name}_threshold",
                f"{label}: threshold, by Wald's identity",
                "1",
                None,
                threshold.value,
                (threshold.low, threshold.high),
            )
        )
        found.append(
            Row(
                f"variant_{name}_detected",
                f"{label}: share detected at -31 dB",
                "1",
                None,
                hits / len(odds),
                (float(low), float(high)),
            )
        )
    return found


def _bootstrapped(statistic: Any, samples: np.ndarray) -> tuple[Any, Any, Any]:
    low, high = bootstrap_interval(statistic, samples, BOOTSTRAPS)
    return float(statistic(samples)), float(low), float(high)


def _three(threshold: Threshold) -> tuple[float, float, float]:
    return threshold.value, threshold.low, threshold.high


def _row(key: str, method: str, name: str, unit: str, values: tuple[Any, Any, Any]) -> Row:
    value, low, high = values
    return Row(f"{key}_{method}", f"{name}, {LABELS[method]}", unit, PAPER.get(key, {}).get(method), value, (low, high))
