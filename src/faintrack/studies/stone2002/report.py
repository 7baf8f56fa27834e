r"""What is read off the runs: the study's rows.

**Equal detection.** The likelihood ratio detector declares where the surface rises above a threshold, the matched
filter where its output (eq. 34) does. Both thresholds give a detection probability of 0.93 of the paper's target at the
last scan. That of the surface is the 0.07 quantile of its highest value within a cell of the truth, set on one half of
the runs where `pd_lrt` is counted on the other. The paper does not say what its false-alarm rate counts. Three
readings, every probability of the surface by a change of measure (`faintrack.metrics.change_of_measure`):

- one state of the surface against one cell of the matched filter: `log10_false_alarm_ratio`;
- any state over the sensor against any of its cells, where the matched filter is almost sure to alarm: `_anywhere`;
- the sum of log ratios along one straight path, without plant noise, against one cell: `_straight`. The sum over n
  scans is normal, its means under target and noise lie :math:`n \cdot \mathrm{SNR}` apart, which is its variance too,
  so that

.. math:: P_0 = Q\left(\sqrt{n\,\mathrm{SNR}} - Q^{-1}(1 - P_d)\right)

with Q the normal tail; n = 1 is the matched filter.
"""

import math
from collections.abc import Callable

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike
from scipy.special import ndtr, ndtri

from faintrack.metrics.accuracy import rmse
from faintrack.metrics.change_of_measure import log_probability_under_noise
from faintrack.metrics.intervals import binomial_interval, bootstrap_interval, quantile_interval
from faintrack.studies.stone2002 import periscope, simulation, tenet
from faintrack.studies.stone2002.settings import PERISCOPE_DB, periscope_name
from faintrack.studies.study import Results, Row, finished

DETECTION = 0.93
"""Probability at which the two detectors are compared."""

SNR = 1.5 * simulation.LEVEL**2
"""Of the matched filter in one scan (eq. 33)."""

BOOTSTRAPS = 400
"""Draws of runs for an interval."""


def rows(results: Results) -> list[Row]:
    """The study's numbers; a setting that has not run leaves its rows out."""
    parts = (
        ("straight", _peaks),
        ("ending", _false_alarms),
        (periscope_name(PERISCOPE_DB), _periscope),
        ("tenet_detection", _tenet_detection),
        ("tenet_grid", _tenet_challenge),
    )
    return [row for name, part in parts if finished(results, name) is not None for row in part(results)]


def false_alarm(scans: int) -> float:
    """Probability of the module's equation, at `DETECTION`."""
    return float(ndtr(-ndtri(1 - DETECTION) - math.sqrt(scans * SNR)))


def _peaks(results: Results) -> list[Row]:
    data = results("straight")
    prior = Row(
        "prior_log_ratio", "log ratio of a state before the first scan", "1", -7.9, simulation.prior_log_ratio()
    )
    return [
        prior,
        *_median("peak_t10", "highest value of the surface at t = 10", "1", 29.0, data.peak[:, 10]),
        *_median("peak_t15", "highest value of the surface at t = 15", "1", 31.0, data.peak[:, 15]),
        *_median("noise_peak_t15", "median local peak of noise at t = 15 (paper: below)", "1", -30.0, data.noise_peak),
        *_median("noise_peak_highest_t15", "highest local peak of noise at t = 15", "1", None, data.noise_peak_highest),
    ]


def _median(key: str, name: str, unit: str, paper: float | None, runs: ArrayLike) -> list[Row]:
    """Median of runs, and their spread: half the range of the middle 68 %, one standard deviation if normal."""
    runs = np.asarray(runs, float)

    def spread(runs: np.ndarray) -> float:
        return float(np.diff(np.quantile(runs, ndtr([-1.0, 1.0])))[0] / 2)

    low, high = bootstrap_interval(spread, runs, BOOTSTRAPS)
    return [
        Row(key, f"{name}, median", unit, paper, float(np.median(runs)), quantile_interval(runs, 0.5)),
        Row(f"{key}_spread", f"{name}, spread from run to run", unit, None, spread(runs), (float(low), float(high))),
    ]


def _false_alarms(results: Results) -> list[Row]:
    near = results("straight").near.values[:, -1]
    for_threshold, for_detection = near[::2], near[1::2]
    threshold = float(np.quantile(for_threshold, 1 - DETECTION))
    bounds = quantile_interval(for_threshold, 1 - DETECTION)
    hits = int((for_detection > threshold).sum())
    low, high = binomial_interval(hits, len(for_detection))
    any_cell = -math.expm1(_log_any_cell_quiet())
    state, anywhere = (
        _log10(function, threshold, bounds) for function in (_state_alarm(results), _anywhere_alarm(results))
    )
    straight = math.log10(false_alarm(simulation.SCANS))
    cell, cells = math.log10(false_alarm(1)), math.log10(any_cell)
    told = "times (log10) that the matched filter alarms falsely more often"
    return [
        Row("threshold_lrt", "threshold on the surface for detection at 0.93", "1", None, threshold, bounds),
        Row(
            "pd_lrt",
            "share detected with it, other runs",
            "1",
            0.93,
            hits / len(for_detection),
            (float(low), float(high)),
        ),
        Row("false_alarm_matched_filter", "false alarms of the matched filter, a cell", "1", None, false_alarm(1)),
        Row("log10_false_alarm_lrt", "log10 of false alarms of the surface, a state", "1", None, state[0], state[1]),
        Row("log10_false_alarm_lrt_anywhere", "the same, anywhere", "1", None, anywhere[0], anywhere[1]),
        _ratio("log10_false_alarm_ratio", f"{told}, cell against state", 18.0, cell, state),
        _ratio("log10_false_alarm_ratio_anywhere", f"{told}, anywhere", 18.0, cells, anywhere),
        Row("log10_false_alarm_ratio_straight", f"{told}, straight path, exact", "1", 18.0, cell - straight),
    ]


