"""Runs of the study: the whole tracker, and trackers that start near the truth, for what needs no detector.

Each way to run is one function, however many settings have it, and is compiled once.
"""

import dataclasses
import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from faintrack.beliefs.axis import Axis
from faintrack.sensors.stations import EnergyScan
from faintrack.studies.kreucher2011 import scene
from faintrack.studies.kreucher2011.triangulation import crossing, filtered, measured_bearings, true_bearings
from faintrack.targets.states import PlanarState
from faintrack.trackers.joint import Followed
from faintrack.trackers.several import SeveralTargetsTracker, Watching

Run = Callable[..., dict[str, Array]]

FROM = 100
"""Scan from which a close pass is followed by trackers alone."""

NEAR = (5.0, 0.5)
"""Standard deviations of a cloud around the truth, in which such trackers start; m, m/s."""

SURE = 5.0
"""Log odds with which they start."""


def follow(key: PRNGKeyArray, tracker: SeveralTargetsTracker, scans: EnergyScan) -> dict[str, Array]:
    """What the whole tracker says of scans."""
    return kept_of(tracker.steps(tracker.init(key), scans, key)[1])


def kept_of(estimate: Any) -> dict[str, Array]:
    """What is kept of a run's estimates."""
    return {
        "label": estimate.label,
        "existence": estimate.existence,
        "x": estimate.mean.x,
        "y": estimate.mean.y,
        "joint": estimate.joint,
        "detection": estimate.detection,
        "full": estimate.full,
    }


@functools.cache
def whole(speed: Axis, separate: bool = False, scans: int = scene.SCANS) -> Run:
    """The synthetic experiment."""

    def run(key: PRNGKeyArray, level: Array) -> dict[str, Array]:
        truth, energies, for_tracker = drawn(key, level)
        truth, energies = (jax.tree.map(lambda values: values[:scans], part) for part in (truth, energies))
        stations = jax.tree.map(lambda values: values[0], energies.stations)
        bearings = {"tracked": filtered(measured_bearings(energies, truth)), "exact": true_bearings(energies, truth)}
        return {
            **follow(for_tracker, scene.tracker(level, separate, speed), energies),
            **truth_of(truth),
            **{name: crossing(stations, of_kind) for name, of_kind in bearings.items()},
        }

    return run


def drawn(key: PRNGKeyArray, level: Array | float) -> tuple[PlanarState, EnergyScan, PRNGKeyArray]:
    """Paths of the three targets, energies, and the tracker's key."""
    for_truth, for_scans, for_tracker = jax.random.split(key, 3)
    truth = scene.truth(for_truth)
    return truth, scene.scans(for_scans, truth, level), for_tracker


@functools.cache
def close_pass(separate: bool) -> Run:
    """The two targets that meet, followed by trackers that start near them."""

    def run(key: PRNGKeyArray, level: Array) -> dict[str, Array]:
        for_truth, for_scans, for_tracker = jax.random.split(key, 3)
        truth = scene.truth(for_truth)
        truth = jax.tree.map(lambda values: values[:, jnp.array(scene.CLOSE)], truth)
        scans = scene.scans(for_scans, truth, level)
        tracker = scene.tracker(level, separate, scene.COARSE, slots=2)
        return near_the_truth(for_tracker, tracker, truth, scans, begin=FROM)

    return run


@functools.cache
def kept(separate: bool) -> Run:
    """Two targets beside each other, followed by trackers that start near them."""

    def run(key: PRNGKeyArray, beams: Array) -> dict[str, Array]:
        for_scans, for_tracker = jax.random.split(key)
        truth = scene.side_by_side(beams)
        scans = scene.scans(for_scans, truth)
        tracker = scene.tracker(separate=separate, speed=scene.COARSE, slots=2)
        return near_the_truth(for_tracker, tracker, truth, scans, begin=1)

    return run


def detected(key: PRNGKeyArray, beams: Array) -> dict[str, Array]:
    """Two targets beside each other in one detector that knows of neither."""
    for_scans, for_tracker = jax.random.split(key)
    truth = scene.side_by_side(beams)
    tracker = scene.tracker(region=scene.BOX, detectors=(1, 1))
    return {**follow(for_tracker, tracker, scene.scans(for_scans, truth)), **truth_of(truth)}


