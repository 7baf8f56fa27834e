"""One frame of an image sequence through the particle filter."""

import jax
import jax.numpy as jnp

from faintrack.beliefs.axis import Axis
from faintrack.bench.machine import Machine
from faintrack.bench.rows import Row, row, timed
from faintrack.bench.sizes import Sizes
from faintrack.filters.bernoulli_particle import BernoulliParticleFilter
from faintrack.filters.run import step
from faintrack.likelihoods.cells import CellLikelihood, gaussian_spread, rayleigh
from faintrack.sensors.cells import Cells, CellScan
from faintrack.targets.motion import PlanarMotion
from faintrack.targets.states import PlanarState
from faintrack.targets.target import Target, UniformBirth

SNR, WIDTH, REACH, OVERSAMPLE = 3.0, 0.7, 2, 3
FASTEST, VELOCITY_NOISE = 2.0, 0.1
"""Pixels a frame, and per frame to the power 3/2."""
FRAME_RATE = 30.0


def pixel_frame(machine: Machine, sizes: Sizes) -> Row:
    """Predict, table the likelihood, take in the frame."""
    axis, particles, births = Axis(0.0, 1.0, sizes.pixels), sizes.pixel_particles, sizes.pixel_births
    cells = Cells((("y", axis), ("x", axis)))
    likelihood = CellLikelihood(cells, rayleigh, SNR, gaussian_spread(WIDTH), REACH, OVERSAMPLE)

    def corner(place: float, rate: float) -> PlanarState:
        return PlanarState(*(jnp.asarray(value, jnp.float32) for value in (place, place, rate, rate)))

    birth = UniformBirth(corner(0.0, -FASTEST), corner(sizes.pixels - 1.0, FASTEST))
    filter = BernoulliParticleFilter(Target(birth, PlanarMotion(VELOCITY_NOISE), 0.01, 0.01), particles, births)
    power = jax.random.exponential(jax.random.key(0), (sizes.pixels, sizes.pixels))
    scan = CellScan(jnp.array(1.0), jnp.sqrt(2 * power))
    belief, key = filter.init(jax.random.key(1), existence=0.5), jax.random.key(2)
    stepped = jax.jit(lambda belief, scan, key: step(filter, likelihood, belief, scan, key))
    timing = timed(lambda: stepped(belief, scan, key), sizes.repeat_seconds)
    drawn = 4 * (particles + births)
    note = (
        f"{sizes.pixels} x {sizes.pixels} pixels, {particles} + {births} particles, point spread over "
        f"{2 * REACH + 1} pixels; no peer; limit: its random numbers, drawn at once"
    )
    return row("pixel_frame", "ms", timing, note, 1e3 / FRAME_RATE, limit=machine.seconds(normals=drawn))
