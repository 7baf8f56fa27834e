"""Beliefs that go with a scene or stay, against plain sums over cells."""

import dataclasses

import jax.numpy as jnp
import numpy as np

from faintrack.beliefs.belief import Belief
from faintrack.trackers.with_scene import with_scene


def belief(weights: np.ndarray) -> Belief:
    return Belief(None, jnp.log(jnp.asarray(weights, jnp.float32)), jnp.array(1.5), jnp.array(0.0))


def test_half_goes_and_half_stays() -> None:
    weights = np.random.default_rng(0).random((5, 6, 2, 3))
    weights /= weights.sum()
    expected = weights.copy()
    for y in range(5):
        for x in range(6):
            if 0 <= y - 1 < 5 and 0 <= x + 2 < 6:
                expected[y, x] += weights[y - 1, x + 2]
    moved = with_scene({"sought": belief(weights), "scans": 3}, jnp.array([1, -2]))
    np.testing.assert_allclose(np.exp(moved["sought"].log_weights), expected / expected.sum(), rtol=1e-5)
    assert float(moved["sought"].log_odds) == 1.5
    assert moved["scans"] == 3


def test_a_scene_at_rest_changes_nothing_and_a_belief_in_slots_goes_slot_by_slot() -> None:
    weights = np.random.default_rng(1).random((2, 4, 4, 1, 1)) + 0.1
    one = belief(weights)
    assert (with_scene(one, jnp.array([0, 0])).log_weights == one.log_weights).all()
    both = with_scene(one, jnp.array([0, 1])).log_weights
    for slot in range(2):
        alone = dataclasses.replace(one, log_weights=one.log_weights[slot])
        np.testing.assert_allclose(both[slot], with_scene(alone, jnp.array([0, 1])).log_weights, rtol=1e-6)


def test_particles_stay_as_they_are() -> None:
    particles = Belief(None, jnp.zeros(7), jnp.array(0.0), jnp.array(0.0))
    assert (with_scene(particles, jnp.array([3, 3])).log_weights == 0).all()
