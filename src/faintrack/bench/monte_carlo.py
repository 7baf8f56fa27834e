"""Simulated runs of scenario I of bosser2022, on workers as a study runs them: draw spectra, form beams, filter."""

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from faintrack.beliefs.belief import Belief
from faintrack.bench.machine import Machine, beam_operations
from faintrack.bench.rows import Row, Timing, row, timed
from faintrack.bench.sizes import Sizes
from faintrack.filters.bernoulli_particle import BernoulliParticleFilter
from faintrack.filters.run import step
from faintrack.likelihoods.white_signal import WhiteSignal
from faintrack.sensors.array import line_array
from faintrack.signal.beamformer import beamformer
from faintrack.simulation.spectra import over_spectra
from faintrack.studies.running import connect
from faintrack.targets.motion import BearingMotion, piecewise_acceleration
from faintrack.targets.states import BearingState
from faintrack.targets.target import Target, UniformBirth, rates

RUNS = 32
"""Runs side by side in a worker."""
SNR_DB = -31.0
"""Where half of the runs are detected."""
SAMPLES, SAMPLE_RATE = 300, 4000.0
"""Samples of a channel in a scan, and Hz."""


def scenario1_run_step(machine: Machine, sizes: Sizes) -> Row:
    """One scan of one run, everything included; the source is there in the last three quarters."""
    with connect() as client:
        workers = list(client.scheduler_info()["workers"])
        futures = [client.submit(run_batches, sizes, workers=[worker], pure=False) for worker in workers]
        timings = [future.result() for future in futures]
    least, median, compiling = zip(*map(dataclasses.astuple, timings), strict=True)
    timing = Timing(float(np.mean(least)), float(np.mean(median)), max(compiling))
    frequencies = SAMPLES // 2 - 1
    limit = machine.seconds(
        beam_operations(frequencies, sizes.beams, sizes.channels, columns=1),
        2 * frequencies * sizes.channels + 3 * (sizes.particles + sizes.births),
    )
    note = (
        f"one scan of one run of bosser2022, scenario I: {sizes.channels} channels, {SAMPLES} samples, "
        f"{sizes.beams} beams, {sizes.particles} + {sizes.births} particles, spectra drawn in its time; {RUNS} runs"
        f" of {sizes.steps} scans side by side in each of {len(workers)} workers of one thread, as in a study; no "
        "peer; limit: its random numbers drawn at once and beam sums at the rate of a large matrix product"
    )
    # All workers compute at once, so each takes its share of the machine.
    share = len(workers) * RUNS * sizes.steps
    return row("scenario1_run_step", "ms", timing.per(share), note, 0.3, limit=limit)


def run_batches(sizes: Sizes) -> Timing:
    """Time of a batch of runs in this process."""
    array = line_array(sizes.channels, 0.375)
    plan = beamformer(array, SAMPLE_RATE, frame=SAMPLES / SAMPLE_RATE, beams=sizes.beams)

    def state(*values: float) -> BearingState:
        return BearingState(*(jnp.asarray(value, jnp.float32) for value in values))

    target = Target(
        UniformBirth(state(0.0, -0.01, -40.0), state(math.pi, 0.01, -15.0)),
        BearingMotion(noise=piecewise_acceleration),
        *rates(birth_probability=0.001, survival_probability=0.999, interval=1.0),
    )
    filter = BernoulliParticleFilter(target, sizes.particles, sizes.births)
    likelihood = WhiteSignal(plan.grid, jnp.asarray(1.0, jnp.float32))
    time = jnp.arange(1.0, sizes.steps + 1)
    bearing = jnp.full_like(time, np.radians(60.0))
    snr_db = jnp.where(time > sizes.steps / 4, SNR_DB, -jnp.inf)

    def existence(key: Array) -> Float[Array, " scan"]:
        for_data, for_filter = jax.random.split(key)

        def take_in(belief: Belief, number: Array, spectra: Array) -> tuple[Belief, Array]:
            scan = plan.scan_frame(time[number], spectra)
            belief, _ = step(filter, likelihood, belief, scan, jax.random.fold_in(for_filter, number))
            return belief, belief.existence

        start = filter.init(jax.random.fold_in(for_filter, sizes.steps))
        return over_spectra(take_in, start, for_data, array, plan.grid, bearing, snr_db)[1]

    runs, keys = jax.jit(jax.vmap(existence)), jax.random.split(jax.random.key(0), RUNS)
    return timed(lambda: runs(keys), sizes.repeat_seconds)
