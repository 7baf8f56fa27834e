"""A scene small enough that a test takes moments: one array, one grid, one target, one filter."""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from faintrack.beliefs import belief as beliefs
from faintrack.beliefs.belief import Belief
from faintrack.filters import run as runs
from faintrack.filters.bernoulli_particle import BernoulliParticleFilter
from faintrack.likelihoods.lobe_width import LobeWidth, lobe_width_likelihood
from faintrack.likelihoods.unknown_noise import UnknownNoise
from faintrack.likelihoods.white_signal import WhiteSignal
from faintrack.sensors.array import SensorArray, line_array, sensor_array
from faintrack.sensors.beams import BeamGrid, BeamScan
from faintrack.signal.beamformer import Beamformer, beamformer
from faintrack.simulation.spectra import draw_spectra
from faintrack.targets.motion import BearingMotion
from faintrack.targets.states import BearingState
from faintrack.targets.target import Target, UniformBirth, rates

LINE = line_array(4, spacing=1.5)
CIRCLE = sensor_array(np.array([[0.0, 0.0], [1.8, 0.3], [-0.4, 1.5], [-1.2, -1.4]]))
SPACE = sensor_array(np.array([[0.0, 0.0, 0.4], [1.8, 0.3, -0.5], [-0.4, 1.5, 0.0], [-1.2, -1.4, 0.8]]))
COLOURED = np.array([0.2, 1.0, 7.0])
"""Noise power in each of the scene's bins."""


@dataclass(frozen=True)
class Scene:
    """Four channels, three frequency bins at 125, 250 and 375 Hz.

    A main lobe spans six or more of the 36 beams, so that reading between them costs little.
    """

    dtype: type
    array: SensorArray = LINE
    snapshots: int = 2

    @cached_property
    def beamformer(self) -> Beamformer:
        return beamformer(self.array, 1000.0, frame=self.snapshots * 0.008, snapshot=0.008, beams=36, dtype=self.dtype)

    @property
    def grid(self) -> BeamGrid:
        return self.beamformer.grid

    @cached_property
    def target(self) -> Target:
        """Appears with 0.05 a second and stays with 0.95, from -10 to 3 dB."""
        low, high = self.states([self.grid.bearing[0], -0.02, -10.0]), self.states([np.pi, 0.02, 3.0])
        motion = BearingMotion(rate_noise=0.005, snr_noise_db=0.5, circular=self.array.circular)
        return Target(UniformBirth(low, high), motion, *rates(0.05, 0.95, 1.0))

    def filter(self, particles: int = 200, births: int = 50, **options: Any) -> BernoulliParticleFilter:
        return BernoulliParticleFilter(self.target, particles, births, **options)

    def states(self, components: Any) -> BearingState:
        """States from bearing, bearing rate and SNR along the first axis."""
        return BearingState(*(jnp.asarray(component, self.dtype) for component in components))

    def points(self) -> BearingState:
        """On the grid, between its beams, and at its ends; SNR so low that the ratios have four moments."""
        bearing = np.array([*self.grid.bearing[[0, 7, 20, -1]], 0.4, 1.3, 2.9])
        return self.states([bearing, np.zeros(7), np.array([-12.0, -13.0, -15.0, -12.0, -12.5, -12.0, -14.0])])

    def draw(
        self,
        key: jax.Array,
        count: int,
        bearing: Any = 0.0,
        snr_db: Any = -np.inf,
        noise_power: Any = 1.0,
    ) -> BeamScan:
        """Scans one second apart, the first at one second, without a source where no SNR is given."""
        full = jnp.full(count, bearing, self.dtype), jnp.full(count, snr_db, self.dtype)
        power = jnp.broadcast_to(jnp.asarray(noise_power, self.dtype), self.grid.frequency.shape)
        return _draw(self.beamformer, self.array, key, *full, power)

    def scan(self, samples: np.ndarray, usable: np.ndarray | None = None) -> BeamScan:
        """Scan of one frame of samples, shape (sample, channel)."""
        usable = np.ones(samples.shape[1], bool) if usable is None else usable
        return part(self.scans(samples[None], usable[None]), 0)

    def scans(self, samples: np.ndarray, usable: np.ndarray) -> BeamScan:
        """Scans of frames of samples, shape (frame, sample, channel), one second apart, the first at one second."""
        time = jnp.arange(1.0, len(samples) + 1, dtype=self.dtype)
        return scan_frames(self.beamformer, time, jnp.asarray(samples, self.dtype), jnp.asarray(usable))

    def white_signal(self, noise_power: Any = 1.0) -> WhiteSignal:
        return WhiteSignal(self.grid, jnp.asarray(noise_power, self.dtype))

    def unknown_noise(self, noise_power: Any = None) -> UnknownNoise:
        return UnknownNoise(self.grid, (-24.0, 10.0))

    def lobe_width(self, noise_power: Any = None) -> LobeWidth:
        return lobe_width_likelihood(self.grid, width=0.5)


