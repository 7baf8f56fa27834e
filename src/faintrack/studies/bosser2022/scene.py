r"""Runs of the study: what is simulated, and the methods that take it in.

All methods of a run hear the same spectra, and the particle filters draw the same random numbers, so their differences
are those of the likelihoods.

The paper leaves out, and these are chosen: newborn targets are uniform over bearing, bearing rate within 0.01 rad/s and
SNR within -40 to -15 dB; 1000 particles and 250 newborn; the true target starts at any bearing, at rest; in scenario II
it comes straight towards the array, its bearing fixed; the detector and tracker of the baseline
(`faintrack.baselines`), with a false-alarm probability of 0.1 a beam, which gave the baseline the best detection.
"""

import functools
import math
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.baselines.cfar import calibrate, cell_averaging
from faintrack.baselines.detect_and_track import DetectAndTrack
from faintrack.beliefs.belief import Belief, log_gain
from faintrack.filters.bernoulli_particle import BernoulliParticleFilter
from faintrack.filters.run import Likelihood, step
from faintrack.likelihoods.lobe_width import lobe_width_likelihood
from faintrack.likelihoods.unknown_noise import UnknownNoise
from faintrack.likelihoods.white_signal import WhiteSignal
from faintrack.sensors.array import SensorArray, line_array
from faintrack.signal.beamformer import Beamformer, beamformer
from faintrack.simulation.model import draw_target
from faintrack.simulation.spectra import over_spectra
from faintrack.targets.motion import BearingMotion, piecewise_acceleration
from faintrack.targets.states import BearingState
from faintrack.targets.target import Target, UniformBirth, rates

METHODS = ("wgsml", "lwl", "cfar", "integrated")
"""The paper's three, and the likelihood whose noise is integrated out."""

LOBE = math.radians(2.12)
"""Main lobe, as the paper states it."""

NOISE_SCANS, SCANS, APPEARS = 180, 240, 60
"""Scans of a run on noise and of scenario I, and when its target appears."""

START_M, SPEED, END_DB = 6813.0, 2.0, -24.5
"""Scenario II: first range, speed towards the array in m/s, and the SNR at which it ends here."""


@dataclass(frozen=True)
class Scene:
    """Array, beams, filter and likelihoods, made once a process."""

    array: SensorArray
    plan: Beamformer
    filter: BernoulliParticleFilter
    likelihoods: dict[str, Likelihood]
    baseline: DetectAndTrack


def make_filter(
    particles: int = 1000,
    births: int = 250,
    snr_db: tuple[float, float] = (-40.0, -15.0),
    rate: float = 0.01,
) -> BernoulliParticleFilter:
    """The paper's filter, with what it leaves out."""

    def state(*values: float) -> BearingState:
        return BearingState(*(jnp.asarray(value, jnp.float32) for value in values))

    birth = UniformBirth(state(0.0, -rate, snr_db[0]), state(math.pi, rate, snr_db[1]))
    motion = BearingMotion(0.001, 0.05, noise=piecewise_acceleration)
    return BernoulliParticleFilter(Target(birth, motion, *rates(0.001, 0.999, interval=1.0)), particles, births)


@functools.cache
def scene() -> Scene:
    """The paper's array of 55 hydrophones, 300 samples a scan, 180 beams."""
    # Runs are traced, and what they share is not part of them.
    with jax.ensure_compile_time_eval():
        array = line_array(55, 0.375)
        plan = beamformer(array, sample_rate=4000.0, frame=0.075, beams=180)
        filter = make_filter()
        one = jnp.asarray(1.0, jnp.float32)
        likelihoods: dict[str, Likelihood] = {
            "wgsml": WhiteSignal(plan.grid, one),
            "lwl": lobe_width_likelihood(plan.grid, LOBE),
            "integrated": UnknownNoise(plan.grid, (-40.0, -15.0)),
        }
        detector = cell_averaging(plan.grid, guard=3, window=12, noise_power=one)
        calibration = calibrate(detector, plan, array, 0.1, jax.random.key(2022), frames=2000)
        baseline = DetectAndTrack(
            calibration.detector,
            filter.target,
            calibration.false_detections,
            bearing_std=LOBE / 4,
            lobe=LOBE,
            detection_probability=0.65,
        )
        return Scene(array, plan, filter, likelihoods, baseline)


