"""Beliefs side by side: of the detectors of a region, of the targets in hand."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
from jaxtyping import Array, Float

from faintrack.beliefs.belief import Belief


class Beliefs(eqx.Module):
    """Several beliefs of one size at one time; each is about a target of its own.

    Attributes
    ----------
    states : components with the belief first; None where the owner knows them.
    log_weights, log_odds : as those of `faintrack.beliefs.belief.Belief`, the belief first.
    time : of all; seconds.
    """

    states: Any
    log_weights: Float[Array, "belief *points"]
    log_odds: Float[Array, " belief"]
    time: Float[Array, ""]

    @property
    def existence(self) -> Float[Array, " belief"]:
        """Probability that each target exists."""
        return jax.nn.sigmoid(self.log_odds)

    def each(self, function: Callable[..., Any], *more: Any) -> Any:
        """What a function makes of every belief, stacked; `more` has an entry for each."""

        def one(states: Any, log_weights: Array, log_odds: Array, *more: Any) -> Any:
            return function(Belief(states, log_weights, log_odds, self.time), *more)

        return jax.vmap(one)(self.states, self.log_weights, self.log_odds, *more)

    def changed(self, function: Callable[..., Belief], *more: Any) -> "Beliefs":
        """Beliefs that a function makes of these; all have the same time again."""
        belief = self.each(function, *more)
        return Beliefs(belief.states, belief.log_weights, belief.log_odds, belief.time[0])
