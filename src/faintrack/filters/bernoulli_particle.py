r"""The Bernoulli particle filter: at most one target, particles for where, log odds for whether.

Prediction mixes the survivors with newborn targets (bosser2022, eq. 1):

.. math::
    q' = p_b (1 - q) + p_s q, \qquad
    s'(x) = \frac{p_b (1 - q)}{q'} b(x) + \frac{p_s q}{q'} \int f(x|x') s(x') dx'

with the survivors resampled and moved, and the newborn drawn from the birth density afresh. The measurement enters by
`faintrack.beliefs.belief.update`, the same for every filter.

In continuous time a target may also leave and another appear within one interval; that part of :math:`p_s q` belongs to
the newborn (`faintrack.targets.target.Target.forecast`).

A loud source has a likelihood far narrower than the gaps between newborn particles. Newborn particles may then be
**guided**: drawn where the scan points, with weights that make up for it, so that they still stand for the birth
density.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from faintrack.beliefs.belief import Belief
from faintrack.filters.tempered import apart
from faintrack.numerics.resampling import systematic
from faintrack.targets.target import Target

Guide = Callable[[Any, PRNGKeyArray, int], tuple[Any, Float[Array, " count"]]]
Resample = Callable[[PRNGKeyArray, Array, Any, int], Int[Array, " slots"]]


class BernoulliParticleFilter(eqx.Module):
    """Carries a belief of particles forward in time.

    Attributes
    ----------
    target : birth, motion, arrival and departure.
    particles : that follow the target; at most `capacity`, and may then vary without a new compilation.
    births : that look for a new one in every scan.
    capacity : places kept for `particles`, where their number is to vary.
    resample : function of (key, log weights, count, slots) to the indices that live on.
    """

    target: Target
    particles: int | Int[Array, ""] = eqx.field(default=1000)
    births: int = eqx.field(static=True, default=250)
    capacity: int | None = eqx.field(static=True, default=None)
    resample: Resample = eqx.field(static=True, default=systematic)

    def init(self, key: PRNGKeyArray, time: float = 0.0, existence: float = 0.0) -> Belief:
        """Belief before any scan: particles from the birth density, and a probability of existence."""
        states = self.target.birth.sample(key, self._slots + self.births)
        like = jax.tree.leaves(states)[0]
        odds = jnp.asarray(existence, like.dtype)
        return Belief(
            states,
            jnp.full_like(like, -jnp.log(like.size)),
            jnp.log(odds) - jnp.log1p(-odds),
            jnp.asarray(time, like.dtype),
            jnp.full_like(like, time),
        )

    def predict(
        self, belief: Belief, time: Float[Array, ""] | float, key: PRNGKeyArray, guide: Guide | None = None
    ) -> Belief:
        """Belief carried forward to `time` (the module's equation).

        Parameters
        ----------
        belief, time : what to carry forward, and to when; seconds.
        key : random key.
        guide : draws newborn states in place of the birth density: a function of (birth, key, count) to states and the
            natural log of weights, birth density over density of the draws.
        """
        for_resampling, for_motion, for_birth = jax.random.split(key, 3)
        dtype = belief.log_weights.dtype
        time = jnp.asarray(time, dtype)
        interval = time - belief.time
        forecast = self.target.forecast(belief.log_odds, interval)

        slots = self._slots
        chosen = self.resample(for_resampling, belief.log_weights, self.particles, slots)
        survivors = jax.tree.map(lambda component: component[chosen], belief.states)
        survivors = self.target.motion.move(survivors, interval, for_motion)
        if guide is None:
            newborn, correction = self.target.birth.sample(for_birth, self.births), jnp.zeros(self.births, dtype)
        else:
            newborn, correction = guide(self.target.birth, for_birth, self.births)
            # Weights are the belief's: they sum to the newborn's share, whatever the draws.
            correction = correction - jax.nn.logsumexp(correction) + jnp.log(self.births)
        states = jax.tree.map(lambda old, new: jnp.concatenate([old, new.astype(dtype)]), survivors, newborn)

        of_same, of_new = forecast.shares
        each_survivor = jnp.where(jnp.arange(slots) < self.particles, of_same - jnp.log(self.particles), -jnp.inf)
        each_newborn = of_new - jnp.log(self.births) + correction
        assert belief.born is not None
        return Belief(
            states,
            jnp.concatenate([each_survivor, each_newborn]).astype(dtype),
            forecast.log_odds,
            time,
            jnp.concatenate([belief.born[chosen], jnp.full(self.births, time)]),
        )

    def carry(self, belief: Belief, time: Float[Array, ""], key: PRNGKeyArray) -> tuple[Belief, Float[Array, ""]]:
        """Belief of a target that stays, carried forward to `time` without births; the log of the share that left."""
        for_resampling, for_motion = jax.random.split(key)
        count = belief.log_weights.size
        chosen = self.resample(for_resampling, belief.log_weights, count, count)
        states = jax.tree.map(lambda component: component[chosen], belief.states)
        states = self.target.motion.move(states, time - belief.time, for_motion)
        equal = jnp.full_like(belief.log_weights, -jnp.log(count))
        assert belief.born is not None
        return Belief(states, equal, belief.log_odds, time, belief.born[chosen]), jnp.full_like(time, -jnp.inf)

    def taken(self, belief: Belief, inside: Bool[Array, " point"], key: PRNGKeyArray) -> Belief:
        """Particles of a target that has been found, as many as follow one, from those inside.

        They are few that stand for many: moved apart, they do not have their few velocities alone.
        """
        mine = jnp.where(inside, belief.log_weights, -jnp.inf)
        share = jax.nn.logsumexp(mine)
        return apart(
            dataclasses.replace(belief, log_weights=mine - share, log_odds=belief.log_odds + share), key, self._slots
        )

    @property
    def _slots(self) -> int:
        return int(self.particles) if self.capacity is None else self.capacity
