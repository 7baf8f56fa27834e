"""What is read off the runs: the study's rows, the measures of davey2008.

Every method has, at each signal to noise ratio, the threshold that one run in twenty passes without a target: the same
probability of a false track for all. A track is declared while the statistic is above it, and is right within three
pixels of the truth. Then

- overall detection: share of the runs in which the target is ever found while it is there;
- instantaneous detection: share of the frames with a target in which it is;
- delay: frames from its appearance until then, the runs that never find it as infinite;
- error: root mean square of the position over the frames in which it is found;
- another place: share of the frames with a target in which a track is declared elsewhere;
- lingers: frames that a track goes on after the target has left, in runs in which it is declared in the last frame with
  it, mean;
- false tracks: stretches of declared frames in a run without a target, and their mean length.

Times are of one run alone, measured when the rows are made, on the machine that makes them, after compilation.
Intervals of what is counted on targets leave out that of the threshold.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

import jax
import numpy as np
from jaxtyping import Bool, Float

from faintrack.metrics.accuracy import rmse
from faintrack.metrics.detection import time_to_detection
from faintrack.metrics.intervals import binomial_interval, bootstrap_interval, quantile_interval
from faintrack.studies.davey2008 import scene
from faintrack.studies.davey2008.settings import SNR_DB, noise, target
from faintrack.studies.study import Results, Row, finished

FALSE_SHARE, NEAR = 0.05, 3.0
"""Of the runs without a target that have a track; pixels."""

LABELS = {"grid": "grid", "viterbi": "dynamic programming", "particle": "particles"}
"""What a method is, for people."""

BOOTSTRAPS, REPEATS = 400, 3
"""Draws of runs for an interval; runs of which the fastest is timed."""

THERE = slice(scene.APPEARS, scene.LEAVES)


@dataclass(frozen=True)
class Declared:
    """A method at one signal to noise ratio: runs by frames.

    Attributes
    ----------
    threshold, bounds : on the statistic, and its interval.
    false : declared in runs without a target.
    declared, found : declared in runs with a target; and that within reach of it, or of its path when it is not there.
    error : distance from the path; pixels.
    """

    threshold: float
    bounds: tuple[float, float]
    false: Bool[np.ndarray, "noise_run scan"]
    declared: Bool[np.ndarray, "run scan"]
    found: Bool[np.ndarray, "run scan"]
    error: Float[np.ndarray, "run scan"]


def declared(results: Results, method: str, snr_db: int) -> Declared | None:
    """Where a method declares a track, if there are runs with and without a target."""
    without, with_target = finished(results, noise(snr_db)), finished(results, target(snr_db))
    if without is None or with_target is None:
        return None
    statistic, error = with_target[f"{method}_statistic"].values, with_target[f"{method}_error"].values
    highest = without[f"{method}_statistic"].max("scan").values
    threshold = float(np.quantile(highest, 1 - FALSE_SHARE))
    above = statistic > threshold
    return Declared(
        threshold,
        quantile_interval(highest, 1 - FALSE_SHARE),
        without[f"{method}_statistic"].values > threshold,
        above,
        above & (error <= NEAR),
        error,
    )


def rows(results: Results) -> list[Row]:
    """The study's numbers; a ratio that has not run leaves its rows out."""
    found: list[Row] = []
    for snr_db in SNR_DB:
        for method in scene.METHODS:
            each = declared(results, method, snr_db)
            if each is not None:
                found += of_method(f"{method}_{snr_db}db", f"{LABELS[method]}, {snr_db} dB", each)
    return [*found, *(_time(method) for method in scene.METHODS)] if found else []


def of_method(key: str, label: str, each: Declared) -> list[Row]:
    """Rows of a method at one ratio; `key` and `label` go before those of the measures."""
    found, there = each.found[:, THERE], each.declared[:, THERE]
    hits, runs = int(found.any(axis=1).sum()), len(found)
    low, high = binomial_interval(hits, runs)
    delay = np.nan_to_num(time_to_detection(found, np.arange(float(found.shape[1]))), nan=np.inf)
    wrong = (there & ~found).mean(axis=1)
    last = each.declared[:, scene.LEAVES - 1]
    # The first frame after it without a track; one that lasts to the end is cut off there.
    after = np.cumprod(each.declared[last, scene.LEAVES :], axis=1).sum(axis=1)
    starts = np.diff(each.false.astype(int), axis=1, prepend=0) > 0
    tracks = starts.sum(axis=1)
    some = tracks > 0
    lengths = each.false.sum(axis=1)[some], tracks[some]
    return [
        Row(f"{key}_threshold", f"{label}: threshold", "1", None, each.threshold, each.bounds),
        Row(f"{key}_detected", f"{label}: overall detection", "1", None, hits / runs, (float(low), float(high))),
        _mean(f"{key}_instantaneous", f"{label}: instantaneous detection", "1", found.mean(axis=1)),
        Row(
            f"{key}_delay",
            f"{label}: delay, median",
            "frame",
            None,
            float(np.median(delay)),
            quantile_interval(delay, 0.5),
        ),
        _error(f"{key}_rmse", f"{label}: error of the position", each.error[:, THERE], found),
        _mean(f"{key}_wrong", f"{label}: another place", "1", wrong),
        _mean(f"{key}_lingers", f"{label}: lingers", "frame", after),
        _mean(f"{key}_false_tracks", f"{label}: false tracks a run", "1", tracks),
        _number(f"{key}_false_length", f"{label}: length of a false track", "frame", _ratio, lengths),
    ]


def _ratio(first: np.ndarray, second: np.ndarray) -> float:
    return float(first.sum() / second.sum())


def _mean(key: str, name: str, unit: str, runs: np.ndarray) -> Row:
    return _number(key, name, unit, np.mean, (runs,))


def _error(key: str, name: str, error: np.ndarray, found: np.ndarray) -> Row:
    some = found.any(axis=1)

    def over_found(error: np.ndarray, found: np.ndarray) -> float:
        return float(rmse(error[found]))

    return _number(key, name, "pixel", over_found, (error[some], found[some]))


def _number(key: str, name: str, unit: str, statistic: Callable[..., float], runs: tuple[np.ndarray, ...]) -> Row:
    if not len(runs[0]):
        return Row(key, name, unit, None, None)
    low, high = bootstrap_interval(statistic, runs, BOOTSTRAPS)
    return Row(key, name, unit, None, float(statistic(*runs)), (float(low), float(high)))


def _time(method: str) -> Row:
    model, key = scene.likelihood(SNR_DB[1]), jax.random.key(0)
    scans, _ = jax.jit(lambda key: scene.look(key, model, True))(key)
    follow = jax.jit(lambda scans: scene.METHODS[method](model, scans, key))
    jax.block_until_ready(follow(scans))
    seconds = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        jax.block_until_ready(follow(scans))
        seconds.append(time.perf_counter() - start)
    return Row(f"{method}_ms", f"{LABELS[method]}: time of a frame", "ms", None, 1e3 * min(seconds) / scene.SCANS)
