r"""What is read off the runs: the study's rows.

A target is declared in a scan where its existence is above 0.6. As in the paper every scan counts by itself: of 40
scans of a run 15 have no target, and of those the share in which one is declared is the probability of a false alarm;
of the other 25 it is that of detection. All six numbers of the paper's table 2 are whole counts of 1500 and 2500 scans
in 100 runs: the 53.33 % of IMM-PDA are 8 scans in every run, as if it never ended a track in the eight scans after the
target, and never had a false one before.

**Delay** is the time from the first scan with the target to the first in which it is declared, 25 s where it never is;
**termination** that from the last scan with the target to the first in which it is not declared, 8 s where that does
not come, over the runs that had it declared at the last. Both are means over runs.

**Errors** are over runs in which the target is declared in the scan, against the posterior Cramer-Rao bound for a
target that is there throughout, with the birth density before scan 8 and the true paths; a ratio is the mean over scans
20 to 32. The bound takes the target's bearing to be known among the others; with the information that false bearings
leave (`faintrack.metrics.cramer_rao.bearing_information`) it is `crlb_clutter_m`. The paper's target always starts in
the very middle of the birth density, which therefore helps more than the bound allows for, and a ratio below 1 is no
contradiction; `_drawn` are runs whose target starts where that density says, for which the bound holds. Tracks that
follow false bearings are part of the root mean square; `median_error_m` hardly notices them.

Intervals are by bootstrap over runs.
"""

from collections.abc import Callable, Iterator

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from faintrack.errors import InputError
from faintrack.metrics.cramer_rao import bearing_information, posterior_bound
from faintrack.metrics.intervals import bootstrap_interval
from faintrack.studies.liu2013 import runs, scene
from faintrack.studies.liu2013.settings import DETECTION, FALSE, GROUPS, PARTICLES
from faintrack.studies.printed import PRINTED
from faintrack.studies.rows import BOOTSTRAPS, beside, bootstrapped, mean, row
from faintrack.studies.study import Results, Row, finished

LABELS = {
    "particle": "particles with a bit (the paper's)",
    "bernoulli": "Bernoulli particle filter",
    "ipda": "IPDA",
    "immpda": "IMM-PDA",
}

WINDOW = slice(19, 32)
"""Scans 20 to 32."""

VARIED = {
    "false": (FALSE, "{} false bearings a scan"),
    "detection": (DETECTION, "P_D {} %"),
    "particles": (PARTICLES, "{} particles"),
}
"""What is varied: beginning of its settings' names, values, and how a value is said."""


def rows(results: Results) -> list[Row]:
    """The study's numbers; a setting that has not run leaves its rows out."""
    ours: list[Row] = []
    for births, title in (("start", ""), ("region", ", births over the region"), ("along", ", births along bearings")):
        suffix = "" if births == "start" else f"_{births}"
        for kind, form, data in methods(results, births):
            ours += _detection(kind, form, data, suffix, title)
            ours += _times(kind, form, data, suffix, title)
            ours += _accuracy(kind, form, data, suffix, title)
    for kind, form, data in methods(results, "drawn"):
        ours += _accuracy(kind, form, data, "_drawn", ", start drawn from the births")
    for prefix, (values, title) in VARIED.items():
        for value in values:
            for kind, form, data in methods(results, f"{prefix}_{value}"):
                suffix, said = f"_{prefix}_{value}", ", " + title.format(value)
                ours += _detection(kind, form, data, suffix, said)
                ours += _accuracy(kind, form, data, suffix, said)
    return beside(PRINTED["liu2013"], [*ours, *_bounds(results), *_chosen()])


def methods(results: Results, name: str) -> Iterator[tuple[str, str, xr.Dataset]]:
    """Every method that has run in a setting: kind, form, and its runs."""
    for group, kinds in GROUPS.items():
        data = finished(results, f"{name}_{group}")
        if data is None:
            continue
        if lost := int(data.lost.values.max()):
            raise InputError(f"{name}_{group}: {lost} bearings of a run found no place; expected none.")
        for number, kind in enumerate(kinds):
            for place, form in enumerate(runs.FORMS):
                yield kind, form, data.isel(kind=number, form=place)


def declared(data: xr.Dataset, threshold: float = scene.DECLARE) -> np.ndarray:
    """Whether a target is declared, runs by scans."""
    with np.errstate(divide="ignore"):
        return np.asarray(data.log_odds.values > np.log(threshold) - np.log1p(-threshold))


def squares(data: xr.Dataset) -> np.ndarray:
    """Squared error of the position where a target is declared, NaN elsewhere; m^2, runs by scans."""
    return np.where(declared(data), data.error.values.astype(float) ** 2, np.nan)


def probabilities(declared: np.ndarray) -> np.ndarray:
    """Probabilities of a false alarm and of detection from what was declared, runs by scans."""
    present = scene.present()
    return np.array([declared[:, ~present].mean(), declared[:, present].mean()])


