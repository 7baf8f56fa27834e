"""Sets of contacts: log ratios by enumeration of associations, means by direct integration, and what is drawn."""

import dataclasses
import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import norm, poisson

from faintrack.errors import InputError
from faintrack.likelihoods.contact_proposal import about_contacts
from faintrack.likelihoods.contact_sets import ContactSetLikelihood
from faintrack.likelihoods.protocols import with_others
from faintrack.sensors.bistatic import Bistatic, fixed
from faintrack.sensors.contact_draws import draw_contact_set
from faintrack.sensors.contact_sets import ContactSensor, ContactSet
from faintrack.targets.states import PlanarState
from faintrack.targets.target import UniformBirth
from tests.tolerances import STANDARD_ERRORS, errors_apart

SOURCE, RECEIVER, SPEED, FREQUENCY = (-400.0, 300.0), (500.0, -100.0), 1500.0, 2000.0
ERRORS = 0.05, 0.06, 2.0
ENDS = (0.8, 3.2), (-1.2, 1.9), (-25.0, 30.0)
VOLUME = math.prod(high - low for low, high in ENDS)
PAIR = Bistatic(fixed(*SOURCE), fixed(*RECEIVER), SPEED)


def sensor(detection: float = 0.8, false: float = 3.0) -> ContactSensor:
    return ContactSensor(ERRORS, detection, false, ENDS, frequency=FREQUENCY)


def ranges(false: float = 1.0) -> ContactSensor:
    return ContactSensor((60.0, 0.06), 0.8, false, ((300.0, 2500.0), (-math.pi, math.pi)), ranged=True)


def contact_set(contacts: Any, components: int = 3) -> ContactSet:
    held = np.zeros((8, components))
    held[: len(contacts)] = np.reshape(contacts, (-1, components))
    return ContactSet(jnp.array(0.0), jnp.asarray(held, float), jnp.arange(8) < len(contacts), PAIR)


def planar(states: Any) -> PlanarState:
    return PlanarState(*(jnp.asarray(part, float) for part in np.transpose(states)))


def measured(state: tuple[float, ...]) -> np.ndarray:
    """Delay, bearing and Doppler shift of a target, written out; both platforms stand still."""
    place, velocity = np.array(state[:2]), np.array(state[2:])
    out, back = place - SOURCE, place - RECEIVER
    delay = (math.dist(place, SOURCE) + math.dist(place, RECEIVER)) / SPEED
    opening, closing = (float(way @ velocity / np.linalg.norm(way)) for way in (out, back))
    shift = FREQUENCY * ((SPEED - opening) / (SPEED + closing) - 1)
    return np.array([delay, math.atan2(back[1], back[0]), shift])


def reported(state: tuple[float, ...]) -> float:
    """Probability that errors leave a contact within all ends."""
    each = [
        norm.cdf(high, value, error) - norm.cdf(low, value, error)
        for value, error, (low, high) in zip(measured(state), ERRORS, ENDS, strict=True)
    ]
    return float(np.prod(each))


def enumerated(contacts: Any, state: tuple[float, ...], detection: float, false: float) -> float:
    """p(contacts | target) over p(contacts | none), by all that may be the target's; of a list in random order."""
    n = len(contacts)
    none = poisson.pmf(n, false) * VOLUME**-n
    with_target = (1 - detection * reported(state)) * none
    for contact in contacts:
        density = float(np.prod(norm.pdf(contact, measured(state), ERRORS)))
        # The target's contact comes first, second, ... among n, each as likely.
        with_target += detection * density * poisson.pmf(n - 1, false) * VOLUME ** -(n - 1) / n
    return with_target / none


STATES = (1500.0, 400.0, 5.0, -3.0), (900.0, 900.0, -6.0, 2.0), (2100.0, 1100.0, 0.0, 0.0), (-900.0, 0.0, 1.0, 1.0)
"""In the middle, near by, at the last delay, and outside the sector."""


