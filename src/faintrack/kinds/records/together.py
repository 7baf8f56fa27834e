"""Data of stations on one time axis: recordings become records, records come in step, arrays stand where they stood."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from faintrack.beliefs.axis import Axis
from faintrack.data.recording import Recording
from faintrack.data.records import InStep, in_step
from faintrack.data.sequence import Sequence
from faintrack.errors import InputError, naming
from faintrack.io.arrays import matched
from faintrack.io.recordings import without_copies
from faintrack.kinds.beamforming import plan_frames
from faintrack.kinds.checks import about_array, about_levels, as_heard
from faintrack.kinds.clean import CleanRecord, CleanRecording
from faintrack.kinds.records.data import Path, Records
from faintrack.kinds.records.read import read_path
from faintrack.kinds.records.sections import RecordsScenario, StationSection, parse_utc
from faintrack.scenario.array import build
from faintrack.sensors.array import SensorArray
from faintrack.signal.beamformer import Beamformer
from faintrack.signal.energies import energies
from faintrack.signal.frames import framed

FRAMES = 32
"""Frames of a recording that are beamformed at once."""


def require_one_each(data: Records, scenario: RecordsScenario) -> None:
    """Refuse more or fewer records than stations.

    Raises
    ------
    InputError : there are.
    """
    stations = scenario.stations
    if len(data.records) != len(stations):
        raise InputError(
            f"there are {len(data.records)} records for {len(stations)} stations "
            f"({', '.join(s.name for s in stations)}); expected one for each."
        )


def cleaned(data: Records) -> tuple[Records, Callable[[], tuple[str, ...]]]:
    """Data with NaN for what is missing, and what tells, at the end, what that was."""
    gates = [
        CleanRecording(without_copies(record)) if isinstance(record, Recording) else CleanRecord(record)
        for record in data.records
    ]
    records = tuple(gate.recording if isinstance(gate, CleanRecording) else gate.record for gate in gates)

    def remarks() -> tuple[str, ...]:
        pairs = zip(data.records, gates, strict=True)
        return tuple(f"{record.source}: {said}" for record, gate in pairs for said in gate.remarks())

    return replace(data, records=records), remarks


def arrays_of(data: Records, scenario: RecordsScenario) -> tuple[dict[str, SensorArray], tuple[str, ...]]:
    """Channels of the stations that are known by them, by name, and what those of recordings cannot tell.

    Raises
    ------
    InputError : a recording whose station has no channels, or others.
    """
    arrays, checks = {}, []
    band = scenario.analysis.band
    for table, record in zip(scenario.stations, data.records, strict=True):
        array, described = data.arrays.get(table.name), table.array
        if array is not None:
            described = None
        elif described is not None:
            array = build(described)
        if isinstance(record, Recording):
            if array is None:
                raise InputError(
                    f"{record.source} is a recording; expected array with the channels of station {table.name}."
                )
            with naming(f"station {table.name}"):
                array, rule = matched(array, record)
            array, straight = as_heard(array, record.sample_rate / 2 if band is None else band[1])
            beamformer = plan_frames(record, array, scenario.analysis)[0]
            said = about_array(array, described, beamformer, record.sample_rate)
            levels = about_levels(CleanRecording(record).recording, array)
            checks += [f"{record.source}: {one}" for one in (*rule, *straight, *said, *levels)]
        if array is not None:
            arrays[table.name] = array
    return arrays, tuple(checks)


def paths_of(data: Records, scenario: RecordsScenario) -> dict[str, Path]:
    """Where the stations that move are, by name.

    Raises
    ------
    InputError : a path cannot be read.
    """
    degrees = scenario.region is not None and scenario.region.degrees
    return {
        table.name: data.paths.get(table.name) or read_path(table.path, degrees, table.is_line)
        for table in scenario.stations
        if table.path is not None
    }


def put_together(data: Records, scenario: RecordsScenario, arrays: Mapping[str, SensorArray]) -> InStep:
    """Records of a scenario's stations on one time axis.

    Parameters
    ----------
    data, scenario : one record, or recording, for each station.
    arrays : of the stations with recordings, by name.

    Raises
    ------
    InputError : what a recording's analysis or `faintrack.data.records.in_step` refuse; a start that is known twice.

    Examples
    --------
    >>> from faintrack.data.sequence import from_frames
    >>> scenario = RecordsScenario(
    ...     stations=[{"name": name, "x": 0.0, "y": 0.0, "heading_deg": 90.0} for name in ("south", "east")],
    ...     region={"x": [0, 1000], "y": [0, 1000], "cell": 50.0, "speed": 3.0},
    ... )
    >>> south = from_frames(np.zeros((9, 181)), axes=(("bearing", Axis(0.0, 1.0, 181)),))
    >>> put_together(Records((south, south)), scenario, {}).length
    9
    """
    records = []
    for table, given in zip(scenario.stations, data.records, strict=True):
        record = beamformed(given, arrays[table.name], scenario) if isinstance(given, Recording) else given
        records.append(_started(record, table))
    return in_step(tuple(records), tuple(table.clock_offset for table in scenario.stations))


def beamformed(recording: Recording, array: SensorArray, scenario: RecordsScenario) -> Sequence:
    """Bearing-time record of a recording; its rows are computed when they are asked for.

    Parameters
    ----------
    recording, array : samples, NaN where they are missing, and the geometry of their channels.
    scenario : whose `analysis` tells band, frame and beams.

    Raises
    ------
    InputError : recording, array, band and frame do not fit together.

    Examples
    --------
    >>> from faintrack.data.recording import from_samples
    >>> from faintrack.sensors.array import line_array
    >>> noise = np.random.default_rng(0).normal(size=(3500, 8))
    >>> scenario = RecordsScenario(stations=[{"name": "line"}])
    >>> record = beamformed(from_samples(noise, 1000.0), line_array(8, 1.0), scenario)
    >>> record.times.tolist(), record.shape, abs(float(record.read(1, 3).mean()) - 1) < 0.1
    ([0.5, 1.5, 2.5], (180,), True)
    """
    plan, length, count = plan_frames(recording, array, scenario.analysis)
    bearing = np.degrees(plan.grid.bearing)
    axis = Axis(float(bearing[0]), float(bearing[1] - bearing[0]), len(bearing))

    def read(start: int, stop: int) -> Float[np.ndarray, "row beam"]:
        rows = [np.empty((0, axis.count), np.float32)]
        for first in range(start, stop, FRAMES):
            number = min(FRAMES, stop - first)
            block = framed(recording, length, first, number)
            missing = FRAMES - number
            samples = np.pad(block.samples, ((0, missing), (0, 0), (0, 0)))
            usable = np.pad(block.usable, ((0, missing), (0, 0)))
            rows.append(np.asarray(_rows(plan, jnp.asarray(samples), jnp.asarray(usable)))[:number])
        return np.concatenate(rows)

    times = (np.arange(count) + 0.5) * length / recording.sample_rate
    return Sequence(read, times, (("bearing", axis),), recording.source, recording.start_time)


def _started(record: Sequence, table: StationSection) -> Sequence:
    """Record with the start that its station tells."""
    if table.start_time is None:
        return record
    if record.start_time is not None:
        raise InputError(f"{record.source} tells its start in UTC; expected no start_time of station {table.name}.")
    return replace(record, start_time=parse_utc(table.start_time))


@eqx.filter_jit
def _rows(plan: Beamformer, samples: Array, usable: Array) -> Float[Array, "frame beam"]:
    """Energies of some frames."""
    return energies(plan.scan(jnp.zeros(len(samples)), samples, usable))
