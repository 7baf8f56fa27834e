r"""What a scan says for a target in hand where an undetected one would explain it as well, on a grid.

A belief on a grid has some weight in every cell, however far motion may carry the target. A loud echo in one that
nobody is believed in has a ratio that outweighs any prior, and would draw the target there in a leap. But a target that
is not in hand may be there too. With q the probability that there is one, w its weights, C(x) the cells around the
position x whatever the velocity, the background of the target in hand is a mixture, and its ratio

.. math:: \frac{\ell(x)}{1 + \rho(x) \max_{C(x)} \ell}, \qquad \rho(x) = q \sum_{C(x)} w ,

at most :math:`1 / \rho`. Within a place ratios are to each other as before. Where the target in hand is believed to be
no other is sought, and its ratio stays as it is.
"""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from faintrack.beliefs.belief import Belief
from faintrack.beliefs.components import components, rates

AROUND = 2
"""Cells on either side that are one place."""


def beside_undetected(
    log_ratio: Float[Array, "..."], sought: Belief, own: Bool[Array, "..."] | bool = False
) -> Float[Array, "..."]:
    """Log ratio of a target in hand beside one that is not (the module's equation).

    Parameters
    ----------
    log_ratio : of every cell; broadcasts to the cells of the belief.
    sought : belief about a target that is not in hand, on the same grid.
    own : cells in which none is sought beside the target in hand.

    Examples
    --------
    >>> from faintrack.targets.states import RangeState
    >>> states = RangeState(jnp.arange(7.0)[:, None], jnp.zeros((1, 1)))
    >>> sought = Belief(states, jnp.full((7, 1), -jnp.log(7.0)), jnp.log(7e-3 / 0.993), jnp.array(0.0))
    >>> log_ratio = jnp.array([0.0, 0.0, 0.0, 0.0, 0.0, 60.0, 50.0])[:, None]
    >>> [round(float(x), 1) for x in beside_undetected(log_ratio, sought)[jnp.array([0, 5, 6]), 0]]
    [-0.0, 5.5, -4.2]
    """
    places = _places(sought.states)
    others = tuple(axis for axis in range(sought.log_weights.ndim) if axis not in places)
    whole = jnp.broadcast_to(log_ratio, jnp.broadcast_shapes(log_ratio.shape, sought.log_weights.shape))
    loudest = _over_places(jax.lax.max, -jnp.inf, jnp.max(whole, axis=others, keepdims=True), places)
    weights = jnp.sum(jnp.exp(sought.log_weights), axis=others, keepdims=True)
    there = _over_places(jax.lax.add, 0.0, weights, places)
    shared = jnp.logaddexp(0.0, jax.nn.log_sigmoid(sought.log_odds) + jnp.log(there) + loudest)
    return jnp.where(own, whole, whole - shared)


def _places(states: Any) -> tuple[int, ...]:
    """Axes of a grid that tell where a target is: those of components that have a rate."""
    named = components(states)
    axes = (jnp.shape(named[name]) for name in rates(states))
    return tuple(sorted({axis for shape in axes for axis, length in enumerate(shape) if length > 1}))


def _over_places(
    reduce: Any, start: float, values: Float[Array, "..."], places: tuple[int, ...]
) -> Float[Array, "..."]:
    """Largest value or sum around every place, axis by axis."""
    for axis in places:
        window = [1] * values.ndim
        window[axis] = 2 * AROUND + 1
        ends = [(AROUND, AROUND) if number == axis else (0, 0) for number in range(values.ndim)]
        first = jnp.asarray(start, values.dtype)
        values = jax.lax.reduce_window(values, first, reduce, window, [1] * values.ndim, ends)
    return values