RATIOS: dict[str, Callable[..., Any]] = {"white signal": Scene.white_signal, "unknown noise": Scene.unknown_noise}
"""True likelihood ratios."""
LIKELIHOODS: dict[str, Callable[..., Any]] = RATIOS | {"lobe width": Scene.lobe_width}


@eqx.filter_jit
def _draw(
    plan: Beamformer, array: SensorArray, key: jax.Array, bearing: jax.Array, snr_db: jax.Array, noise_power: jax.Array
) -> BeamScan:
    spectra = draw_spectra(key, array, plan.grid, bearing, snr_db, noise_power)
    usable = jnp.ones((len(bearing), len(array.gains)), bool)
    return plan.scan_spectra(jnp.arange(1.0, len(bearing) + 1, dtype=bearing.dtype), spectra, usable)


@eqx.filter_jit
def scan_frames(plan: Beamformer, time: jax.Array, samples: jax.Array, usable: jax.Array) -> BeamScan:
    return plan.scan(time, samples, usable)


def part(stacked: Any, index: Any) -> Any:
    """One of a stack, or some."""
    return jax.tree.map(lambda leaf: leaf[index], stacked)


@eqx.filter_jit
def log_ratios(likelihood: Any, scans: BeamScan, states: BearingState) -> jax.Array:
    """Shape (scan, point)."""
    return jax.vmap(likelihood.log_ratio, in_axes=(0, None))(scans, states)


@eqx.filter_jit
def log_ratio(likelihood: Any, scan: BeamScan, states: Any) -> jax.Array:
    return likelihood.log_ratio(scan, states)


@eqx.filter_jit
def _init(filter: BernoulliParticleFilter, key: jax.Array) -> Belief:
    return filter.init(key)


def start(filter: BernoulliParticleFilter, key: jax.Array, existence: float = 0.5) -> Belief:
    """Belief before any scan; compiled once for every existence."""
    belief = _init(filter, key)
    with np.errstate(divide="ignore"):
        log_odds = np.log(existence) - np.log1p(-existence)
    return dataclasses.replace(belief, log_odds=jnp.asarray(log_odds, belief.log_odds.dtype))


@eqx.filter_jit
def _predict(filter: BernoulliParticleFilter, belief: Belief, time: jax.Array, key: jax.Array) -> Belief:
    return filter.predict(belief, time, key)


def predict(filter: BernoulliParticleFilter, belief: Belief, time: Any, key: jax.Array) -> Belief:
    """Belief carried forward; compiled once for every time."""
    return _predict(filter, belief, jnp.asarray(time, belief.time.dtype), key)


def followed(dtype: type) -> tuple[BernoulliParticleFilter, WhiteSignal, BeamScan]:
    """What to run: filter, likelihood, and six frames of a source at 90 degrees."""
    scene, rng = Scene(dtype), np.random.default_rng(4)
    samples = rng.normal(size=(6, 16, 4)) + rng.normal(size=(6, 16, 1))
    return scene.filter(), scene.white_signal(), scene.scans(samples, np.ones((6, 4), bool))


def batch(
    filter: BernoulliParticleFilter, likelihood: Any, scans: BeamScan, keys: jax.Array
) -> tuple[Belief, Belief, jax.Array]:
    """The same run under each key."""
    return jax.vmap(lambda key: runs.run(filter, likelihood, scans, key))(keys)


update = eqx.filter_jit(beliefs.update)
step = eqx.filter_jit(runs.step)
