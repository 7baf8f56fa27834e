"""Resampling: which points live on."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PRNGKeyArray


def systematic(
    key: PRNGKeyArray, log_weights: Float[Array, " points"], count: Int[Array, ""] | int, slots: int
) -> Int[Array, " slots"]:
    r"""Indices of `count` points drawn by systematic resampling, without a sort.

    One uniform offset u places the teeth :math:`(u + i) / n` of a comb on the cumulative weights; point j is taken as
    often as teeth fall on it, which is its share times n to within one. The index of each point is written at its first
    tooth, and a running maximum fills the rest.

    Parameters
    ----------
    key : random key.
    log_weights : natural log of weights that sum to 1.
    count : how many to draw, at most `slots`; may vary without a new compilation.
    slots : length of the result; what lies beyond `count` repeats the last point drawn.

    Examples
    --------
    >>> systematic(jax.random.key(0), jnp.log(jnp.array([0.5, 0.0, 0.5])), 4, 4).tolist()
    [0, 0, 2, 2]
    """
    weights = jnp.exp(log_weights)
    cumulative = jnp.cumsum(weights)
    cumulative = cumulative / cumulative[-1]
    offset = jax.random.uniform(key, (), weights.dtype)
    ends = jnp.ceil(cumulative * count - offset).astype(jnp.int32)
    starts = jnp.concatenate([jnp.zeros(1, jnp.int32), ends[:-1]])
    # A point that is not taken starts where the next one starts; it is written outside and dropped. So is one without
    # weight, which a rounded sum can give a tooth.
    starts = jnp.where((ends > starts) & (weights > 0), starts, slots)
    taken = jnp.zeros(slots, jnp.int32).at[starts].max(jnp.arange(weights.size, dtype=jnp.int32), mode="drop")
    return jax.lax.cummax(taken)
