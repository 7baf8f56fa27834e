"""What is read off the runs: the study's rows.

Errors are root mean squares over the runs, scan by scan, of the cell with the highest probability (the paper's MAP
estimate); a row has their mean over scans 14 to 29, as read off its figures. Target probabilities are means over the
scans in which the sonar can hear the target, or in which it is blanked. Intervals are by bootstrap over the runs.

Times are of one measurement update, measured when the rows are made, on the machine that makes them, after
compilation: the first includes what can be used again while source and receiver stand still.
"""

from collections.abc import Callable

import numpy as np
import xarray as xr

from faintrack.errors import InputError
from faintrack.metrics.accuracy import rmse
from faintrack.metrics.intervals import binomial_interval, bootstrap_interval, quantile_interval
from faintrack.studies.aughenbaugh2010 import runs, scene
from faintrack.studies.aughenbaugh2010.settings import BEYOND, METHODS, PULSES
from faintrack.studies.aughenbaugh2010.timing import update_seconds
from faintrack.studies.study import Results, Row, finished

WINDOW = slice(13, 29)
"""Scans 14 to 29."""

DECLARE = 0.9
"""Target probability at which a target counts as declared."""

BOOTSTRAPS = 400
"""Draws of runs for an interval."""

LABELS = {
    "guided": "guided",
    "random1": "1 random point a cell",
    "random5": "5 random points a cell",
    "guided_fine": "guided, fine grid",
    "random1_fine": "1 random point, fine grid",
    "reduced": "guided, smaller swath",
    "cell_particles": "guided, motion by particles from every cell",
    "stationary_birth": "guided, births of the stationary prior",
    "unknown_snr": "guided, SNR not known",
    "particles": "100,000 particles, ratio at their state",
    "particles_guided": "100,000 particles, guided mean of their cell",
}
"""What a method is, for people."""

PAPER_SAMPLES = {
    "fm_guided": 16_269,
    "fm_random1": 127_449,
    "fm_random5": 637_245,
    "fm_guided_fine": 20_270,
    "fm_random1_fine": 644_809,
    "cw_guided": 58_530,
    "cw_random1": 127_449,
    "cw_random5": 637_245,
    "cw_guided_fine": 72_570,
    "cw_random1_fine": 644_809,
}
"""Tables II and III: points at which the likelihood is taken, a scan."""

PAPER_SECONDS = {
    "fm_guided": (6.8, 1.8),
    "fm_random1": (6.0, 5.8),
    "fm_random5": (31.9, 30.8),
    "fm_guided_fine": (13.3, 6.9),
    "fm_random1_fine": (30.0, 29.0),
    "cw_guided": (22.3, 10.2),
    "cw_random1": (4.3, 4.1),
    "cw_random5": (27.9, 27.1),
    "cw_guided_fine": (79.4, 15.4),
    "cw_random1_fine": (21.5, 20.7),
}
"""Tables II and III: first and later measurement update; s."""


def rows(results: Results) -> list[Row]:
    """The study's numbers; a setting that has not run leaves its rows out."""
    found: list[Row] = []
    for pulse in PULSES:
        for method in (*METHODS, "reduced", *BEYOND):
            data = whole(results, f"{pulse}_{method}")
            if data is not None:
                found += _of_method(pulse, method, data)
    return found


def whole(results: Results, name: str) -> xr.Dataset | None:
    """Runs of a setting, if there are any, in none of which a return found no place."""
    data = finished(results, name)
    if data is not None and int(data.lost.max()):
        raise InputError(f"{name}: {int(data.lost.max())} returns of a ping found no place; expected none.")
    return data


def probability(data: xr.Dataset) -> np.ndarray:
    """Target probability, runs by scans."""
    return 1 / (1 + np.exp(-data.log_odds.values.astype(float)))