Log10 = tuple[float, tuple[float | None, float | None]]


def _ratio(key: str, name: str, paper: float, matched: float, found: Log10) -> Row:
    value, (low, high) = found
    interval = (None if high is None else matched - high, None if low is None else matched - low)
    return Row(key, name, "1", paper, matched - value, interval)


def _log10(alarm: Callable[[float], tuple[float, float]], threshold: float, bounds: tuple[float, float]) -> Log10:
    """Log10 of a false-alarm probability, with the interval that both the threshold's and the draws' errors give."""
    value, _ = alarm(threshold)

    def end(bound: float, side: float) -> float | None:
        if not np.isfinite(bound):
            return None
        log, error = alarm(bound)
        return (log - side * ndtri(0.025) * error) / math.log(10)

    return value / math.log(10), (end(bounds[1], -1.0), end(bounds[0], 1.0))


def _state_alarm(results: Results) -> Callable[[float], tuple[float, float]]:
    at_state = results("ending").at_state.values.astype(float)
    log_ratio = at_state - simulation.prior_log_ratio()
    return lambda threshold: log_probability_under_noise(at_state > threshold, log_ratio)


def _anywhere_alarm(results: Results) -> Callable[[float], tuple[float, float]]:
    data = results("modelled")
    peak, log_ratio = data.peak.values[:, -1], data.log_ratio.values[:, -1]
    return lambda threshold: log_probability_under_noise(peak > threshold, log_ratio)


def _log_any_cell_quiet() -> float:
    """Log of the probability that no cell of the matched filter alarms, over the sensor.

    Outputs of cells up to two apart are correlated, which this leaves out; with 16 alarms expected it is nearly 0 in
    any case.
    """
    return simulation.CELLS * math.log1p(-false_alarm(1))


def _periscope(results: Results) -> list[Row]:
    """At the ratio of signal to clutter that is nearest to the paper's peak; then how the peak moves with it."""
    found: list[Row] = []
    peak, second = "highest likelihood ratio on the target's path", "highest likelihood ratio elsewhere"
    data = results(periscope_name(PERISCOPE_DB))
    log10_peak = data.peak.values / math.log(10)
    found += _median("periscope_log10_peak", f"{peak}, log10", "1", 7.6, log10_peak)
    found += _median("periscope_second_peak", second, "1", 7.6, np.exp(data.second_peak.values))
    largest = float(np.exp(data.second_peak.values.max()))
    found.append(Row("periscope_second_peak_largest", f"{second}, largest of all runs", "1", None, largest))
    for scr_db in periscope.SCR_DB:
        at = finished(results, periscope_name(scr_db))
        if at is not None:
            name = f"{peak}, log10, target {scr_db} dB over clutter"
            found.append(_median(f"periscope_log10_peak_{scr_db}_db", name, "1", None, at.peak / math.log(10))[0])
    return found


def _tenet_detection(results: Results) -> list[Row]:
    data = results("tenet_detection")
    above = data.log_odds.values > 0
    runs = np.flatnonzero(above.any(axis=1))
    first = np.where(above.any(axis=1), above.argmax(axis=1), np.inf)
    detected = len(runs)
    right = int((data.error.values[runs, first[runs].astype(int)] < tenet.LOCK).sum())
    name = "first scan with an integrated likelihood ratio above 1, median"
    bounds = quantile_interval(first, 0.5)
    return [
        Row("tenet_detection_scan", name, "scan", None, float(np.median(first)), bounds),
        _share("tenet_detected", "share of runs that ever detect", detected, len(first)),
        _share("tenet_detection_right", "share of those within 3 pixels then", right, detected),
        _lock("tenet_detection_lock", "share of runs within 3 pixels at t = 10", data),
    ]


def _tenet_challenge(results: Results) -> list[Row]:
    found = []
    for name, label in (("particle", "particles"), ("grid", "implicit grid")):
        data = finished(results, f"tenet_{name}")
        if data is None:
            continue
        last = data.error.values[:, -1]
        locked = last[last < tenet.LOCK]
        if locked.size:
            low, high = bootstrap_interval(rmse, locked, BOOTSTRAPS)
            title = f"error of the position at the last scan with lock, {label}, root mean square"
            found.append(
                Row(f"tenet_rmse_{name}", title, "pixel", None, float(rmse(locked)), (float(low), float(high)))
            )
        found.append(_lock(f"tenet_lock_{name}", f"share of runs with lock, {label}", data))
    return found


def _lock(key: str, name: str, data: xr.Dataset) -> Row:
    return _share(key, name, int((data.error.values[:, -1] < tenet.LOCK).sum()), data.sizes["run"])


def _share(key: str, name: str, hits: int, runs: int) -> Row:
    low, high = binomial_interval(hits, runs)
    return Row(key, name, "1", None, hits / max(runs, 1), (float(low), float(high)))
