"""Runs of the study: every method on the same bearings.

The particle filters are the paper's, with a bit of existence, and the Bernoulli filter of this package. The classics
have one Gaussian. Each has two forms, the published likelihood (liu2013, eq. 12-13) and the full one (`_full`); for the
classics the published form takes the density of false bearings from the scan itself (`faintrack.baselines.pda`).

The classics are tuned like the filters: the same P_b, P_d, motion and error of a bearing, the birth density's own mean
and covariance. The bearing enters by the unscented innovation, which gave them more detections than the extended one
where births spread over the region, and the same where they do not.
"""

import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.baselines.imm_pda import ImmPda
from faintrack.baselines.ipda import Ipda
from faintrack.baselines.pda import Association, Gaussian, turned, unscented
from faintrack.beliefs.belief import Belief, mean
from faintrack.filters.bernoulli_particle import BernoulliParticleFilter
from faintrack.filters.existence_particle import ExistenceParticleFilter, OfPossible, of_target
from faintrack.filters.run import Filter, Likelihood, step
from faintrack.likelihoods.bearing_sets import BearingSetLikelihood
from faintrack.numerics.precision import full_precision
from faintrack.sensors.bearing_sets import BearingSensor, BearingSet
from faintrack.simulation.bearing_sets import draw_bearing_set
from faintrack.studies.liu2013 import scene
from faintrack.targets.births import NormalBirth, RangeBirth
from faintrack.targets.motion import white_acceleration
from faintrack.targets.target import UniformBirth

KINDS = ("particle", "bernoulli", "ipda", "immpda")
"""The paper's filter, this package's, and the classics."""
FORMS = ("", "_full")
"""Published likelihood, full likelihood."""

Advance = Callable[[Any, BearingSet, PRNGKeyArray], Any]
Read = Callable[[Any], tuple[Array, Array, Array]]


def follow(
    key: PRNGKeyArray,
    false_per_scan: Float[Array, ""] | float,
    detection_probability: Float[Array, ""] | float,
    spread: Float[Array, ""] | float,
    kinds: tuple[str, ...] = KINDS,
    particles: int = scene.PARTICLES,
    births: Callable[[], Any] = scene.around_start,
    capacity: int = 24,
) -> dict[str, Array]:
    """One run: log odds and error of the position of every method after every scan, (scan, kind, form); what was drawn.

    Parameters
    ----------
    key : of the run; data follow from it alone, so that settings with the same address see the same.
    false_per_scan, detection_probability : of the sensor, as the methods know them.
    spread : 0 where the target starts at the paper's place, 1 where the births about it say.
    kinds : of `KINDS`, each in both of `FORMS`.
    particles : of each particle filter, newborn included.
    births : where new targets are looked for, see `faintrack.studies.liu2013.scene`.
    capacity : places for bearings of a scan.
    """
    for_path, for_scans, for_filter = jax.random.split(key, 3)
    sensor = scene.sensor(false_per_scan, detection_probability)
    path, observer, time = scene.path(for_path, spread), scene.observer(), jnp.asarray(scene.TIME, float)
    present = jnp.asarray(scene.present())

    def draw(key: PRNGKeyArray, *at: Any) -> tuple[BearingSet, Array]:
        return draw_bearing_set(key, sensor, capacity, *at)

    scans, lost = jax.vmap(draw)(jax.random.split(for_scans, scene.SCANS), time, observer, path, present)

    def by(kind: str, published: Array) -> tuple[Array, Array, Array]:
        begin, advance, read = method(kind, sensor, published, particles, births(), for_filter)

        def take_in(state: Any, item: tuple[BearingSet, Array]) -> tuple[Any, tuple[Array, Array, Array]]:
            scan, number = item
            state = advance(state, scan, jax.random.fold_in(for_filter, number))
            return state, read(state)

        return jax.lax.scan(take_in, begin, (scans, jnp.arange(scene.SCANS)))[1]

    forms = jnp.array([form == "" for form in FORMS])
    of_kinds = [jax.vmap(functools.partial(by, kind))(forms) for kind in kinds]
    # (kind, form, scan) to (scan, kind, form).
    log_odds, x, y = (jnp.moveaxis(jnp.stack(values), 2, 0) for values in zip(*of_kinds, strict=True))
    error = jnp.hypot(x - path.x[:, None, None], y - path.y[:, None, None])
    drawn = {"x": path.x, "y": path.y, "bearing": scans.bearing, "there": scans.there, "lost": lost.sum()}
    return {"log_odds": log_odds, "error": error, **drawn}


