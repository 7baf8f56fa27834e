"""Random words are those of Threefry, and the numbers made of them follow their laws."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.stats
from jax.extend.random import threefry_2x32

from faintrack.numerics.draws import normal, normal_pairs, uniform, words
from tests.tolerances import assert_mean

COUNT = 100_001
RARE = 1e-6
"""Probability of a stronger departure from the law, below which a test fails; the keys are fixed."""


@pytest.mark.parametrize("seed", [0, 7])
def test_words_are_those_of_jax(seed: int) -> None:
    key, counters = jax.random.key(seed), np.arange(COUNT, dtype=np.uint32)
    expected = threefry_2x32(jax.random.key_data(key), jnp.concatenate([jnp.zeros(COUNT, jnp.uint32), counters]))
    np.testing.assert_array_equal(jnp.concatenate(words(key, COUNT)), expected)


def test_uniform_numbers_are_uniform_and_normal_ones_normal() -> None:
    """Kolmogorov and Smirnov, over the whole distribution."""
    evenly, normally = uniform(jax.random.key(1), (COUNT,)), normal(jax.random.key(2), (COUNT,))
    assert evenly.min() >= 0
    assert evenly.max() < 1
    assert scipy.stats.kstest(evenly, "uniform").pvalue > RARE
    assert scipy.stats.kstest(normally, "norm").pvalue > RARE


def test_numbers_do_not_go_with_each_other() -> None:
    """Products of neighbours, of the halves that share a key, of the parts of a pair and of their squares: mean 0."""
    drawn = np.asarray(normal(jax.random.key(3), (2, COUNT)), float)
    pairs = np.asarray(normal_pairs(jax.random.key(4), COUNT), complex)
    others = np.asarray(normal(jax.random.key(5), (COUNT,)), float)
    for first, second in ((drawn[0], drawn[1]), (drawn[0, 1:], drawn[0, :-1]), (drawn[0], others)):
        assert_mean(first * second, 0)
        assert_mean((first**2 - 1) * (second**2 - 1), 0)
    assert_mean(pairs.real * pairs.imag, 0)
    assert_mean((pairs.real**2 - 1) * (pairs.imag**2 - 1), 0)
    assert_mean(np.abs(pairs) ** 2, 2)


def test_far_numbers_are_as_frequent_as_they_should_be() -> None:
    """Beyond four standard deviations, in two million draws."""
    drawn = np.abs(np.asarray(normal(jax.random.key(6), (2_000_000,))))
    assert_mean((drawn > 4).astype(float), 2 * scipy.stats.norm.sf(4))


def test_each_key_of_a_batch_draws_as_it_does_alone() -> None:
    keys = jax.random.split(jax.random.key(8), 3)
    together = jax.vmap(lambda key: (uniform(key, (3, 5)), normal_pairs(key, 5)))(keys)
    for number, key in enumerate(keys):
        np.testing.assert_array_equal(together[0][number], uniform(key, (3, 5)))
        np.testing.assert_allclose(together[1][number], normal_pairs(key, 5), rtol=1e-6)


def test_double_precision_and_other_generators_are_those_of_jax(float64: type) -> None:
    key, other = jax.random.key(9), jax.random.key(9, impl="rbg")
    np.testing.assert_array_equal(uniform(key, (5, 3), float64), jax.random.uniform(key, (5, 3), float64))
    np.testing.assert_array_equal(normal(key, (5, 3), float64), jax.random.normal(key, (5, 3), float64))
    assert normal_pairs(key, 5, float64).dtype == np.complex128
    np.testing.assert_array_equal(normal(other, (5,)), jax.random.normal(other, (5,), jnp.float32))
    assert normal_pairs(other, 5).dtype == np.complex64
