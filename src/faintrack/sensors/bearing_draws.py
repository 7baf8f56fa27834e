"""Sets of bearings drawn: the target's, where it is detected, among false ones."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from faintrack.sensors.bearing_sets import BearingSensor, BearingSet
from faintrack.targets.states import PlanarState

TINY = 2.0**-24
"""In place of a uniform number that is 0, whose normal one would be infinite."""


@eqx.filter_jit
def draw_bearing_set(
    key: PRNGKeyArray,
    sensor: BearingSensor,
    capacity: int,
    time: Float[Array, ""],
    observer: PlanarState,
    state: Any,
    present: Bool[Array, ""] | bool,
) -> tuple[BearingSet, Int[Array, ""]]:
    """Bearings of one scan.

    Parameters
    ----------
    key : random key.
    sensor : what it reports.
    capacity : entries; enough for the expected number of false bearings and several times its root.
    time : seconds.
    observer : where the sensor is; scalars.
    state : of a target; scalars.
    present : whether it is there.

    Returns
    -------
    The scan, bearings in ascending order from the start of the sector, and how many found no place in it.
    """
    # All numbers at once: XLA takes a second to compile each draw.
    for_gaps, for_rest = jnp.split(jax.random.uniform(key, (capacity + 3,)), [capacity + 1])
    for_detection, for_error = for_rest
    # Arrivals of a Poisson process along the sector, so that their number is Poisson and their places even.
    places = jnp.cumsum(-jnp.log1p(-for_gaps)) / sensor.false_per_radian
    false = places < sensor.width
    true = jnp.arctan2(state.y - observer.y, state.x - observer.x)
    detected = present & (sensor.after_start(true) <= sensor.width)
    detected = detected & (for_detection < sensor.detection_probability)
    measured = sensor.after_start(true + sensor.error * jax.scipy.special.ndtri(jnp.maximum(for_error, TINY)))
    # An error may carry a bearing over the edge of the sector: there it is not reported.
    detected = detected & (measured <= sensor.width)
    every = jnp.append(jnp.where(false, places, jnp.inf), jnp.where(detected, measured, jnp.inf))
    every = jnp.sort(every)
    there = every < jnp.inf
    bearing = sensor.start + jnp.where(there, every, 0)
    kept = BearingSet(time, bearing[:capacity], there[:capacity], observer)
    return kept, there[capacity:].sum()
