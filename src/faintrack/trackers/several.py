r"""Several targets: detectors that hand over to joint particle trackers (kreucher2011).

Every scan goes first to the targets that are in hand (`faintrack.trackers.joint`), then to the detectors that watch the
region (`faintrack.trackers.detectors`), which leave out what is explained already (eq. 34-36):

- near a target in hand, in the same beams of every array or their neighbours, a scan says nothing to a detector;
- in a beam of a declared target, it says whether there is one more (`faintrack.likelihoods.beam_energies.beside`);
- in the beams next to it, which a target raises too, it can only say that there is none.

The second rule is what keeps **ghosts** away, places where the beams of two targets cross: the energy of one target
speaks against a second. Before any target is declared a ghost looks like one, and may be handed over; but once both of
its targets are declared, their beams are explained without it, and it dies. So a target that has been handed over is
tentative: it is declared, and labelled, when it has lasted for some scans and its existence is above a threshold, in
spite of all other sets of tentative targets (`faintrack.trackers.hypotheses`). A declared one is dropped when its
existence falls below a lower threshold; a tentative one is kept until next to nothing speaks for it, or a target is
found and no slot is free. Two arrays may never tell two targets from their ghosts: these are undecided, and said to be
so.

Where the surroundings of a region are watched, targets there are found, tentative, declared and explain energy like all
others. They have a label as long as they are in the region.
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from faintrack.beliefs.axis import Axis
from faintrack.beliefs.belief import covariance
from faintrack.beliefs.grids import Grid
from faintrack.errors import InputError
from faintrack.filters.adi import alternating_directions, steps_within
from faintrack.filters.grid import GridFilter
from faintrack.likelihoods.beam_energies import BeamEnergies, beside, in_beams, region_log_ratio
from faintrack.sensors.stations import EnergyScan
from faintrack.targets.motion import BearingMotion, PlanarMotion
from faintrack.targets.states import BearingState
from faintrack.targets.target import Target
from faintrack.trackers.beliefs import Beliefs
from faintrack.trackers.detectors import Detectors, around, hand_over, planar_detectors, surrounding_detector
from faintrack.trackers.joint import Followed, JointTrackers

OUTSIDE = -1
"""Label of a target that has not been in the region since it was declared."""


class Watching(eqx.Module):
    """What is known between scans.

    Attributes
    ----------
    beliefs : of the region's detectors, stacked, and of that of its surroundings where they are watched.
    followed : targets in hand.
    age : scans since the target in each slot was handed over.
    label : of each slot; 0 where it is not declared, `OUTSIDE` where it is and has not been in the region since.
    labels : given so far.
    scans : taken in so far.
    full : whether a target was found in the last one, and there was no free slot.
    """

    beliefs: tuple[Beliefs, ...]
    followed: Followed
    age: Int[Array, " slot"]
    label: Int[Array, " slot"]
    labels: Int[Array, ""]
    scans: Int[Array, ""]
    full: Bool[Array, ""]


class SeveralEstimate(eqx.Module):
    """What is said after a scan.

    Attributes
    ----------
    time : of the scan; seconds.
    detection : target-present probability of every detector of the region, before it hands over.
    label : of the declared target in each slot; 0 where there is none in the region.
    existence : of the target in each slot, declared or not; 0 in a free one.
    mean : state of each slot.
    covariance : of its components in their order.
    joint : whether a target was updated together with another.
    full : a target was found, and there was no free slot.
    undecided : whether the target in a slot has been in hand for `hold` scans and can be neither declared nor given up,
        its existence being between `drop` and `declare`: as two arrays cannot tell targets from the places where their
        beams cross otherwise, where these move as steadily.
    """

    time: Float[Array, "*scan"]
    detection: Float[Array, "*scan detector"]
    label: Int[Array, "*scan slot"]
    existence: Float[Array, "*scan slot"]
    mean: Any
    covariance: Float[Array, "*scan slot component component"]
    joint: Bool[Array, "*scan slot"]
    full: Bool[Array, "*scan"]
    undecided: Bool[Array, "*scan slot"]


class SeveralTargetsTracker(eqx.Module):
    """Finds targets with detectors and follows them with particles.

    Attributes
    ----------
    detectors, trackers : what finds, and what follows.
    detect : probability of a detector at which it hands over.
    declare : existence at which a target is declared, once it has been in hand for `hold` scans.
    drop : existence below which a target is given up.
    doubt : the same of a tentative one, whose turn may come with a target that is found later. Only where one is found
        and no slot is free, the least likely one below `drop` is given up.
    hold : scans that a target is tentative at least.
    margin : beams on either side of a target's own that it raises too.
    outside : watches the region and its surroundings; targets outside explain energy and are followed, without a label.
    """

    detectors: Detectors
    trackers: JointTrackers
    detect: float = 0.9
    declare: float = 0.99
    drop: float = 0.1
    doubt: float = 1e-8
    hold: int = 10
    margin: int = eqx.field(static=True, default=1)
    outside: Detectors | None = None

    @property
    def watches(self) -> tuple[Detectors, ...]:
        """Detectors of the region, and of its surroundings."""
        return (self.detectors,) if self.outside is None else (self.detectors, self.outside)

    def init(self, key: PRNGKeyArray) -> Watching:
        """State before the first scan."""
        slots = self.trackers.slots
        none = jnp.zeros(slots, jnp.int32)
        beliefs = tuple(watch.init(key) for watch in self.watches)
        followed = self.trackers.init(self.detectors.filter.grid.states(beliefs[0].log_weights.dtype))
        return Watching(beliefs, followed, none, none, jnp.array(0), jnp.array(0), jnp.array(False))

    def step(self, watching: Watching, scan: EnergyScan, key: PRNGKeyArray) -> tuple[Watching, SeveralEstimate]:
        """Take in one scan. `key` is that of the whole record; each scan makes its own from it."""
        for_trackers, for_detectors, for_hand_over = jax.random.split(jax.random.fold_in(key, watching.scans), 3)
        declared = watching.label != 0
        followed = self.trackers.step(watching.followed, scan, declared, for_trackers)
        held = followed.active
        existence = followed.beliefs.existence
        kept = held & (existence >= jnp.where(declared, self.drop, self.doubt))
        # A full tracker that was to take a target in gives up its least likely one, if that is likely not to exist.
        tentative = jnp.where(kept & ~declared, existence, jnp.inf)
        least = (jnp.arange(held.size) == jnp.argmin(tentative)) & (tentative < self.drop)
        kept = kept & ~(least & watching.full & jnp.all(kept))
        followed = dataclasses.replace(followed, active=kept)
        age = jnp.where(kept, watching.age + 1, 0)
        old = kept & declared
        declared = old | (kept & (age >= self.hold) & (followed.beliefs.existence >= self.declare))
        middles = self.trackers.middles(followed)
        inside = self.detectors.covers(middles) if self.outside is not None else jnp.array(True)
        before = jnp.where(old, watching.label, OUTSIDE)
        new = declared & inside & (before == OUTSIDE)
        label = jnp.where(declared, jnp.where(new, watching.labels + jnp.cumsum(new), before), 0).astype(jnp.int32)

        beams = [self.trackers.likelihood.fans.beams(scan.stations, watch.points) for watch in self.watches]
        log_ratios = self._unexplained(scan, beams, followed, declared)
        beliefs = tuple(
            watch.update(watch.predict(of, scan.time, for_detectors), log_ratio)
            for watch, of, log_ratio in zip(self.watches, watching.beliefs, log_ratios, strict=True)
        )
        found = jnp.max(jnp.concatenate([of.existence for of in beliefs])) >= self.detect
        estimate = SeveralEstimate(
            scan.time,
            beliefs[0].existence,
            jnp.where(inside, jnp.maximum(label, 0), 0),
            jnp.where(kept, followed.beliefs.existence, 0),
            middles,
            followed.beliefs.each(covariance),
            kept & (jnp.sum(followed.joint & kept, axis=1) > 1),
            found & jnp.all(kept),
            kept & ~declared & (age >= self.hold) & (followed.beliefs.existence >= self.drop),
        )

        def taken(beliefs: tuple[Beliefs, ...], followed: Followed) -> tuple[tuple[Beliefs, ...], Followed]:
            left, states, log_odds = hand_over(
                self.watches, beliefs, beams, self.margin, self.trackers.particles, for_hand_over
            )
            return left, self.trackers.take(followed, states, log_odds, scan.stations, self.margin)

        wanted = found & ~jnp.all(kept)
        beliefs, followed = jax.lax.cond(wanted, taken, lambda *same: same, beliefs, followed)
        labels = watching.labels + new.sum()
        return Watching(beliefs, followed, age, label, labels, watching.scans + 1, estimate.full), estimate

    @eqx.filter_jit
    def steps(self, watching: Watching, scans: EnergyScan, key: PRNGKeyArray) -> tuple[Watching, SeveralEstimate]:
        """Take in a stack of scans in one compiled loop; the estimates are stacked."""
        return jax.lax.scan(lambda carry, scan: self.step(carry, scan, key), watching, scans)

    def _unexplained(
        self,
        scan: EnergyScan,
        beams: Sequence[Int[Array, "array ..."]],
        followed: Followed,
        declared: Bool[Array, " slot"],
    ) -> list[Float[Array, "..."]]:
        """Log ratio of a scan at the points of every kind of detector, beside what targets in hand explain."""
        likelihood = self.trackers.likelihood
        ratios = beside(likelihood.table(scan, self.trackers.slots + 1), self.trackers.shares(followed, scan, declared))
        at = likelihood.fans.beams(scan.stations, self.trackers.middles(followed))
        apart = jnp.abs(jnp.arange(ratios.shape[1]) - at[:, :, None])
        near = (apart > 0) & (apart <= self.margin) & (at >= 0)[:, :, None]
        raised = jnp.any(near & declared[None, :, None], axis=1)
        ratios = jnp.where(raised, jnp.minimum(ratios, 0), ratios)

        def at_points(beams: Array) -> Array:
            held = jax.vmap(lambda middle, held: held & around(beams, middle, self.margin), in_axes=(1, 0))
            own = jnp.any(held(at, followed.active), axis=0)
            return jnp.where(own, 0, region_log_ratio(in_beams(ratios, beams), beams >= 0))

        return [at_points(each) for each in beams]


def region_tracker(
    likelihood: BeamEnergies,
    x: tuple[float, float],
    y: tuple[float, float],
    detectors: tuple[int, int],
    cells: tuple[int, int],
    cell: float,
    speed: Axis,
    velocity_noise: float,
    interval: float,
    arrival_rate: float,
    departure_rate: float,
    slots: int = 8,
    particles: int = 2048,
    separate: bool = False,
    surroundings: float = 0.0,
    **options: Any,
) -> SeveralTargetsTracker:
    """Tracker of targets that move at a nearly constant velocity within a region.

    Parameters
    ----------
    likelihood : of the energies that the arrays report.
    x, y : ends of the region, east and north; metres.
    detectors : along x and y; they overlap evenly.
    cells : of one detector along x and y.
    cell : side of a cell; metres.
    speed : cells of either component of the velocity; m/s.
    velocity_noise : density of the acceleration along each axis; m/s per root second.
    interval : between scans; seconds. Scans come at whole multiples of it.
    arrival_rate : of a target in one detector; per second.
    departure_rate : of a target that is there; per second.
    slots, particles, separate : see `faintrack.trackers.joint.JointTrackers`.
    surroundings : how far outside the region there are targets that explain energy; metres.
    options : see `SeveralTargetsTracker`.

    Raises
    ------
    InputError : detectors that do not cover the region.
    """
    target = Target(None, PlanarMotion(velocity_noise), arrival_rate, departure_rate)
    watch = planar_detectors(x, y, detectors, cells, cell, speed, target, interval)
    outside = surrounding_detector(watch, surroundings, interval) if surroundings > 0 else None
    return assembled(watch, outside, target, likelihood, slots, particles, separate, **options)


def assembled(
    watch: Detectors,
    outside: Detectors | None,
    target: Target,
    likelihood: BeamEnergies,
    slots: int,
    particles: int,
    separate: bool = False,
    **options: Any,
) -> SeveralTargetsTracker:
    """Tracker with these detectors, whose targets are followed as far as any of them watches; see `region_tracker`."""
    limits = (watch if outside is None else outside).limits
    trackers = JointTrackers(target, likelihood, limits, slots, particles, separate=separate)
    return SeveralTargetsTracker(watch, trackers, outside=outside, **options)


def bearing_tracker(
    likelihood: BeamEnergies,
    bearing: Axis,
    bearing_rate: Axis,
    rate_noise: float,
    interval: float,
    arrival_rate: float,
    departure_rate: float,
    slots: int = 8,
    particles: int = 2048,
    **options: Any,
) -> SeveralTargetsTracker:
    """Tracker of targets that one array hears, in bearing; a target's level is that of the likelihood.

    Parameters
    ----------
    likelihood : of the energies that the array reports.
    bearing, bearing_rate : cells; radians, radians a second. A line's bearings are from 0 to pi, those of an array that
        hears all around from -pi to pi: there targets are followed across pi, and sought on either side of it.
    rate_noise : density of the bearing's acceleration; radians a second per root second.
    interval : between scans; seconds. Scans come at whole multiples of it.
    arrival_rate, departure_rate : of a target; per second.
    slots, particles : see `faintrack.trackers.joint.JointTrackers`.
    options : see `SeveralTargetsTracker`.

    Raises
    ------
    InputError : bearings beyond those.
    """
    circular = not likelihood.fans.line[0]
    low, high = (-math.pi, math.pi) if circular else (0.0, math.pi)
    if bearing.edges[0] < low - 1e-6 or bearing.edges[-1] > high + 1e-6:
        raise InputError(
            f"bearings are sought from {bearing.edges[0]:.4g} to {bearing.edges[-1]:.4g} rad; expected some of "
            f"{low:.4g} to {high:.4g}."
        )
    grid = Grid(BearingState, (("bearing_rate", bearing_rate), ("bearing", bearing)))
    motion = BearingMotion(rate_noise, circular=circular)
    target = Target(None, motion, arrival_rate, departure_rate)
    substeps = steps_within(float(bearing_rate.edges[-1]) * interval, bearing.step)
    filter = GridFilter(grid, target, alternating_directions(grid, rate_noise, interval, substeps))
    watch = Detectors(filter, BearingState(*(jnp.zeros(1),) * 3))
    trackers = JointTrackers(target, likelihood, watch.limits, slots, particles)
    return SeveralTargetsTracker(watch, trackers, **options)
