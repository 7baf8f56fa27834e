"""The threshold on existence at which a scenario declares a false track as rarely as is wished.

Likelihood ratios are calibrated by Wald's identity, with runs drawn from the scenario's own model; what is no
likelihood ratio (lobe width, the CFAR baseline) by counting runs on noise, a hundred times as many. Both are in
`faintrack.metrics.thresholds`. Noise is drawn white and of power 1: with the noise power integrated out any other
spectrum gives the same threshold, and a noise power that is known is known.
"""

import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from faintrack.beliefs.belief import log_gain
from faintrack.errors import InputError
from faintrack.filters.run import step
from faintrack.kinds.beamforming import build_beamformer
from faintrack.kinds.calibration import Calibrated, Progress, counted_runs
from faintrack.kinds.recording.build import build_tracker
from faintrack.kinds.recording.sections import RecordingScenario
from faintrack.kinds.recording.simulate import simulated_array
from faintrack.metrics.thresholds import Stratum, counted_threshold, wald_threshold
from faintrack.sensors.array import SensorArray
from faintrack.signal.beamformer import Beamformer
from faintrack.simulation.model import birth_probability, draw_target
from faintrack.simulation.spectra import over_spectra
from faintrack.trackers.single import SingleTargetTracker

BATCH = 16
"""Runs side by side."""

WALD_RUNS = 512
"""Runs with a target where the number is not given; a quarter as many without one are drawn beside them."""

LONGEST = 100_000
"""Frames of a run at most: more would not end."""


def calibrate(
    scenario: RecordingScenario, probability: float, duration: float, runs: int | None, seed: int, progress: Progress
) -> Calibrated:
    """Threshold of a scenario for a probability of a false track in a stated time.

    Parameters
    ----------
    scenario : with an array, and a band or a simulation that tells the sample rate.
    probability : of a false track in `duration`.
    duration : s.
    runs : with a target, or on noise where runs are counted; where not given, 512 or twenty over the probability.
    seed : of the random numbers.
    progress : is called with the runs drawn just now, and the number of all.

    Raises
    ------
    InputError : duration out of range; the sample rate is not known; runs too few to reach the probability.
    """
    interval = scenario.analysis.frame
    if not interval <= duration <= LONGEST * interval:
        raise InputError(
            f"duration is {duration:g} s; expected from {interval:g} s, one frame, to {LONGEST * interval:g} s."
        )
    array, frames = simulated_array(scenario), round(duration / interval)
    analysis, elevation = scenario.analysis, scenario.target.elevation_deg
    plan = build_beamformer(analysis, array, _sample_rate(scenario), analysis.taper, elevation)
    # A false track begins with one target that is sought: the threshold is that of the filter of one.
    alone = scenario.model_copy(update={"tracker": scenario.tracker.model_copy(update={"targets": 1})})
    tracker = build_tracker(alone, array, plan, np.ones(plan.grid.frequency.size, np.float32))
    time = interval * jnp.arange(1.0, frames + 1)
    if not isinstance(tracker, SingleTargetTracker) or scenario.likelihood.kind == "lobe_width":
        count = counted_runs(probability, runs)
        run = jax.jit(jax.vmap(_on_noise(tracker, plan, array, time)))
        (highest,) = _drawn(run, count, jax.random.key(seed), lambda drawn: progress(drawn, count))
        return Calibrated(counted_threshold(highest, probability), "counting", count)
    with_target = WALD_RUNS if runs is None else runs
    without = max(with_target // 4, 2)
    born = birth_probability(tracker.filter.target, interval, frames)
    modelled = jax.jit(jax.vmap(_modelled(tracker, plan, array, time), in_axes=(None, 0)))
    strata = []
    for count, share, present in ((with_target, born, True), (without, 1 - born, False)):
        key = jax.random.fold_in(jax.random.key(seed), int(present))
        of_stratum = functools.partial(modelled, jnp.array(present))
        drawn = _drawn(of_stratum, count, key, lambda done: progress(done, with_target + without))
        strata.append(Stratum(share, *drawn))
    return Calibrated(wald_threshold(strata, probability), "Wald's identity", with_target + without)


def _sample_rate(scenario: RecordingScenario) -> float:
    """Of the simulation where there is one, else enough for the band."""
    if scenario.simulation is not None:
        return scenario.simulation.sample_rate
    if scenario.analysis.band is None:
        raise InputError(
            "the sample rate is not known; expected simulation.sample_rate (--sample-rate HZ), or analysis.band "
            "(--band LOW HIGH) to take it from."
        )
    return 2.5 * scenario.analysis.band[1]


def _drawn(
    run: Callable[[PRNGKeyArray], tuple[Array, ...]], count: int, key: PRNGKeyArray, progress: Callable[[int], None]
) -> tuple[np.ndarray, ...]:
    """Results of so many runs, drawn in batches; `run` takes the keys of a batch."""
    batches = []
    for first in range(0, count, BATCH):
        keys = jax.vmap(functools.partial(jax.random.fold_in, key))(first + np.arange(BATCH))
        used = min(BATCH, count - first)
        batches.append([np.asarray(values)[:used] for values in run(keys)])
        progress(used)
    return tuple(np.concatenate(column) for column in zip(*batches, strict=True))


def _modelled(
    tracker: SingleTargetTracker, plan: Beamformer, array: SensorArray, time: Float[Array, " scan"]
) -> Callable[[Bool[Array, ""], PRNGKeyArray], tuple[Array, ...]]:
    """A run of the tracker's own model, with a target or without: log odds and log ratio after every frame."""
    filter = tracker.filter

    def run(present: Bool[Array, ""], key: PRNGKeyArray) -> tuple[Array, ...]:
        for_target, for_spectra, for_filter = jax.random.split(key, 3)
        states, there = draw_target(for_target, filter.target, time)
        snr_db = jnp.where(there & present, states.snr_db, -jnp.inf)

        def take_in(state: tuple, number: Array, spectra: Array) -> tuple[tuple, tuple[Array, Array]]:
            belief, log_ratio = state
            scan = plan.scan_frame(time[number], spectra)
            key = jax.random.fold_in(for_filter, number)
            belief, log_evidence = step(filter, tracker.likelihood, belief, scan, key, tracker.guided)
            log_ratio = log_ratio + log_gain(belief, log_evidence)
            return (belief, log_ratio), (belief.log_odds, log_ratio)

        start = filter.init(jax.random.fold_in(for_filter, time.size)), jnp.zeros(())
        elevation = getattr(states, "elevation", None)
        source = states.bearing, snr_db
        return over_spectra(take_in, start, for_spectra, array, plan.grid, *source, elevation=elevation)[1]

    return run


def _on_noise(
    tracker: Any, plan: Beamformer, array: SensorArray, time: Float[Array, " scan"]
) -> Callable[[PRNGKeyArray], tuple[Array, ...]]:
    """A run on noise: the highest log odds of existence."""

    def run(key: PRNGKeyArray) -> tuple[Array, ...]:
        for_spectra, for_filter = jax.random.split(key)

        def take_in(following: Any, number: Array, spectra: Array) -> tuple[Any, Array]:
            following, estimate = tracker.step(following, plan.scan_frame(time[number], spectra), for_filter)
            # Existence in single precision is below 1 by 6e-8 or not at all.
            return following, jax.scipy.special.logit(jnp.clip(estimate.existence, 1e-7, 1 - 1e-7))

        silence = jnp.zeros_like(time), jnp.full_like(time, -jnp.inf)
        odds = over_spectra(take_in, tracker.init(for_filter), for_spectra, array, plan.grid, *silence)[1]
        return (odds.max(),)

    return run
