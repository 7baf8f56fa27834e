r"""Particle trackers of several targets, updated jointly where their targets share beams.

A target that has been found is followed by particles, with an existence of its own. As long as no other is heard in the
same beams, all targets are independent, and each is a Bernoulli filter without births (kreucher2011, VI-B). Targets
whose beams meet, in any array, form a **group**: particle p of all its members is one joint state :math:`X_p`, weighted
by the occupation numbers of its beams (`faintrack.likelihoods.beam_energies`, its eq. 28), so that two targets in one
beam neither fall onto the louder one nor lose the weaker.

With :math:`E_p` the members that exist in joint state p, drawn with their probabilities, a member t has

.. math::
    \frac{q_t'}{1 - q_t'} = \frac{q_t}{1 - q_t} \,
        \frac{\sum_p w_p \, p(z \mid X_p, E_p \cup t)}{\sum_p w_p \, p(z \mid X_p, E_p \setminus t)}, \qquad
    w_{tp}' \propto w_p \, p(z \mid X_p, E_p \cup t)

which is the one update of `faintrack.beliefs.belief`, its log ratio less the log of the lower sum. Two trackers on one
target have beams that are explained without them: their evidence falls below one, and one dies. A target that leaves
the region of the detectors, or moves faster than they know, is gone. Members that exist for certain have equal weights,
and so stay paired when they are resampled.

Until it is declared a target is **tentative**: it may be a **ghost**, a place where the beams of two others cross. It
does not yet explain anything to the particles of others, which it would push out of their beams, and existence is
believed of whole sets e of tentative targets (`faintrack.trackers.hypotheses`), with the evidence

.. math:: \frac{p(z|e)}{p(z|\emptyset)} = \frac{1}{P} \sum_p \ell_R(z|X_p, e)

where each target's places are drawn from its particles, and :math:`\ell_R` is the ratio of a region
(`faintrack.likelihoods.beam_energies.set_log_ratio`): what a beam says for a target is bounded, since a source from
elsewhere would say it too, and what it says against one is not. So where the beam of a target in hand crosses one of
nobody's, the array that speaks against the ghost outweighs the one that speaks for it.

Members that share no beam are independent, and the mean is the product of theirs, each over all particles of its
target. So that is what is taken, times what sharing makes of it: the mean over joint states of fewer particles, over
that of the products. Their errors cancel, which would otherwise walk off with the odds of two sets that explain the
same beams.

**Coupled partitions** propose the particles (Kreucher, Kastella and Hero 2005): one member after the other, each joint
state draws several places to move to, and takes one with the probability that the scan gives it beside the other
members. The weight makes up for it:

.. math:: w_p \leftarrow w_p \prod_t \frac{\frac{1}{M} \sum_m \ell_{tpm}}{\ell_{tp}}

with :math:`\ell_{tpm}` the ratio of proposal m, and :math:`\ell_{tp}` that of the one taken.
"""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from faintrack.beliefs.belief import covariance, mean, update
from faintrack.likelihoods.beam_energies import BeamEnergies, occupied_log_ratios, region_log_ratio, set_log_ratio
from faintrack.likelihoods.within import REFUTED
from faintrack.numerics.draws import normal, uniform
from faintrack.numerics.precision import full_precision
from faintrack.numerics.resampling import systematic
from faintrack.sensors.stations import EnergyScan, Stations
from faintrack.targets.target import Target, odds_of
from faintrack.trackers.beliefs import Beliefs
from faintrack.trackers.hypotheses import Hypotheses

KERNEL = 0.2
"""Standard deviation by which resampled particles are moved apart, over that of all of them."""

WEIGHING = 4
"""Particles of a target for each that sets of targets are weighed with."""


class Followed(eqx.Module):
    """Targets in hand.

    Attributes
    ----------
    beliefs : of every slot, stacked; states and weights have the shape (slot, particle).
    active : slots that hold a target.
    joint : whether two slots were updated together in the last scan.
    hypotheses : which of the targets that are not declared exist.
    """

    beliefs: Beliefs
    active: Bool[Array, " slot"]
    joint: Bool[Array, "slot slot"]
    hypotheses: Hypotheses


