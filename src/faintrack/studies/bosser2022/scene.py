r"""The paper's array, signals and filter.

The paper leaves out, and these are chosen: newborn targets are uniform over bearing, bearing rate within 0.01 rad/s and
SNR within -40 to -15 dB; 1000 particles and 250 newborn; the true target starts at any bearing, at rest; in scenario II
it comes straight towards the array, its bearing fixed; the detector and tracker of the baseline
(`faintrack.baselines`), with a false-alarm probability of 0.1 a beam, which gave the baseline the best detection.
"""

import functools
import math
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.baselines.cfar import calibrate, cell_averaging
from faintrack.baselines.detect_and_track import DetectAndTrack
from faintrack.filters.bernoulli_particle import BernoulliParticleFilter
from faintrack.filters.run import Likelihood
from faintrack.likelihoods.lobe_width import lobe_width_likelihood
from faintrack.likelihoods.unknown_noise import UnknownNoise
from faintrack.likelihoods.white_signal import WhiteSignal
from faintrack.sensors.array import SensorArray, line_array
from faintrack.signal.beamformer import Beamformer, beamformer
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


def true_bearing(key: PRNGKeyArray, scans: int) -> Float[Array, " scan"]:
    """Bearing of a target that is at rest at any bearing and moves as the filter believes (eq. 5)."""
    for_start, for_motion = jax.random.split(key)
    zero = jnp.zeros(())
    start = BearingState(jax.random.uniform(for_start, (), maxval=jnp.pi), zero, zero)

    def move(state: BearingState, key: PRNGKeyArray) -> tuple[BearingState, Array]:
        moved = make_filter().target.motion.move(state, jnp.array(1.0), key)
        return moved, moved.bearing

    return jax.lax.scan(move, start, jax.random.split(for_motion, scans))[1]


def approach_snr_db() -> Float[np.ndarray, " scan"]:
    """SNR of scenario II in each scan (eq. 28); dB."""
    distance = START_M - SPEED * np.arange(int(START_M / SPEED))
    snr_db = -18.0 * np.log10(distance / 100.0)
    return snr_db[snr_db <= END_DB]
