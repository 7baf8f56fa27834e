"""What a loud place says for a target in hand beside one that is not: sums over both, place by place."""

import jax.numpy as jnp
import numpy as np

from faintrack.beliefs.belief import Belief, update
from faintrack.targets.states import PlanarState
from faintrack.trackers.undetected import AROUND, beside_undetected

SHAPE = 9, 8, 3, 2
STATES = PlanarState(
    *(jnp.arange(float(n)).reshape([-1 if a == b else 1 for b in range(4)]) for a, n in enumerate(SHAPE))
)


def belief(weights: np.ndarray, existence: float) -> Belief:
    log_odds = jnp.log(existence / (1 - existence))
    return Belief(STATES, jnp.log(jnp.asarray(weights / weights.sum(), jnp.float32)), log_odds, jnp.array(0.0))


def test_ratio_is_that_over_a_mixture() -> None:
    rng = np.random.default_rng(0)
    ratio, weights, existence = rng.normal(0, 3, SHAPE), rng.random(SHAPE), 0.03
    found = np.asarray(beside_undetected(jnp.asarray(ratio, jnp.float32), belief(weights, existence)))
    weights = weights / weights.sum()
    for cell in np.ndindex(SHAPE):
        around = tuple(slice(max(0, place - AROUND), place + AROUND + 1) for place in cell[:2])
        share = existence * weights[around].sum()
        expected = ratio[cell] - np.log1p(share * np.exp(ratio[around].max()))
        np.testing.assert_allclose(found[cell], expected, rtol=1e-4, atol=1e-4)


def test_a_target_does_not_leap_to_an_echo_that_another_may_be_the_source_of() -> None:
    """Its belief has the weight 1e-10 there; the echo's ratio is e^60, that of a miss at its own place 0.4."""
    own = np.full(SHAPE, 1e-10)
    own[1, 1] = 1.0
    ratio = np.full((*SHAPE[:2], 1, 1), np.log(0.4))
    ratio[7, 6] = 60.0
    mine, sought = belief(own, 0.99), belief(np.ones(SHAPE), 0.01)
    leapt, _ = update(mine, jnp.asarray(ratio, jnp.float32))
    stays, _ = update(mine, beside_undetected(jnp.asarray(ratio, jnp.float32), sought))
    assert float(jnp.exp(leapt.log_weights)[7, 6].sum()) > 0.99
    assert float(jnp.exp(stays.log_weights)[1, 1].sum()) > 0.99
