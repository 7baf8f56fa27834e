r"""Beliefs in pictures whose scene moves: a target stays with the detector or moves with the scene.

A camera that follows a target holds it while the scene drifts past. The same camera shakes, and then both jump
alike. Which of the two a frame has seen is not known, so before it each half of a belief goes one of the ways,

.. math:: w'(y, x) = \tfrac12 w(y, x) + \tfrac12 w(y - d_y, x - d_x)

with d the pixels by which the scene has moved; the target's own motion follows. What leaves the picture is lost. Of
particles every other one goes: after resampling neighbours are alike.
"""

import dataclasses
import operator
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Int

from faintrack.beliefs.belief import Belief
from faintrack.sensors.cells import Cells
from faintrack.trackers.many import Hand

State = TypeVar("State")


def with_scene(state: State, moved: Int[Array, " axis"], cells: Cells) -> State:
    """State of a tracker whose beliefs have taken half of the scene's motion.

    Parameters
    ----------
    state : of any tracker; beliefs on grids are over the cells of the picture, whose axes y and x are followed by those
        of two rates.
    moved : cells along y and x by which the scene has moved since the frame before.
    cells : of the picture.

    Examples
    --------
    >>> from faintrack.beliefs.axis import Axis
    >>> belief = Belief(None, jnp.full((1, 4, 1, 1), -jnp.inf).at[0, 1].set(0.0), jnp.array(0.0), jnp.array(0.0))
    >>> cells = Cells((("y", Axis(0.0, 1.0, 1)), ("x", Axis(0.0, 1.0, 4))))
    >>> jnp.exp(with_scene(belief, jnp.array([0, 2]), cells).log_weights[0, :, 0, 0]).tolist()
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

    def gone(states: Any) -> Any:
        goes = jnp.arange(jax.tree.leaves(states)[0].shape[-1]) % 2
        steps = {name: goes * (way * axis.step) for way, (name, axis) in zip(moved, cells.axes, strict=True)}
        return dataclasses.replace(states, **{name: getattr(states, name) + step for name, step in steps.items()})

    def followed(part: Any) -> Any:
        beliefs = part.beliefs if isinstance(part, Hand) else part
        if not isinstance(beliefs, Belief):
            return part
        if beliefs.born is not None:
            where = operator.attrgetter("beliefs.states" if isinstance(part, Hand) else "states")
            return eqx.tree_at(where, part, gone(beliefs.states))
        if isinstance(part, Hand):
            after = jax.lax.map(
                lambda each: jax.lax.cond(each[0], mixed, lambda log_weights: log_weights, each[1]),
                (part.active & ~still, beliefs.log_weights),
            )
            return eqx.tree_at(lambda hand: hand.beliefs.log_weights, part, after)
        after = jax.lax.cond(still, lambda log_weights: log_weights, mixed, beliefs.log_weights)
        return dataclasses.replace(part, log_weights=after)

    return jax.tree.map(followed, state, is_leaf=lambda part: isinstance(part, Belief | Hand))
