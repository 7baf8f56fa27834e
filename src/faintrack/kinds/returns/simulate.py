"""Returns drawn from the model: echoes of targets in noise, or noise alone."""

from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from faintrack.data.recording import Recording
from faintrack.data.returns import Returns, together
from faintrack.errors import InputError
from faintrack.kinds.planar import Targets, known, states_of
from faintrack.kinds.returns.build import build_likelihood, build_sonar
from faintrack.kinds.returns.hydrophones import draw_samples
from faintrack.kinds.returns.pairs import pairs_of
from faintrack.kinds.returns.sections import ReturnsScenario, SimulationSection
from faintrack.likelihoods.exceedances import ExceedanceLikelihood
from faintrack.results.truth import Known
from faintrack.sensors.active import Ping
from faintrack.signal.pings import from_pings
from faintrack.simulation.active import capacity_for, draw_ping


def simulate(scenario: ReturnsScenario) -> Returns | Recording:
    """Returns that a scenario's `[simulation]` describes, or with `[reception]` the samples of its hydrophones.

    Raises
    ------
    InputError : the scenario has no simulation, or does not say where source and receiver stand.
    """
    section = _simulation(scenario)
    if scenario.reception is not None:
        return draw_samples(scenario, section.targets, section.seed)
    return _drawn(scenario, section.targets, section.seed)


def targets(scenario: ReturnsScenario) -> list[Known]:
    """Targets of a simulation, as results tell their places."""
    return known(_simulation(scenario).targets)


def silence(scenario: ReturnsScenario, seed: int) -> Returns:
    """The same without a target."""
    return _drawn(scenario, (), seed)


def _simulation(scenario: ReturnsScenario) -> SimulationSection:
    if scenario.simulation is None:
        raise InputError("the scenario has no [simulation]; expected one with pings and interval.")
    return scenario.simulation


def _drawn(scenario: ReturnsScenario, targets: Targets, seed: int) -> Returns:
    section, pairs = _simulation(scenario), pairs_of(scenario)
    for pair in pairs:
        for name in ("source", "receiver"):
            if getattr(pair.table, name) is None:
                called = getattr(pair, name)
                field = f"the place of {name} {called!r}" if called else f"sonar.{name}"
                raise InputError(f"{field} is missing; expected metres east and north, where it stands, to simulate.")
    times = section.interval * np.arange(section.pings)
    states, there = states_of(targets, times)
    key = jax.random.key(seed)
    keys = [key] if len(pairs) == 1 else [jax.random.fold_in(key, number) for number in range(len(pairs))]
    drawn = []
    for pair, mine in zip(pairs, keys, strict=True):
        sonar = build_sonar(pair.table)
        likelihood = build_likelihood(pair.table, sonar)
        capacity, lost = capacity_for(likelihood, len(targets)), jnp.array(True)
        while lost.any():
            pings, lost = _pings(likelihood, capacity, mine, jnp.asarray(times, float), states, jnp.asarray(there))
            capacity *= 2
        drawn.append(replace(from_pings(pings, sonar, "simulation"), times=times))
    return together({(pair.source, pair.receiver): each for pair, each in zip(pairs, drawn, strict=True)})


@eqx.filter_jit
def _pings(
    likelihood: ExceedanceLikelihood,
    capacity: int,
    key: PRNGKeyArray,
    times: Float[Array, " ping"],
    states: Any,
    there: Bool[Array, "ping target"],
) -> tuple[Ping, Int[Array, " ping"]]:
    """Pings one after the other, stacked, and how many returns each had no entry for."""

    def ping(one: tuple[Array, Array, Any, Array]) -> tuple[Ping, Array]:
        return draw_ping(jax.random.fold_in(key, one[0]), likelihood, capacity, *one[1:])

    return jax.lax.map(ping, (jnp.arange(len(times)), times, states, there))
