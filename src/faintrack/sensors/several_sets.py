"""Sets of several sensors at one time: bearings of observers, contacts of pairs of a source and a receiver."""

from typing import Generic, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

Set = TypeVar("Set")


class SeveralSets(eqx.Module, Generic[Set]):
    """What several sensors report at one time, or a stack of that.

    Attributes
    ----------
    time : seconds.
    sets : one a sensor; the axis of the sensors follows those of `time`.
    heard : whether a sensor reported, if only that it heard nothing.
    """

    time: Float[Array, "*scan"]
    sets: Set
    heard: Bool[Array, "*scan sensor"]

    def first(self) -> Set:
        """Of one time, the set of the first sensor that reported."""
        chosen = jnp.argmax(self.heard)
        return jax.tree.map(lambda leaf: leaf[chosen], self.sets)
