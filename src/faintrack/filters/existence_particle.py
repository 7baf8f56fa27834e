r"""Particles that carry a bit of existence: the joint posterior of state and presence (liu2013, eq. 9-17).

Each particle is a possible truth: a target with a state, or no target. With :math:`\lambda` the bit, a particle without
a target gets one with :math:`p_b` and a state from the birth density, one with a target keeps it with :math:`p_s` and
moves it (eq. 10-11). The scan multiplies the weight of a particle with a target by the likelihood ratio and leaves that
of the others as it is, so that

.. math:: q = \sum_n \lambda^n w^n, \qquad N_\text{eff} = 1 / \sum_n (w^n)^2

are existence (eq. 15) and effective number (eq. 17); where this falls below a share of the particles they are drawn
anew, with probabilities like their weights.

It is a belief about something that is there for certain, a truth with or without a target (`PossibleState`), so that
`faintrack.beliefs.belief.update` takes in its scans too; the mean ratio over it is the gain :math:`1 - q + q I` of a
scan, and `of_target` reads off it what the package believes elsewhere. Use `faintrack.filters.bernoulli_particle`
instead: it estimates the same existence without drawing the bit, and so with less variance for as many particles.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from faintrack.beliefs.belief import Belief
from faintrack.filters.bernoulli_particle import Resample
from faintrack.likelihoods.protocols import Likelihood
from faintrack.numerics.draws import uniform
from faintrack.numerics.resampling import systematic
from faintrack.targets.target import Target


class PossibleState(eqx.Module):
    """A truth that is possible: a target with a state, or none.

    Attributes
    ----------
    state : of the target; means nothing where there is none.
    present : whether there is one.
    """

    state: Any
    present: Bool[Array, "..."]


class OfPossible(eqx.Module):
    """Log ratio of truths with and without a target.

    Attributes
    ----------
    likelihood : of a target's state.
    """

    likelihood: Likelihood

    def log_ratio(self, scan: Any, states: PossibleState) -> Float[Array, "..."]:
        """That of the likelihood where there is a target, 0 where there is none."""
        return jnp.where(states.present, self.likelihood.log_ratio(scan, states.state), 0)


class ExistenceParticleFilter(eqx.Module):
    """Carries particles with a bit of existence forward in time; `OfPossible` takes in their scans.

    Attributes
    ----------
    target : birth, motion, arrival and departure.
    particles : with and without a target.
    scarce : share of the particles below which their effective number makes them be drawn anew.
    resample : function of (key, log weights, count, slots) to the indices that live on.

    Examples
    --------
    >>> from faintrack.targets.motion import PlanarMotion
    >>> from faintrack.targets.states import RangeState
    >>> from faintrack.targets.target import UniformBirth
    >>> birth = UniformBirth(RangeState(jnp.array(0.0), jnp.array(-1.0)), RangeState(jnp.array(9.0), jnp.array(1.0)))
    >>> filter = ExistenceParticleFilter(Target(birth, PlanarMotion(0.1), 0.1, 0.1), particles=4000)
    >>> belief = filter.predict(filter.init(jax.random.key(0), existence=0.5), 3.0, jax.random.key(1))
    >>> round(float(of_target(belief).existence), 1)
    0.5
    """

    target: Target
    particles: int = eqx.field(static=True, default=3000)
    scarce: float = 0.5
    resample: Resample = eqx.field(static=True, default=systematic)

    @eqx.filter_jit
    def init(self, key: PRNGKeyArray, time: float = 0.0, existence: float = 0.0) -> Belief:
        """Belief before any scan: each particle has a target with the probability of existence."""
        for_state, for_bit = jax.random.split(key)
        state = self.target.birth.sample(for_state, self.particles)
        like = jax.tree.leaves(state)[0]
        present = uniform(for_bit, like.shape, like.dtype) < existence
        return Belief(
            PossibleState(state, present),
            jnp.full_like(like, -jnp.log(self.particles)),
            jnp.asarray(jnp.inf, like.dtype),
            jnp.asarray(time, like.dtype),
            jnp.full_like(like, time),
        )

    def predict(self, belief: Belief, time: Float[Array, ""] | float, key: PRNGKeyArray) -> Belief:
        """Belief carried forward to `time` (the module's equations)."""
        for_resampling, for_bit, for_state = jax.random.split(key, 3)
        dtype, count = belief.log_weights.dtype, self.particles
        time = jnp.asarray(time, dtype)
        interval = time - belief.time
        # What becomes of a truth without a target, and of one with it.
        chances = jax.tree.map(jnp.exp, self.target.forecast(jnp.array([-jnp.inf, jnp.inf], dtype), interval))

        log_effective = -jax.nn.logsumexp(2 * belief.log_weights)
        scarce = log_effective < jnp.log(self.scarce * count)
        drawn = self.resample(for_resampling, belief.log_weights, count, count)
        chosen = jnp.where(scarce, drawn, jnp.arange(count))
        log_weights = jnp.where(scarce, -jnp.log(count).astype(dtype), belief.log_weights)
        states = jax.tree.map(lambda component: component[chosen], belief.states)

        change, before = uniform(for_bit, (count,), dtype), states.present.astype(jnp.int32)
        new = chances.appeared + chances.replaced
        begins, present = change < new[before], change < (new + chances.same)[before]
        # A particle moves or is born: the two may come from the same random numbers.
        moved = self.target.motion.move(states.state, interval, for_state)
        newborn = self.target.birth.sample(for_state, count)
        state = jax.tree.map(lambda old, new: jnp.where(begins, new.astype(dtype), old), moved, newborn)
        assert belief.born is not None
        born = jnp.where(begins, time, belief.born[chosen])
        return Belief(PossibleState(state, present), log_weights, belief.log_odds, time, born)


def of_target(belief: Belief) -> Belief:
    """What particles with a bit believe of a target, in the way of all other filters.

    Its states are those of the target, its weights sum to 1 over the particles that have one, its log odds are those
    of the bit. Where no particle has a target the weights mean nothing.
    """
    present, log_weights = belief.states.present, belief.log_weights
    log_there = jax.nn.logsumexp(log_weights, where=present)
    log_absent = jax.nn.logsumexp(log_weights, where=~present)
    possible = log_there > -jnp.inf
    weights = jnp.where(present, log_weights - jnp.where(possible, log_there, 0), -jnp.inf)
    return Belief(
        belief.states.state,
        jnp.where(possible, weights, -jnp.log(log_weights.size).astype(log_weights.dtype)),
        log_there - log_absent,
        belief.time,
        belief.born,
    )
