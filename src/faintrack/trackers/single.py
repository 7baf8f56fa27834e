r"""A tracker for one target at a time: it declares, follows and drops.

A track is declared when the probability that a target exists reaches a threshold. From then on it owns the particles
that
descend from targets born up to that moment; its own existence is the probability that the target exists *and* is one
of those:

.. math:: q_\text{track} = q \sum_{i:\, \text{born}_i \le \text{declared}} w_i

The track is dropped when this falls below a lower threshold. A source that takes over elsewhere brings newborn
particles, so it ends the old track and begins one with a new label, without any rule about jumps in the estimate.

The cells of a grid have no birth times. There a track owns all of them and goes on until existence falls below the
threshold, whichever target it is that exists.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from faintrack.beliefs.belief import Belief, deviations, moments
from faintrack.filters.run import Filter, step
from faintrack.likelihoods.protocols import CellMeans, Likelihood


class Following(eqx.Module):
    """What a single-target tracker knows between scans.

    Attributes
    ----------
    belief : after the last scan.
    label : of the track in hand or the last one; 0 before the first.
    active : whether there is a track in hand.
    declared : when the track was declared; seconds.
    scans : taken in so far.
    """

    belief: Belief
    label: Int[Array, ""]
    active: Bool[Array, ""]
    declared: Float[Array, ""]
    scans: Int[Array, ""]

    @property
    def beliefs(self) -> tuple[Belief, ...]:
        """The one belief."""
        return (self.belief,)


class Estimate(eqx.Module):
    """What the tracker says after a scan.

    Attributes
    ----------
    time : of the scan; seconds.
    existence : probability that a target exists.
    label : of the track in hand; 0 where there is none.
    track_existence : probability that the track's target exists.
    mean : state, of the track's particles where there is a track, otherwise of all.
    covariance : of its components in their order, those of `dataclasses.fields(mean)`.
    log_evidence : log of the scan's mean ratio over the belief.
    """

    time: Float[Array, "*scan"]
    existence: Float[Array, "*scan"]
    label: Int[Array, "*scan"]
    track_existence: Float[Array, "*scan"]
    mean: Any
    covariance: Float[Array, "*scan component component"]
    log_evidence: Float[Array, "*scan"]

    @property
    def std(self) -> Any:
        """Standard deviation of each component, as a state."""
        return deviations(self.mean, self.covariance)


class SingleTargetTracker(eqx.Module):
    """Declares, follows and drops one target at a time.

    Attributes
    ----------
    filter, likelihood : what carries the belief, and what takes in a scan.
    declare : existence at which a track begins; above `drop`.
    drop : existence of the track below which it ends.
    guided : whether newborn particles are drawn where the scan points, by a likelihood that can propose them.
    """

    filter: Filter
    likelihood: Likelihood | CellMeans
    declare: float = 0.97
    drop: float = 0.3
    guided: bool = eqx.field(static=True, default=False)

    def init(self, key: PRNGKeyArray) -> Following:
        """State before the first scan."""
        belief = self.filter.init(key)
        return Following(belief, jnp.array(0), jnp.array(False), belief.time, jnp.array(0))

    def step(self, following: Following, scan: Any, key: PRNGKeyArray) -> tuple[Following, Estimate]:
        """Take in one scan. `key` is that of the whole recording; each scan makes its own from it."""
        key = jax.random.fold_in(key, following.scans)
        belief, log_evidence = step(self.filter, self.likelihood, following.belief, scan, key, self.guided)
        weights = jnp.exp(belief.log_weights)
        born = belief.born

        def owned(active: Array, declared: Array) -> Float[Array, "*points"]:
            # Cells of a grid do not know when their target was born: the track owns them all.
            return weights if born is None else jnp.where(active & (born > declared), 0, weights)

        held = belief.existence * owned(following.active, following.declared).sum()
        kept = following.active & (held >= self.drop)
        # What is not the track's own may be a new target: strong enough, it begins a track in the same scan.
        declares = ~kept & (belief.existence >= self.declare)
        active = kept | declares
        declared = jnp.where(declares, belief.time, following.declared)
        label = following.label + declares

        mine = owned(active, declared)
        share = mine.sum()
        estimate = Estimate(
            belief.time,
            belief.existence,
            jnp.where(active, label, 0),
            belief.existence * jnp.minimum(share, 1),
            *moments(belief, mine / share),
            log_evidence,
        )
        return Following(belief, label, active, declared, following.scans + 1), estimate

    @eqx.filter_jit
    def steps(self, following: Following, scans: Any, key: PRNGKeyArray) -> tuple[Following, Estimate]:
        """Take in a stack of scans in one compiled loop; the estimates are stacked.

        Two scans at a time or many give the same bits; one alone is compiled otherwise and agrees to rounding.
        """
        return jax.lax.scan(lambda carry, scan: self.step(carry, scan, key), following, scans)
