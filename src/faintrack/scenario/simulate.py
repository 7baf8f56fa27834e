"""From the simulation of a scenario to samples."""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from faintrack.errors import InputError
from faintrack.scenario.array import build
from faintrack.scenario.model import Scenario, SimulationTable
from faintrack.sensors.array import SensorArray
from faintrack.simulation.samples import Source, draw_samples


def simulated_array(scenario: Scenario, folder: Path) -> SensorArray:
    """Array of a scenario.

    Raises
    ------
    InputError : the scenario has no array.
    """
    if scenario.array is None:
        raise InputError("the scenario has no [array]; expected one to simulate.")
    return build(scenario.array, folder)


def sources_of(table: SimulationTable) -> list[Source]:
    """Sources of a simulation, in SI units.

    Raises
    ------
    InputError : a source ends before it starts.
    """
    sources = []
    for number, source in enumerate(table.sources):
        end = math.inf if source.end is None else source.end
        if not end > source.start:
            raise InputError(
                f"simulation.sources[{number}].end is {end:g} s; expected more than start, {source.start:g} s."
            )
        rate = math.radians(source.bearing_rate_deg)
        sources.append(Source(source.snr_db, math.radians(source.bearing_deg), rate, source.start, end))
    return sources


def simulated_samples(scenario: Scenario, array: SensorArray) -> Iterator[np.ndarray]:
    """Blocks of samples of a scenario's simulation; see `faintrack.simulation.samples.draw_samples`.

    Raises
    ------
    InputError : the scenario has no simulation.
    """
    table = scenario.simulation
    if table is None:
        raise InputError("the scenario has no [simulation]; expected one with duration and sample_rate.")
    return draw_samples(
        array, sources_of(table), table.duration, table.sample_rate, table.seed, table.noise_power, table.noise_slope_db
    )