def _of_method(pulse: str, method: str, data: xr.Dataset) -> list[Row]:
    key, label = f"{pulse}_{method}", f"{pulse.upper()}, {LABELS[method]}"
    seen, blank = scene.in_view(pulse), scene.blanked(pulse)
    odds = probability(data)
    found = [
        _over_window(f"{key}_rmse_km", f"{label}: error of the position", "km", data.error.values / 1e3),
        _over_window(f"{key}_velocity_rmse", f"{label}: error of the velocity", "m/s", data.velocity_error.values),
        _mean(f"{key}_probability", f"{label}: target probability in view", odds[:, seen]),
        _mean(f"{key}_blanked_probability", f"{label}: target probability while blanked", odds[:, blank]),
        *_declared(key, label, odds, seen),
    ]
    if method in METHODS or method == "reduced":
        found.append(_samples(key, label, method, data))
    if method in METHODS:
        found += _times(pulse, method, label)
    if method == "unknown_snr":
        found.append(_snr(key, label, data))
    return found


def _over_window(key: str, name: str, unit: str, errors: np.ndarray) -> Row:
    def over_scans(errors: np.ndarray) -> float:
        return float(rmse(errors[:, WINDOW]).mean())

    return Row(key, name, unit, None, over_scans(errors), _bootstrapped(over_scans, errors))


def _mean(key: str, name: str, values: np.ndarray) -> Row:
    return Row(key, name, "1", None, float(values.mean()), _bootstrapped(lambda runs: float(runs.mean()), values))


def _declared(key: str, label: str, odds: np.ndarray, seen: np.ndarray) -> list[Row]:
    """When the target is declared, and the share of runs in which that is in the first or second scan in view."""
    first = int(np.flatnonzero(seen)[0])
    after = odds[:, first:] >= DECLARE
    scan = np.where(after.any(axis=1), first + 1 + after.argmax(axis=1), np.inf)
    soon = int((scan <= first + 2).sum())
    low, high = binomial_interval(soon, len(scan))
    return [
        Row(
            f"{key}_declared_scan",
            f"{label}: scan of declaration, median (first in view: {first + 1})",
            "scan",
            None,
            float(np.median(scan)),
            quantile_interval(scan, 0.5),
        ),
        Row(
            f"{key}_declared_soon",
            f"{label}: share of runs declared within two scans of coming into view",
            "1",
            None,
            soon / len(scan),
            (float(low), float(high)),
        ),
    ]


def _samples(key: str, label: str, method: str, data: xr.Dataset) -> Row:
    """Points a scan: of the guided ones as many as there were, of the random ones as many as there are cells."""
    name, paper = f"{label}: points at which the ratio is taken", PAPER_SAMPLES.get(key)
    if method.startswith("random"):
        cells = scene.grid(scene.FINE if method.endswith("_fine") else scene.BASE).size
        return Row(f"{key}_samples", name, "1", paper, float(cells * int(method[len("random")])))
    each = data.samples.values.mean(axis=1)
    return Row(
        f"{key}_samples", name, "1", paper, float(each.mean()), _bootstrapped(lambda runs: float(runs.mean()), each)
    )


def _times(pulse: str, method: str, label: str) -> list[Row]:
    first, later = update_seconds(pulse, method)
    of_first, of_later = PAPER_SECONDS[f"{pulse}_{method}"]
    key = f"{pulse}_{method}_update_ms"
    return [
        Row(f"{key}_first", f"{label}: first measurement update", "ms", 1e3 * of_first, 1e3 * first),
        Row(key, f"{label}: later measurement update", "ms", 1e3 * of_later, 1e3 * later),
    ]


def _snr(key: str, label: str, data: xr.Dataset) -> Row:
    """Mean SNR under the belief at the last scan before the blanked zone."""
    levels = np.asarray(runs.LEVELS_DB.values)
    mean = data.snr.values[:, WINDOW.stop - 1] @ levels
    name = f"{label}: mean SNR at scan 29 (true: {scene.SNR_DB} dB)"
    return Row(
        f"{key}_snr_db", name, "dB", None, float(mean.mean()), _bootstrapped(lambda runs: float(runs.mean()), mean)
    )


def _bootstrapped(statistic: Callable[[np.ndarray], float], values: np.ndarray) -> tuple[float, float]:
    low, high = bootstrap_interval(statistic, values, BOOTSTRAPS)
    return float(low), float(high)
