"""A point lives on as often as its weight says: to within one in every draw, exactly on average."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from faintrack.numerics.resampling import systematic
from tests.tolerances import STANDARD_ERRORS, rounding

SIZE, SLOTS = 12, 40
WEIGHTS = st.lists(st.just(0.0) | st.floats(1e-6, 1.0), min_size=SIZE, max_size=SIZE).filter(any)


@jax.jit
def resample(seed: int, log_weights: jax.Array, count: int) -> jax.Array:
    return systematic(jax.random.key(seed), log_weights, count, SLOTS)


def copies(weights: np.ndarray, count: int, seed: int) -> np.ndarray:
    """How often each point is among the first `count`."""
    chosen = np.asarray(resample(seed, jnp.log(jnp.asarray(weights, np.float32)), count))
    return np.bincount(chosen[:count], minlength=len(weights))


@settings(deadline=None, max_examples=200)
@given(weights=WEIGHTS, count=st.integers(1, SLOTS), seed=st.integers(0, 2**31 - 1))
def test_copies_are_within_one_of_the_share(weights: list[float], count: int, seed: int) -> None:
    share = np.array(weights) / np.sum(weights)
    taken = copies(share, count, seed)
    assert taken.sum() == count
    assert np.all(np.abs(taken - count * share) < 1 + count * rounding(np.float32, 2 * SIZE))
    assert not np.any(taken[share == 0])


@settings(deadline=None, max_examples=50)
@given(weights=WEIGHTS, count=st.integers(1, SLOTS - 1), seed=st.integers(0, 2**31 - 1))
def test_slots_beyond_the_count_repeat_the_last(weights: list[float], count: int, seed: int) -> None:
    share = np.array(weights) / np.sum(weights)
    chosen = np.asarray(resample(seed, jnp.log(jnp.asarray(share, np.float32)), count))
    assert np.all(np.diff(chosen) >= 0)
    assert np.all(chosen[count:] == chosen[count - 1])


@pytest.mark.parametrize("weights", [[0.5, 0.0, 0.5], [0.1, 0.2, 0.7], [0.001, 0.998, 0.001], [0.0, 0.25, 0.75]])
@pytest.mark.parametrize("count", [1, 7])
def test_copies_are_unbiased(weights: list[float], count: int) -> None:
    """20,000 keys, 5 standard errors: a point gets its whole share, and one more with what is left over."""
    keys = 20_000
    log_weights = jnp.log(jnp.array(weights))
    draw = jax.jit(jax.vmap(lambda key: systematic(key, log_weights, count, 7)[:count]))
    chosen = np.asarray(draw(jax.random.split(jax.random.key(3), keys)))
    share = count * np.array(weights)
    left_over = share - np.floor(share)
    error = np.sqrt(left_over * (1 - left_over) / keys)
    mean = np.bincount(chosen.ravel(), minlength=len(weights)) / keys
    assert np.all(np.abs(mean - share) <= STANDARD_ERRORS * error + rounding(np.float32, 10))


def test_a_point_without_weight_is_never_taken() -> None:
    """13 million draws among 1,250 points: the rounded sum of weights can rise where a weight is zero."""
    rng, count = np.random.default_rng(2), 2**16
    weights = np.zeros(1250, np.float32)
    weights[rng.choice(1250, 300, replace=False)] = rng.exponential(size=300)
    log_weights = jnp.log(weights / weights.sum())

    @jax.jit
    def weightless(keys: jax.Array, log_weights: jax.Array) -> jax.Array:
        return jax.lax.map(
            lambda key: jnp.sum(log_weights[systematic(key, log_weights, count, count)] == -jnp.inf), keys
        )

    assert not np.any(weightless(jax.random.split(jax.random.key(0), 200), log_weights))