def crowd(key: PRNGKeyArray, count: Array) -> dict[str, Array]:
    """So many targets at once, anywhere in the region."""
    for_truth, for_scans, for_tracker = jax.random.split(key, 3)
    truth = scene.crowd(for_truth)
    present = jnp.arange(scene.CROWD) < count
    scans = scene.scans(for_scans, truth, present=present)
    tracker = scene.tracker(speed=scene.COARSE, slots=scene.CROWD + 4)
    nowhere = jax.tree.map(lambda values: jnp.where(present, values, jnp.nan), truth)
    return {**follow(for_tracker, tracker, scans), **truth_of(nowhere)}


def four(key: PRNGKeyArray) -> dict[str, Array]:
    """Four targets in one detector: what it believes of the position, scan by scan (figures 1 and 2)."""
    for_truth, for_scans, for_tracker = jax.random.split(key, 3)
    starts = jnp.array([[140.0, 820.0], [560.0, 840.0], [330.0, 1120.0], [600.0, 1240.0]])
    velocities = jnp.array([[0.5, 0.5], [-0.5, 0.5], [0.5, -0.5], [-0.5, -0.5]])
    truth = scene.paths(for_truth, starts, velocities, 40)
    scans = scene.scans(for_scans, truth)
    tracker = scene.tracker(region=scene.BOX, detectors=(1, 1))

    def step(watching: Watching, scan: EnergyScan) -> tuple[Watching, tuple[Any, Array]]:
        after, estimate = tracker.step(watching, scan, for_tracker)
        (belief,) = after.beliefs
        place = jax.nn.logsumexp(belief.log_weights[0], axis=(0, 1)) + jax.nn.log_sigmoid(belief.log_odds)
        return after, (estimate, place)

    _, (estimate, place) = jax.lax.scan(step, tracker.init(for_tracker), scans)
    return {**kept_of(estimate), **truth_of(truth), "log_place": place}


def near_the_truth(
    key: PRNGKeyArray, tracker: SeveralTargetsTracker, truth: PlanarState, scans: EnergyScan, begin: int
) -> dict[str, Array]:
    """Existence and estimates after scan `begin`, counted from 1, of declared trackers that start near the truth."""
    trackers = tracker.trackers
    for_start, for_steps = jax.random.split(key)
    start = jax.tree.map(lambda values: values[begin - 1], truth)
    truth, scans = jax.tree.map(lambda values: values[begin:], (truth, scans))
    spread = PlanarState(*jnp.array([NEAR[0], NEAR[0], NEAR[1], NEAR[1]]))
    followed = trackers.init(start, float(begin))
    for target in range(trackers.slots):
        keys = PlanarState(*jax.random.split(jax.random.fold_in(for_start, target), 4))
        cloud = jax.tree.map(
            lambda at, std, key, target=target: at[target] + std * jax.random.normal(key, (trackers.particles,)),
            start,
            spread,
            keys,
        )
        followed = trackers.take(followed, cloud, jnp.asarray(SURE), scene.stations(), tracker.margin)

    def step(followed: Followed, item: tuple[EnergyScan, PRNGKeyArray]) -> tuple[Followed, tuple[Array, ...]]:
        after = trackers.step(followed, item[0], followed.active, item[1])
        active = followed.active & (after.beliefs.existence >= tracker.drop)
        after = dataclasses.replace(after, active=active)
        middle = trackers.middles(after)
        joint = active & (jnp.sum(after.joint & active, axis=1) > 1)
        return after, (active, middle.x, middle.y, joint)

    every = jax.random.split(for_steps, scans.time.shape[0])
    _, (active, x, y, joint) = jax.lax.scan(step, followed, (scans, every))
    return {"active": active, "x": x, "y": y, "joint": joint, **truth_of(truth)}


def truth_of(states: PlanarState) -> dict[str, Float[Array, "scan target"] | Bool[Array, "scan target"]]:
    """Positions of the targets."""
    return {"true_x": states.x, "true_y": states.y}
