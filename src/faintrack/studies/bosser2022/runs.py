"""Runs of the study: what is simulated, and the methods that take it in.

All methods of a run hear the same spectra, and the particle filters draw the same random numbers, so their differences
are those of the likelihoods.
"""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.beliefs.belief import Belief, log_gain
from faintrack.filters.bernoulli_particle import BernoulliParticleFilter
from faintrack.filters.run import step
from faintrack.simulation.model import draw_target
from faintrack.simulation.spectra import over_spectra
from faintrack.studies.bosser2022 import scene
from faintrack.studies.bosser2022.scene import APPEARS, NOISE_SCANS, SCANS, approach_snr_db, make_filter, true_bearing


def follow(
    key: PRNGKeyArray,
    bearing: Float[Array, " scan"],
    snr_db: Float[Array, " scan"],
    filter: BernoulliParticleFilter | None = None,
    methods: tuple[str, ...] = scene.METHODS,
    guided: bool = False,
    estimates: bool = True,
) -> dict[str, Array]:
    """Every method on one simulated run: log odds, bearing and its standard deviation, (scan, method); log ratio.

    Without `estimates`, which take time, no bearings.

    `log_ratio` is the log of the product of (1 - q) + q I up to each scan (`faintrack.metrics.thresholds`); 0 for the
    baseline.
    """
    with jax.ensure_compile_time_eval():
        at = scene.scene()
    filter = at.filter if filter is None else filter
    for_spectra, for_filter = jax.random.split(key)
    particles = [name for name in methods if name != "cfar"]
    beliefs = {name: filter.init(jax.random.fold_in(for_filter, 2**31 - 1)) for name in particles}
    start = (beliefs, at.baseline.init(key) if "cfar" in methods else None, jnp.zeros(len(methods)))

    def take_in(state: tuple, number: Array, spectra: Array) -> tuple[tuple, tuple[Array, ...]]:
        beliefs, standing, log_ratio = state
        scan = at.plan.scan_frame(number + 1.0, spectra)
        after, said = {}, {}
        for name in particles:
            belief, evidence = step(
                filter, at.likelihoods[name], beliefs[name], scan, jax.random.fold_in(for_filter, number), guided
            )
            after[name] = belief
            said[name] = belief.log_odds, log_gain(belief, evidence), *(_bearing(belief) if estimates else ())
        if standing is not None:
            standing, estimate = at.baseline.step(standing, scan, key)
            odds = jnp.log(estimate.existence) - jnp.log1p(-jnp.minimum(estimate.existence, 1 - 1e-7))
            bearing = (estimate.mean.bearing, estimate.std.bearing) if estimates else ()
            said["cfar"] = odds, jnp.array(0.0), *bearing
        odds, gains, *bearings = (jnp.stack(column) for column in zip(*(said[name] for name in methods), strict=True))
        log_ratio = log_ratio + gains
        return (after, standing, log_ratio), (odds, log_ratio, *bearings)

    kept = over_spectra(take_in, start, for_spectra, at.array, at.plan.grid, bearing, snr_db)[1]
    return dict(zip(("log_odds", "log_ratio", "bearing", "bearing_std"), kept, strict=False))


def _bearing(belief: Belief) -> tuple[Array, Array]:
    """Mean bearing and its standard deviation; the array is a line, no bearing wraps."""
    weights = jnp.exp(belief.log_weights)
    middle = jnp.sum(weights * belief.states.bearing)
    return middle, jnp.sqrt(jnp.sum(weights * (belief.states.bearing - middle) ** 2))


def noise(key: PRNGKeyArray) -> dict[str, Array]:
    """Highest log odds of every method in 180 scans of noise."""
    silence = jnp.full(NOISE_SCANS, -jnp.inf)
    return {"highest": follow(key, jnp.ones(NOISE_SCANS), silence, estimates=False)["log_odds"].max(axis=0)}


def appearing(key: PRNGKeyArray, snr_db: Float[Array, ""] | float, **options: Any) -> dict[str, Array]:
    """A target of fixed SNR appears after 60 of 240 scans; `options` as in `follow`."""
    for_target, for_run = jax.random.split(key)
    bearing = true_bearing(for_target, SCANS)
    in_scan_db = jnp.where(jnp.arange(SCANS) < APPEARS, -jnp.inf, snr_db)
    return errors(follow(for_run, bearing, in_scan_db, **options), bearing)


def scenario_one(key: PRNGKeyArray, snr_db: Float[Array, ""]) -> dict[str, Array]:
    """Scenario I: `appearing`, every method."""
    return appearing(key, snr_db)


def guided(key: PRNGKeyArray, snr_db: Float[Array, ""]) -> dict[str, Array]:
    """As `scenario_one` with WGSML alone, newborn particles drawn where the scan points, as on recordings."""
    return appearing(key, snr_db, methods=("wgsml",), guided=True)


def approach(key: PRNGKeyArray) -> dict[str, Array]:
    """Scenario II: a target comes towards the array, its SNR rising by spreading (eq. 28)."""
    for_target, for_run = jax.random.split(key)
    snr_db = jnp.asarray(approach_snr_db(), jnp.float32)
    bearing = jnp.full(snr_db.shape, jax.random.uniform(for_target, (), maxval=jnp.pi))
    return errors(follow(for_run, bearing, snr_db), bearing)


def errors(run: dict[str, Array], bearing: Float[Array, " scan"]) -> dict[str, Array]:
    """What is kept of a run with a target."""
    return {
        "log_odds": run["log_odds"],
        "error": run["bearing"] - bearing[:, None],
        "bearing_std": run["bearing_std"],
    }


def modelled(
    key: PRNGKeyArray,
    born: Float[Array, ""] | float,
    filter: BernoulliParticleFilter | None = None,
    methods: tuple[str, ...] = ("wgsml", "integrated"),
    guided: bool = False,
) -> dict[str, Array]:
    """A run drawn from the filter's own model, given that a target is born (1) or that none is (0)."""
    for_target, for_run = jax.random.split(key)
    filter = make_filter() if filter is None else filter
    states, present = draw_target(for_target, filter.target, jnp.arange(1.0, NOISE_SCANS + 1))
    snr_db = jnp.where(present & (born > 0), states.snr_db, -jnp.inf)
    run = follow(for_run, states.bearing, snr_db, filter, methods, guided, estimates=False)
    return {name: run[name] for name in ("log_odds", "log_ratio")}


VARIANTS: dict[str, dict[str, Any]] = {
    "as_chosen": {},
    "particles_4000": {"particles": 4000, "births": 1000},
    "particles_300": {"particles": 300, "births": 75},
    "births_1000": {"births": 1000},
    "snr_prior_wide": {"snr_db": (-40.0, 0.0)},
    "snr_prior_narrow": {"snr_db": (-34.0, -25.0)},
    "rate_prior_wide": {"rate": 0.03},
    "guided": {"guided": True},
}
"""What is chosen, one thing changed at a time."""


def variant(key: PRNGKeyArray, name: str, wald: bool) -> dict[str, Array]:
    """Scenario I at -31 dB, or a run drawn from the model with a target, with a variant of the filter."""
    options = dict(VARIANTS[name])
    guided = bool(options.pop("guided", False))
    filter = make_filter(**options)
    if wald:
        return modelled(key, 1.0, filter, ("wgsml",), guided)
    return appearing(key, -31.0, filter=filter, methods=("wgsml",), guided=guided)
