r"""One target in an image, and four trackers that look for it: grid, dynamic programming, particles, histogram PMHT.

davey2008 compares a Bayesian grid, dynamic programming (Viterbi), particles and the histogram probabilistic
multi-hypothesis tracker for one target in two-dimensional images, at peak signal to noise ratios of 12, 6 and 3 dB, by
overall and instantaneous probability of detection, root mean square error of the position, number and length of false
tracks, and computation. That much stands in its abstract and in a public digest of it. The rest was not at hand and is
chosen here:

- 32 x 32 pixels, 40 frames a second apart, a target in frames 10 to 29 that moves straight on, at up to one pixel a
  frame in any direction;
- its amplitude is constant with any phase in complex Gaussian noise and spreads as a Gaussian of one pixel: the power
  of a pixel is Rice's squared, and the peak signal to noise ratio is the target's power over the noise's in a pixel
  with the target in its middle;
- all trackers know that ratio. A target appears with 0.01 and stays with 0.95 from frame to frame, anywhere, at up to
  one pixel a frame along each axis.

**Grid** and **dynamic programming** share pixels, 9 x 9 velocities a quarter of a pixel apart, plant noise of a pixel
with 0.1 either way along each axis, and the mean ratio over places within a pixel; one sums over paths, the other keeps
the likeliest. **Particles**: 10,000 that follow, 5000 newborn in every frame, not guided.

**Histogram PMHT** takes the amplitudes as shots, of a quantum with which those of noise have Poisson's mean and
variance. The mean amplitude of noise and a signal to noise ratio s is

.. math:: a(s) = \frac{\sqrt{\pi}}{2} e^{-s/2} \left[ (1 + s) I_0(s / 2) + s I_1(s / 2) \right] ;

what a target adds to it, :math:`a(s e^{-r^2}) - a(0)` at the distance r, is taken for a Gaussian with the same sum and
second moment, less that of a pixel. Candidates start at 16 peaks of a frame, 32 are kept, batches of 8 frames are
fitted in 10 iterations, accelerations are those of the particles. These numbers were chosen on other seeds than the
study's.

What is thresholded is the log odds of existence, of the best candidate where there are several, or the score of the
best path; the place is the mean under the belief, or where the best path ends.
"""

import functools
import math
from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.baselines.histogram import Histogram
from faintrack.baselines.histogram_pmht import HistogramPmht
from faintrack.baselines.histogram_tracks import HistogramTracks
from faintrack.baselines.viterbi import Viterbi
from faintrack.beliefs.axis import Axis
from faintrack.beliefs.grids import Grid
from faintrack.filters.bernoulli_particle import BernoulliParticleFilter
from faintrack.filters.grid import GridFilter
from faintrack.filters.shifts import Shifts
from faintrack.likelihoods.cells import CellLikelihood, gaussian_spread, swerling0
from faintrack.sensors.cells import Cells, CellScan
from faintrack.simulation.cells import draw_scans
from faintrack.targets.motion import PlanarMotion, white_acceleration
from faintrack.targets.states import PlanarState
from faintrack.targets.target import Target, UniformBirth, rates

PIXELS, SCANS, APPEARS, LEAVES = 32, 40, 10, 30
"""Along each side; frames; first frame with a target, and first without again."""

FASTEST, VELOCITIES, PLANT = 1.0, 9, (0.1, 0.8, 0.1)
"""Pixels a frame; velocities along each axis of the grid; its plant noise."""

BIRTH, SURVIVAL = 0.01, 0.95
"""From frame to frame."""

WIDTH, REACH, PLACES = 0.5**0.5, 2, 3
"""Spread of the power, pixels: that of an amplitude of width 1; pixels looked at on either side; places told apart."""

PARTICLES, NEWBORN, VELOCITY_NOISE = 10_000, 5_000, 0.05


QUIET = math.pi**0.5 / 2
"""Mean amplitude of noise."""
QUANTUM = (1 - QUIET**2) / QUIET
"""Variance of the amplitude of noise over its mean."""

WINDOW, CANDIDATES, STARTS, ITERATIONS = 8, 32, 16, 10
"""Of histogram PMHT."""


class PixelMean(eqx.Module):
    """Likelihood for a grid of pixels: mean ratio over the places within each."""

    likelihood: CellLikelihood

    def log_mean_ratio(self, scan: CellScan) -> Float[Array, "x y"]:
        """Log of the mean ratio of every pixel."""
        reach = REACH * PLACES
        table = self.likelihood.table(scan)[reach:-reach, reach:-reach]
        parts = table.reshape(PIXELS, PLACES, PIXELS, PLACES)
        return jax.nn.logsumexp(parts, axis=(1, 3)) - 2 * math.log(PLACES)


@dataclass(frozen=True)
class Scene:
    """Trackers, made once a process."""

    grid: GridFilter
    viterbi: Viterbi
    particles: BernoulliParticleFilter


