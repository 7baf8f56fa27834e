r"""Several targets as a set of Bernoulli beliefs, each updated with the others as a part of the background.

Every slot holds a target that may exist, as particles and log odds (`faintrack.beliefs.belief`). They are independent:
what is believed of all is the product, a **multi-Bernoulli** density. In every scan one more may be newborn. With
:math:`\ell_t(z|x)` the ratio for target t beside the others, `likelihood.beside` and `likelihood.log_ratio`, each is
updated by the one rule, and the product of these updates stands for the posterior of all: its marginals, with what the
others do summed out.

Others enter as they are predicted, since what the scan says of them it says at the same time; but a target that has
left is no small change of what is expected on average, which is all that a background of moments can say. So there are
**sweeps**: in each, every target is updated from its prediction, with the places of others as predicted and their
existence as of the sweep before. Whether others exist is decided by a scan or two, and then this is what Bayes' rule
has for those who know it.

One newborn target a scan, of all places where targets appear, is a model too: of two that come in the same scan one is
found in the next. Were there several at once, each would explain the same energy before any other does.

Particles are resampled after each scan, and moved by a share of their covariance about a mean that keeps both (Liu and
West 2001), so that none is there twice.

A likelihood needs `log_ratio`, `beside` and `propose`, such as `faintrack.likelihoods.superposed`.
"""

import dataclasses
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.beliefs.belief import Belief, covariance, mean, update
from faintrack.beliefs.components import components
from faintrack.likelihoods.protocols import with_others
from faintrack.numerics.draws import normal
from faintrack.numerics.precision import full_precision
from faintrack.numerics.resampling import systematic
from faintrack.targets.target import Target, odds_of
from faintrack.trackers.beliefs import Beliefs

CERTAIN = 30.0
"""Largest log odds, so that a target that was certain to exist can still leave."""

RIDGE = 1e-3
"""Added to the correlation of a belief's components, so that rounding leaves it a root."""


class BernoulliEstimate(eqx.Module):
    """What is said after a scan.

    Attributes
    ----------
    time : of the scan; seconds.
    existence : probability of the target in each slot.
    mean : its state, if it exists.
    covariance : of the state's components in their order.
    """

    time: Float[Array, "*scan"]
    existence: Float[Array, "*scan slot"]
    mean: Any
    covariance: Float[Array, "*scan slot component component"]


