"""What is read off the runs: the study's rows.

Errors are root mean squares over the runs, scan by scan, of the cell with the highest probability (the paper's MAP
estimate); a row has their mean over scans 14 to 29, as read off its figures. Target probabilities are means over the
scans in which the sonar can hear the target, or in which it is blanked. Intervals are by bootstrap over the runs.

Times are of one measurement update, measured when the rows are made, on the machine that makes them, after
compilation: the first includes what can be used again while source and receiver stand still.
"""

import numpy as np
import xarray as xr

from faintrack.errors import InputError
from faintrack.metrics.accuracy import rmse
from faintrack.studies.aughenbaugh2010 import runs, scene
from faintrack.studies.aughenbaugh2010.settings import BEYOND, METHODS, PULSES
from faintrack.studies.aughenbaugh2010.timing import update_seconds
from faintrack.studies.printed import PRINTED
from faintrack.studies.rows import beside, bootstrapped, mean, median, row, share
from faintrack.studies.study import Results, Row, finished

WINDOW = slice(13, 29)
"""Scans 14 to 29."""

DECLARE = 0.9
"""Target probability at which a target counts as declared."""

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


def rows(results: Results) -> list[Row]:
    """The study's numbers; a setting that has not run leaves its rows out."""
    settings = ((pulse, method) for pulse in PULSES for method in (*METHODS, "reduced", *BEYOND))
    ran = ((pulse, method, whole(results, f"{pulse}_{method}")) for pulse, method in settings)
    ours = [
        of_method for pulse, method, data in ran if data is not None for of_method in _of_method(pulse, method, data)
    ]
    return beside(PRINTED["aughenbaugh2010"], ours)


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
    ours = [
        _over_window(f"{key}_rmse_km", f"{label}: error of the position", "km", data.error.values / 1e3),
        _over_window(f"{key}_velocity_rmse", f"{label}: error of the velocity", "m/s", data.velocity_error.values),
        mean(f"{key}_probability", f"{label}: target probability in view", "1", odds[:, seen]),
        mean(f"{key}_blanked_probability", f"{label}: target probability while blanked", "1", odds[:, blank]),
        *_declared(key, label, odds, seen),
    ]
    if method in METHODS or method == "reduced":
        ours.append(_samples(key, label, method, data))
    if method in METHODS:
        first, later = update_seconds(pulse, method)
        ours.append(row(f"{key}_update_ms_first", f"{label}: first measurement update", "ms", 1e3 * first))
        ours.append(row(f"{key}_update_ms", f"{label}: later measurement update", "ms", 1e3 * later))
    if method == "unknown_snr":
        # Under the belief at the last scan before the blanked zone.
        snr_db = data.snr.values[:, WINDOW.stop - 1] @ np.asarray(runs.LEVELS_DB.values)
        ours.append(mean(f"{key}_snr_db", f"{label}: mean SNR at scan 29 (true: {scene.SNR_DB} dB)", "dB", snr_db))
    return ours


def _over_window(key: str, name: str, unit: str, errors: np.ndarray) -> Row:
    return bootstrapped(key, name, unit, lambda errors: rmse(errors[:, WINDOW]).mean(), errors)


def _declared(key: str, label: str, odds: np.ndarray, seen: np.ndarray) -> list[Row]:
    """When the target is declared, and the share of runs in which that is in the first or second scan in view."""
    first = int(np.flatnonzero(seen)[0])
    after = odds[:, first:] >= DECLARE
    scan = np.where(after.any(axis=1), first + 1 + after.argmax(axis=1), np.inf)
    in_view = f"{label}: scan of declaration, median (first in view: {first + 1})"
    soon = f"{label}: share of runs declared within two scans of coming into view"
    return [
        median(f"{key}_declared_scan", in_view, "scan", scan),
        share(f"{key}_declared_soon", soon, int((scan <= first + 2).sum()), len(scan)),
    ]


def _samples(key: str, label: str, method: str, data: xr.Dataset) -> Row:
    """Points a scan: of the guided ones as many as there were, of the random ones as many as there are cells."""
    key, name = f"{key}_samples", f"{label}: points at which the ratio is taken"
    if method.startswith("random"):
        cells = scene.grid(scene.FINE if method.endswith("_fine") else scene.BASE).size
        return row(key, name, "1", float(cells * int(method[len("random")])))
    return mean(key, name, "1", data.samples.values.mean(axis=1))