def bound(data: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Bound of the position over the runs in scans 8 to 32: with the bearing known, and among false ones; m."""
    states = np.zeros((data.sizes["run"], scene.LAST - scene.FIRST + 1, 4), np.float32)
    # The Jacobians depend on the place alone.
    states[..., :2] = np.stack([data.x.values, data.y.values], axis=-1)[:, scene.present()]
    sensor = scene.sensor()
    covariance, noise, error = _gaussians()

    def position(share: float) -> np.ndarray:
        least = posterior_bound(states, np.linalg.inv(covariance), _move, noise, _measure, error, share)
        return np.sqrt(least[:, 0, 0] + least[:, 1, 1])

    return position(1.0), position(bearing_information(sensor)[0])


@jax.jit
def _gaussians() -> tuple[jax.Array, ...]:
    """Covariances at birth, of the motion's noise and of a bearing, as the classics have them."""
    single = runs.classic(scene.sensor(), jnp.array(False), scene.around_start())
    return single.birth.covariance, single.noise, single.association.error


def _move(state: jax.Array) -> jax.Array:
    return state.at[:2].add(scene.INTERVAL * state[2:])


def _measure(state: jax.Array, scan: jax.Array) -> jax.Array:
    observer, at = scene.observer(), scene.FIRST - 1 + scan
    return jnp.arctan2(state[1] - observer.y[at], state[0] - observer.x[at])[None]


def _detection(kind: str, form: str, data: xr.Dataset, suffix: str, title: str) -> list[Row]:
    above, name = declared(data), _name(kind, form, title)
    values = probabilities(above).tolist()
    ends = zip(*bootstrap_interval(probabilities, above, BOOTSTRAPS), strict=True)
    measures = (("pfa", "scans with a false alarm"), ("pd", "scans with a detection"))
    return [
        row(f"{key}_{kind}{form}{suffix}", f"{name}: {what}", "1", value, interval)
        for (key, what), value, interval in zip(measures, values, ends, strict=True)
    ]


def _times(kind: str, form: str, data: xr.Dataset, suffix: str, title: str) -> list[Row]:
    above, name = declared(data), _name(kind, form, title)
    here, after = above[:, scene.FIRST - 1 : scene.LAST], above[:, scene.LAST :]
    delay = np.where(here.any(axis=1), here.argmax(axis=1), here.shape[1]) * scene.INTERVAL
    gone = (np.where(after.all(axis=1), after.shape[1], after.argmin(axis=1)) + 1) * scene.INTERVAL
    gone = np.minimum(gone, after.shape[1] * scene.INTERVAL)[here[:, -1]]
    ours = [mean(f"delay_{kind}{form}{suffix}_s", f"{name}: delay of the declaration, mean", "s", delay)]
    if gone.size:
        ours.append(mean(f"termination_{kind}{form}{suffix}_s", f"{name}: time to termination, mean", "s", gone))
    return ours


def _accuracy(kind: str, form: str, data: xr.Dataset, suffix: str, title: str) -> list[Row]:
    """Ratio to the bound, where that is the setting's; root mean square; median."""
    errors, name = squares(data)[:, WINDOW], _name(kind, form, title)
    if np.isnan(errors).all(axis=0).any():
        return []
    least = bound(data)[0][-errors.shape[1] :]

    def over_window(key: str, what: str, unit: str, statistic: Callable[[np.ndarray], float]) -> Row:
        key = f"{key}{'' if kind == 'particle' else '_' + kind}{form}{suffix}"
        return bootstrapped(key, f"{name}: {what}, scans 20 to 32", unit, statistic, errors)

    ours = [
        over_window("rms_m", "RMS error of the position", "m", lambda e: np.sqrt(np.nanmean(e))),
        over_window("median_error_m", "median error of the position", "m", lambda e: np.sqrt(np.nanmedian(e))),
    ]
    if suffix in ("", "_drawn") or suffix.startswith("_particles"):
        ratio = over_window(
            "rms_ratio_crlb", "RMS error over the bound", "1", lambda e: np.mean(np.sqrt(np.nanmean(e, axis=0)) / least)
        )
        ours.insert(0, ratio)
    return ours


def _bounds(results: Results) -> list[Row]:
    start = next(methods(results, "start"), None)
    if start is None:
        return []
    alone, among = (float(least[WINDOW.start - scene.LAST - 1 :].mean()) for least in bound(start[2]))
    title = "posterior Cramer-Rao bound of the position, scans 20 to 32"
    return [
        row("crlb_m", title, "m", alone),
        row("crlb_clutter_m", f"{title}, with the information that false bearings leave", "m", among),
    ]


def _chosen() -> list[Row]:
    """What the paper does not print."""
    return [
        row(f"chosen_{key}", f"chosen: {chosen.name}", chosen.unit, chosen.value)
        for key, chosen in scene.CHOSEN.items()
    ]


def _name(kind: str, form: str, title: str) -> str:
    return f"{LABELS[kind]}, {'full' if form else 'published'} likelihood{title}"
