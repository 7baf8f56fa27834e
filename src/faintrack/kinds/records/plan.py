"""Bearing-time records of several arrays through detectors and trackers, block by block of scans.

What `faintrack.kinds.session` is for one array this is for several. One compiled step serves every block, and the
memory that it takes does not grow with the length of the records. A recording becomes a record first (`beamformed`),
whose rows are computed when they are asked for.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from faintrack.kinds.session import collect, plan_frames
from faintrack.results.stations import scans_dataset
from faintrack.scenario.build_stations import (
    Path,
    build_fans,
    build_placed,
    build_plane,
    build_several,
)
from faintrack.scenario.model import Scenario
from faintrack.scenario.stations import parse_utc
from jaxtyping import Array, Float

from faintrack.beliefs.axis import Axis
from faintrack.data.recording import Recording
from faintrack.data.records import InStep, in_step
from faintrack.data.sequence import Sequence
from faintrack.errors import InputError, naming
from faintrack.results.result import Result
from faintrack.sensors.array import SensorArray
from faintrack.sensors.stations import EnergyScan, Stations
from faintrack.signal.beamformer import Beamformer
from faintrack.signal.energies import energies, standardised
from faintrack.signal.frames import framed
from faintrack.trackers.several import SeveralEstimate, SeveralTargetsTracker

BLOCK_SCANS = 32
"""Scans taken in at once. Records of any length then share one compiled step."""

LARGEST_ENERGY = 1e15
"""Squares of energies are formed in single precision."""


def track_records(
    records: tuple[Sequence, ...],
    scenario: Scenario,
    paths: Mapping[str, Path] | None = None,
    arrays: Mapping[str, SensorArray] | None = None,
) -> Result:
    """Tracks of the targets in the records of several arrays.

    Parameters
    ----------
    records : one for each station of the scenario, in their order; see `faintrack.io.records.read_record` and
        `beamformed`.
    scenario : with tables of the stations and the region; without a region of one station.
    paths : of the stations that move, by name; see `faintrack.io.stations`.
    arrays : of the stations whose records were made of recordings, by name.

    Raises
    ------
    InputError : records, paths and scenario do not fit together.
    """
    return collect(track_record_blocks(records, scenario, paths or {}, arrays or {}), scenario, None)


def track_record_blocks(
    records: tuple[Sequence, ...],
    scenario: Scenario,
    paths: Mapping[str, Path],
    arrays: Mapping[str, SensorArray],
    block_scans: int = BLOCK_SCANS,
) -> Iterator[xr.Dataset]:
    """Yield what is known of consecutive scans, a block at a time; see `track_records`.

    Parameters
    ----------
    records, scenario, paths, arrays : as `track_records`.
    block_scans : scans taken in at once.
    """
    together = put_together(records, scenario)
    plane = build_plane(scenario)
    placed = build_placed(scenario, together, paths, arrays, plane)
    fans = build_fans(scenario, together, arrays, placed)
    with naming(" and ".join(record.source for record in records)):
        tracker = build_several(scenario, fans, placed, plane, together.interval)
    estimated = scenario.energies.absent is None
    # From an interval before the first scan on, so that a target may be there from the beginning; single precision
    # resolves no second in the years since 1970.
    since_start = together.times - together.times[0]
    key = jax.random.key(scenario.filter.seed)
    watching: Any = tracker.init(jax.random.fold_in(key, 2**31 - 1))
    for start in range(0, together.length, block_scans):
        used = min(block_scans, together.length - start)
        # The last block is filled up with its last scan: what is believed after that is not read.
        numbers = np.minimum(np.arange(start, start + block_scans), together.length - 1)
        energy = _checked(together, start, start + used)
        filled = np.concatenate([energy, np.repeat(energy[-1:], block_scans - used, axis=0)])
        scans = (jnp.asarray(since_start[numbers] + together.interval, jnp.float32), jnp.asarray(filled))
        watching, estimates, read = _take_in(tracker, watching, scans, placed.stations(numbers), key, estimated)
        estimates, read = jax.tree.map(lambda values, used=used: np.asarray(values)[:used], (estimates, read))
        part = slice(start, start + used)
        yield scans_dataset(part, estimates, read, scenario, together, placed, fans, tracker.detectors, plane)


def put_together(records: tuple[Sequence, ...], scenario: Scenario) -> InStep:
    """Records of a scenario's stations on one time axis.

    Raises
    ------
    InputError : as many records as stations are expected; see `faintrack.data.records.in_step`.

    Examples
    --------
    >>> from faintrack.data.sequence import from_frames
    >>> scenario = Scenario.model_validate({
    ...     "stations": [{"name": name, "x": 0.0, "y": 0.0, "heading_deg": 90.0} for name in ("south", "east")],
    ...     "region": {"x": [0, 1000], "y": [0, 1000], "cell": 50.0, "speed": 3.0},
    ... })
    >>> beams = (("bearing", Axis(0.0, 1.0, 181)),)
    >>> south = from_frames(np.zeros((9, 181)), axes=beams)
    >>> put_together((south, south), scenario).length
    9
    >>> put_together((south,), scenario)
    Traceback (most recent call last):
        ...
    faintrack.errors.InputError: there are 1 records for 2 stations (south, east); expected one for each.
    """
    stations = scenario.stations or ()
    if len(records) != len(stations):
        raise InputError(
            f"there are {len(records)} records for {len(stations)} stations ({', '.join(s.name for s in stations)}); "
            "expected one for each."
        )
    started = tuple(
        replace(record, start_time=parse_utc(table.start_time)) if table.start_time is not None else record
        for record, table in zip(records, stations, strict=True)
    )
    for record, table in zip(records, stations, strict=True):
        if record.start_time is not None and table.start_time is not None:
            raise InputError(f"{record.source} tells its start in UTC; expected no start_time of station {table.name}.")
    return in_step(started, tuple(table.clock_offset for table in stations))


def beamformed(recording: Recording, array: SensorArray, scenario: Scenario) -> Sequence:
    """Bearing-time record of a recording; its rows are computed when they are asked for.

    Parameters
    ----------
    recording, array : samples, and the geometry of their channels.
    scenario : whose `analysis` tells band, frame and beams.

    Raises
    ------
    InputError : recording, array, band and frame do not fit together.

    Examples
    --------
    >>> from faintrack.data.recording import from_samples
    >>> from faintrack.sensors.array import line_array
    >>> noise = np.random.default_rng(0).normal(size=(3500, 8))
    >>> record = beamformed(from_samples(noise, 1000.0), line_array(8, 1.0), Scenario())
    >>> record.times.tolist(), record.shape, abs(float(record.read(1, 3).mean()) - 1) < 0.1
    ([0.5, 1.5, 2.5], (180,), True)
    """
    plan, length, count = plan_frames(recording, array, scenario)
    bearing = np.degrees(plan.grid.bearing)
    axis = Axis(float(bearing[0]), float(bearing[1] - bearing[0]), len(bearing))

    def read(start: int, stop: int) -> Float[np.ndarray, "row beam"]:
        rows = [np.empty((0, axis.count), np.float32)]
        for first in range(start, stop, BLOCK_SCANS):
            number = min(BLOCK_SCANS, stop - first)
            block = framed(recording, length, first, number)
            missing = BLOCK_SCANS - number
            samples = np.pad(block.samples, ((0, missing), (0, 0), (0, 0)))
            usable = np.pad(block.usable, ((0, missing), (0, 0)))
            rows.append(np.asarray(_rows(plan, jnp.asarray(samples), jnp.asarray(usable)))[:number])
        return np.concatenate(rows)

    times = (np.arange(count) + 0.5) * length / recording.sample_rate
    return Sequence(read, times, (("bearing", axis),), recording.source, recording.start_time)


@eqx.filter_jit
def _rows(plan: Beamformer, samples: Array, usable: Array) -> Float[Array, "frame beam"]:
    """Energies of some frames."""
    return energies(plan.scan(jnp.zeros(len(samples)), samples, usable))


@eqx.filter_jit
def _take_in(
    tracker: SeveralTargetsTracker,
    watching: Any,
    scans: tuple[Array, Array],
    stations: Stations,
    key: Array,
    estimated: bool,
) -> tuple[Any, SeveralEstimate, Float[Array, "scan array beam"]]:
    """Tracker after a block, the estimates, and the energies as the tracker reads them."""
    time, energy = scans
    energy = standardised(energy) if estimated else energy
    usable = ~jnp.isnan(energy)
    watching, estimates = tracker.steps(watching, EnergyScan(time, jnp.where(usable, energy, 0), usable, stations), key)
    return watching, estimates, energy


def _checked(together: InStep, start: int, stop: int) -> Float[np.ndarray, "scan array beam"]:
    """Energies of some scans; refuses what nothing can be told from."""
    energy = together.read(start, stop)
    beyond = np.nanmax(np.abs(energy), axis=(0, 2), initial=0) > LARGEST_ENERGY
    if beyond.any():
        record = together.records[int(np.argmax(beyond))]
        raise InputError(f"{record.source}: energies lie beyond {LARGEST_ENERGY:g}; expected smaller ones.")
    return energy
