"""Contacts drawn from the model: those of targets among false ones, or false ones alone."""

import math
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Int, PRNGKeyArray

from faintrack.data.contacts import Contacts
from faintrack.errors import InputError
from faintrack.kinds.contacts.build import build_sensor, pairs_of, place_of
from faintrack.kinds.contacts.sections import ContactsScenario, SimulationSection
from faintrack.kinds.planar import Targets, known, states_of
from faintrack.results.truth import Known
from faintrack.sensors.bistatic import Bistatic, fixed
from faintrack.sensors.contact_draws import draw_contact_set
from faintrack.sensors.contact_sets import BEARING, ContactSensor, ContactSet
from faintrack.targets.states import PlanarState


def simulate(scenario: ContactsScenario) -> Contacts:
    """Contacts that a scenario's `[simulation]` describes.

    Raises
    ------
    InputError : the scenario has no simulation, no number of false contacts, or no place of source or receiver.
    """
    section = _simulation(scenario)
    return _drawn(scenario, section.targets, section.seed)


def targets(scenario: ContactsScenario) -> list[Known]:
    """Targets of a simulation, as results tell their places."""
    return known(_simulation(scenario).targets)


def silence(scenario: ContactsScenario, seed: int) -> Contacts:
    """The same without a target."""
    return _drawn(scenario, (), seed)


def _simulation(scenario: ContactsScenario) -> SimulationSection:
    if scenario.simulation is None:
        raise InputError("the scenario has no [simulation]; expected one with pings and interval.")
    return scenario.simulation


def _drawn(scenario: ContactsScenario, targets: Targets, seed: int) -> Contacts:
    section, expected = _simulation(scenario), scenario.contacts.false_per_ping
    if expected is None:
        raise InputError("contacts.false_per_ping is missing; expected the number of false contacts, to simulate.")
    sensor, pairs = build_sensor(scenario.contacts), pairs_of(scenario)
    placed = [
        Bistatic(
            fixed(*place_of(scenario, "source", source, "simulation")),
            fixed(*place_of(scenario, "receiver", receiver, "simulation")),
            scenario.contacts.sound_speed,
        )
        for source, receiver in pairs
    ]
    stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves), *placed)
    times = section.interval * np.arange(section.pings)
    states, there = states_of(targets, times)
    # Fewer than one ping of a million has more; of its contacts none may be lost.
    capacity, lost = int(expected + 6 * math.sqrt(expected)) + 8 + len(targets), jnp.array(True)
    while lost.any():
        sets, lost = _sets(sensor, capacity, jax.random.key(seed), stacked, states, jnp.asarray(there))
        capacity *= 2
    ping, pair, entry = np.nonzero(np.asarray(sets.there))
    values = np.asarray(sets.values, float)[ping, pair, entry]
    contacts = Contacts(
        times,
        ping,
        values[:, 0],
        sensor.ranged,
        values[:, BEARING],
        values[:, 2] if len(sensor.errors) == 3 else None,
        None,
        None,
        np.arange(len(ping)),
        "simulation",
    )
    if pairs == (("", ""),):
        return contacts
    return replace(contacts, pairs=pairs, pair=pair, reported=np.ones((len(times), len(pairs)), bool))


@eqx.filter_jit
def _sets(
    sensor: ContactSensor,
    capacity: int,
    key: PRNGKeyArray,
    pairs: Bistatic,
    states: PlanarState,
    there: Bool[Array, "scan target"],
) -> tuple[ContactSet, Int[Array, "scan pair"]]:
    """Sets of all pings and pairs, stacked, and how many contacts each had no entry for."""

    def scan(one: tuple[Array, PlanarState, Array]) -> Any:
        number, targets, present = one

        def draw(place: Array, pair: Bistatic) -> tuple[ContactSet, Array]:
            address = jax.random.fold_in(jax.random.fold_in(key, number), place)
            return draw_contact_set(address, sensor, capacity, jnp.zeros(()), pair, targets, present)

        return jax.vmap(draw)(jnp.arange(len(pairs.source.x)), pairs)

    return jax.lax.map(scan, (jnp.arange(len(there)), states, there))
