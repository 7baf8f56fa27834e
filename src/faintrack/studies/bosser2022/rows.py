"""What is read off the runs: thresholds, detection, OSPA, bearing errors."""

import contextlib

import numpy as np
import xarray as xr
from jaxtyping import Float
from scipy.special import logit

from faintrack.errors import InputError
from faintrack.metrics.accuracy import rmse
from faintrack.metrics.intervals import quantile_interval
from faintrack.metrics.thresholds import Stratum, Threshold, wald_threshold
from faintrack.studies.bosser2022 import measures
from faintrack.studies.bosser2022.measures import FALSE_TRACK_PROBABILITY, LABELS, PRESENT
from faintrack.studies.bosser2022.runs import VARIANTS
from faintrack.studies.bosser2022.scene import APPEARS, METHODS, approach_snr_db
from faintrack.studies.printed import PRINTED
from faintrack.studies.rows import BOOTSTRAPS, beside, bootstrapped, row, share
from faintrack.studies.study import Results, Row, finished


def rows(results: Results) -> list[Row]:
    """The study's numbers; a setting that has not run leaves its rows out."""
    if finished(results, "noise") is None:
        return []
    level, ran = measures.levels(results), measures.scenario_one(results)
    ours = [*_thresholds(results), *_detection(results, ran)]
    if -27 in ran:
        ours.append(_lag(ran[-27], level))
    if -15 in ran:
        for method in METHODS:
            key, name = f"bearing_rmse_deg_{method}", f"bearing error at detection, -15 dB, {LABELS[method]}"
            ours.append(_bearing(key, name, ran[-15], method, level))
    guided = finished(results, "guided_15")
    if guided is not None:
        name = "bearing error at detection, -15 dB, WGSML with guided newborn particles"
        ours.append(_bearing("bearing_rmse_deg_guided", name, guided, "wgsml", level))
    coming = finished(results, "approach")
    if coming is not None:
        ours += [_approach(coming, method, level[method]) for method in METHODS]
    return beside(PRINTED["bosser2022"], [*ours, *_variants(results)])


def _threshold(key: str, name: str, threshold: Threshold) -> Row:
    return row(key, name, "1", threshold.value, (threshold.low, threshold.high))


def _thresholds(results: Results) -> list[Row]:
    """By counting, and by Wald's identity."""
    ours = [
        _threshold(f"threshold_{method}", f"threshold on existence, by counting, {LABELS[method]}", threshold)
        for method, threshold in measures.thresholds(results).items()
    ]
    for method, drawn in measures.strata(results).items():
        # Few runs may not reach so rare a threshold.
        with contextlib.suppress(InputError):
            threshold = wald_threshold(drawn, FALSE_TRACK_PROBABILITY)
            name = f"threshold, {LABELS[method]}, by Wald's identity"
            ours.append(_threshold(f"threshold_{method}_wald", name, threshold))
    return ours


def _detection(results: Results, ran: dict[int, xr.Dataset]) -> list[Row]:
    """SNR at which half of the runs are detected, and what not knowing the noise costs of it."""
    best = {snr_db: measures.best_odds(data) for snr_db, data in ran.items()}
    drawn = dict(zip(METHODS, _drawn_snr50(results, best).T, strict=True))
    half = "SNR at which half of the runs are detected"
    cost = drawn["integrated"] - drawn["wgsml"]
    return [
        *(_of_draws(f"snr50_{method}", f"{half}, {LABELS[method]}", draws) for method, draws in drawn.items()),
        _of_draws("unknown_noise_cost_db", "what not knowing the noise costs in detection", cost),
    ]


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
    drawn = np.empty((BOOTSTRAPS + 1, len(METHODS)))
    for draw in range(BOOTSTRAPS + 1):

        def picked(runs: np.ndarray, as_they_are: bool = draw == 0) -> np.ndarray:
            return runs if as_they_are else runs[rng.integers(len(runs), size=len(runs))]

        level = np.quantile(picked(highest), 1 - FALSE_TRACK_PROBABILITY, axis=0, method="higher")
        curve = np.array([(picked(best[value]) > level).mean(axis=0) for value in sorted(best)])
        drawn[draw] = [_crossing(snr_db, share) for share in curve.T]
    return drawn


def _of_draws(key: str, name: str, values: Float[np.ndarray, " draw"]) -> Row:
    """The first, and the interval of the others; dB."""
    low, high = np.nanpercentile(values[1:], [2.5, 97.5])
    return row(key, name, "dB", float(values[0]), (float(low), float(high)))


def _lag(data: xr.Dataset, level: dict[str, float]) -> Row:
    """Largest time by which the mean OSPA of one method reaches a value later than that of another."""

    def lag(first: np.ndarray, second: np.ndarray) -> float:
        curves = [np.minimum.accumulate(runs.mean(axis=0)[APPEARS:]) for runs in (first, second)]
        top, bottom = min(curve[0] for curve in curves), max(curve[-1] for curve in curves)
        values = np.linspace(bottom + 0.1 * (top - bottom), top - 0.1 * (top - bottom), 60)
        times = [np.interp(-values, -curve, np.arange(len(curve))) for curve in curves]
        return float(np.max(times[1] - times[0]))

    early, late = (measures.ospa(data, method, level[method], PRESENT) for method in ("wgsml", "lwl"))
    return bootstrapped(
        "ospa_lag_lwl_s", "most that LWL lags behind WGSML in mean OSPA, -27 dB", "s", lag, (early, late)
    )


def _bearing(key: str, name: str, data: xr.Dataset, method: str, level: dict[str, float]) -> Row:
    errors, _ = measures.at_detection(data, method, level[method])
    return bootstrapped(key, name, "degree", lambda errors: np.degrees(rmse(errors)), errors)


def _approach(data: xr.Dataset, method: str, level: float) -> Row:
    seen, snr_db = measures.detected(data, method, level), approach_snr_db()
    first = np.where(seen.any(axis=1), seen.argmax(axis=1), np.inf)
    ours, *ends = (
        float(snr_db[int(scan)]) if np.isfinite(scan) else np.nan
        for scan in (np.median(first), *quantile_interval(first, 0.5))
    )
    name = f"SNR by which half of the approaching targets are detected, {LABELS[method]}"
    return row(f"approach_snr50_{method}", name, "dB", ours, (ends[0], ends[1]))


def _variants(results: Results) -> list[Row]:
    """Threshold and detection at -31 dB with one thing changed in what the paper leaves out."""
    ours = []
    for name in VARIANTS:
        drawn, runs = (finished(results, f"variant_{name}_{which}") for which in ("wald", "scenario1"))
        if drawn is None or runs is None:
            continue
        # Draws without a target add at most one part in thirty at such thresholds; see the module on thresholds.
        stratum = Stratum(measures.birth_share(), drawn.log_odds.values[..., 0], drawn.log_ratio.values[..., 0])
        threshold = wald_threshold([stratum], FALSE_TRACK_PROBABILITY)
        hits = int((measures.best_odds(runs)[:, 0] > logit(threshold.value)).sum())
        key, label = f"variant_{name}", name.replace("_", " ")
        ours.append(_threshold(f"{key}_threshold", f"{label}: threshold, by Wald's identity", threshold))
        ours.append(share(f"{key}_detected", f"{label}: share detected at -31 dB", hits, runs.sizes["run"]))
    return ours
