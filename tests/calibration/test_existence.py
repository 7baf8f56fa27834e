"""Of targets believed in at 0.8, 80 % exist."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.filters.bernoulli_particle import BernoulliParticleFilter
from faintrack.filters.run import Likelihood
from faintrack.sensors.beams import BeamScan
from faintrack.targets.target import Target, UniformBirth, rates
from faintrack.trackers.single import SingleTargetTracker
from tests.scenes import Scene
from tests.tolerances import assert_calibrated

RUNS, SCANS = 2500, 8


@pytest.fixture(scope="module")
def target() -> Target:
    """As likely there as not in the long run, and so faint that belief is often in between."""
    scene = Scene(np.float32)
    birth = UniformBirth(scene.states([0.0, -0.02, -10.0]), scene.states([np.pi, 0.02, -1.0]))
    return Target(birth, scene.target.motion, *rates(0.1, 0.9, 1.0))


@jax.jit
def lives(target: Target, key: jax.Array) -> tuple[jax.Array, Any]:
    """Existence and states of targets that come, move and go as the filter supposes; shape (scan, run).

    None is there before the first scan.
    """

    def live(before: tuple[jax.Array, Any], key: jax.Array) -> tuple[Any, Any]:
        exists, states = before
        for_change, for_birth, for_motion = jax.random.split(key, 3)
        appears, stays = target.transition(1.0)
        moved, newborn = target.motion.move(states, 1.0, for_motion), target.birth.sample(for_birth, RUNS)
        states = jax.tree.map(lambda old, new: jnp.where(exists, old, new), moved, newborn)
        exists = jax.random.uniform(for_change, (RUNS,)) < jnp.where(exists, stays, appears)
        return (exists, states), (exists, states)

    start = jnp.zeros(RUNS, bool), target.birth.sample(key, RUNS)
    return jax.lax.scan(live, start, jax.random.split(key, SCANS))[1]


@pytest.fixture(scope="module")
def simulated(target: Target) -> tuple[np.ndarray, BeamScan]:
    """Whether a target exists at the last scan, shape (run,), and the scans, (run, scan, ...)."""
    scene = Scene(np.float32)
    exists, states = lives(target, jax.random.key(6))
    snr_db = jnp.where(exists, states.snr_db, -jnp.inf)
    scans = scene.draw(jax.random.key(7), RUNS * SCANS, states.bearing.T.ravel(), snr_db.T.ravel())
    scans = jax.tree.map(lambda leaf: leaf.reshape(RUNS, SCANS, *leaf.shape[1:]), scans)
    time = jnp.broadcast_to(jnp.arange(1.0, SCANS + 1), (RUNS, SCANS))
    return np.asarray(exists[-1]), BeamScan(time, scans.beam_power, scans.total_power, scans.channels)


@pytest.mark.parametrize(
    ("build", "guided"),
    [
        pytest.param(Scene.white_signal, False, id="white signal"),
        pytest.param(Scene.unknown_noise, True, id="unknown noise and guided births", marks=pytest.mark.slow),
    ],
)
def test_of_targets_believed_in_as_many_exist(
    build: Callable[[Scene], Likelihood],
    guided: bool,
    target: Target,
    simulated: tuple[np.ndarray, BeamScan],
    scene: Scene,
) -> None:
    """2,500 runs of 8 scans, one number from the end of each; five bins of probability, 5 standard errors in each."""
    exists, scans = simulated
    tracker = SingleTargetTracker(BernoulliParticleFilter(target, 400, 200), build(scene), guided=guided)

    def existence_at_the_end(scans: BeamScan, key: jax.Array) -> jax.Array:
        return tracker.steps(tracker.init(key), scans, key)[0].belief.existence

    keys = jax.random.split(jax.random.key(8), RUNS)
    assert_calibrated(jax.jit(jax.vmap(existence_at_the_end))(scans, keys), exists)
