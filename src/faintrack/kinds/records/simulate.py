"""Records drawn from the model: targets in the beams of arrays, or noise alone."""

import math
from collections.abc import Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from faintrack.beliefs.axis import Axis
from faintrack.data.sequence import Sequence
from faintrack.errors import InputError
from faintrack.kinds.records.build import build_fans, build_likelihood, build_placed, build_plane
from faintrack.kinds.records.data import Records
from faintrack.kinds.records.sections import RecordsScenario, SimulatedTargetSection, SimulationSection, parse_utc
from faintrack.kinds.records.together import paths_of, put_together
from faintrack.simulation.energies import draw_energies
from faintrack.targets.states import BearingState, PlanarState

BLOCK_SCANS = 1024
"""Scans drawn at once."""


def simulate(scenario: RecordsScenario) -> Records:
    """Records that a scenario's `[simulation]` describes, one for each station.

    Raises
    ------
    InputError : the scenario has no simulation, targets without a place in its region, or stations that no record is
        drawn of.
    """
    table = _simulation(scenario)
    return _drawn(scenario, table, table.targets, table.seed)


def silence(scenario: RecordsScenario, seed: int) -> Records:
    """The same without a target."""
    return _drawn(scenario, _simulation(scenario), (), seed)


def _simulation(scenario: RecordsScenario) -> SimulationSection:
    if scenario.simulation is None:
        raise InputError("the scenario has no [simulation]; expected one with scans.")
    for station in scenario.stations:
        for name in ("array", "beams_deg"):
            if getattr(station, name) is not None:
                raise InputError(
                    f"station {station.name} has {name}; expected none to simulate, as records with bearings are drawn."
                )
    return scenario.simulation


def _drawn(
    scenario: RecordsScenario, table: SimulationSection, targets: tuple[SimulatedTargetSection, ...], seed: int
) -> Records:
    times = table.interval * np.arange(table.scans)
    # Not drawn yet: arrays are placed by the times alone.
    blank = Records(tuple(_record(scenario, number, times, None) for number in range(len(scenario.stations))))
    together = put_together(blank, scenario, {})
    placed = build_placed(scenario, together, paths_of(blank, scenario), {}, build_plane(scenario))
    fans = build_fans(scenario, together, {}, placed)
    likelihood = build_likelihood(scenario, fans)

    def blocks() -> Iterator[np.ndarray]:
        for number, first in enumerate(range(0, table.scans, BLOCK_SCANS)):
            part = slice(first, min(first + BLOCK_SCANS, table.scans))
            states, present = _states(scenario, targets, times[part])
            key = jax.random.fold_in(jax.random.key(seed), number)
            moments = jnp.asarray(times[part], jnp.float32)
            drawn = draw_energies(key, likelihood, moments, placed.stations(part), states, present)
            yield np.asarray(drawn.energy, np.float32)

    energy = np.concatenate(list(blocks()))
    return Records(
        tuple(
            _record(scenario, number, times, energy[:, number, : fans.count[number]])
            for number in range(len(scenario.stations))
        )
    )


def _record(scenario: RecordsScenario, number: int, times: np.ndarray, energy: np.ndarray | None) -> Sequence:
    """Record of a station, on its own clock."""
    station, table = scenario.stations[number], _simulation(scenario)
    starts = [parse_utc(one.start_time) for one in scenario.stations if one.start_time is not None]
    since = 0.0
    if station.start_time is not None:
        since = float((parse_utc(station.start_time) - min(starts)) / np.timedelta64(1, "ns")) / 1e9
    count = math.floor(180 / table.beam_deg + 1e-9) + 1
    if not station.is_line:
        count = math.floor(360 / table.beam_deg + 1e-9)
    values = np.empty((len(times), 0), np.float32) if energy is None else energy
    return Sequence(
        lambda start, stop: values[start:stop],
        times + station.clock_offset - since,
        (("bearing", Axis(0.0, table.beam_deg, count)),),
        station.name,
    )


def _states(
    scenario: RecordsScenario, targets: tuple[SimulatedTargetSection, ...], times: np.ndarray
) -> tuple[Any, Bool[Array, "scan target"]]:
    """States of the targets in some scans, and when they are there."""
    place = "bearing_deg" if scenario.region is None else "x"
    for number, target in enumerate(targets):
        if getattr(target, place) is None:
            expected = "bearing_deg for an array by itself" if place == "bearing_deg" else "x and y in a region"
            raise InputError(f"simulation.targets[{number}]: expected {expected}.")
        if target.end is not None and not target.end > target.start:
            raise InputError(
                f"simulation.targets[{number}].end is {target.end:g} s; expected more than start, {target.start:g} s."
            )

    def column(name: str) -> Float[np.ndarray, " target"]:
        return np.array([getattr(target, name) for target in targets], float)

    start = column("start")
    end = np.array([math.inf if target.end is None else target.end for target in targets], float)
    since = times[:, None] - start
    present = jnp.asarray((since >= 0) & (times[:, None] < end))

    def moving(name: str, rate: str) -> list[Any]:
        fields = column(name) + since * column(rate), np.broadcast_to(column(rate), since.shape)
        return [jnp.asarray(values, jnp.float32) for values in fields]

    if scenario.region is None:
        bearing, rate = (jnp.radians(values) for values in moving("bearing_deg", "bearing_rate_deg"))
        return BearingState(bearing, rate, jnp.zeros_like(rate)), present
    (x, vx), (y, vy) = moving("x", "vx"), moving("y", "vy")
    return PlanarState(x, y, vx, vy), present
