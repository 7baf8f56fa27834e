"""Records drawn from the model: targets in the beams of arrays, or noise alone."""

import math
from collections.abc import Iterator
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from faintrack.beliefs.axis import Axis
from faintrack.data.sequence import Sequence
from faintrack.errors import InputError
from faintrack.kinds.planar import known, states_of
from faintrack.kinds.records.build import build_fans, build_likelihood, build_placed, build_plane
from faintrack.kinds.records.data import Records
from faintrack.kinds.records.sections import RecordsScenario, SimulationSection, SourceSection, parse_utc
from faintrack.kinds.records.together import paths_of, put_together
from faintrack.results.truth import Known, Places
from faintrack.simulation.energies import draw_energies
from faintrack.targets.states import BearingState

BLOCK_SCANS = 1024
"""Scans drawn at once."""


def simulate(scenario: RecordsScenario) -> Records:
    """Records that a scenario's `[simulation]` describes, one for each station.

    Raises
    ------
    InputError : the scenario has no simulation, or stations that no record is drawn of.
    """
    return _drawn(scenario, _simulation(scenario))


def silence(scenario: RecordsScenario, seed: int) -> Records:
    """The same without a target."""
    return _drawn(scenario, _simulation(scenario).model_copy(update={"targets": (), "sources": (), "seed": seed}))


def targets(scenario: RecordsScenario) -> list[Known]:
    """Targets of a simulation, as results tell their places."""
    table = _simulation(scenario)
    if scenario.region is None:
        line = scenario.stations[0].is_line
        return [Known(f"source {n}", partial(_heard_at, source, line)) for n, source in enumerate(table.sources, 1)]
    return known(table.targets)


def _heard_at(source: SourceSection, line: bool, times: np.ndarray) -> Places:
    """Bearing of a source as results tell it."""
    bearing = (_bearing(source, times) + 180) % 360 - 180
    # A line hears a wave as from its mirror image.
    return {"bearing": np.abs(bearing) if line else bearing}


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


def _drawn(scenario: RecordsScenario, table: SimulationSection) -> Records:
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
            states, present = _states(scenario, table, times[part])
            key = jax.random.fold_in(jax.random.key(table.seed), number)
            moments = jnp.asarray(times[part], jnp.float32)
            drawn = draw_energies(key, likelihood, moments, placed.stations(part), states, jnp.asarray(present))
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


def _states(scenario: RecordsScenario, table: SimulationSection, times: np.ndarray) -> tuple[Any, Any]:
    """States of the targets in some scans, components of shape (scan, target), and whether they are there."""
    if scenario.region is not None:
        return states_of(table.targets, times)
    bearing = np.array([_bearing(source, times) for source in table.sources]).reshape(-1, len(times)).T
    still = jnp.zeros(bearing.shape)
    return BearingState(jnp.radians(jnp.nan_to_num(jnp.asarray(bearing))), still, still), np.isfinite(bearing)


def _bearing(source: SourceSection, times: np.ndarray) -> Float[np.ndarray, " scan"]:
    """Bearing of a source, degrees; not a number where it is not heard."""
    end = math.inf if source.end is None else source.end
    bearing = source.bearing_deg + source.bearing_rate_deg * (times - source.start)
    return np.where((times >= source.start) & (times < end), bearing, np.nan)
