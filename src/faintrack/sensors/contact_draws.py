"""Sets of contacts drawn: those of targets, where they are detected, among false ones."""

import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from faintrack.sensors.bearing_draws import TINY
from faintrack.sensors.bistatic import Bistatic
from faintrack.sensors.contact_sets import BEARING, ContactSensor, ContactSet


@eqx.filter_jit
def draw_contact_set(
    key: PRNGKeyArray,
    sensor: ContactSensor,
    capacity: int,
    time: Float[Array, ""],
    pair: Bistatic,
    states: Any,
    present: Bool[Array, "*target"] | bool,
) -> tuple[ContactSet, Int[Array, ""]]:
    """Contacts of one ping.

    Parameters
    ----------
    key : random key.
    sensor : what it reports.
    capacity : entries; enough for the expected number of false contacts and several times its root.
    time : seconds.
    pair : source and receiver; scalars.
    states : of a target, scalars; or of several, all of one shape.
    present : whether it is there, or each of them.

    Returns
    -------
    The contacts, in ascending order of their bearing from the start of the sector, and how many found no place.
    """
    true = jnp.stack([jnp.ravel(value) for value in sensor.expected(pair, states)], axis=-1)
    targets, components = true.shape
    # All numbers at once: XLA takes a second to compile each draw.
    sizes = (capacity + 1) * components, targets, targets * components
    numbers = jax.random.uniform(key, (sum(sizes),), true.dtype)
    for_false, for_detection, for_error = jnp.split(numbers, [sizes[0], sizes[0] + sizes[1]])
    for_false = for_false.reshape(capacity + 1, components)
    low, high = (jnp.asarray(ends, true.dtype) for ends in zip(*sensor.ends, strict=True))
    # Arrivals of a Poisson process along the sector, so that their number is Poisson and their bearings even.
    after = jnp.cumsum(-jnp.log1p(-for_false[:, BEARING])) * sensor.width / sensor.false_per_ping
    false = (low + (high - low) * for_false).at[:, BEARING].set(after)

    errors = jnp.stack([jnp.asarray(error, true.dtype) for error in sensor.errors])
    measured = true + errors * jax.scipy.special.ndtri(jnp.maximum(for_error, TINY)).reshape(true.shape)
    measured = measured.at[:, BEARING].set(sensor.after_start(measured[:, BEARING]))
    within = ((measured >= low) & (measured <= high)).at[:, BEARING].set(measured[:, BEARING] <= sensor.width)
    detected = jnp.ravel(jnp.broadcast_to(jnp.asarray(present), (targets,)))
    detected = detected & (for_detection < sensor.detection_probability) & jnp.all(within, axis=-1)

    every = jnp.concatenate([false, measured])
    there = jnp.concatenate([after < sensor.width, detected])
    order = jnp.argsort(jnp.where(there, every[:, BEARING], math.inf))
    every, there = every[order].at[:, BEARING].add(low[BEARING]), there[order]
    values = jnp.where(there[:, None], every, 0)
    return ContactSet(time, values[:capacity], there[:capacity], pair), there[capacity:].sum()