@pytest.mark.parametrize("detection", [0.3, 0.95])
@pytest.mark.parametrize("count", [0, 1, 3])
def test_ratio_is_the_sum_over_associations(count: int, detection: float) -> None:
    near = [measured(state) + 0.7 * np.array(ERRORS) for state in STATES[:2]]
    contacts = [*near, np.array([2.9, -1.0, 11.0])][:count]
    found = ContactSetLikelihood(sensor(detection)).log_ratio(contact_set(contacts), planar(STATES))
    expected = np.log([enumerated(contacts, state, detection, 3.0) for state in STATES])
    # Far from any contact only logs below those of chance differ: a shift has seven digits of the frequency.
    np.testing.assert_allclose(found, expected, rtol=2e-3, atol=2e-3)


def test_a_ping_without_contacts_rules_out_what_is_never_missed() -> None:
    found = ContactSetLikelihood(sensor(1.0)).log_ratio(contact_set([]), planar(STATES))
    assert float(found[1]) == -math.inf
    assert float(found[3]) == 0


@pytest.mark.parametrize("state", STATES[:3])
def test_mean_of_one_false_contact_by_integration(state: tuple[float, ...]) -> None:
    """Of ranges and bearings on a fine mesh: 1 - P_D A + P_D A / M_c, at the edge as well."""
    low, high = 300.0, 2500.0
    distance = np.linspace(low, high, 1101)
    bearing = np.linspace(-math.pi, math.pi, 801)
    mesh = np.stack(np.meshgrid(distance, bearing, indexing="ij"), axis=-1).reshape(-1, 1, 2)
    one = contact_set([(1000.0, 0.0)], 2)
    likelihood, here = ContactSetLikelihood(ranges(2.0)), jax.tree.map(lambda leaf: leaf[0], planar([state]))

    @jax.jit
    def ratio(value: jax.Array) -> jax.Array:
        scan = dataclasses.replace(one, values=one.values[:1] * 0 + value, there=jnp.array([True]))
        return jnp.exp(likelihood.log_ratio(scan, here))

    values = np.asarray(jax.vmap(ratio)(jnp.asarray(mesh, float)), float).reshape(len(distance), len(bearing))
    found = np.trapezoid(np.trapezoid(values, bearing), distance) / (2 * math.pi * (high - low))
    away = math.dist(state[:2], RECEIVER)
    inside = norm.cdf(high, away, 60.0) - norm.cdf(low, away, 60.0)
    assert found == pytest.approx(1 - 0.8 * inside + 0.8 * inside / 2.0, rel=2e-3)


def test_contacts_of_another_add_to_the_false_ones() -> None:
    contacts = [measured(STATES[0]) + 0.3 * np.array(ERRORS), np.array([2.9, -1.0, 11.0])]
    others = jax.tree.map(lambda leaf: leaf[None], planar(STATES[:2]))
    weights, existence = np.array([0.6, 0.4]), 0.7
    found = with_others(
        ContactSetLikelihood(sensor()),
        contact_set(contacts),
        others,
        jnp.log(jnp.asarray(weights))[None],
        jnp.array([existence]),
    )
    for contact, crowding in zip(contacts, np.asarray(found.crowding), strict=False):
        densities = [np.prod(norm.pdf(contact, measured(state), ERRORS)) for state in STATES[:2]]
        assert crowding == pytest.approx(1 + existence * 0.8 * (weights @ densities) * VOLUME / 3.0, rel=3e-3)


@pytest.mark.parametrize("of_ranges", [False, True])
def test_newborn_stand_for_the_birth_density(of_ranges: bool) -> None:
    """Mean weight 1, and that of weight times ratio is the mean of the ratio over the region, by a fine mesh."""
    known = ranges(3.0) if of_ranges else ContactSensor(ERRORS[:2], 0.8, 3.0, ENDS[:2])
    contact = measured((1500.0, 400.0, 0.0, 0.0))[:2]
    if of_ranges:
        contact[0] = math.dist((1500.0, 400.0), RECEIVER)
    scan, likelihood = contact_set([contact], 2), ContactSetLikelihood(known)
    low, high = (PlanarState(*(jnp.array(sign * each) for each in (2600.0, 2500.0, 8.0, 8.0))) for sign in (-1, 1))
    states, log_weights = about_contacts(likelihood, scan, UniformBirth(low, high), jax.random.key(0), 30_000)
    weights = np.exp(np.asarray(log_weights, float))
    assert errors_apart(weights, 1.0) < STANDARD_ERRORS
    assert weights.max() <= 10.0 + 1e-3
    assert errors_apart(weights * np.asarray(states.x > 700.0), 1900 / 5200) < STANDARD_ERRORS
    ratio = np.exp(np.asarray(likelihood.log_ratio(scan, states), float))
    x, y = (np.linspace(-side, side, 501) for side in (2600.0, 2500.0))
    east, north = np.meshgrid(x, y, indexing="ij")
    mesh = planar(np.stack([east.ravel(), north.ravel(), 0 * east.ravel(), 0 * east.ravel()], axis=-1))
    expected = float(np.exp(np.asarray(likelihood.log_ratio(scan, mesh), float)).mean())
    assert errors_apart(weights * ratio, expected) < STANDARD_ERRORS


