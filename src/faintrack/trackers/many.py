r"""Many targets of any sensor: some in hand, one sought, each with the others as its background.

What is not in hand is sought by the filter of one target, as `faintrack.trackers.single` does, in scans that have the
targets in hand as part of their background (`faintrack.likelihoods.protocols.Beside`). Where the probability that a
target exists near one place reaches a threshold, it is taken in hand: its part of the belief is cut out, and what is
left seeks the next.

Every target in hand has a belief of its own without births, so a label moves no further than motion allows. It is
updated with what is expected of all others in its background, which is the linear multitarget approximation of Musicki
and La Scala (*Multi-target tracking in clutter without measurement assignment*, 2008) carried over from the clutter of
detections to any background: exact for one target, and for several whose supports do not meet. Two tracks on one target
explain it to each other; their odds fall until one of them is dropped. A target may fall silent
(`faintrack.targets.silence`); with h the probability that it is observable,

.. math:: I = h \sum_i w_i \ell(z|x_i) + 1 - h, \qquad \frac{q}{1-q} \leftarrow \frac{q}{1-q} I .

States that a sensor hardly tells from a target in hand are not sought. On a grid what an undetected target would
explain as well speaks for one in hand only so much (`faintrack.trackers.undetected`).
"""

import dataclasses
from collections.abc import Callable
from functools import partial
from typing import Any, Protocol, runtime_checkable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from faintrack.beliefs.belief import Belief, moments, update
from faintrack.filters.run import Filter
from faintrack.filters.tempered import tempered
from faintrack.likelihoods.protocols import Preparing, Proposing, Sighted, Zooming, log_ratios
from faintrack.numerics.draws import uniform
from faintrack.numerics.resampling import systematic
from faintrack.numerics.traced import traced
from faintrack.targets.silence import Silence
from faintrack.trackers.undetected import beside_undetected

CANDIDATES = 32
"""Places that are looked at for the peak of a belief."""

AT_ONCE = 4
"""Targets that are taken in hand after one scan at most."""


@runtime_checkable
class Carrying(Filter, Protocol):
    """A filter that can follow a target in hand."""

    def carry(self, belief: Belief, time: Float[Array, ""], key: PRNGKeyArray) -> tuple[Belief, Float[Array, ""]]:
        """Belief of a target that stays, carried forward without births; the log of the share that left."""

    def taken(self, belief: Belief, inside: Bool[Array, "..."], key: PRNGKeyArray) -> Belief:
        """Belief of a target that has been found, from the points inside."""


class Hand(eqx.Module):
    """Targets in hand, a slot each.

    Attributes
    ----------
    beliefs : stacked.
    observable : natural log of the odds that a target is observable, if it exists.
    label : of the track; 0 in a free slot.
    """

    beliefs: Belief
    observable: Float[Array, " slot"]
    label: Int[Array, " slot"]

    @property
    def active(self) -> Bool[Array, " slot"]:
        """Slots with a target."""
        return self.label > 0

    @property
    def observable_existence(self) -> Float[Array, " slot"]:
        """Probability that each target exists and is observable; 0 in a free slot."""
        both = jax.nn.sigmoid(self.beliefs.log_odds) * jax.nn.sigmoid(self.observable)
        return jnp.where(self.active, both, 0)


class Seeking(eqx.Module):
    """What is known between scans.

    Attributes
    ----------
    sought : belief about a target that is not in hand.
    hand : targets in hand.
    labels : given so far.
    scans : taken in so far.
    """

    sought: Belief
    hand: Hand
    labels: Int[Array, ""]
    scans: Int[Array, ""]

    @property
    def beliefs(self) -> tuple[Belief, ...]:
        """What is believed of the target in each slot, of none in a free one, and of the one that is sought."""
        log_odds = jnp.where(self.hand.active, self.hand.beliefs.log_odds, -jnp.inf)
        held = eqx.tree_at(lambda beliefs: beliefs.log_odds, self.hand.beliefs, log_odds)
        return (*(_of_slot(held, slot) for slot in range(len(log_odds))), self.sought)

    @property
    def belief(self) -> Belief:
        """Points of all beliefs together, each with the odds of its own target; of a grid, the sums in its cells."""
        free = jnp.where(self.hand.active, self.hand.beliefs.log_odds, -jnp.inf)
        held = self.hand.beliefs.log_weights + free.reshape(-1, *(1,) * (self.hand.beliefs.log_weights.ndim - 1))
        alone = self.sought.log_weights + self.sought.log_odds
        if self.sought.born is None:
            states, joint = self.sought.states, jax.nn.logsumexp(jnp.concatenate([held, alone[None]]), axis=0)
        else:
            joint = jnp.concatenate([held.ravel(), alone])
            states = jax.tree.map(
                lambda held, alone: jnp.concatenate([held.ravel(), alone]), self.hand.beliefs.states, self.sought.states
            )
        log_odds = jax.nn.logsumexp(joint)
        some = log_odds > -jnp.inf
        log_weights = jnp.where(some, joint - jnp.where(some, log_odds, 0), -jnp.log(joint.size))
        return Belief(states, log_weights.astype(joint.dtype), log_odds, self.sought.time)


