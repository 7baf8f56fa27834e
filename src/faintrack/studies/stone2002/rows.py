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
from faintrack.metrics.intervals import quantile_interval
from faintrack.studies.printed import PRINTED
from faintrack.studies.rows import beside, bootstrapped, median, row, share
from faintrack.studies.stone2002 import periscope, simulation, tenet
from faintrack.studies.stone2002.settings import PERISCOPE_DB, periscope_name
from faintrack.studies.study import Results, Row, finished

DETECTION = 0.93
"""Probability at which the two detectors are compared."""

SNR = 1.5 * simulation.LEVEL**2
"""Of the matched filter in one scan (eq. 33)."""


def rows(results: Results) -> list[Row]:
    """The study's numbers; a setting that has not run leaves its rows out."""
    parts = (
        ("straight", _peaks),
        ("ending", _false_alarms),
        (periscope_name(PERISCOPE_DB), _periscope),
        ("tenet_detection", _tenet_detection),
        ("tenet_grid", _tenet_challenge),
    )
    ours = [row for name, part in parts if finished(results, name) is not None for row in part(results)]
    return beside(PRINTED["stone2002"], ours)


def false_alarm(scans: int) -> float:
    """Probability of the module's equation, at `DETECTION`."""
    return float(ndtr(-ndtri(1 - DETECTION) - math.sqrt(scans * SNR)))


def _peaks(results: Results) -> list[Row]:
    data = results("straight")
    return [
        row("prior_log_ratio", "log ratio of a state before the first scan", "1", simulation.prior_log_ratio()),
        *_median("peak_t10", "highest value of the surface at t = 10", data.peak[:, 10]),
        *_median("peak_t15", "highest value of the surface at t = 15", data.peak[:, 15]),
        *_median("noise_peak_t15", "median local peak of noise at t = 15 (paper: below)", data.noise_peak),
        *_median("noise_peak_highest_t15", "highest local peak of noise at t = 15", data.noise_peak_highest),
    ]


def _median(key: str, name: str, runs: ArrayLike) -> list[Row]:
    """Median of runs, and their spread: half the range of the middle 68 %, one standard deviation if normal."""

    def spread(runs: np.ndarray) -> float:
        return float(np.diff(np.quantile(runs, ndtr([-1.0, 1.0])))[0] / 2)

    runs = np.asarray(runs, float)
    return [
        median(key, f"{name}, median", "1", runs),
        bootstrapped(f"{key}_spread", f"{name}, spread from run to run", "1", spread, runs),
    ]


def _false_alarms(results: Results) -> list[Row]:
    near = results("straight").near.values[:, -1]
    for_threshold, for_detection = near[::2], near[1::2]
    threshold = float(np.quantile(for_threshold, 1 - DETECTION))
    bounds = quantile_interval(for_threshold, 1 - DETECTION)
    hits = int((for_detection > threshold).sum())
    any_cell = -math.expm1(_log_any_cell_quiet())
    state, anywhere = (
        _log10(function, threshold, bounds) for function in (_state_alarm(results), _anywhere_alarm(results))
    )
    straight = math.log10(false_alarm(simulation.SCANS))
    cell, cells = math.log10(false_alarm(1)), math.log10(any_cell)
    times = "times (log10) that the matched filter alarms falsely more often"
    return [
        row("threshold_lrt", "threshold on the surface for detection at 0.93", "1", threshold, bounds),
        share("pd_lrt", "share detected with it, other runs", hits, len(for_detection)),
        row("false_alarm_matched_filter", "false alarms of the matched filter, a cell", "1", false_alarm(1)),
        row("log10_false_alarm_lrt", "log10 of false alarms of the surface, a state", "1", *state),
        row("log10_false_alarm_lrt_anywhere", "the same, anywhere", "1", *anywhere),
        _ratio("log10_false_alarm_ratio", f"{times}, cell against state", cell, state),
        _ratio("log10_false_alarm_ratio_anywhere", f"{times}, anywhere", cells, anywhere),
        row("log10_false_alarm_ratio_straight", f"{times}, straight path, exact", "1", cell - straight),
    ]


Log10 = tuple[float, tuple[float | None, float | None]]


def _ratio(key: str, name: str, matched: float, surface: Log10) -> Row:
    value, (low, high) = surface
    interval = (None if high is None else matched - high, None if low is None else matched - low)
    return row(key, name, "1", matched - value, interval)


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
    peak, second = "highest likelihood ratio on the target's path", "highest likelihood ratio elsewhere"
    data = results(periscope_name(PERISCOPE_DB))
    largest = float(np.exp(data.second_peak.values.max()))
    ours = [
        *_median("periscope_log10_peak", f"{peak}, log10", data.peak.values / math.log(10)),
        *_median("periscope_second_peak", second, np.exp(data.second_peak.values)),
        row("periscope_second_peak_largest", f"{second}, largest of all runs", "1", largest),
    ]
    for scr_db in periscope.SCR_DB:
        at = finished(results, periscope_name(scr_db))
        if at is not None:
            name = f"{peak}, log10, target {scr_db} dB over clutter, median"
            ours.append(median(f"periscope_log10_peak_{scr_db}_db", name, "1", at.peak / math.log(10)))
    return ours


def _tenet_detection(results: Results) -> list[Row]:
    data = results("tenet_detection")
    above = data.log_odds.values > 0
    runs = np.flatnonzero(above.any(axis=1))
    first = np.where(above.any(axis=1), above.argmax(axis=1), np.inf)
    right = int((data.error.values[runs, first[runs].astype(int)] < tenet.LOCK).sum())
    name = "first scan with an integrated likelihood ratio above 1, median"
    return [
        median("tenet_detection_scan", name, "scan", first),
        share("tenet_detected", "share of runs that ever detect", len(runs), len(first)),
        share("tenet_detection_right", "share of those within 3 pixels then", right, len(runs)),
        _lock("tenet_detection_lock", "share of runs within 3 pixels at t = 10", data),
    ]


def _tenet_challenge(results: Results) -> list[Row]:
    ours = []
    for name, label in (("particle", "particles"), ("grid", "implicit grid")):
        data = finished(results, f"tenet_{name}")
        if data is None:
            continue
        last = data.error.values[:, -1]
        locked = last[last < tenet.LOCK]
        if locked.size:
            title = f"error of the position at the last scan with lock, {label}, root mean square"
            ours.append(bootstrapped(f"tenet_rmse_{name}", title, "pixel", rmse, locked))
        ours.append(_lock(f"tenet_lock_{name}", f"share of runs with lock, {label}", data))
    return ours


def _lock(key: str, name: str, data: xr.Dataset) -> Row:
    return share(key, name, int((data.error.values[:, -1] < tenet.LOCK).sum()), data.sizes["run"])
