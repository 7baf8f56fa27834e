"""Beliefs that go with a scene or stay, against plain sums over cells."""

import jax
import jax.numpy as jnp
import numpy as np

from faintrack.beliefs.axis import Axis
from faintrack.beliefs.belief import Belief
from faintrack.sensors.cells import Cells
from faintrack.targets.states import PlanarState
from faintrack.trackers.many import Hand
from faintrack.trackers.with_scene import with_scene

CELLS = Cells((("y", Axis(0.0, 2.0, 5)), ("x", Axis(0.0, 0.5, 6))))


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
    moved = with_scene({"sought": belief(weights), "scans": 3}, jnp.array([1, -2]), CELLS)
    np.testing.assert_allclose(np.exp(moved["sought"].log_weights), expected / expected.sum(), rtol=1e-5)
    assert float(moved["sought"].log_odds) == 1.5
    assert moved["scans"] == 3


def test_a_scene_at_rest_changes_nothing_and_targets_in_hand_go_one_by_one() -> None:
    weights = np.random.default_rng(1).random((3, 4, 4, 1, 1)) + 0.1
    beliefs = [belief(slot) for slot in weights]
    stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves), *beliefs)
    hand = Hand(stacked, jnp.zeros(3), jnp.array([2, 0, 5]))
    still = with_scene((hand, beliefs[0]), jnp.array([0, 0]), CELLS)
    assert (still[0].beliefs.log_weights == stacked.log_weights).all()
    assert (still[1].log_weights == beliefs[0].log_weights).all()
    moved = with_scene(hand, jnp.array([0, 1]), CELLS).beliefs.log_weights
    for slot in (0, 2):
        np.testing.assert_array_equal(moved[slot], with_scene(beliefs[slot], jnp.array([0, 1]), CELLS).log_weights)
    np.testing.assert_array_equal(moved[1], stacked.log_weights[1])


def test_every_other_particle_goes() -> None:
    at = jnp.array([0.0, 0.0, 1.5, 1.5])
    states = PlanarState(x=at, y=2 * at, vx=at, vy=at)
    particles = Belief(states, jnp.full(4, -jnp.log(4.0)), jnp.array(0.0), jnp.array(0.0), jnp.zeros(4))
    hand = Hand(jax.tree.map(lambda leaf: jnp.stack([leaf, leaf]), particles), jnp.zeros(2), jnp.array([1, 0]))
    for moved in (with_scene(particles, jnp.array([-1, 3]), CELLS), with_scene(hand, jnp.array([-1, 3]), CELLS)):
        after = moved.beliefs if isinstance(moved, Hand) else moved
        np.testing.assert_array_equal(after.states.x, np.broadcast_to([0.0, 1.5, 1.5, 3.0], after.states.x.shape))
        np.testing.assert_array_equal(after.states.y, np.broadcast_to([0.0, -2.0, 3.0, 1.0], after.states.y.shape))
        assert (after.states.vx == after.states.x[..., [0, 0, 2, 2]]).all()
