r"""Newborn particles along the bearings of a scan.

A passive sensor knows of a new target the direction at best, and of its range what its power and the medium allow
(`faintrack.targets.births.RangeBirth`): any bearing of the sector alike, a range between two ends. Of n bearings in a
scan one is the target's, if it was detected; newborn particles are drawn about them,

.. math:: \pi(\beta) = \frac{\alpha}{V} + \frac{1 - \alpha}{n} \sum_i N(\beta; z_i, \sigma^2)

with V the width of the sector and :math:`\alpha` one half, and have the weight :math:`1 / (V \pi)`, birth density over
density of the draws, at most 2. They so stand for the birth density, and land where a target can be.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.likelihoods.beam_proposal import EVERYWHERE
from faintrack.likelihoods.protocols import Likelihood
from faintrack.numerics.resampling import systematic
from faintrack.sensors.bearing_sets import BearingSet
from faintrack.targets.births import RangeBirth
from faintrack.targets.states import PlanarState
from faintrack.targets.target import Birth

Candidates = Callable[[PRNGKeyArray, int], tuple[PlanarState, Array]]

CANDIDATES = 8
"""States looked at for each that is drawn."""


def along_bearings(
    likelihood: Any, scan: BearingSet, birth: RangeBirth, key: PRNGKeyArray, count: int
) -> tuple[PlanarState, Float[Array, " count"]]:
    """Draw states of new targets about an observer, half of them along the bearings of its scan.

    Parameters
    ----------
    likelihood : its `sensor` says how wrong a bearing is, and over which sector.
    scan : with the observer.
    birth : ranges and speeds; its own observer is not read.
    key : random key.
    count : how many to draw.

    Returns
    -------
    States, and the natural log of their weights, birth density over density of the draws.

    Examples
    --------
    >>> import numpy as np
    >>> from faintrack.likelihoods.bearing_sets import BearingSetLikelihood
    >>> from faintrack.sensors.bearing_sets import BearingSensor, bearing_set
    >>> here = PlanarState(*(jnp.zeros(()) for _ in range(4)))
    >>> sensor = BearingSensor(0.02, 0.9, 5.0)
    >>> scan = bearing_set(sensor, 0.0, np.array([1.0]), here, capacity=4)
    >>> birth = RangeBirth(here, 100.0, 900.0, 5.0)
    >>> states, log_weights = along_bearings(BearingSetLikelihood(sensor), scan, birth, jax.random.key(0), 1000)
    >>> bool((jnp.abs(jnp.arctan2(states.y, states.x) - 1.0) < 0.06).mean() > 0.4)
    True
    """
    sensor = likelihood.sensor
    for_source, for_place, for_error, for_rest = jax.random.split(key, 4)
    states = birth.sample(for_rest, count)
    dtype = states.x.dtype
    heard = scan.there.sum()
    # Entries that are bearings come first.
    source = jnp.floor(jax.random.uniform(for_source, (count,), dtype) * heard / (1 - EVERYWHERE)).astype(int)
    along = source < heard
    measured = scan.bearing[jnp.minimum(source, len(scan.bearing) - 1)]
    measured = measured + sensor.error * jax.random.normal(for_error, (count,), dtype)
    anywhere = sensor.start + sensor.width * jax.random.uniform(for_place, (count,), dtype)
    bearing = jnp.where(along, measured, anywhere)

    off = bearing - scan.bearing[:, None]
    off = off - 2 * jnp.pi * jnp.round(off / (2 * jnp.pi))
    density = jnp.exp(-0.5 * (off / sensor.error) ** 2) / (sensor.error * jnp.sqrt(2 * jnp.pi))
    density = jnp.where(scan.there[:, None], density, 0).sum(axis=0) / jnp.maximum(heard, 1)
    share = jnp.where(heard > 0, EVERYWHERE, 1)
    drawn = share + (1 - share) * density * sensor.width
    # An error may carry a draw over the edge of the sector, where no target is looked for.
    inside = sensor.after_start(bearing) <= sensor.width
    log_weights = jnp.where(inside, -jnp.log(drawn), -jnp.inf).astype(dtype)
    return birth.turned_to(states, scan.observer, bearing), log_weights


def where_likely(
    likelihood: Likelihood,
    scan: Any,
    birth: Birth,
    key: PRNGKeyArray,
    count: int,
    candidates: Candidates | None = None,
) -> tuple[PlanarState, Float[Array, " count"]]:
    """Draw states of new targets in the plane, half of them where the ratio of a scan is large.

    Of `CANDIDATES` times as many states half are chosen evenly and half by their ratio, as in
    `faintrack.likelihoods.beam_proposal`; velocities, of which bearings say nothing, are drawn anew.

    Parameters
    ----------
    likelihood, scan : what the candidates are judged by.
    birth : any density in the plane.
    key : random key.
    count : how many to draw.
    candidates : function of (key, count) to states and the log of their weights; the birth density where not given.
    """
    for_candidates, for_choice, for_rest = jax.random.split(key, 3)
    if candidates is not None:
        places, log_weights = candidates(for_candidates, CANDIDATES * count)
    else:
        places = birth.sample(for_candidates, CANDIDATES * count)
        log_weights = jnp.zeros_like(places.x)
    log_joint = log_weights + likelihood.log_ratio(scan, places)
    share = EVERYWHERE / log_joint.size + (1 - EVERYWHERE) * jax.nn.softmax(log_joint)
    chosen = systematic(for_choice, jnp.log(share), count, count)
    fresh = birth.sample(for_rest, count)
    states = PlanarState(places.x[chosen], places.y[chosen], fresh.vx, fresh.vy)
    return states, log_weights[chosen] - jnp.log(share[chosen] * log_joint.size)
