"""What is read off the runs: the study's rows, the measures of davey2008.

Every method has, at each signal to noise ratio, the threshold that one run in twenty passes without a target: the same
probability of a false track for all. A track is declared while the statistic is above it, and is right within three
pixels of the truth. Then

- overall detection: share of the runs in which the target is ever found while it is there;
- instantaneous detection: share of the frames with a target in which it is;
- delay: frames from its appearance until then, the runs that never find it as infinite;
- error: root mean square of the position over the frames in which it is found;
- detection by speed: both again, for targets in each third of the speeds;
- another place: share of the frames with a target in which a track is declared elsewhere;
- lingers: frames that a track goes on after the target has left, in runs in which it is declared in the last frame with
  it, mean;
- false tracks: stretches of declared frames in a run without a target, and their mean length.

Times are of one run alone, measured when the rows are made, on the machine that makes them, after compilation.
Intervals of what is counted on targets leave out that of the threshold.
"""

from dataclasses import dataclass

import jax
import numpy as np
from jaxtyping import Bool, Float, Int

from faintrack.metrics.accuracy import rmse
from faintrack.metrics.detection import time_to_detection
from faintrack.metrics.intervals import quantile_interval
from faintrack.studies.davey2008 import runs, scene
from faintrack.studies.davey2008.settings import SNR_DB, noise, target
from faintrack.studies.printed import PRINTED
from faintrack.studies.rows import beside, bootstrapped, mean, median, row, seconds, share
from faintrack.studies.study import Results, Row, finished

FALSE_SHARE, NEAR = 0.05, 3.0
"""Of the runs without a target that have a track; pixels."""

LABELS = {"grid": "grid", "viterbi": "dynamic programming", "particle": "particles", "pmht": "histogram PMHT"}
"""What a method is, for people."""

SPEEDS = ("slow", "middle", "fast")
"""Thirds of the speeds, up to the fastest."""

REPEATS = 3
"""Runs of which the fastest is timed."""

SEEN = slice(scene.APPEARS, scene.LEAVES)
"""Frames with a target."""


@dataclass(frozen=True)
class Declared:
    """A method at one signal to noise ratio: runs by frames.

    Attributes
    ----------
    threshold, bounds : on the statistic, and its interval.
    false : declared in runs without a target.
    declared, right : declared in runs with a target; and that within reach of it, or of its path when it is not there.
    error : distance from the path; pixels.
    third : of the speeds, that of the target; index into `SPEEDS`.
    """

    threshold: float
    bounds: tuple[float, float]
    false: Bool[np.ndarray, "noise_run scan"]
    declared: Bool[np.ndarray, "run scan"]
    right: Bool[np.ndarray, "run scan"]
    error: Float[np.ndarray, "run scan"]
    third: Int[np.ndarray, " run"]


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
        np.minimum(with_target["speed"].values / scene.FASTEST * len(SPEEDS), len(SPEEDS) - 1).astype(int),
    )


def rows(results: Results) -> list[Row]:
    """The study's numbers; a ratio that has not run leaves its rows out."""
    tables = ((method, snr_db, declared(results, method, snr_db)) for snr_db in SNR_DB for method in runs.METHODS)
    ours = [
        of_ratio
        for method, snr_db, track in tables
        if track is not None
        for of_ratio in of_method(f"{method}_{snr_db}db", f"{LABELS[method]}, {snr_db} dB", track)
    ]
    return beside(PRINTED["davey2008"], [*ours, *(_time(method) for method in runs.METHODS)]) if ours else []


def of_method(key: str, label: str, track: Declared) -> list[Row]:
    """Rows of a method at one ratio; `key` and `label` go before those of the measures."""
    right, claimed = track.right[:, SEEN], track.declared[:, SEEN]
    delay = np.nan_to_num(time_to_detection(right, np.arange(float(right.shape[1]))), nan=np.inf)
    last = track.declared[:, scene.LEAVES - 1]
    # The first frame after it without a track; one that lasts to the end is cut off there.
    after = np.cumprod(track.declared[last, scene.LEAVES :], axis=1).sum(axis=1)
    tracks = (np.diff(track.false.astype(int), axis=1, prepend=0) > 0).sum(axis=1)
    false, hit = tracks > 0, right.any(axis=1)
    return [
        row(f"{key}_threshold", f"{label}: threshold", "1", track.threshold, track.bounds),
        share(f"{key}_detected", f"{label}: overall detection", int(hit.sum()), len(right)),
        mean(f"{key}_instantaneous", f"{label}: instantaneous detection", "1", right.mean(axis=1)),
        median(f"{key}_delay", f"{label}: delay, median", "frame", delay),
        bootstrapped(
            f"{key}_rmse",
            f"{label}: error of the position",
            "pixel",
            lambda error, right: rmse(error[right]),
            (track.error[:, SEEN][hit], right[hit]),
        ),
        mean(f"{key}_wrong", f"{label}: another place", "1", (claimed & ~right).mean(axis=1)),
        mean(f"{key}_lingers", f"{label}: lingers", "frame", after),
        mean(f"{key}_false_tracks", f"{label}: false tracks a run", "1", tracks),
        bootstrapped(
            f"{key}_false_length",
            f"{label}: length of a false track",
            "frame",
            lambda frames, tracks: frames.sum() / tracks.sum(),
            (track.false.sum(axis=1)[false], tracks[false]),
        ),
        *(of_speed for third in range(len(SPEEDS)) for of_speed in _by_speed(key, label, track, third)),
    ]


def _by_speed(key: str, label: str, track: Declared, third: int) -> list[Row]:
    right, speed = track.right[track.third == third][:, SEEN], SPEEDS[third]
    hits = int(right.any(axis=1).sum())
    return [
        share(f"{key}_{speed}_detected", f"{label}, {speed}: overall detection", hits, len(right)),
        mean(f"{key}_{speed}_instantaneous", f"{label}, {speed}: instantaneous detection", "1", right.mean(axis=1)),
    ]


def _time(method: str) -> Row:
    model, key = scene.likelihood(SNR_DB[1]), jax.random.key(0)
    scans, _ = jax.jit(lambda key: scene.look(key, model, True))(key)
    follow = jax.jit(lambda scans: runs.METHODS[method](model, scans, key))
    jax.block_until_ready(follow(scans))
    least = min(seconds(lambda: follow(scans)) for _ in range(REPEATS))
    return row(f"{method}_ms", f"{LABELS[method]}: time of a frame", "ms", 1e3 * least / scene.SCANS)
