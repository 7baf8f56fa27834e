"""Recordings drawn from the model: sources in noise, or noise alone."""

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from faintrack.data.recording import Recording
from faintrack.errors import InputError
from faintrack.io.headings import read_headings
from faintrack.kinds.recording.heading import axis_heading
from faintrack.kinds.recording.sections import RecordingScenario, SimulationSection
from faintrack.results.truth import Known
from faintrack.scenario.array import build
from faintrack.sensors.array import SensorArray
from faintrack.simulation.samples import Source, draw_samples


def simulate(scenario: RecordingScenario) -> Recording:
    """Recording that a scenario's `[simulation]` describes; samples are drawn as they are read, in order.

    Raises
    ------
    InputError : the scenario has no simulation or no array, a source ends before it starts, or is to be elevated and
        the array is a line.
    """
    table, array = _simulation(scenario), simulated_array(scenario)
    for number, source in enumerate(table.sources):
        if source.elevation_deg and not array.circular:
            raise InputError(
                f"simulation.sources[{number}].elevation_deg is {source.elevation_deg:g}, and the array is a line, "
                "which hears every wave of a cone about its axis alike; expected its angle from the axis as "
                "bearing_deg, and no elevation."
            )
    return _drawn(array, table, sources_of(table), table.seed, _heading(scenario, array))


def silence(scenario: RecordingScenario, seed: int) -> Recording:
    """The same without a source."""
    return _drawn(simulated_array(scenario), _simulation(scenario), [], seed)


def targets(scenario: RecordingScenario) -> list[Known]:
    """Sources of a simulation, as results tell their bearings."""
    array = simulated_array(scenario)
    heading = _heading(scenario, array)

    def known(number: int, source: Source) -> Known:
        def at(times: np.ndarray) -> dict[str, np.ndarray]:
            ahead = 0.0 if heading is None else heading(times)
            bearing = (np.degrees(source.bearing_at(times) - ahead) + 180) % 360 - 180
            # A line hears a wave as from its mirror image.
            bearing = bearing if array.circular else np.abs(bearing)
            there = (times >= source.start) & (times < source.end)
            tone = {} if source.tone is None else {"frequency": np.where(there, source.tone, np.nan)}
            return {"bearing": np.where(there, bearing, np.nan)} | tone

        return Known(f"source {number}, {source.snr_db:g} dB", at)

    return [known(number, source) for number, source in enumerate(sources_of(_simulation(scenario)), start=1)]


def simulated_array(scenario: RecordingScenario) -> SensorArray:
    """Array of a scenario.

    Raises
    ------
    InputError : the scenario has no array.
    """
    if scenario.array is None:
        raise InputError("the scenario has no [array]; expected one to simulate.")
    return build(scenario.array)


def sources_of(table: SimulationSection) -> list[Source]:
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
        if source.tone is not None and source.tone >= table.sample_rate / 2:
            raise InputError(
                f"simulation.sources[{number}].tone is {source.tone:g} Hz; expected less than half the sample rate, "
                f"{table.sample_rate / 2:g} Hz."
            )
        bearing, rate, elevation = (
            math.radians(value) for value in (source.bearing_deg, source.bearing_rate_deg, source.elevation_deg)
        )
        sources.append(Source(source.snr_db, bearing, rate, source.start, end, elevation, source.tone))
    return sources


def _simulation(scenario: RecordingScenario) -> SimulationSection:
    if scenario.simulation is None:
        raise InputError("the scenario has no [simulation]; expected one with duration and sample_rate.")
    return scenario.simulation


def _heading(scenario: RecordingScenario, array: SensorArray) -> Callable[[Any], Any] | None:
    """Heading at times of an array that turns, of a line that of its axis; radians."""
    if scenario.heading is None:
        return None
    times, degrees = read_headings(scenario.heading)
    axis = axis_heading(array)
    return lambda time: np.radians(np.interp(time, times, degrees)) + axis


def _drawn(
    array: SensorArray,
    table: SimulationSection,
    sources: list[Source],
    seed: int,
    heading: Callable[[Any], Any] | None = None,
) -> Recording:
    """Recording whose samples are drawn when they are read; what was read before is drawn again from the start."""
    blocks: Iterator[np.ndarray] = iter(())
    held, position = np.empty((0, len(array.gains)), np.float32), -1

    def read(start: int, stop: int) -> np.ndarray:
        nonlocal blocks, held, position
        if position < 0 or start < position:
            blocks = draw_samples(
                array,
                sources,
                table.duration,
                table.sample_rate,
                seed,
                table.noise_power,
                table.noise_slope_db,
                heading,
            )
            held, position = held[:0], 0
        while position + len(held) < stop:
            block = next(blocks, None)
            if block is None:
                break
            skipped = max(0, min(start - position, len(held)))
            held, position = np.concatenate([held[skipped:], block]), position + skipped
        return held[start - position : stop - position]

    length = round(table.duration * table.sample_rate)
    return Recording(read, length, table.sample_rate, array.channel_names, source="simulation")
