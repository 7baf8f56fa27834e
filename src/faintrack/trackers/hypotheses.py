r"""Which of several tentative targets exist, as one belief about all of them.

Two arrays hear two targets in four places, where their beams cross: either the targets exist or the two **ghosts**, and
never one of each. No number for each place says that. So what is believed is a probability for every set of tentative
targets, a **hypothesis** as those of the labelled multi-Bernoulli filter (Vo and Vo 2013). With e a set and z a scan,

.. math::
    w_e \leftarrow w_e \, \frac{p(z|e)}{p(z|\emptyset)}, \qquad
    \frac{q_t}{1 - q_t} = \frac{\sum_{e \ni t} w_e}{\sum_{e \not\ni t} w_e}

and of two sets that explain all scans alike both keep what they have. A target that is handed over is in half of the
sets, by its odds; one that is declared or given up is settled: the sets that say otherwise are gone. Targets leave
independently of each other.

Targets are found one after the other, and what a scan says for a set is not gathered before all of it are in hand: the
pair that is in hand first, targets or ghosts, has a lead that nothing speaks for. Sets that occupy the same beams
explain the same energy. So one with a newcomer starts with no less than a set :math:`e'` without it in the same beams,

.. math:: w_{e \cup n} = \max\left(w_e \, q_n, \; \max_{e' \sim e \cup n} w_{e'} (1 - q_n)\right)

Up to `CAPACITY` sets are held, all there are of six targets. With more, the likeliest are kept.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.typing import DTypeLike
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from faintrack.numerics.resampling import systematic

CAPACITY = 64
"""Sets that are held at most."""


class Hypotheses(eqx.Module):
    """Sets of targets that may exist, and how likely each is.

    Attributes
    ----------
    members : which targets a set has.
    log_weights : natural log of its probability; minus infinity where an entry is free.
    """

    members: Bool[Array, "set target"]
    log_weights: Float[Array, " set"]

    @classmethod
    def none(cls, targets: int, dtype: DTypeLike = float) -> "Hypotheses":
        """The empty set alone, with room for others."""
        log_weights = jnp.full(CAPACITY, -jnp.inf, dtype).at[0].set(0)
        return cls(jnp.zeros((CAPACITY, targets), bool), log_weights)

    @property
    def log_odds(self) -> Float[Array, " target"]:
        """Natural log of the odds of each target's existence."""

        def total(chosen: Array) -> Array:
            return jax.nn.logsumexp(jnp.where(chosen, self.log_weights[:, None], -jnp.inf), axis=0)

        return total(self.members) - total(~self.members)

    def joined(
        self,
        new: Bool[Array, " target"],
        log_odds: Float[Array, ""],
        beams: Int[Array, "array target"],
        margin: int,
    ) -> "Hypotheses":
        """With a target that is in no set yet.

        Parameters
        ----------
        new : which target it is.
        log_odds : natural log of the odds that it exists.
        beams : of every target; -1 where an array does not hear it.
        margin : beams apart that are taken for one.
        """
        members = jnp.concatenate([self.members, self.members | new])
        # What is not heard, and what is in no set, is far from any beam.
        far = jnp.iinfo(beams.dtype).max // 4
        occupied = jnp.sort(jnp.where(members[:, None], jnp.where(beams < 0, -far, beams), far), axis=2)
        before, after = jnp.split(occupied, 2)
        same = jnp.all(jnp.abs(after[:, None] - before) <= margin, axis=(2, 3))
        alone = self.log_weights + jax.nn.log_sigmoid(-log_odds)
        least = jnp.max(jnp.where(same, alone, -jnp.inf), axis=1)
        both = jnp.maximum(self.log_weights + jax.nn.log_sigmoid(log_odds), least)
        log_weights = jnp.concatenate([alone, jnp.where(self.log_weights > -jnp.inf, both, -jnp.inf)])
        likeliest = jax.lax.top_k(log_weights, CAPACITY)[1]
        return Hypotheses(members[likeliest], jax.nn.log_softmax(log_weights[likeliest]))

    def settled(self, exists: Bool[Array, " target"], gone: Bool[Array, " target"]) -> "Hypotheses":
        """Given that some targets exist and some do not; none of them is in a set any more."""
        asked = jnp.any(self.members, axis=0)
        against = jnp.any((self.members & gone) | (~self.members & (exists & asked)), axis=1)
        log_weights = jnp.where(against, -jnp.inf, self.log_weights)
        return Hypotheses(self.members & ~(exists | gone), jax.nn.log_softmax(log_weights))

    def departed(self, log_stays: Float[Array, ""]) -> "Hypotheses":
        """A scan later, each target still there with a probability of which the natural log is given."""
        before, after = self.members[:, None], self.members[None]
        left = jnp.sum(before & ~after, axis=2)
        # A rate of zero: no target leaves, and none times minus infinity is no number.
        leaves = jnp.where(left > 0, left * jnp.log(-jnp.expm1(log_stays)), 0)
        possible = ~jnp.any(after & ~before, axis=2) & (self.log_weights > -jnp.inf)
        moves = jnp.where(possible, jnp.sum(before & after, axis=2) * log_stays + leaves, -jnp.inf)
        log_weights = jax.nn.logsumexp(self.log_weights[:, None] + moves, axis=0)
        return Hypotheses(self.members, jax.nn.log_softmax(log_weights))

    def updated(self, evidence: Callable[[Bool[Array, " target"]], Float[Array, ""]]) -> "Hypotheses":
        """After a scan; `evidence` is the log ratio that it has for a set, asked for those that are held."""
        held = self.log_weights > -jnp.inf
        first = jnp.argsort(~held, stable=True)

        def one(number: Array, log_weights: Array) -> Array:
            entry = first[number]
            return log_weights.at[entry].add(evidence(self.members[entry]))

        log_weights = jax.lax.fori_loop(0, jnp.sum(held), one, self.log_weights)
        return Hypotheses(self.members, jax.nn.log_softmax(log_weights))

    def drawn(self, key: PRNGKeyArray, count: int) -> Bool[Array, "count target"]:
        """Sets, each as often as it is likely, those that are alike one after the other."""
        return self.members[systematic(key, self.log_weights, count, count)]
