r"""One step of the Bernoulli particle filter on bearings in clutter, ours and Stone Soup's.

Both sides resample, move, draw newborn targets and take in the same six bearings with the full ratio of
`faintrack.likelihoods.bearing_sets` (liu2013, with its number of false bearings).
"""

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from faintrack.beliefs.belief import Belief
from faintrack.bench.machine import Machine
from faintrack.bench.rows import Row, Timing, row, timed
from faintrack.bench.sizes import Sizes
from faintrack.filters.bernoulli_particle import BernoulliParticleFilter
from faintrack.filters.run import step
from faintrack.likelihoods.bearing_sets import BearingSetLikelihood
from faintrack.sensors.bearing_sets import BearingSensor, BearingSet, bearing_set
from faintrack.targets.motion import PlanarMotion
from faintrack.targets.states import PlanarState
from faintrack.targets.target import Target, UniformBirth, rates

BEARINGS = np.radians([31.0, -20.0, 75.0, 120.0, -95.0, 170.0])
"""Radians clockwise from north; the first points at the middle of the newborn targets."""
MIDDLE = (1500.0, 2500.0, 0.0, 0.0)
SPREAD = (1500.0, 1500.0, 10.0, 10.0)
"""Newborn targets: x, y, vx, vy, metres and m/s, and how far they reach to either side of the middle."""
BEARING_STD = float(np.radians(2.0))
FALSE_PER_SCAN = 5.0
DETECTION_PROBABILITY = 0.9
BIRTH_PROBABILITY, SURVIVAL_PROBABILITY = 0.05, 0.98
VELOCITY_NOISE = 0.1
EXISTENCE = 0.5


@dataclass(frozen=True)
class Problem:
    """What is believed, and the scan to take in."""

    filter: BernoulliParticleFilter
    likelihood: BearingSetLikelihood
    belief: Belief
    scan: BearingSet

    def step(self, belief: Belief, key: Array) -> tuple[Belief, Array]:
        """One prediction and update from a given belief."""
        return step(self.filter, self.likelihood, belief, self.scan, key)


def problem(particles: int, births: int) -> Problem:
    """Belief spread as newborn targets are, one second before the scan."""

    def state(*values: float) -> PlanarState:
        return PlanarState(*(jnp.asarray(value, jnp.float32) for value in values))

    middle, spread = np.array(MIDDLE), np.array(SPREAD)
    target = Target(
        UniformBirth(state(*(middle - spread)), state(*(middle + spread))),
        PlanarMotion(VELOCITY_NOISE),
        *rates(BIRTH_PROBABILITY, SURVIVAL_PROBABILITY, interval=1.0),
    )
    filter = BernoulliParticleFilter(target, particles, births)
    sensor = BearingSensor(BEARING_STD, DETECTION_PROBABILITY, FALSE_PER_SCAN)
    # Anticlockwise from the x axis.
    scan = bearing_set(sensor, 1.0, np.pi / 2 - BEARINGS, state(0.0, 0.0, 0.0, 0.0), capacity=len(BEARINGS))
    return Problem(filter, BearingSetLikelihood(sensor), filter.init(jax.random.key(0), existence=EXISTENCE), scan)