@functools.cache
def scene() -> Scene:
    """The module's trackers."""
    # Runs are traced, and what they share is not part of them.
    with jax.ensure_compile_time_eval():
        pixels, rate = Axis(0.0, 1.0, PIXELS), Axis(-FASTEST, 2 * FASTEST / (VELOCITIES - 1), VELOCITIES)
        grid = Grid(PlanarState, (("vx", rate), ("vy", rate), ("x", pixels), ("y", pixels)))

        def corner(place: float, rate: float) -> PlanarState:
            return PlanarState(*(jnp.asarray(value, jnp.float32) for value in (place, place, rate, rate)))

        birth = UniformBirth(corner(-0.5, -FASTEST), corner(PIXELS - 0.5, FASTEST))
        target = Target(birth, PlanarMotion(VELOCITY_NOISE), *rates(BIRTH, SURVIVAL, 1.0))
        return Scene(
            GridFilter(grid, target, Shifts(grid, 1.0, PLANT)),
            Viterbi(grid, Shifts(grid, 1.0, PLANT, jnp.max), BIRTH, SURVIVAL),
            BernoulliParticleFilter(target, PARTICLES, NEWBORN),
        )


def likelihood(snr_db: Float[Array, ""] | float) -> CellLikelihood:
    """Of a target with this peak signal to noise ratio."""
    axis = Axis(0.0, 1.0, PIXELS)
    spread = gaussian_spread(WIDTH)
    return CellLikelihood(
        Cells((("x", axis), ("y", axis))), swerling0, 10 ** (jnp.asarray(snr_db) / 10), spread, REACH, PLACES
    )


def shots(scans: CellScan) -> Float[Array, "scan x y"]:
    """Amplitudes of frames in quanta."""
    return jnp.sqrt(scans.values) / QUANTUM


def amplitude(snr: Float[Array, "..."]) -> Float[Array, "..."]:
    """Mean amplitude of noise and a target with this ratio in the pixel (the module's equation)."""
    half = snr / 2
    return QUIET * ((1 + snr) * jax.scipy.special.i0e(half) + snr * jax.scipy.special.i1e(half))


def histogram(snr: Float[Array, ""] | float) -> Histogram:
    """Shots of noise and a target; `snr` is the peak signal to noise ratio, linear."""
    radius = jnp.linspace(0.0, 6.0, 301)
    added = 2 * jnp.pi * radius * (amplitude(snr * jnp.exp(-(radius**2) / (2 * WIDTH**2))) - QUIET)
    total = jax.scipy.integrate.trapezoid(added, radius)
    along = jax.scipy.integrate.trapezoid(added * radius**2, radius) / total / 2
    # A histogram adds up what falls into a pixel, a frame reads its middle.
    width = jnp.sqrt(along - 1 / 12)
    axis = Axis(0.0, 1.0, PIXELS)
    return Histogram(Cells((("x", axis), ("y", axis))), QUIET / QUANTUM, total / QUANTUM, width, reach=3)


def tracks(snr: Float[Array, ""] | float) -> HistogramTracks:
    """Histogram PMHT for a target of this peak signal to noise ratio, linear."""
    a, b, c = (VELOCITY_NOISE * factor for factor in white_acceleration(1.0))
    noise = jnp.array([[a * a + b * b, a * c], [a * c, c * c]])
    transition = jnp.array([[1.0, 1.0], [0.0, 1.0]])
    pmht = HistogramPmht(histogram(snr), scene().grid.target, transition, noise, 1.0, ITERATIONS)
    # Of a peak's place within a pixel or so, and of the speed along an axis.
    start = jnp.diag(jnp.array([0.5, FASTEST / 2])) ** 2
    return HistogramTracks(pmht, start, WINDOW, CANDIDATES, STARTS, near=1.0, alike=FASTEST / 2)


def look(key: PRNGKeyArray, model: CellLikelihood, present: Array | bool) -> tuple[CellScan, Float[Array, "scan 2"]]:
    """Frames, and where the target is or would be: straight through the middle of the image, give or take five pixels.

    The path stays in the image while the target is there.
    """
    for_place, for_course, for_scans = jax.random.split(key, 3)
    time = jnp.arange(float(SCANS))
    place = (PIXELS - 1) / 2 + jax.random.uniform(for_place, (2,), minval=-5.0, maxval=5.0)
    speed, course = jax.random.uniform(for_course, (2,)) * jnp.array([FASTEST, 2 * jnp.pi])
    velocity = speed * jnp.stack([jnp.cos(course), jnp.sin(course)])
    path = place + velocity * (time - (APPEARS + LEAVES - 1) / 2)[:, None]
    still = jnp.zeros(SCANS)
    seen = (time >= APPEARS) & (time < LEAVES) & jnp.asarray(present, bool)
    return draw_scans(for_scans, model, time, PlanarState(path[:, 0], path[:, 1], still, still), seen), path
