"""What is measured of runs: thresholds on existence, detection, OSPA, bearings at detection.

A method declares a target where its log odds are above its **level**, the log odds of its threshold. A target is
detected while it is declared within a lobe of its bearing.
"""

import numpy as np
import xarray as xr
from jaxtyping import Bool, Float
from scipy.special import logit

from faintrack.errors import InputError
from faintrack.metrics.sets import single_ospa
from faintrack.metrics.thresholds import Stratum, Threshold, counted_threshold
from faintrack.simulation.model import birth_probability
from faintrack.studies.bosser2022.scene import APPEARS, LOBE, METHODS, NOISE_SCANS, SCANS, make_filter
from faintrack.studies.bosser2022.settings import SNR_DB, scenario_name
from faintrack.studies.study import Results, ran

FALSE_TRACK_PROBABILITY = 1e-3
"""In 180 scans of noise."""

LABELS = {"wgsml": "WGSML", "lwl": "LWL", "cfar": "CFAR and Kalman filter", "integrated": "noise integrated out"}
"""What a method is, for people."""

PRESENT = np.arange(SCANS) >= APPEARS
"""Scans of scenario I with a target."""

MODELLED = ("wgsml", "integrated")
"""Methods whose thresholds also follow from runs drawn from the model."""


def thresholds(results: Results) -> dict[str, Threshold]:
    """By counting runs of noise."""
    highest = results("noise").highest.values
    return {
        method: counted_threshold(highest[:, column], FALSE_TRACK_PROBABILITY) for column, method in enumerate(METHODS)
    }


def levels(results: Results) -> dict[str, float]:
    """Log odds of the thresholds by counting."""
    return {method: float(logit(threshold.value)) for method, threshold in thresholds(results).items()}


def birth_share() -> float:
    """Share of the model's runs in which a target is born."""
    return birth_probability(make_filter().target, 1.0, NOISE_SCANS)


def strata(results: Results) -> dict[str, list[Stratum]]:
    """Runs drawn from the model with and without a target, for each of `MODELLED`; none where they have not run."""
    share = birth_share()
    try:
        drawn = ((share, results("modelled_born")), (1 - share, results("modelled_none")))
    except InputError:
        return {}
    return {
        method: [
            Stratum(probability, data.log_odds.values[:, :, column], data.log_ratio.values[:, :, column])
            for probability, data in drawn
        ]
        for column, method in enumerate(MODELLED)
    }


def scenario_one(results: Results) -> dict[int, xr.Dataset]:
    """Runs of scenario I by their SNR, of those that have run."""
    return ran(results, {snr_db: scenario_name(snr_db) for snr_db in SNR_DB})


def best_odds(data: xr.Dataset) -> Float[np.ndarray, "run method"]:
    """Highest log odds of each run while the bearing was within a lobe of the target; it is detected above a level."""
    near = (np.abs(data.error.values) < LOBE) & PRESENT[None, :, None]
    return np.where(near, data.log_odds.values, -np.inf).max(axis=1)


def detected(data: xr.Dataset, method: str, level: float) -> Bool[np.ndarray, "run scan"]:
    """Scans in which the target is detected."""
    column = METHODS.index(method)
    return (data.log_odds.values[..., column] > level) & (np.abs(data.error.values[..., column]) < LOBE)


def at_detection(data: xr.Dataset, method: str, level: float) -> tuple[np.ndarray, np.ndarray]:
    """Bearing error and the tracker's standard deviation where existence first passes the level with a target there."""
    column = METHODS.index(method)
    declared = (data.log_odds.values[..., column] > level) & PRESENT
    runs = np.flatnonzero(declared.any(axis=1))
    at = runs, declared.argmax(axis=1)[runs], column
    return data.error.values[at], data.bearing_std.values[at]


def ospa(
    data: xr.Dataset, method: str, level: float, present: Bool[np.ndarray, " scan"]
) -> Float[np.ndarray, "run scan"]:
    """Distance from the true target, or from none, with a cutoff of 180 degrees; radians."""
    column = METHODS.index(method)
    declared = data.log_odds.values[..., column] > level
    return single_ospa(declared, np.abs(data.error.values[..., column]), present, np.pi)