@eqx.filter_jit
def draws(key: jax.Array, known: ContactSensor, state: PlanarState, present: Any) -> tuple[ContactSet, jax.Array]:
    def one(key: jax.Array) -> tuple[ContactSet, jax.Array]:
        return draw_contact_set(key, known, 16, jnp.array(0.0), PAIR, state, present)

    return jax.vmap(one)(jax.random.split(key, 20_000))


def one_state(state: tuple[float, ...]) -> PlanarState:
    return jax.tree.map(lambda leaf: leaf[0], planar([state]))


def test_false_contacts_are_poisson_and_even() -> None:
    drawn, _ = draws(jax.random.key(1), sensor(), one_state(STATES[0]), jnp.array(False))
    number = np.asarray(drawn.there.sum(axis=1))
    assert errors_apart(number, 3.0) < STANDARD_ERRORS
    assert errors_apart((number - 3.0) ** 2, 3.0) < STANDARD_ERRORS
    every = np.asarray(drawn.values)[np.asarray(drawn.there)]
    for component, ends in zip(every.T, ENDS, strict=True):
        share = np.histogram(component, 10, ends)[0] / len(every)
        assert np.abs(share - 0.1).max() < STANDARD_ERRORS * math.sqrt(0.09 / len(every))


def test_a_target_is_detected_as_often_as_it_should() -> None:
    """At the last delay an error carries every other contact over the edge."""
    quiet = sensor(false=1e-3)
    for number, state in enumerate(STATES[:3]):
        drawn, _ = draws(jax.random.key(number), quiet, one_state(state), jnp.array(True))
        hit = np.asarray(drawn.there.any(axis=1), float)
        expected = 0.8 * reported(state)
        assert errors_apart(hit, expected + (1 - expected) * (1 - math.exp(-1e-3))) < STANDARD_ERRORS
    first = np.asarray(draws(jax.random.key(0), quiet, one_state(STATES[0]), jnp.array(True))[0].values)[:, 0]
    off = (first - measured(STATES[0])) / ERRORS
    near = off[np.all(np.abs(off) < 8, axis=1)]
    for component in near.T:
        assert errors_apart(component, 0.0) < STANDARD_ERRORS
        assert errors_apart(component**2, 1.0) < STANDARD_ERRORS


def test_what_finds_no_place_is_counted() -> None:
    drawn, lost = draws(jax.random.key(3), sensor(false=60.0), one_state(STATES[0]), jnp.array(True))
    assert bool(drawn.there.all())
    assert int(lost.min()) >= 1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"errors": (0.0, 0.1, 1.0)}, "error of the distance is 0; expected above 0"),
        ({"detection_probability": 1.2}, "detection_probability is 1.2; expected above 0, at most 1"),
        ({"false_per_ping": float("nan")}, "false_per_ping is nan; expected above 0"),
        ({"ends": ((1.0, 2.0), (0.0, 7.0), (-1.0, 1.0))}, "width of the sector is 7 rad; expected at most a turn"),
        ({"ends": ((2.0, 1.0), (0.0, 6.0), (-1.0, 1.0))}, "distance goes from 2 to 1; expected the lower end first"),
        ({"ends": ((1.0, 2.0), (0.0, 6.0))}, "3 errors and 2 ends; expected 2 or 3 of each"),
    ],
)
def test_a_sensor_that_cannot_be(change: dict[str, Any], message: str) -> None:
    known = {"errors": ERRORS, "detection_probability": 0.9, "false_per_ping": 3.0, "ends": ENDS}
    with pytest.raises(InputError, match=message):
        ContactSensor(**(known | change))
