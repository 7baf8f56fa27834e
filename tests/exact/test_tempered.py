"""A scan taken in by steps, against the Gaussian case that is known."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.beliefs.belief import Belief, covariance, mean, update
from faintrack.filters.tempered import tempered
from faintrack.targets.states import RangeState

COUNT = 2000


def standard(seed: int = 0) -> Belief:
    """Particles of a standard normal place."""
    place = jax.random.normal(jax.random.key(seed), (COUNT,))
    return Belief(
        RangeState(place, jnp.zeros(COUNT)), jnp.full(COUNT, -jnp.log(COUNT)), jnp.zeros(()), jnp.zeros(()), place
    )


def test_one_step_is_the_update() -> None:
    belief = standard()

    def log_ratio(belief: Belief) -> jax.Array:
        return -((belief.states.range - 0.3) ** 2)

    at_once, evidence = update(belief, log_ratio(belief))
    found, log_evidence = tempered(belief, log_ratio, jax.random.key(1))
    np.testing.assert_array_equal(found.log_weights, at_once.log_weights)
    assert float(log_evidence) == float(evidence)


@pytest.mark.parametrize("width", [1e-2, 1e-4])
def test_a_scan_far_narrower_than_the_gaps(width: float) -> None:
    """Density of the place given N(z; x, w^2), z = 1.5: mean z / (1 + w^2), deviation w to second order."""
    seen, runs = 1.5, 8

    def log_ratio(belief: Belief) -> jax.Array:
        return -0.5 * ((belief.states.range - seen) / width) ** 2

    places, spreads, evidence = [], [], []
    step = jax.jit(lambda belief, key: tempered(belief, log_ratio, key))
    for seed in range(runs):
        belief, log_evidence = step(standard(seed), jax.random.key(seed))
        places.append(float(mean(belief).range))
        spreads.append(float(covariance(belief)[0, 0]) ** 0.5)
        evidence.append(float(log_evidence))
    exact = np.log(width) - 0.5 * seen**2 / (1 + width**2)
    # In single precision a place of 1.5 is known to 1e-7, and the moves leave a tenth of the deviation to chance.
    assert np.mean(places) == pytest.approx(seen, abs=0.2 * width + 1e-6)
    assert np.mean(spreads) == pytest.approx(width, rel=0.15)
    # Some ten steps, each with an error of a few hundredths; eight runs.
    assert np.mean(evidence) == pytest.approx(exact, abs=0.25)
