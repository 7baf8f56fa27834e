r"""Newborn particles about the contacts of a ping.

A contact tells where its echo comes from (`faintrack.sensors.bistatic`). Of n contacts in a ping one is a new target's,
if it was detected; newborn particles are drawn about them,

.. math::
    \pi(x) = \alpha\, b(x) + \frac{1 - \alpha}{n} \sum_i N(\tau(x); \tau_i, \sigma_\tau^2)\,
    N(\phi(x); \phi_i, \sigma_\phi^2) \left| \frac{\partial(\tau, \phi)}{\partial(x, y)} \right|

with b the birth density in the plane and :math:`\alpha` a tenth, and have the weight :math:`b(x) / \pi(x)`, at most
10. A target that is missed when it appears is found about its next contact, so that few are needed elsewhere.
With R the range and u the unit vectors to the target, from the source S and the receiver T,

.. math:: \left| \frac{\partial(\tau, \phi)}{\partial(x, y)} \right| = \frac{1 + u_S \cdot u_T}{c R},

and 1 / R where ranges are measured. Velocities, of which a contact without Doppler says nothing, are the births'.
"""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.sensors.bistatic import Bistatic
from faintrack.sensors.contact_sets import BEARING, ContactSensor, ContactSet
from faintrack.targets.states import PlanarState
from faintrack.targets.target import UniformBirth

ELSEWHERE = 0.1
"""Share of the draws that are from the birth density."""

NEAREST = 1e-3
"""Range below which a place is the receiver's own; m."""


def about_contacts(
    likelihood: Any, scan: ContactSet, birth: UniformBirth, key: PRNGKeyArray, count: int
) -> tuple[PlanarState, Float[Array, " count"]]:
    """Draw states of new targets, most of them about the contacts of a ping.

    Parameters
    ----------
    likelihood : its `sensor` says how wrong contacts are.
    scan : with source and receiver.
    birth : evenly over a box of places and velocities.
    key : random key.
    count : how many to draw.

    Returns
    -------
    States, and the natural log of their weights, birth density over density of the draws.

    Examples
    --------
    >>> import math
    >>> from faintrack.likelihoods.contact_sets import ContactSetLikelihood
    >>> from faintrack.sensors.bistatic import fixed
    >>> sensor = ContactSensor((10.0, 0.02), 0.9, 5.0, ((100.0, 9000.0), (-math.pi, math.pi)), ranged=True)
    >>> sonar = Bistatic(fixed(0.0, 0.0), fixed(0.0, 0.0))
    >>> contacts = ContactSet(jnp.array(0.0), jnp.array([[3000.0, 0.0]]), jnp.array([True]), sonar)
    >>> low, high = (PlanarState(*(jnp.array(sign * each) for each in (9e3, 9e3, 8.0, 8.0))) for sign in (-1, 1))
    >>> likelihood, birth = ContactSetLikelihood(sensor), UniformBirth(low, high)
    >>> states, log_weights = about_contacts(likelihood, contacts, birth, jax.random.key(0), 1000)
    >>> bool((jnp.hypot(states.x - 3000.0, states.y) < 200.0).mean() > 0.8)
    True
    """
    sensor: ContactSensor = likelihood.sensor
    for_source, for_error, for_rest = jax.random.split(key, 3)
    states = birth.sample(for_rest, count)
    dtype = states.x.dtype
    heard = scan.there.sum()
    # Entries that are contacts come first.
    source = jnp.floor(jax.random.uniform(for_source, (count,), dtype) * heard / (1 - ELSEWHERE)).astype(int)
    about = source < heard
    contact = scan.values[jnp.minimum(source, len(scan.values) - 1)]
    errors = jax.random.normal(for_error, (2, count), dtype)
    distance, bearing = (contact[:, number] + sensor.errors[number] * errors[number] for number in (0, BEARING))
    x, y = _place(sensor, scan.pair, distance, bearing)
    states = PlanarState(
        jnp.where(about, x, states.x).astype(dtype),
        jnp.where(about, y, states.y).astype(dtype),
        states.vx,
        states.vy,
    )

    expected = sensor.expected(scan.pair, states)
    near = zip(sensor.off(scan.values, expected)[:2], sensor.errors[:2], strict=True)
    log_density: Any = sum(-0.5 * off**2 - jnp.log(error * jnp.sqrt(2 * jnp.pi)) for off, error in near)
    log_density = jax.nn.logsumexp(jnp.where(scan.there[:, None], log_density, -jnp.inf), axis=0)
    log_density = log_density + _log_jacobian(sensor, scan.pair, states) - jnp.log(jnp.maximum(heard, 1))
    low, high = birth.low, birth.high
    log_area = jnp.log((high.x - low.x) * (high.y - low.y))
    share = jnp.where(heard > 0, ELSEWHERE, 1)
    log_drawn = jnp.logaddexp(jnp.log(share), jnp.log1p(-share) + log_density + log_area)
    # An error may carry a draw out of the region, or a contact lie beyond it, where no target is looked for.
    inside = (states.x >= low.x) & (states.x <= high.x) & (states.y >= low.y) & (states.y <= high.y)
    inside = inside & (_range(scan.pair, states) > NEAREST)
    return states, jnp.where(inside, -log_drawn, -jnp.inf).astype(dtype)


def _place(
    sensor: ContactSensor, pair: Bistatic, distance: Float[Array, " count"], bearing: Float[Array, " count"]
) -> tuple[Array, Array]:
    if not sensor.ranged:
        return pair.position(distance, bearing)
    distance = jnp.maximum(distance, 0)
    return pair.receiver.x + distance * jnp.cos(bearing), pair.receiver.y + distance * jnp.sin(bearing)


def _range(pair: Bistatic, states: Any) -> Float[Array, " count"]:
    return jnp.hypot(states.x - pair.receiver.x, states.y - pair.receiver.y)


def _log_jacobian(sensor: ContactSensor, pair: Bistatic, states: Any) -> Float[Array, " count"]:
    """Log of the determinant of distance and bearing by the place (the module's equation)."""
    distance = jnp.maximum(_range(pair, states), NEAREST)
    if sensor.ranged:
        return -jnp.log(distance)
    (sx, sy), (rx, ry) = pair.directions(states)
    return jnp.log(jnp.maximum(1 + sx * rx + sy * ry, 1e-12)) - jnp.log(pair.sound_speed * distance)
