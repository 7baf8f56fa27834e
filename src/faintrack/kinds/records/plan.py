"""How the records of several arrays become a result: detectors and trackers over scans that the records share.

A recording becomes a record first (`faintrack.kinds.records.together`), whose rows are computed when they are asked
for.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.data.recording import Recording
from faintrack.data.records import InStep
from faintrack.errors import InputError, naming
from faintrack.kinds.kind import Plan
from faintrack.kinds.loop import begun
from faintrack.kinds.records.build import (
    build_fans,
    build_placed,
    build_plane,
    build_region,
    build_several,
    elsewhere,
    particles_of,
    velocity_noise,
)
from faintrack.kinds.records.checks import about_evidence
from faintrack.kinds.records.data import Records
from faintrack.kinds.records.dataset import scans_dataset
from faintrack.kinds.records.sections import RecordsScenario
from faintrack.kinds.records.together import arrays_of, cleaned, paths_of, put_together, require_one_each
from faintrack.scenario.array import describe
from faintrack.sensors.array import SensorArray
from faintrack.sensors.stations import EnergyScan, Fans, Stations
from faintrack.signal.energies import standardised
from faintrack.trackers.several import SeveralEstimate, SeveralTargetsTracker, Watching

BLOCK_SCANS = 32
"""Scans taken in at once. Records of any length then share one compiled step."""

LARGEST_ENERGY = 1e15
"""Squares of energies are formed in single precision."""

WITHIN_CELLS, WITHIN_BEAMS = 3.0, 2.0
"""How near a track must be to a known target to be one of it: cells of a detector, or beams of an array by itself."""

Energies = Float[Array, "*scan array beam"]


class Rows(NamedTuple):
    """What all arrays report in some scans.

    Attributes
    ----------
    time : from one interval before the first scan; seconds.
    energy : of each array and beam.
    stations : where the arrays are.
    """

    time: Any
    energy: Any
    stations: Stations


class RecordsStep(eqx.Module):
    """Energies of all arrays through detectors and trackers.

    Attributes
    ----------
    tracker : what takes them in.
    estimated : whether what a beam without a target reports is estimated from every scan.
    """

    tracker: SeveralTargetsTracker
    estimated: bool = eqx.field(static=True)

    def scans(self, block: Rows) -> tuple[EnergyScan, Energies]:
        """Scans of time, energies and places of the arrays; the energies as the tracker reads them beside."""
        time, energy, stations = block
        energy = standardised(energy) if self.estimated else energy
        usable = ~jnp.isnan(energy)
        return EnergyScan(time, jnp.where(usable, energy, 0), usable, stations), energy

    def advance(
        self, state: Watching, scan: tuple[EnergyScan, Energies], key: PRNGKeyArray
    ) -> tuple[Watching, tuple[SeveralEstimate, Energies]]:
        """As `faintrack.kinds.kind.Step.advance`."""
        watching, estimate = self.tracker.step(state, scan[0], key)
        return watching, (estimate, scan[1])


def plan(data: Records, scenario: RecordsScenario) -> Plan:
    """How records become a result.

    Raises
    ------
    InputError : records, paths, channels and scenario do not fit together.
    """
    require_one_each(data, scenario)
    arrays, checks = arrays_of(data, scenario)
    data, remarks = cleaned(data)
    paths = paths_of(data, scenario)
    together = put_together(data, scenario, arrays)
    plane = build_plane(scenario)
    placed = build_placed(scenario, together, paths, arrays, plane)
    fans = build_fans(scenario, together, arrays, placed)
    with naming(" and ".join(record.source for record in together.records)):
        tracker = build_several(scenario, fans, placed, plane, together.interval)
    # From an interval before the first scan on, so that a target may be there from the beginning.
    times = together.times - together.times[0] + together.interval

    def read(start: int, stop: int) -> Rows:
        part = slice(start, min(stop, together.length))
        return Rows(times[part], _checked(together, part), placed.stations(part))

    def rows(start: int, block: Any, outputs: tuple[SeveralEstimate, np.ndarray]) -> xr.Dataset:
        part = slice(start, start + len(block[0]))
        return scans_dataset(part, *outputs, scenario, together, placed, fans, tracker.detectors, plane)

    return Plan(
        scenario=_chosen(scenario, data, arrays),
        step=RecordsStep(tracker, scenario.energies.absent is None),
        state=begun(tracker, scenario.filter.seed),
        read=read,
        rows=rows,
        length=together.length,
        size=BLOCK_SCANS,
        seed=scenario.filter.seed,
        plane=plane,
        within=_within(scenario, fans),
        checks=(*checks, *_apart(together), *about_evidence(tracker, together.interval)),
        remarks=remarks,
        limits=None if scenario.region is None else dict(zip("xy", build_region(scenario, plane), strict=True)),
    )


def _apart(together: InStep) -> tuple[str, ...]:
    """Rows of records that belong to no scan."""
    said = []
    for record, scans in zip(together.records, together.scans, strict=True):
        rest = int(((scans < 0) | (scans >= together.length)).sum())
        if rest:
            said.append(
                f"{record.source}: {rest} of {record.length} rows lie outside the time that two records share; they "
                "were left out."
            )
    return tuple(said)


def _within(scenario: RecordsScenario, fans: Fans) -> float:
    """How near a track must be to a known target to be one of it."""
    if scenario.region is None:
        return WITHIN_BEAMS * math.degrees(fans.step[0])
    return WITHIN_CELLS * scenario.region.cell


def _chosen(scenario: RecordsScenario, data: Records, arrays: Mapping[str, SensorArray]) -> RecordsScenario:
    """Scenario with what was chosen for the data filled in."""
    stations = tuple(
        table.model_copy(update={"array": describe(arrays[table.name])}) if isinstance(record, Recording) else table
        for table, record in zip(scenario.stations, data.records, strict=True)
    )
    energies = scenario.energies.model_copy(
        update={"present": scenario.energies.levels[1], "elsewhere": elsewhere(scenario)}
    )
    several = scenario.several.model_copy(update={"particles": particles_of(scenario.several)})
    target = scenario.target
    if scenario.region is not None:
        target = target.model_copy(update={"velocity_noise": velocity_noise(scenario)})
    chosen = {"stations": stations, "energies": energies, "several": several, "target": target}
    return scenario.model_copy(update=chosen)


def _checked(together: InStep, part: slice) -> Float[np.ndarray, "scan array beam"]:
    """Energies of some scans; refuses what nothing can be told from."""
    energy = together.read(part.start, part.stop)
    beyond = np.nanmax(np.abs(energy), axis=(0, 2), initial=0) > LARGEST_ENERGY
    if beyond.any():
        record = together.records[int(np.argmax(beyond))]
        raise InputError(f"{record.source}: energies lie beyond {LARGEST_ENERGY:g}; expected smaller ones.")
    return energy