class Found(eqx.Module):
    """What is known within a scan: what is left to seek, what is in hand, and what the scan said.

    Attributes
    ----------
    sought, hand, labels : as of `Seeking`.
    parts : of each target in hand in the scan's background.
    unread : slots whose target has not taken in the scan.
    log_evidence : of the scan, for the belief that seeks.
    full : a target was found, and there was no free slot.
    """

    sought: Belief
    hand: Hand
    parts: Any
    unread: Bool[Array, " slot"]
    labels: Int[Array, ""]
    log_evidence: Float[Array, ""]
    full: Bool[Array, ""]


class ManyEstimate(eqx.Module):
    """What the tracker says after a scan. The last slot is that of the target that is sought.

    Attributes
    ----------
    time : of the scan; seconds.
    label : of the track in each slot; 0 where there is none.
    existence : probability that the target of the slot exists; 0 in a free one.
    mean : state.
    covariance : of its components in their order.
    observable : probability that the target is observable, if it exists.
    log_evidence : log of the mean ratio of the scan over the belief that seeks.
    full : a target was found, and there was no free slot.
    """

    time: Float[Array, "*scan"]
    label: Int[Array, "*scan slot"]
    existence: Float[Array, "*scan slot"]
    mean: Any
    covariance: Float[Array, "*scan slot component component"]
    observable: Float[Array, "*scan slot"]
    log_evidence: Float[Array, "*scan"]
    full: Bool[Array, "*scan"]


