r"""Rayleigh pixels (stone2002, section 4.3): a target in an image, ten pixels to a unit of length.

**The example.** 61 x 61 pixels, 11 scans, 100,000 points over the whole field and all velocities; the target is
detected when the integrated likelihood ratio first exceeds 1.

**The challenge.** 256 x 256 pixels; the target is known to lie in a gate of 10 x 10 pixels, and is to be followed.
Particles against the alternating-direction implicit grid. The grid is a window of pixels that moves with the target:
after every scan it is moved by whole pixels so that the mean is in its middle pixel. What comes in at its edge is
empty.

Chosen for the challenge, as the paper does not say: 20 scans; velocities anywhere within 0.5 along each axis, drawn for
each run from the density that both trackers start from; the target starts in the middle of the image, at any place of
the gate; 10,000 particles; a window of 41 x 41 pixels and 21 x 21 velocities, 0.05 apart. A tracker has lock if its
mean is within 3 pixels of the truth at the last scan.

Points are copied where they fit and are told apart by the motion's noise alone, which is small: a pixel of the example
holds 27 points at first, whose velocities lead to 144 pixels. A loud first scan leaves these few, and the target is
often lost after it was found.
"""

import functools
import math
from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.beliefs.axis import Axis
from faintrack.beliefs.belief import Belief, mean, update
from faintrack.beliefs.grids import Grid
from faintrack.filters.adi import alternating_directions
from faintrack.filters.bernoulli_particle import BernoulliParticleFilter
from faintrack.filters.grid import GridFilter
from faintrack.filters.run import step
from faintrack.likelihoods.cells import CellLikelihood, rayleigh
from faintrack.sensors.cells import Cells, CellScan
from faintrack.simulation.cells import draw_scans
from faintrack.targets.motion import PlanarMotion
from faintrack.targets.states import PlanarState
from faintrack.targets.target import Target, UniformBirth

PIXEL, LEVEL, PRIOR = 0.1, 10.9, 0.1
"""Unit lengths a pixel, lambda, and the prior probability of a target in the example."""

MOTION = PlanarMotion(math.sqrt(5e-4))
"""Nearly constant velocity, q = 5e-4."""

SCANS, POINTS = 11, 100_000
"""Of the example."""

PIXELS, GATE, CHALLENGE_SCANS, PARTICLES = 256, 10, 20, 10_000
"""Of the challenge."""

FASTEST, WINDOW, VELOCITIES = 0.5, 41, 21
"""Largest velocity of the challenge along an axis; pixels and velocities of the window along each."""

LOCK = 3.0
"""Pixels from the truth within which a tracker has lock."""


@dataclass(frozen=True)
class Scene:
    """Likelihood and trackers, made once a process."""

    likelihood: CellLikelihood
    particles: BernoulliParticleFilter
    grid: GridFilter | None = None


def _pixels(x: float, y: float, count: int) -> CellLikelihood:
    """Square image whose first pixel has its middle at x, y."""
    return CellLikelihood(Cells((("y", Axis(y, PIXEL, count)), ("x", Axis(x, PIXEL, count)))), rayleigh, LEVEL)


def _target(low: tuple[float, ...], high: tuple[float, ...]) -> Target:
    """A target that is there from the first scan on or never; corners in x, y, vx, vy."""
    corners = (PlanarState(*(jnp.asarray(value, jnp.float32) for value in corner)) for corner in (low, high))
    return Target(UniformBirth(*corners), MOTION, 0.0, 0.0)


@functools.cache
def example() -> Scene:
    """The paper's field and density."""
    # Runs are traced, and what they share is not part of them.
    with jax.ensure_compile_time_eval():
        target = _target((-1.5, -3.0, -0.5, -0.6), (4.5, 3.0, 0.7, 0.6))
        return Scene(_pixels(-1.5, -3.0, 61), BernoulliParticleFilter(target, POINTS, births=1))