def follow(
    key: PRNGKeyArray,
    bearing: Float[Array, " scan"],
    snr_db: Float[Array, " scan"],
    filter: BernoulliParticleFilter | None = None,
    methods: tuple[str, ...] = METHODS,
    guided: bool = False,
    estimates: bool = True,
) -> dict[str, Array]:
    """Every method on one simulated run: log odds, bearing and its standard deviation, (scan, method); log ratio.

    Without `estimates`, which take time, no bearings.

    `log_ratio` is the log of the product of (1 - q) + q I up to each scan (`faintrack.metrics.thresholds`); 0 for the
    baseline.
    """
    with jax.ensure_compile_time_eval():
        at = scene()
    filter = at.filter if filter is None else filter
    for_spectra, for_filter = jax.random.split(key)
    particles = [name for name in methods if name != "cfar"]
    beliefs = {name: filter.init(jax.random.fold_in(for_filter, 2**31 - 1)) for name in particles}
    start = (beliefs, at.baseline.init(key) if "cfar" in methods else None, jnp.zeros(len(methods)))

    def take_in(state: tuple, number: Array, spectra: Array) -> tuple[tuple, tuple[Array, ...]]:
        beliefs, standing, log_ratio = state
        scan = at.plan.scan_frame(number + 1.0, spectra)
        after, told = {}, {}
        for name in particles:
            belief, evidence = step(
                filter, at.likelihoods[name], beliefs[name], scan, jax.random.fold_in(for_filter, number), guided
            )
            after[name] = belief
            told[name] = belief.log_odds, log_gain(belief, evidence), *(_bearing(belief) if estimates else ())
        if standing is not None:
            standing, estimate = at.baseline.step(standing, scan, key)
            odds = jnp.log(estimate.existence) - jnp.log1p(-jnp.minimum(estimate.existence, 1 - 1e-7))
            bearing = (estimate.mean.bearing, estimate.std.bearing) if estimates else ()
            told["cfar"] = odds, jnp.array(0.0), *bearing
        odds, gains, *bearings = (jnp.stack(column) for column in zip(*(told[name] for name in methods), strict=True))
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


def true_bearing(key: PRNGKeyArray, scans: int) -> Float[Array, " scan"]:
    """Bearing of a target that is at rest at any bearing and moves as the filter believes (eq. 5)."""
    for_start, for_motion = jax.random.split(key)
    zero = jnp.zeros(())
    start = BearingState(jax.random.uniform(for_start, (), maxval=jnp.pi), zero, zero)

    def move(state: BearingState, key: PRNGKeyArray) -> tuple[BearingState, Array]:
        moved = make_filter().target.motion.move(state, jnp.array(1.0), key)
        return moved, moved.bearing

    return jax.lax.scan(move, start, jax.random.split(for_motion, scans))[1]


def scenario_one(key: PRNGKeyArray, snr_db: Float[Array, ""]) -> dict[str, Array]:
    """A target of fixed SNR appears after 60 of 240 scans."""
    for_target, for_run = jax.random.split(key)
    bearing = true_bearing(for_target, SCANS)
    heard_db = jnp.where(jnp.arange(SCANS) < APPEARS, -jnp.inf, snr_db)
    return errors(follow(for_run, bearing, heard_db), bearing)


def guided(key: PRNGKeyArray, snr_db: Float[Array, ""]) -> dict[str, Array]:
    """As `scenario_one` with WGSML alone, newborn particles drawn where the scan points, as on recordings."""
    for_target, for_run = jax.random.split(key)
    bearing = true_bearing(for_target, SCANS)
    heard_db = jnp.where(jnp.arange(SCANS) < APPEARS, -jnp.inf, snr_db)
    return errors(follow(for_run, bearing, heard_db, methods=("wgsml",), guided=True), bearing)


def approach(key: PRNGKeyArray) -> dict[str, Array]:
    """Scenario II: a target comes towards the array, its SNR rising by spreading (eq. 28)."""
    for_target, for_run = jax.random.split(key)
    snr_db = jnp.asarray(approach_snr_db(), jnp.float32)
    bearing = jnp.full(snr_db.shape, jax.random.uniform(for_target, (), maxval=jnp.pi))
    return errors(follow(for_run, bearing, snr_db), bearing)


def approach_snr_db() -> Float[np.ndarray, " scan"]:
    """SNR of scenario II in each scan (eq. 28); dB."""
    distance = START_M - SPEED * np.arange(int(START_M / SPEED))
    snr_db = -18.0 * np.log10(distance / 100.0)
    return snr_db[snr_db <= END_DB]


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
    for_target, for_run = jax.random.split(key)
    bearing = true_bearing(for_target, SCANS)
    heard_db = jnp.where(jnp.arange(SCANS) < APPEARS, -jnp.inf, -31.0)
    return errors(follow(for_run, bearing, heard_db, filter, ("wgsml",), guided), bearing)
