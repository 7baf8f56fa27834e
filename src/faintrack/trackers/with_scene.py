r"""Beliefs in pictures whose scene moves: a target stays with the detector or moves with the scene.

A camera that follows a target holds it while the scene drifts past. The same camera shakes, and then both jump
alike. Which of the two a frame has seen is not known, so before it each half of a belief goes one of the ways,

.. math:: w'(y, x) = \tfrac12 w(y, x) + \tfrac12 w(y - d_y, x - d_x)

with d the pixels by which the scene has moved; the target's own motion follows. What leaves the picture is lost.
"""

import dataclasses
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Int

from faintrack.beliefs.belief import Belief
from faintrack.trackers.many import Hand

State = TypeVar("State")


def with_scene(state: State, moved: Int[Array, " axis"]) -> State:
    """State of a tracker whose beliefs on grids have taken half of the scene's motion.

    Parameters
    ----------
    state : of any tracker; its beliefs are over the cells of the picture, whose axes y and x are followed by those of
        two rates. Beliefs of particles stay as they are.
    moved : cells along y and x by which the scene has moved since the frame before.

    Examples
    --------
    >>> belief = Belief(None, jnp.full((1, 4, 1, 1), -jnp.inf).at[0, 1].set(0.0), jnp.array(0.0), jnp.array(0.0))
    >>> jnp.exp(with_scene(belief, jnp.array([0, 2])).log_weights[0, :, 0, 0]).tolist()
    [0.0, 0.5, 0.0, 0.5]
    """

    still = jnp.all(moved == 0)

    def mixed(log_weights: Array) -> Array:
        planes = log_weights.shape[:2]
        along = [jnp.arange(count) - moved[axis] for axis, count in enumerate(planes)]
        y, x = ((place >= 0) & (place < count) for place, count in zip(along, planes, strict=True))
        inside = (y[:, None] & x[None, :])[..., None, None]
        weights = jnp.exp(log_weights - jnp.max(log_weights))
        both = weights + jnp.where(inside, jnp.roll(weights, moved, axis=(0, 1)), 0)
        return jnp.log(both / jnp.sum(both))

    def followed(part: Any) -> Any:
        beliefs = part.beliefs if isinstance(part, Hand) else part
        # Particles have one axis.
        if not isinstance(beliefs, Belief) or beliefs.log_weights.ndim - isinstance(part, Hand) < 4:
            return part
        if isinstance(part, Hand):
            after = jax.lax.map(
                lambda each: jax.lax.cond(each[0], mixed, lambda log_weights: log_weights, each[1]),
                (part.active & ~still, beliefs.log_weights),
            )
            return eqx.tree_at(lambda hand: hand.beliefs.log_weights, part, after)
        after = jax.lax.cond(still, lambda log_weights: log_weights, mixed, beliefs.log_weights)
        return dataclasses.replace(part, log_weights=after)

    return jax.tree.map(followed, state, is_leaf=lambda part: isinstance(part, Belief | Hand))
