"""Sets of bearings drawn from the model: those of targets among false ones, or false ones alone."""

import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Int, PRNGKeyArray

from faintrack.data.bearings import Bearings
from faintrack.errors import InputError
from faintrack.kinds.bearings.build import build_sensor
from faintrack.kinds.bearings.sections import BearingsScenario, SimulationSection
from faintrack.kinds.planar import Targets, known, states_of
from faintrack.results.truth import Known
from faintrack.sensors.bearing_draws import draw_bearing_set
from faintrack.sensors.bearing_sets import BearingSensor, BearingSet
from faintrack.targets.states import PlanarState


def simulate(scenario: BearingsScenario) -> Bearings:
    """Bearings that a scenario's `[simulation]` describes.

    Raises
    ------
    InputError : the scenario has no simulation.
    """
    section = _simulation(scenario)
    return _drawn(scenario, section.targets, section.seed)


def targets(scenario: BearingsScenario) -> list[Known]:
    """Targets of a simulation, as results tell their places."""
    return known(_simulation(scenario).targets)


def silence(scenario: BearingsScenario, seed: int) -> Bearings:
    """The same without a target."""
    return _drawn(scenario, (), seed)


def _simulation(scenario: BearingsScenario) -> SimulationSection:
    if scenario.simulation is None:
        raise InputError("the scenario has no [simulation]; expected one with scans and observers.")
    return scenario.simulation


def _drawn(scenario: BearingsScenario, targets: Targets, seed: int) -> Bearings:
    section, sensor = _simulation(scenario), build_sensor(scenario.bearings)
    times = section.interval * np.arange(section.scans)
    states, there = states_of(targets, times)
    place = np.stack([_along(observer.path, times) for observer in section.observers], axis=1)
    still = np.zeros(place.shape[:2])
    observers = PlanarState(*(jnp.asarray(part, float) for part in (*np.moveaxis(place, 2, 0), still, still)))
    expected = scenario.bearings.false_per_scan
    # Fewer than one scan of a million has more; of its bearings none may be lost.
    capacity, lost = int(expected + 6 * math.sqrt(expected)) + 8 + len(targets), jnp.array(True)
    while lost.any():
        sets, lost = _sets(sensor, capacity, jax.random.key(seed), observers, states, jnp.asarray(there))
        capacity *= 2
    scan, observer, entry = np.nonzero(np.asarray(sets.there))
    return Bearings(
        times,
        np.arange(len(section.observers)),
        np.ones(place.shape[:2], bool),
        place,
        scan,
        observer,
        np.asarray(sets.bearing, float)[scan, observer, entry],
        np.arange(len(scan)),
        "simulation",
    )


def _along(path: tuple[tuple[float, float, float], ...], times: np.ndarray) -> np.ndarray:
    """Where an observer is at some times, shape (time, 2); m."""
    time, x, y = np.array(path, float).T
    return np.stack([np.interp(times, time, x), np.interp(times, time, y)], axis=-1)


@eqx.filter_jit
def _sets(
    sensor: BearingSensor,
    capacity: int,
    key: PRNGKeyArray,
    observers: PlanarState,
    states: PlanarState,
    there: Bool[Array, "scan target"],
) -> tuple[BearingSet, Int[Array, "scan observer"]]:
    """Sets of all scans and observers, stacked, and how many bearings each had no entry for."""

    def scan(one: tuple[Array, PlanarState, PlanarState, Array]) -> Any:
        number, placed, targets, present = one

        def draw(observer: Array, place: PlanarState) -> tuple[BearingSet, Array]:
            address = jax.random.fold_in(jax.random.fold_in(key, number), observer)
            return draw_bearing_set(address, sensor, capacity, jnp.zeros(()), place, targets, present)

        return jax.vmap(draw)(jnp.arange(len(placed.x)), placed)

    return jax.lax.map(scan, (jnp.arange(len(there)), observers, states, there))