class ManyTargetsTracker(eqx.Module):
    """Seeks, declares, follows and drops several targets.

    Attributes
    ----------
    filter : carries beliefs, with and without births.
    likelihood : takes in scans; it can put targets into their background.
    silence : how targets fall silent.
    targets : in hand at most.
    declare : existence near one place at which a track begins; above `drop`.
    drop : existence below which it ends.
    guided : whether newborn particles are drawn where the scan points, by a likelihood that can propose them.
    finer : likelihood of the same scans for targets in hand, where they are believed in at other points than the one
        that is sought; the same where None.
    """

    filter: Carrying
    likelihood: Any
    silence: Silence
    targets: int = eqx.field(static=True, default=6)
    declare: float = 0.97
    drop: float = 0.3
    guided: bool = eqx.field(static=True, default=False)
    finer: Any = None

    def init(self, key: PRNGKeyArray) -> Seeking:
        """State before the first scan."""
        sought = self.filter.init(key)
        inside = jnp.ones(sought.log_weights.shape, bool)
        # Hidden from XLA, which would work out sums over all cells of a constant while it compiles.
        one = self.filter.taken(jax.lax.optimization_barrier(sought), inside, key)
        beliefs = jax.tree.map(lambda leaf: jnp.zeros((self.targets, *leaf.shape), leaf.dtype), one)
        beliefs = eqx.tree_at(lambda belief: belief.states, beliefs, _repeated(one.states, self.targets))
        label = jnp.zeros(self.targets, jnp.int32)
        hand = Hand(beliefs, jnp.zeros_like(beliefs.log_odds), label)
        return Seeking(sought, hand, jnp.array(0), jnp.array(0))

    def step(self, seeking: Seeking, scan: Any, key: PRNGKeyArray) -> tuple[Seeking, ManyEstimate]:
        """Take in one scan. `key` is that of the whole recording; each scan makes its own from it."""
        key = jax.random.fold_in(key, seeking.scans)
        for_motion, for_hand, for_sought, for_taking = jax.random.split(key, 4)
        hand = self._carried(seeking.hand, scan, for_motion)
        none = jnp.zeros_like(seeking.sought.log_odds)
        part, nothing = self._part(scan, hand)
        parts = _over(hand.active, part, lambda belief: nothing, hand.beliefs)
        start = Found(seeking.sought, hand, parts, hand.active, seeking.labels, none, jnp.array(False))

        def unfinished(carried: tuple[Found, Array]) -> Array:
            found, number = carried
            return (number == 0) | jnp.any(found.unread)

        def look(carried: tuple[Found, Array]) -> tuple[Found, Array]:
            found, number = carried
            key = jax.random.fold_in(for_hand, number)
            hand = self._updated(found.hand, found.parts, found.unread, scan, seeking.sought, key)
            parts = _over(
                found.unread,
                lambda belief, before: part(belief),
                lambda belief, before: before,
                hand.beliefs,
                found.parts,
            )
            new = hand.label > seeking.labels
            beside = self._prepared(self._of_hand.beside(scan, parts, hand.observable_existence))
            predicted, near = self._sought(seeking.sought, hand, new, beside, for_sought)
            log_ratio = log_ratios(self.likelihood, beside, predicted.states)
            sought, log_evidence = update(predicted, jnp.where(near, 0, log_ratio))
            found = Found(sought, hand, parts, jnp.zeros_like(new), found.labels, log_evidence, found.full)
            for_peak = jax.random.fold_in(for_taking, number)
            return self._taken(found, predicted, number < AT_ONCE, beside, for_peak), number + 1

        # What is found takes in the scan itself and is part of the background before more is sought.
        found, _ = jax.lax.while_loop(unfinished, look, (start, jnp.array(0)))
        after = Seeking(found.sought, found.hand, found.labels, seeking.scans + 1)
        return after, self._estimate(found)

    @eqx.filter_jit
    def steps(self, seeking: Seeking, scans: Any, key: PRNGKeyArray) -> tuple[Seeking, ManyEstimate]:
        """Take in a stack of scans in one compiled loop; the estimates are stacked."""
        return jax.lax.scan(lambda carry, scan: self.step(carry, scan, key), seeking, scans)

    def beside(self, scan: Any, hand: Hand) -> Any:
        """Scan with targets in hand as part of its background, with the probability that each is observable."""
        return self._of_hand.beside(scan, self.parts(scan, hand), hand.observable_existence)

    def parts(self, scan: Any, hand: Hand) -> Any:
        """What every target in hand puts into the background of a scan; zeros of a free slot."""
        part, nothing = self._part(scan, hand)
        return _over(hand.active, part, lambda belief: nothing, hand.beliefs)

    def _part(self, scan: Any, hand: Hand) -> tuple[Callable[[Belief], Any], Any]:
        """Function of a belief to its part of a scan's background, and such a part of zeros."""

        def of_one(belief: Belief) -> Any:
            return self._of_hand.part(scan, belief.states, belief.log_weights)

        part, shapes = traced(of_one, _of_slot(hand.beliefs, 0))
        return part, jax.tree.map(lambda shape: jnp.zeros(shape.shape, shape.dtype), shapes)

    @property
    def _of_hand(self) -> Any:
        return self.likelihood if self.finer is None else self.finer

    def _carried(self, hand: Hand, scan: Any, key: PRNGKeyArray) -> Hand:
        """Targets in hand, carried forward to a scan."""

        def carried(belief: Belief, observable: Array, key: PRNGKeyArray) -> tuple[Belief, Array]:
            interval = scan.time - belief.time
            moved, log_lost = self.filter.carry(belief, scan.time, key)
            departure_rate = self.filter.target.departure_rate
            log_odds, observable = self.silence.forecast(
                belief.log_odds, observable, departure_rate, interval, log_lost
            )
            moved = dataclasses.replace(moved, log_odds=log_odds)
            if isinstance(self._of_hand, Sighted):
                moved, _ = update(moved, self._of_hand.in_sight(moved.states))
            return moved, observable

        def still(belief: Belief, observable: Array, key: PRNGKeyArray) -> tuple[Belief, Array]:
            return dataclasses.replace(belief, time=scan.time), observable

        keys = jax.random.split(key, self.targets)
        beliefs, observable = _over(hand.active, carried, still, hand.beliefs, hand.observable, keys)
        return Hand(beliefs, observable, hand.label)

    def _updated(
        self, hand: Hand, parts: Any, unread: Bool[Array, " slot"], scan: Any, sought: Belief, key: PRNGKeyArray
    ) -> Hand:
        """Targets in hand after a scan, those that have not taken it in yet."""
        number, expected = jnp.arange(self.targets), hand.observable_existence

        def updated(belief: Belief, observable: Array, slot: Array, key: PRNGKeyArray) -> tuple[Belief, Array]:
            others = jnp.where(number == slot, 0, expected)
            return self._observed(belief, observable, self._of_hand.beside(scan, parts, others), sought, key)

        def as_it_is(belief: Belief, observable: Array, slot: Array, key: PRNGKeyArray) -> tuple[Belief, Array]:
            return belief, observable

        keys = jax.random.split(key, self.targets)
        beliefs, observable = _over(unread, updated, as_it_is, hand.beliefs, hand.observable, number, keys)
        kept = hand.active & (jax.nn.sigmoid(beliefs.log_odds) >= self.drop)
        return Hand(beliefs, observable, jnp.where(kept, hand.label, 0))

    def _observed(
        self, belief: Belief, observable: Float[Array, ""], scan: Any, sought: Belief, key: PRNGKeyArray
    ) -> tuple[Belief, Float[Array, ""]]:
        """Belief of a target that may be silent, and the odds that it is observable (the module's equation)."""
        for_steps, for_draw, for_rest, for_choice = jax.random.split(key, 4)
        log_odds, particles = belief.log_odds, belief.born is not None
        if particles:
            updated, log_evidence = tempered(belief, partial(self._closely, scan), for_steps)
        else:
            ratio = log_ratios(self._of_hand, scan, belief.states)
            own = self._of_hand.alike(scan, belief.states, jax.tree.map(lambda x: x[None], moments(belief)[0]))[0]
            updated, log_evidence = update(belief, beside_undetected(ratio, sought, own))
        gained = jnp.logaddexp(jax.nn.log_sigmoid(observable) + log_evidence, jax.nn.log_sigmoid(-observable))
        observable = observable + log_evidence
        if particles:
            count = belief.log_weights.size
            chosen = systematic(for_draw, updated.log_weights, count, count)
            silent = systematic(for_rest, belief.log_weights, count, count)
            mine = uniform(for_choice, (count,), log_odds.dtype) < jax.nn.sigmoid(observable)
            states = jax.tree.map(
                lambda new, old: jnp.where(mine, new[chosen], old[silent]), updated.states, belief.states
            )
            equal = jnp.full_like(belief.log_weights, -jnp.log(count))
            belief = dataclasses.replace(belief, states=states, log_weights=equal)
        else:
            log_weights = jnp.logaddexp(
                jax.nn.log_sigmoid(observable) + updated.log_weights,
                jax.nn.log_sigmoid(-observable) + belief.log_weights,
            )
            belief = dataclasses.replace(belief, log_weights=log_weights)
        return dataclasses.replace(belief, log_odds=log_odds + gained), observable

    def _closely(self, scan: Any, belief: Belief) -> Float[Array, " point"]:
        """Log ratio at the points of a belief, from as near as the likelihood can look."""
        if not isinstance(self._of_hand, Zooming):
            return self._of_hand.log_ratio(scan, belief.states)
        return self._of_hand.zoomed(scan, belief.states, belief.log_weights).log_ratio(belief.states)

    def _prepared(self, scan: Any) -> Any:
        return self.likelihood.prepared(scan) if isinstance(self.likelihood, Preparing) else scan

    def _sought(
        self, sought: Belief, hand: Hand, new: Bool[Array, " slot"], scan: Any, key: PRNGKeyArray
    ) -> tuple[Belief, Bool[Array, "*points"]]:
        """Belief about a target that is not in hand, without what is new in hand; which states are near one in hand."""
        guided = self.guided and isinstance(self.likelihood, Proposing)
        guide = {"guide": partial(self.likelihood.propose, scan)} if guided else {}
        predicted = self.filter.predict(sought, scan.time, key, **guide)
        close = self.likelihood.alike(scan, predicted.states, _moments(hand)[0])
        among = (-1, *(1,) * (close.ndim - 1))
        near = jnp.any(close & hand.active.reshape(among), axis=0)
        return _without(predicted, jnp.any(close & new.reshape(among), axis=0)), near

    def _taken(self, found: Found, predicted: Belief, more: Bool[Array, ""], scan: Any, key: PRNGKeyArray) -> Found:
        """Take in hand what has been found at one place, as it was predicted, where there is such and a free slot."""
        sought, hand, labels = found.sought, found.hand, found.labels

        def look() -> Found:
            for_peak, for_choice = jax.random.split(key)
            inside, log_share = self._peak(sought, scan, for_peak)
            sure = more & (jax.nn.sigmoid(sought.log_odds + log_share) >= self.declare)
            taken = sure & ~jnp.all(hand.active)
            mine = taken & (jnp.arange(self.targets) == jnp.argmin(hand.active))
            new = self.filter.taken(predicted, inside, for_choice)
            beliefs = jax.tree.map(
                lambda held, new: jnp.where(mine.reshape(-1, *(1,) * new.ndim), new[None].astype(held.dtype), held),
                hand.beliefs,
                new,
            )
            held = Hand(beliefs, jnp.where(mine, jnp.inf, hand.observable), jnp.where(mine, labels + 1, hand.label))
            full = found.full | (sure & ~taken)
            return Found(sought, held, found.parts, mine, labels + taken, found.log_evidence, full)

        return jax.lax.cond(sought.existence >= self.declare, look, lambda: found)

    def _peak(self, belief: Belief, scan: Any, key: PRNGKeyArray) -> tuple[Bool[Array, "*points"], Float[Array, ""]]:
        """Points alike to the place that most of a belief is alike to, and the log of their share."""
        weights = belief.log_weights
        numbers = systematic(key, weights.ravel(), CANDIDATES, CANDIDATES)
        centres = jax.tree.map(lambda values: jnp.broadcast_to(values, weights.shape).ravel()[numbers], belief.states)
        close = self.likelihood.alike(scan, belief.states, centres)
        shares = jax.nn.logsumexp(jnp.where(close, weights, -jnp.inf).reshape(CANDIDATES, -1), axis=1)
        best = jnp.argmax(shares)
        return jnp.broadcast_to(close[best], weights.shape), shares[best]

    def _estimate(self, found: Found) -> ManyEstimate:
        sought, hand = found.sought, found.hand
        middles, matrices = _moments(hand)
        middle, matrix = moments(sought)
        existence = jnp.where(hand.active, jax.nn.sigmoid(hand.beliefs.log_odds), 0)
        return ManyEstimate(
            sought.time,
            jnp.append(hand.label, 0),
            jnp.append(existence, sought.existence),
            jax.tree.map(lambda held, one: jnp.append(held, one), middles, middle),
            jnp.concatenate([matrices, matrix[None]]),
            jnp.append(jax.nn.sigmoid(hand.observable), 1).astype(existence.dtype),
            found.log_evidence,
            found.full,
        )