class JointTrackers(eqx.Module):
    """Follows several targets with particles.

    Attributes
    ----------
    target : motion and departure; what arrives is the detectors' to find.
    likelihood : of beam energies.
    limits : lowest and highest state of a target, component by component; one beyond them is gone.
    slots : targets that can be held at once.
    particles : of each; a power of two, at least 8.
    proposals : places that a particle can move to in a scan.
    margin : beams between two targets up to which they are updated together, beside the spread of their particles.
    separate : never updates targets together, to see what it is good for.
    """

    target: Target
    likelihood: BeamEnergies
    limits: tuple[Any, Any]
    slots: int = eqx.field(static=True, default=8)
    particles: int = eqx.field(static=True, default=2048)
    proposals: int = eqx.field(static=True, default=4)
    margin: float = eqx.field(static=True, default=1.0)
    separate: bool = eqx.field(static=True, default=False)

    def init(self, states: Any, time: float = 0.0) -> Followed:
        """No targets; `states` is any state, of the kind that will be followed."""
        shape = (self.slots, self.particles)
        nowhere = jax.tree.map(lambda component: jnp.zeros(shape, jnp.result_type(component)), states)
        like = jax.tree.leaves(nowhere)[0]
        beliefs = Beliefs(
            nowhere,
            jnp.full(shape, -jnp.log(self.particles), like.dtype),
            jnp.full(self.slots, -jnp.inf, like.dtype),
            jnp.asarray(time, like.dtype),
        )
        alone = jnp.eye(self.slots, dtype=bool)
        return Followed(beliefs, jnp.zeros(self.slots, bool), alone, Hypotheses.none(self.slots, like.dtype))

    @eqx.filter_jit
    def step(self, followed: Followed, scan: EnergyScan, declared: Bool[Array, " slot"], key: PRNGKeyArray) -> Followed:
        """Carry all targets forward to a scan and take it in (the module's equations).

        Parameters
        ----------
        followed : after the scan before.
        scan : one scan.
        declared : slots whose targets explain energy to the particles of others.
        key : random key.
        """
        for_choice, for_move, for_there = jax.random.split(key, 3)
        interval = scan.time - followed.beliefs.time
        joint = self._groups(followed, scan)
        resampled = self._resampled(followed, joint, for_choice)
        # A target in hand is one that was found: what else arrives is the detectors' to find.
        log_odds = odds_of(self.target.forecast(resampled.log_odds, interval).same)
        log_odds = jnp.where(followed.active, log_odds, -jnp.inf)
        beliefs = dataclasses.replace(resampled, log_odds=log_odds, time=scan.time)
        tentative = followed.active & ~declared
        log_stays = self.target.forecast(jnp.array(jnp.inf, log_odds.dtype), interval).same
        hypotheses = followed.hypotheses.settled(declared, ~followed.active).departed(log_stays)

        exists = self._there(beliefs, hypotheses, declared, for_there)
        table = self.likelihood.table(scan, self.slots)
        explains = exists & declared[:, None]
        states, beams, correction = self._proposed(beliefs, explains, joint, scan, table, interval, for_move)
        log_weights = jax.nn.log_softmax(beliefs.log_weights + correction, axis=1)
        predicted = dataclasses.replace(beliefs, states=states, log_weights=log_weights)

        beyond = self._beyond(states)
        exists, explains = exists & (beyond == 0), explains & (beyond == 0)

        def updated(there: Array) -> Beliefs:
            without, own = occupied_log_ratios(table, beams, there, joint)
            log_ratio = without + jnp.sum(own, axis=0)
            log_ratio = log_ratio - jax.nn.logsumexp(log_weights + without, axis=1, keepdims=True)
            log_ratio = log_ratio + beyond
            return predicted.changed(lambda belief, log_ratio: update(belief, log_ratio)[0], log_ratio)

        whether, where = updated(exists), updated(explains)
        few = self._paired(log_weights, joint & declared & declared[:, None], for_there)
        at = jnp.take_along_axis(beams, few[None], axis=2)
        certain, past = (jnp.take_along_axis(each, few, axis=1) for each in (explains, beyond))
        own = occupied_log_ratios(table, beams, explains, joint)[1]
        alone = region_log_ratio(own, beams >= 0) + beyond
        single = jax.nn.logsumexp(log_weights + alone, axis=1)
        few_alone = jnp.take_along_axis(alone, few, axis=1)

        def evidence(members: Array) -> Array:
            ratio = set_log_ratio(table, at, certain, members, joint)
            ratio = ratio + jnp.sum(jnp.where(members[:, None], past, 0), axis=0)
            apart = jnp.sum(jnp.where(members[:, None], few_alone, 0), axis=0)
            shared = jax.nn.logsumexp(ratio) - jax.nn.logsumexp(apart)
            return jnp.sum(jnp.where(members, single, 0)) + shared

        hypotheses = hypotheses.updated(evidence)
        log_odds = jnp.where(tentative, hypotheses.log_odds, whether.log_odds)
        return Followed(dataclasses.replace(where, log_odds=log_odds), followed.active, joint, hypotheses)

    def take(
        self, followed: Followed, states: Any, log_odds: Float[Array, ""], stations: Stations, margin: int
    ) -> Followed:
        """Put a target into the first free slot, of which there is one.

        Parameters
        ----------
        followed : targets in hand.
        states : of the new one, as many as there are particles.
        log_odds : natural log of the odds that it exists.
        stations : where the arrays are.
        margin : beams apart that are taken for one, see `Hypotheses.joined`.
        """
        mine = jnp.arange(self.slots) == jnp.argmin(followed.active)
        old = followed.beliefs
        beliefs = Beliefs(
            jax.tree.map(
                lambda held, new: jnp.where(mine[:, None], new[None].astype(held.dtype), held), old.states, states
            ),
            jnp.where(mine[:, None], -jnp.log(self.particles), old.log_weights).astype(old.log_weights.dtype),
            jnp.where(mine, log_odds, old.log_odds).astype(old.log_odds.dtype),
            old.time,
        )
        joint = (followed.joint & ~mine[:, None] & ~mine[None, :]) | jnp.eye(self.slots, dtype=bool)
        beams = self.likelihood.fans.beams(stations, beliefs.each(mean))
        left = followed.hypotheses.settled(jnp.zeros_like(mine), ~followed.active)
        hypotheses = left.joined(mine, log_odds, beams, margin)
        return Followed(beliefs, followed.active | mine, joint, hypotheses)

    def middles(self, followed: Followed) -> Any:
        """Mean state of every slot."""
        return followed.beliefs.each(mean)

    def shares(
        self, followed: Followed, scan: EnergyScan, among: Bool[Array, " slot"]
    ) -> Float[Array, "slot array beam"]:
        """Probability that each target is in each beam; 0 of those that are not asked about.

        Parameters
        ----------
        followed : targets in hand.
        scan : says where the arrays are.
        among : slots that are asked about.
        """
        fans, beliefs = self.likelihood.fans, followed.beliefs
        beams = fans.beams(scan.stations, beliefs.states)
        weights = jnp.exp(beliefs.log_weights) * (beliefs.existence * among)[:, None]
        array, slot = jnp.arange(fans.arrays)[:, None, None], jnp.arange(self.slots)[:, None]
        # What is heard in no beam falls into the one more that stands last.
        none = jnp.zeros((self.slots, fans.arrays, fans.most + 1), weights.dtype)
        # Weights rounded each may come to a little more than 1.
        return jnp.minimum(none.at[slot, array, beams].add(weights), 1)

    def _beyond(self, states: Any) -> Float[Array, "..."]:
        """Log ratio of states to be there at all: 0, or `REFUTED` beyond the limits."""
        within = jax.tree.map(lambda value, low, high: (value >= low) & (value <= high), states, *self.limits)
        return jnp.where(jnp.stack(jax.tree.leaves(within)).all(axis=0), 0.0, REFUTED)

    def _groups(self, followed: Followed, scan: EnergyScan) -> Bool[Array, "slot slot"]:
        """Which slots share beams, through others too."""
        alone = jnp.eye(self.slots, dtype=bool)
        if self.separate:
            return alone
        beams = self.likelihood.fans.beams(scan.stations, followed.beliefs.states).astype(jnp.float32)
        weights = jnp.exp(followed.beliefs.log_weights)
        heard = beams >= 0
        share = jnp.sum(weights * heard, axis=2)
        safe = jnp.maximum(share, jnp.finfo(share.dtype).tiny)
        middle = jnp.sum(weights * heard * beams, axis=2) / safe
        spread = jnp.sqrt(jnp.sum(weights * heard * (beams - middle[..., None]) ** 2, axis=2) / safe)
        reach = 2 * (spread[:, :, None] + spread[:, None, :]) + self.margin
        meets = (jnp.abs(middle[:, :, None] - middle[:, None, :]) <= reach) & (share[:, :, None] > 0)
        meets = jnp.any(meets & (share[:, None, :] > 0), axis=0)
        meets = alone | (meets & followed.active[:, None] & followed.active[None, :])
        for _ in range(max(self.slots - 1, 1).bit_length()):
            meets = (meets.astype(jnp.int32) @ meets.astype(jnp.int32)) > 0
        return meets

    def _resampled(self, followed: Followed, joint: Bool[Array, "slot slot"], key: PRNGKeyArray) -> Beliefs:
        """Equal weights where few particles carry them or a group is new; members of a group keep their pairs."""
        beliefs, count = followed.beliefs, self.particles
        key, for_spread = jax.random.split(key)
        effective = jnp.exp(-jax.nn.logsumexp(2 * beliefs.log_weights, axis=1))
        changed = jnp.any(joint != followed.joint, axis=1)
        needed = changed | (effective < count / 2)
        needed = jnp.any(joint & needed[None, :], axis=1)
        # One key for the members of an old group: equal weights then are resampled to the same particles.
        keys = jax.vmap(lambda number: jax.random.fold_in(key, number))(jnp.argmax(followed.joint, axis=1))
        chosen = jax.vmap(lambda key, weights: _shuffled(key, weights, count))(keys, beliefs.log_weights)
        states = jax.tree.map(
            lambda values: jnp.where(needed[:, None], jnp.take_along_axis(values, chosen, axis=1), values),
            beliefs.states,
        )
        equal = jnp.full_like(beliefs.log_weights, -jnp.log(count))
        resampled = dataclasses.replace(
            beliefs, states=states, log_weights=jnp.where(needed[:, None], equal, beliefs.log_weights)
        )
        return dataclasses.replace(resampled, states=self._spread(resampled, needed, for_spread))

    @full_precision
    def _spread(self, beliefs: Beliefs, needed: Bool[Array, " slot"], key: PRNGKeyArray) -> Any:
        """Particles moved apart by a share of their spread, so that copies of one are different places."""
        fields = [field.name for field in dataclasses.fields(beliefs.states)]
        matrices = beliefs.each(covariance)
        scale = jnp.sqrt(jnp.maximum(jnp.diagonal(matrices, axis1=1, axis2=2), 0))
        safe = jnp.where(scale > 0, scale, 1)
        correlation = matrices / (safe[:, :, None] * safe[:, None, :])
        root = jnp.linalg.cholesky(correlation + 1e-3 * jnp.eye(len(fields)))
        apart = root @ normal(key, (self.slots, len(fields), self.particles), matrices.dtype)
        apart = jnp.where(needed[:, None, None], KERNEL * scale[:, :, None] * apart, 0)
        moved = {name: getattr(beliefs.states, name) + apart[:, number] for number, name in enumerate(fields)}
        return dataclasses.replace(beliefs.states, **moved)

    def _paired(
        self, log_weights: Float[Array, "slot particle"], pairs: Bool[Array, "slot slot"], key: PRNGKeyArray
    ) -> Int[Array, "slot few"]:
        """Few particles of every slot, as often as they are likely; those of pairs are of the same joint states."""
        one = jnp.argmax(pairs | jnp.eye(self.slots, dtype=bool), axis=1)
        keys = jax.vmap(lambda number: jax.random.fold_in(key, number))(one)
        return jax.vmap(lambda key, weights: _shuffled(key, weights, self.particles // WEIGHING))(keys, log_weights)

    def _there(
        self, beliefs: Beliefs, hypotheses: Hypotheses, declared: Bool[Array, " slot"], key: PRNGKeyArray
    ) -> Bool[Array, "slot particle"]:
        """In which joint states each target exists, as often as it is likely to, tentative ones as the sets have it."""
        count = self.particles
        offsets = jax.random.uniform(key, (self.slots, 2))
        # Evenly spaced levels in a shuffled order: every slot exists in its share of the joint states, to within one.
        levels = (jax.vmap(lambda offset: _mixed(offset, count))(offsets[:, 0]) + offsets[:, 1:]) / count
        alone = levels < jax.nn.sigmoid(beliefs.log_odds)[:, None]
        for_comb, for_order = jax.random.split(jax.random.fold_in(key, self.slots))
        together = hypotheses.drawn(for_comb, count)[_mixed(jax.random.uniform(for_order), count)]
        return jnp.where(declared[:, None], alone, together.T)

    @full_precision
    def _proposed(
        self,
        beliefs: Beliefs,
        explains: Bool[Array, "slot particle"],
        joint: Bool[Array, "slot slot"],
        scan: EnergyScan,
        table: Float[Array, "array beam number"],
        interval: Float[Array, ""],
        key: PRNGKeyArray,
    ) -> tuple[Any, Int[Array, "array slot particle"], Float[Array, "slot particle"]]:
        """States moved by coupled partitions, their beams, and the log of what makes up for the choice."""
        fans, slots, proposals = self.likelihood.fans, self.slots, self.proposals
        array = jnp.arange(fans.arrays)[:, None, None]
        active = beliefs.log_odds > -jnp.inf

        def place(number: Array, carried: tuple[Any, Array, Array]) -> tuple[Any, Array, Array]:
            """Choose where the particles of one member go, the others where they are."""
            states, beams, correction = carried
            mine = jax.tree.map(lambda values: values[number], states)
            for_move, for_choice = jax.random.split(jax.random.fold_in(key, number))
            many = jax.tree.map(lambda values: jnp.broadcast_to(values, (proposals, *values.shape)), mine)
            moved = self.target.motion.move(many, interval, for_move)
            heard = fans.beams(scan.stations, moved)
            others = joint[number] & (jnp.arange(slots) != number)
            same = (heard[:, None] == beams[:, :, None]) & (others[:, None] & explains)[None, :, None]
            occupied = jnp.sum(same, axis=1)
            ratio = jnp.sum(table[array, heard, occupied + 1] - table[array, heard, occupied], axis=0)
            total = jax.nn.logsumexp(ratio, axis=0)
            levels = jnp.cumsum(jnp.exp(ratio - total), axis=0)
            choice = jnp.sum(levels < levels[-1] * uniform(for_choice, levels.shape[1:]), axis=0)[None]
            chosen = jax.tree.map(lambda values: jnp.take_along_axis(values, choice, axis=0)[0], moved)
            return (
                jax.tree.map(lambda values, new: values.at[number].set(new), states, chosen),
                beams.at[:, number].set(jnp.take_along_axis(heard, choice[None], axis=1)[:, 0]),
                correction.at[number].set(total - jnp.take_along_axis(ratio, choice, axis=0)[0]),
            )

        start = (beliefs.states, fans.beams(scan.stations, beliefs.states), jnp.zeros_like(beliefs.log_weights))
        states, beams, correction = jax.lax.fori_loop(
            0,
            slots,
            lambda number, carried: jax.lax.cond(active[number], place, lambda _, same: same, number, carried),
            start,
        )
        return states, beams, joint.astype(correction.dtype) @ correction


def _mixed(offset: Float[Array, ""], count: int) -> Int[Array, " count"]:
    """Numbers below a power of two in an order that depends on a number from 0 to 1."""
    seed = (offset * (count * count // 4)).astype(jnp.int32)
    step, shift = 2 * (seed % (count // 2)) + 1, seed // (count // 2)
    return (jnp.arange(count, dtype=jnp.int32) * step + shift) % count


def _shuffled(key: PRNGKeyArray, log_weights: Float[Array, " particle"], count: int) -> Int[Array, " few"]:
    """Systematic resampling in a mixed order, so that particles of two targets are paired at random."""
    for_comb, for_order = jax.random.split(key)
    return systematic(for_comb, log_weights, count, count)[_mixed(jax.random.uniform(for_order), count)]
