"""Sets of bearings drawn: those of targets, where they are detected, among false ones."""

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
    present: Bool[Array, "*target"] | bool,
) -> tuple[BearingSet, Int[Array, ""]]:
    """Bearings of one scan.

    Parameters
    ----------
    key : random key.
    sensor : what it reports.
    capacity : entries; enough for the expected number of false bearings and several times its root.
    time : seconds.
    observer : where the sensor is; scalars.
    state : of a target, scalars; or of several, all of one shape.
    present : whether it is there, or each of them.

    Returns
    -------
    The scan, bearings in ascending order from the start of the sector, and how many found no place in it.
    """
    true = jnp.ravel(jnp.arctan2(state.y - observer.y, state.x - observer.x))
    # All numbers at once: XLA takes a second to compile each draw.
    numbers = jax.random.uniform(key, (capacity + 1 + 2 * true.size,))
    for_gaps, for_detection, for_error = jnp.split(numbers, [capacity + 1, capacity + 1 + true.size])
    # Arrivals of a Poisson process along the sector, so that their number is Poisson and their places even.
    places = jnp.cumsum(-jnp.log1p(-for_gaps)) / sensor.false_per_radian
    false = places < sensor.width
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
