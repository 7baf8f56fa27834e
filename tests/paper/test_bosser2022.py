"""The paper's statistics in small: at -31 dB about half of the runs of scenario I are detected (bosser2022, figure 2a).

Parameters that the paper leaves out: births uniform over bearing, bearing rate within 0.01 rad/s, SNR uniform from -40
to -15 dB, 1000 particles and 250 births.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array, PRNGKeyArray

from faintrack.beliefs.belief import mean
from faintrack.filters.bernoulli_particle import BernoulliParticleFilter
from faintrack.filters.run import run
from faintrack.likelihoods.white_signal import WhiteSignal
from faintrack.sensors.array import line_array
from faintrack.signal.beamformer import beamformer
from faintrack.simulation.spectra import draw_spectra
from faintrack.targets.motion import BearingMotion, piecewise_acceleration
from faintrack.targets.states import BearingState
from faintrack.targets.target import Target, UniformBirth, rates

RUNS = 200
SCANS, APPEARS = 240, 60
THRESHOLD = 0.968
LOBE = np.radians(2.12)

ARRAY = line_array(55, 0.375)
PLAN = beamformer(ARRAY, 4000.0, frame=0.075, beams=180)
MOTION = BearingMotion(0.001, 0.05, noise=piecewise_acceleration)


def state(bearing: float, bearing_rate: float, snr_db: float) -> BearingState:
    return BearingState(*(jnp.asarray(value, jnp.float32) for value in (bearing, bearing_rate, snr_db)))


TARGET = Target(
    UniformBirth(state(0.0, -0.01, -40.0), state(np.pi, 0.01, -15.0)), MOTION, *rates(0.001, 0.999, interval=1.0)
)
FILTER = BernoulliParticleFilter(TARGET)
LIKELIHOOD = WhiteSignal(PLAN.grid, jnp.array(1.0))


@eqx.filter_jit
def true_bearings(key: PRNGKeyArray) -> Array:
    """Bearing of a target that appears anywhere at rest and moves as the filter believes; shape (run, scan)."""
    for_start, for_motion = jax.random.split(key)
    bearing = jax.random.uniform(for_start, (RUNS,), minval=0.0, maxval=jnp.pi)

    def move(states: BearingState, key: PRNGKeyArray) -> tuple[BearingState, Array]:
        moved = MOTION.move(states, 1.0, key)
        return moved, moved.bearing

    start = BearingState(bearing, jnp.zeros(RUNS), jnp.zeros(RUNS))
    return jax.lax.scan(move, start, jax.random.split(for_motion, SCANS))[1].T


@eqx.filter_jit
def detected(key: PRNGKeyArray, bearing: Array, snr_db: Array) -> Array:
    """Whether one run confirms a track within a lobe of the target after it appeared."""
    for_spectra, for_filter = jax.random.split(key)
    time = jnp.arange(SCANS, dtype=jnp.float32)
    heard_db = jnp.where(time < APPEARS, -jnp.inf, snr_db)
    spectra = draw_spectra(for_spectra, ARRAY, PLAN.grid, bearing, heard_db)
    scans = PLAN.scan_spectra(time + 1, spectra, jnp.ones((SCANS, 55), bool))
    _, (existence, found), _ = run(
        FILTER, LIKELIHOOD, scans, for_filter, keep=lambda belief: (belief.existence, mean(belief).bearing)
    )
    return jnp.any((existence > THRESHOLD) & (jnp.abs(found - bearing) < LOBE) & (time >= APPEARS))


@pytest.mark.slow
def test_half_of_the_runs_are_detected_at_minus_31_db() -> None:
    for_bearings, for_runs = jax.random.split(jax.random.key(2022))
    bearings = true_bearings(for_bearings)
    keys = jax.random.split(for_runs, RUNS)
    share = np.mean(
        [bool(detected(key, bearing, jnp.array(-31.0))) for key, bearing in zip(keys, bearings, strict=True)]
    )
    print(f"detected {share:.3f} of {RUNS} runs")
    # The paper reads 0.5 off a figure, whose curve rises by about 0.2 a decibel; half a decibel of reading and three
    # standard errors of 200 runs make 0.2.
    assert 0.3 < share < 0.7