def stone_soup_step(particles: int, births: int) -> Callable[[], Any] | None:
    """The same step with Stone Soup, from the same kind of prior; None where it is not installed."""
    try:
        from stonesoup.models.measurement.nonlinear import Cartesian2DToBearing
        from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
        from stonesoup.predictor.particle import BernoulliParticlePredictor
        from stonesoup.resampler.particle import SystematicResampler
        from stonesoup.sampler.detection import SwitchingDetectionSampler
        from stonesoup.sampler.particle import ParticleSampler
        from stonesoup.types.array import StateVectors
        from stonesoup.types.detection import Detection
        from stonesoup.types.hypothesis import SingleHypothesis
        from stonesoup.types.multihypothesis import MultipleHypothesis
        from stonesoup.types.state import BernoulliParticleState
        from stonesoup.updater.particle import BernoulliParticleUpdater
    except ImportError:
        return None
    # Stone Soup's states are x, vx, y, vy.
    middle, spread = np.array(MIDDLE)[[0, 2, 1, 3]], np.array(SPREAD)[[0, 2, 1, 3]]

    def draw(size: tuple[int, int]) -> np.ndarray:
        return np.random.uniform(middle - spread, middle + spread, size)

    births_anywhere = ParticleSampler(draw, {"size": (births, 4)}, ndim_state=4)
    motion = ConstantVelocity(VELOCITY_NOISE**2)
    predictor = BernoulliParticlePredictor(
        CombinedLinearGaussianTransitionModel([motion, motion]),
        birth_probability=BIRTH_PROBABILITY,
        survival_probability=SURVIVAL_PROBABILITY,
        birth_sampler=SwitchingDetectionSampler(births_anywhere, births_anywhere),
    )
    sensor = Cartesian2DToBearing(ndim_state=4, mapping=(0, 2), noise_covar=np.array([[BEARING_STD**2]]))
    updater = BernoulliParticleUpdater(
        sensor,
        resampler=SystematicResampler(),
        clutter_rate=FALSE_PER_SCAN,
        clutter_distribution=1 / (2 * np.pi),
        detection_probability=DETECTION_PROBABILITY,
        nsurv_particles=particles,
    )
    start = datetime(2000, 1, 1)
    after = start + timedelta(seconds=1)
    prior = BernoulliParticleState(
        state_vector=StateVectors(draw((particles, 4)).T),
        weight=np.full(particles, 1 / particles),
        existence_probability=EXISTENCE,
        timestamp=start,
    )
    # Anticlockwise from the x axis.
    detections = [Detection([np.pi / 2 - bearing], after, measurement_model=sensor) for bearing in BEARINGS]

    def once() -> Any:
        prediction = predictor.predict(prior, timestamp=after)
        return updater.update(MultipleHypothesis([SingleHypothesis(prediction, seen) for seen in detections]))

    return once


def bernoulli_step_single(machine: Machine, sizes: Sizes) -> Row:
    """A single step, as a live tracker takes it."""
    given = problem(sizes.bearing_particles, sizes.bearing_births)
    stepped, key = jax.jit(given.step), jax.random.key(1)
    timing = timed(lambda: stepped(given.belief, key), sizes.repeat_seconds)
    return _row("bernoulli_step_single", timing, "one compiled call", 20.0, machine, sizes)


def bernoulli_step_batch(machine: Machine, sizes: Sizes) -> Row:
    """Many runs side by side, as in a Monte Carlo study."""
    given = problem(sizes.bearing_particles, sizes.bearing_births)
    stepped, keys = jax.jit(jax.vmap(given.step)), jax.random.split(jax.random.key(1), sizes.batch)
    beliefs = jax.vmap(lambda key: given.filter.init(key, existence=EXISTENCE))(keys)
    timing = timed(lambda: stepped(beliefs, keys), sizes.repeat_seconds).per(sizes.batch)
    return _row("bernoulli_step_batch", timing, f"a run's share of {sizes.batch} side by side", 50.0, machine, sizes)


def _row(name: str, timing: Timing, what: str, times_faster: float, machine: Machine, sizes: Sizes) -> Row:
    """Row with Stone Soup timed beside."""
    particles, births = sizes.bearing_particles, sizes.bearing_births
    theirs = stone_soup_step(particles, births)
    peer = None if theirs is None else timed(theirs, sizes.repeat_seconds).least
    beside = "Stone Soup is not installed" if peer is None else "peer: Stone Soup's Bernoulli particle filter"
    # Four numbers move or start a particle.
    limit = machine.seconds(normals=4 * (particles + births))
    note = (
        f"resample, predict and update with {particles} + {births} particles and {len(BEARINGS)} bearings, {what}; "
        f"{beside}; limit: its random numbers, drawn at once"
    )
    return row(name, "ms", timing, note, None if peer is None else 1e3 * peer / times_faster, peer, limit)
