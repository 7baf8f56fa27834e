r"""Random numbers in single precision, at a quarter of the time of JAX's own on a CPU.

JAX turns a key and a counter into random words by Threefry (Salmon et al., *Parallel random numbers: as easy as 1, 2,
3*, 2011), in a loop over its rounds that writes every round to memory, and keeps one word of two. Here the rounds are
written out, so that XLA does them all in registers, and both words are used. A pair of uniform numbers u, v makes a
pair of normal ones (Box and Muller 1958):

.. math:: n_1 + j n_2 = \sqrt{-2 \log (1 - u)} \, e^{2 \pi j v}

In double precision, and with keys of another generator, the numbers are those of `jax.random`. Use this where numbers
are drawn by the thousand in every step; it knows no other distribution.
"""

import math
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float, PRNGKeyArray, UInt32

from faintrack.numerics.trigonometry import sine_cosine

ROTATIONS = ((13, 15, 26, 6), (17, 29, 16, 24))
"""Bits by which the second word is turned in each round (Salmon et al., table 2)."""
PARITY = 0x1BD11BDA
"""What the third word of the key is made with."""


@partial(jax.jit, static_argnames=("shape", "dtype"))
def uniform(key: PRNGKeyArray, shape: tuple[int, ...], dtype: Any = jnp.float32) -> Float[Array, "..."]:
    """Uniform numbers from 0 to below 1.

    Parameters
    ----------
    key : random key.
    shape : of the result.
    dtype : real type.

    Examples
    --------
    >>> uniform(jax.random.key(0), (3, 2)).shape
    (3, 2)
    """
    if not _single(key, dtype):
        return jax.random.uniform(key, shape, dtype)
    size = math.prod(shape)
    first, second = words(key, (size + 1) // 2)
    return jnp.concatenate([_unit(first), _unit(second)])[:size].reshape(shape)


@partial(jax.jit, static_argnames=("shape", "dtype"))
def normal(key: PRNGKeyArray, shape: tuple[int, ...], dtype: Any = jnp.float32) -> Float[Array, "..."]:
    """Normal numbers of mean 0 and variance 1; parameters as in `uniform`.

    Examples
    --------
    >>> normal(jax.random.key(0), (3, 2)).shape
    (3, 2)
    """
    if not _single(key, dtype):
        return jax.random.normal(key, shape, dtype)
    size = math.prod(shape)
    pairs = normal_pairs(key, (size + 1) // 2, dtype)
    return jnp.concatenate([pairs.real, pairs.imag])[:size].reshape(shape)


@partial(jax.jit, static_argnames=("count", "dtype"))
def normal_pairs(key: PRNGKeyArray, count: int, dtype: Any = jnp.float32) -> Complex[Array, " count"]:
    """Pairs of normal numbers as real and imaginary part, each of variance 1; `dtype` is that of the parts.

    Check: the mean of the squared size is 2, that of the square is 0.
    """
    if not _single(key, dtype):
        return jax.lax.complex(*jax.random.normal(key, (2, count), dtype))
    first, second = words(key, count)
    size = jnp.sqrt(-2 * jnp.log(1 - _unit(first)))
    sine, cosine = sine_cosine(2 * jnp.pi * _unit(second))
    # Complex, so that XLA forms both at once.
    return jax.lax.complex(size * cosine, size * sine)


@partial(jax.jit, static_argnames="count")
def words(key: PRNGKeyArray, count: int) -> tuple[UInt32[Array, " count"], UInt32[Array, " count"]]:
    """Two random words for each of the counters 0, 1, ... under a key: Threefry of 2 words and 20 rounds.

    Examples
    --------
    >>> first, second = words(jax.random.key(0), 1)
    >>> f"{int(first[0]):x} {int(second[0]):x}"
    '6b200159 99ba4efe'
    """
    low, high = jax.random.key_data(key)
    keys = (low, high, low ^ high ^ jnp.uint32(PARITY))
    first = jnp.full(count, keys[0])
    second = jax.lax.iota(jnp.uint32, count) + keys[1]
    for turn in range(5):
        for bits in ROTATIONS[turn % 2]:
            first = first + second
            second = first ^ (second << bits | second >> (32 - bits))
        first = first + keys[(turn + 1) % 3]
        second = second + keys[(turn + 2) % 3] + jnp.uint32(turn + 1)
    return first, second


def _single(key: PRNGKeyArray, dtype: Any) -> bool:
    return dtype == jnp.float32 and str(jax.random.key_impl(key)) == "threefry2x32"


def _unit(word: UInt32[Array, " count"]) -> Float[Array, " count"]:
    """Number from 0 to below 1: the upper 23 bits of a word, as the fraction of a number from 1 to below 2."""
    return jax.lax.bitcast_convert_type(word >> 9 | jnp.uint32(0x3F800000), jnp.float32) - 1