def _of_slot(beliefs: Belief, slot: int) -> Belief:
    return jax.tree.map(lambda leaf: leaf[slot], beliefs)


def _over(active: Bool[Array, " slot"], then: Callable[..., Any], otherwise: Callable[..., Any], *operands: Any) -> Any:
    """One function of the slots that are active, another of the rest; one by one, so that a free slot costs nothing."""
    return jax.lax.map(lambda each: jax.lax.cond(each[0], then, otherwise, *each[1:]), (active, *operands))


def _repeated(tree: Any, count: int) -> Any:
    return jax.tree.map(lambda leaf: jnp.repeat(leaf[None], count, axis=0), tree)


def _moments(hand: Hand) -> tuple[Any, Float[Array, "slot component component"]]:
    """Mean and covariance of every target; zeros in a free slot."""
    shapes = jax.eval_shape(moments, _of_slot(hand.beliefs, 0))
    nothing = jax.tree.map(lambda shape: jnp.zeros(shape.shape, shape.dtype), shapes)
    return _over(hand.active, moments, lambda belief: nothing, hand.beliefs)


def _without(belief: Belief, inside: Bool[Array, "*points"]) -> Belief:
    """What is left of a belief without some of its points."""
    rest = jnp.where(inside, -jnp.inf, belief.log_weights)
    share = jax.nn.logsumexp(rest)
    some = share > -jnp.inf
    log_weights = jnp.where(some, rest - jnp.where(some, share, 0), -jnp.log(rest.size))
    return dataclasses.replace(belief, log_weights=log_weights.astype(rest.dtype), log_odds=belief.log_odds + share)