@functools.cache
def challenge() -> Scene:
    """Both trackers; the origin is the middle of the gate and near that of the image."""
    # Runs are traced, and what they share is not part of them.
    with jax.ensure_compile_time_eval():
        reach = GATE * PIXEL / 2
        target = _target((-reach, -reach, -FASTEST, -FASTEST), (reach, reach, FASTEST, FASTEST))
        place = Axis(-(WINDOW // 2) * PIXEL, PIXEL, WINDOW)
        rate = Axis(-FASTEST, 2 * FASTEST / (VELOCITIES - 1), VELOCITIES)
        grid = Grid(PlanarState, (("vx", rate), ("vy", rate), ("x", place), ("y", place)))
        transport = alternating_directions(grid, float(MOTION.velocity_noise), 1.0, substeps=4)
        edge = -PIXELS // 2 * PIXEL
        return Scene(
            _pixels(edge, edge, PIXELS),
            BernoulliParticleFilter(target, PARTICLES, births=1),
            GridFilter(grid, target, transport, _gate(place)),
        )


def _gate(place: Axis) -> Float[Array, "1 1 x y"]:
    """Log weight of the cells that the gate covers, each by its share; of all velocities alike."""
    low = jnp.clip(jnp.asarray(place.edges), -GATE * PIXEL / 2, GATE * PIXEL / 2)
    share = jnp.log(jnp.diff(low) / (GATE * PIXEL))
    return (share[:, None] + share[None, :] - 2 * math.log(VELOCITIES)).astype(jnp.float32)[None, None]


def path(key: PRNGKeyArray, start: PlanarState, scans: int) -> PlanarState:
    """States of a target at every scan, a second apart, the start first."""

    def advance(state: PlanarState, key: PRNGKeyArray) -> tuple[PlanarState, PlanarState]:
        return MOTION.move(state, 1.0, key), state

    return jax.lax.scan(advance, start, jax.random.split(key, scans))[1]


def search(key: PRNGKeyArray) -> tuple[Belief, PlanarState]:
    """Beliefs after every scan of the example, and where the target is."""
    at = example()
    for_path, for_scans, for_filter = jax.random.split(key, 3)
    truth = path(for_path, PlanarState(*(jnp.array(value) for value in (0.0, 0.0, 0.2, 0.0))), SCANS)
    scans = draw_scans(for_scans, at.likelihood, jnp.arange(float(SCANS)), truth, jnp.ones(SCANS, bool))
    start = at.particles.init(jax.random.fold_in(for_filter, SCANS), existence=PRIOR)

    def take_in(belief: Belief, scan: CellScan) -> tuple[Belief, Belief]:
        number = scan.time.astype(jnp.int32)
        belief, _ = step(at.particles, at.likelihood, belief, scan, jax.random.fold_in(for_filter, number))
        return belief, belief

    return jax.lax.scan(take_in, start, scans)[1], truth


def detection(key: PRNGKeyArray) -> dict[str, Array]:
    """Log integrated likelihood ratio after every scan of the example, and the error of the mean; pixels."""
    beliefs, truth = search(key)
    middle = jax.vmap(mean)(beliefs)
    return {"log_odds": beliefs.log_odds, "error": jnp.hypot(middle.x - truth.x, middle.y - truth.y) / PIXEL}


def points(key: PRNGKeyArray) -> dict[str, Array]:
    """One run of the example, all points: states, log weights and log odds at t = 0, 2, 4, 6, 8."""
    beliefs, truth = search(key)
    shown = jax.tree.map(lambda values: values[:10:2], beliefs)
    state = jnp.stack([shown.states.x, shown.states.y, shown.states.vx, shown.states.vy], axis=1)
    true = jnp.stack([truth.x, truth.y, truth.vx, truth.vy], axis=1)
    return {
        "state": state,
        "log_ratio": shown.log_weights + shown.log_odds[:, None],
        "truth": true[:10:2],
    }


def chase(key: PRNGKeyArray) -> tuple[CellScan, PlanarState]:
    """Scans of one run of the challenge, and where the target is."""
    at = challenge()
    for_start, for_path, for_scans = jax.random.split(key, 3)
    start = jax.tree.map(lambda values: values[0], at.particles.target.birth.sample(for_start, 1))
    truth = path(for_path, start, CHALLENGE_SCANS)
    time = jnp.arange(float(CHALLENGE_SCANS))
    return draw_scans(for_scans, at.likelihood, time, truth, jnp.ones(CHALLENGE_SCANS, bool)), truth


def by_particles(key: PRNGKeyArray) -> dict[str, Array]:
    """The challenge with particles: distance of the mean from the truth after every scan; pixels."""
    at = challenge()
    scans, truth = chase(key)
    for_filter = jax.random.fold_in(key, 2**31 - 1)
    start = at.particles.init(jax.random.fold_in(for_filter, CHALLENGE_SCANS), existence=0.5)

    def take_in(belief: Belief, scan: CellScan) -> tuple[Belief, PlanarState]:
        number = scan.time.astype(jnp.int32)
        belief, _ = step(at.particles, at.likelihood, belief, scan, jax.random.fold_in(for_filter, number))
        return belief, mean(belief)

    return _errors(jax.lax.scan(take_in, start, scans)[1], truth)


def by_grid(key: PRNGKeyArray) -> dict[str, Array]:
    """The same with the grid in its moving window."""
    at = challenge()
    assert at.grid is not None
    filter, likelihood = at.grid, at.likelihood
    scans, truth = chase(key)
    here = filter.grid.states()

    def take_in(carried: tuple[Belief, Array], scan: CellScan) -> tuple[tuple[Belief, Array], PlanarState]:
        belief, corner = carried
        predicted = filter.predict(belief, scan.time, key)
        at_window = PlanarState(here.x + corner[0] * PIXEL, here.y + corner[1] * PIXEL, here.vx, here.vy)
        belief, _ = update(predicted, likelihood.log_ratio(scan, at_window))
        middle = mean(belief)
        off = jnp.round(jnp.stack([middle.x, middle.y]) / PIXEL).astype(jnp.int32)
        moved = Belief(here, shifted(belief.log_weights, off), belief.log_odds, belief.time)
        estimate = PlanarState(middle.x + corner[0] * PIXEL, middle.y + corner[1] * PIXEL, middle.vx, middle.vy)
        return (moved, corner + off), estimate

    start = (filter.init(key, existence=0.5), jnp.zeros(2, jnp.int32))
    return _errors(jax.lax.scan(take_in, start, scans)[1], truth)


def shifted(log_weights: Float[Array, "vx vy x y"], off: Array) -> Float[Array, "vx vy x y"]:
    """Log weights of a window that has moved on by whole pixels; what comes in is empty."""
    padded = jnp.pad(log_weights, [(0, 0), (0, 0), (WINDOW, WINDOW), (WINDOW, WINDOW)], constant_values=-jnp.inf)
    return jax.lax.dynamic_slice(padded, (0, 0, WINDOW + off[0], WINDOW + off[1]), log_weights.shape)


def _errors(estimate: PlanarState, truth: PlanarState) -> dict[str, Array]:
    return {"error": jnp.hypot(estimate.x - truth.x, estimate.y - truth.y) / PIXEL}