class MultiBernoulliTracker(eqx.Module):
    """Follows several targets that appear, move and leave by themselves.

    Attributes
    ----------
    target : birth, motion and departure of each; the arrival rate is that of all together.
    likelihood : has `log_ratio`, `beside` and `propose`.
    slots : targets that can be held at once; the likeliest stay.
    particles : of each, and of the newborn.
    sweeps : in which existence is settled, at least 1.
    kernel : standard deviation by which resampled particles are moved, over that of all of them.
    """

    target: Target
    likelihood: Any
    slots: int = eqx.field(static=True, default=8)
    particles: int = eqx.field(static=True, default=500)
    sweeps: int = eqx.field(static=True, default=2)
    kernel: float = 0.2

    def init(self, key: PRNGKeyArray, time: float = 0.0) -> Beliefs:
        """No targets."""
        states = jax.vmap(lambda key: self.target.birth.sample(key, self.particles))(jax.random.split(key, self.slots))
        like = jax.tree.leaves(states)[0]
        equal = jnp.full_like(like, -jnp.log(self.particles))
        return Beliefs(states, equal, jnp.full(self.slots, -CERTAIN, like.dtype), jnp.asarray(time, like.dtype))

    @eqx.filter_jit
    def step(self, beliefs: Beliefs, scan: Any, key: PRNGKeyArray) -> tuple[Beliefs, BernoulliEstimate]:
        """Carry all targets forward to a scan and take it in (the module's equations).

        Parameters
        ----------
        beliefs : after the scan before.
        scan : one scan.
        key : random key of this step.
        """
        for_choice, for_move, for_birth = jax.random.split(key, 3)
        interval = scan.time - beliefs.time
        spread = self._resampled(beliefs, for_choice)
        predicted = Beliefs(
            self.target.motion.move(spread.states, interval, for_move),
            spread.log_weights,
            odds_of(self.target.forecast(beliefs.log_odds, interval).same),
            scan.time,
        )
        existence = predicted.existence
        newborn = self._newborn(predicted, scan, interval, for_birth)

        def sweep(_: Array, carried: tuple[Beliefs, Belief, Array]) -> tuple[Beliefs, Belief, Array]:
            return self._swept(predicted, newborn, carried[2], scan)

        # A loop, for what it reads is in memory; XLA would draw and move the particles anew for every sensor.
        updated, appeared, _ = jax.lax.fori_loop(0, self.sweeps, sweep, (predicted, newborn, existence))
        updated = _with(updated, appeared)
        _, best = jax.lax.top_k(updated.log_odds, self.slots)
        kept = Beliefs(
            jax.tree.map(lambda component: component[best], updated.states),
            updated.log_weights[best],
            jnp.clip(updated.log_odds[best], -CERTAIN, CERTAIN),
            scan.time,
        )
        return kept, BernoulliEstimate(scan.time, kept.existence, kept.each(mean), kept.each(covariance))

    @eqx.filter_jit
    def steps(self, beliefs: Beliefs, scans: Any, key: PRNGKeyArray) -> tuple[Beliefs, BernoulliEstimate]:
        """Take in a stack of scans in one compiled loop; the estimates are stacked."""
        keys = jax.random.split(key, scans.time.shape[0])
        return jax.lax.scan(lambda carry, scan: self.step(carry, *scan), beliefs, (scans, keys))

    def _newborn(self, others: Beliefs, scan: Any, interval: Float[Array, ""], key: PRNGKeyArray) -> Belief:
        """Belief of a target that has just appeared, before the scan but drawn where that points."""
        beside = with_others(self.likelihood, scan, others.states, others.log_weights, others.existence)
        states, log_weights = self.likelihood.propose(beside, self.target.birth, key, self.particles)
        log_odds = odds_of(self.target.forecast(jnp.full_like(others.log_odds[0], -jnp.inf), interval).appeared)
        # Weights as they are: their mean is 1, of which draws that lie close together say little.
        return Belief(states, log_weights - jnp.log(self.particles), log_odds, scan.time)

    def _swept(
        self, predicted: Beliefs, newborn: Belief, existence: Float[Array, " slot"], scan: Any
    ) -> tuple[Beliefs, Belief, Float[Array, " slot"]]:
        """The newborn after the scan, beside those in hand, and every target in hand, beside the others and it."""

        parts = jax.vmap(partial(self.likelihood.part, scan))(predicted.states, predicted.log_weights)

        def beside(scan: Any, existence: Float[Array, " slot"]) -> Any:
            return self.likelihood.beside(scan, parts, existence)

        appeared = update(newborn, self.likelihood.log_ratio(beside(scan, existence), newborn.states))[0]
        states = jax.tree.map(lambda component: component[None], appeared.states)
        scan = with_others(self.likelihood, scan, states, appeared.log_weights[None], appeared.existence[None])
        others = jnp.where(jnp.eye(self.slots, dtype=bool), 0, existence)

        def of_one(belief: Belief, others: Float[Array, " slot"]) -> Belief:
            return update(belief, self.likelihood.log_ratio(beside(scan, others), belief.states))[0]

        updated = predicted.changed(of_one, others)
        return updated, appeared, updated.existence

    @full_precision
    def _resampled(self, beliefs: Beliefs, key: PRNGKeyArray) -> Beliefs:
        """Particles of equal weights: drawn by theirs, moved apart and towards their mean."""
        for_choice, for_kernel = jax.random.split(key)
        keys = jax.random.split(for_choice, self.slots)
        count = self.particles
        chosen = jax.vmap(lambda key, weights: systematic(key, weights, count, count))(keys, beliefs.log_weights)
        names, middles, matrices = list(components(beliefs.states)), beliefs.each(mean), beliefs.each(covariance)
        scale = jnp.sqrt(jnp.maximum(jnp.diagonal(matrices, axis1=1, axis2=2), jnp.finfo(matrices.dtype).tiny))
        correlation = matrices / (scale[:, :, None] * scale[:, None, :])
        root = scale[:, :, None] * jnp.linalg.cholesky(correlation + RIDGE * jnp.eye(len(names)))
        apart = self.kernel * root @ normal(for_kernel, (self.slots, len(names), count), matrices.dtype)
        shrink = jnp.sqrt(1 - self.kernel**2)
        moved = {}
        for number, name in enumerate(names):
            middle = getattr(middles, name)[:, None]
            drawn = jnp.take_along_axis(getattr(beliefs.states, name), chosen, axis=1)
            moved[name] = middle + shrink * (drawn - middle) + apart[:, number]
        states = dataclasses.replace(beliefs.states, **moved)
        return dataclasses.replace(
            beliefs, states=states, log_weights=jnp.full_like(beliefs.log_weights, -jnp.log(count))
        )


def _with(beliefs: Beliefs, one: Belief) -> Beliefs:
    """Beliefs, and one more behind them."""
    return Beliefs(
        jax.tree.map(lambda many, new: jnp.concatenate([many, new[None]]), beliefs.states, one.states),
        jnp.concatenate([beliefs.log_weights, one.log_weights[None]]),
        jnp.append(beliefs.log_odds, one.log_odds),
        beliefs.time,
    )