def method(
    kind: str, sensor: BearingSensor, published: Array, particles: int, birth: Any, key: PRNGKeyArray
) -> tuple[Any, Advance, Read]:
    """A method: its start, what takes it to the next scan, and what it says (log odds, x, y)."""
    if kind in ("ipda", "immpda"):
        single = classic(sensor, published, birth)
        tracker = single if kind == "ipda" else ImmPda(single)
        return (
            tracker.init(),
            lambda state, scan, key: tracker.step(state, scan)[0],
            lambda state: (state.log_odds, state.state.mean[0], state.state.mean[1]),
        )
    target, likelihood = scene.target(birth), BearingSetLikelihood(sensor, published)
    filter: Filter
    takes_in: Likelihood
    if kind == "particle":
        filter = ExistenceParticleFilter(target, particles, scene.CHOSEN["scarce"].value)
        takes_in, of = OfPossible(likelihood), of_target
    else:
        newborn = round(scene.CHOSEN["births"].value * particles)
        filter = BernoulliParticleFilter(target, particles - newborn, newborn)
        takes_in, of = likelihood, lambda belief: belief

    def read(belief: Belief) -> tuple[Array, Array, Array]:
        belief = of(belief)
        middle = mean(belief)
        return belief.log_odds, middle.x, middle.y

    begin = filter.init(jax.random.fold_in(key, scene.SCANS))
    guided = isinstance(birth, RangeBirth)
    return begin, lambda belief, scan, key: step(filter, takes_in, belief, scan, key, guided)[0], read


@full_precision
def classic(sensor: BearingSensor, published: Array, birth: Any) -> Ipda:
    """Data association with the same target and sensor; the state's components are x, y, vx, vy."""
    a, b, c = white_acceleration(jnp.asarray(scene.INTERVAL))
    root = scene.MOTION.velocity_noise * jnp.array([[a, b], [c, 0.0]])
    association = Association(
        lambda state, scan: jnp.arctan2(state[1] - scan.observer.y, state[0] - scan.observer.x)[None],
        lambda scan: (scan.bearing[:, None], scan.there),
        jnp.full((1, 1), sensor.error**2),
        jnp.where(published, 1, sensor.detection_probability),
        lambda scan: jnp.where(published, scan.there.sum() / sensor.width, sensor.false_per_radian),
        unscented,
        turned,
    )
    transition = np.kron(np.array([[1.0, scene.INTERVAL], [0.0, 1.0]]), np.eye(2))
    return Ipda(
        association,
        moments(birth),
        jnp.asarray(transition, float),
        jnp.kron(root @ root.T, jnp.eye(2)),
        scene.target(birth),
        scene.INTERVAL,
    )


def moments(birth: NormalBirth | UniformBirth) -> Gaussian:
    """Mean and covariance of the birth density."""
    if isinstance(birth, UniformBirth):
        low, high = (jnp.stack(jax.tree.leaves(corner)) for corner in (birth.low, birth.high))
        return Gaussian((low + high) / 2, jnp.diag(((high - low) ** 2) / 12))
    mean, std = (jnp.stack(jax.tree.leaves(part)) for part in (birth.mean, birth.std))
    return Gaussian(mean, jnp.diag(std**2))
