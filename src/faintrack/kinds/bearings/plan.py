"""How sets of bearings become a result: scans with room for them, tracker, and which bearings were the target's.

The belief starts one interval before the first scan, so that a target may be there from the beginning with the
probability of a birth.
"""

from typing import Any

import equinox as eqx
import jax
import numpy as np
import xarray as xr
from jaxtyping import Float

from faintrack.data.bearings import Bearings
from faintrack.errors import naming
from faintrack.kinds.bearings.build import build_sensor, build_tracker, chosen
from faintrack.kinds.bearings.sections import BearingsScenario
from faintrack.kinds.kind import Plan
from faintrack.kinds.loop import begun
from faintrack.kinds.sets import SetsStep
from faintrack.kinds.several import with_targets
from faintrack.results.schema import NORTH, estimated, planar
from faintrack.sensors.several_sets import SeveralSets
from faintrack.signal.bearing_sets import in_sets

BLOCK_SCANS = 64
"""Scans taken in at once. Files of any length then share one compiled step."""

NEAR = 0.1
"""How near a track must be to a known target to be one of it, over the size of where new targets are looked for."""


def plan(bearings: Bearings, scenario: BearingsScenario) -> Plan:
    """How sets of bearings become a result.

    Raises
    ------
    InputError : bearings and scenario do not fit together.
    """
    table = scenario.bearings
    with naming(bearings.origin):
        scans = in_sets(bearings, build_sensor(table), table.capacity)
    length = bearings.length
    since = bearings.times - bearings.times[0]
    interval = float(since[-1] / (length - 1)) if length > 1 else 1.0
    tracker = build_tracker(scenario, interval)
    scans = eqx.tree_at(lambda scans: scans.time, scans, since + interval)
    scans = jax.tree.map(np.asarray, scans)
    attributes = {
        "kind": "bearings",
        "source": bearings.origin,
        "start_time": "",
        "first_scan_time": float(bearings.times[0]),
        "scan_interval": interval,
    }

    def read(start: int, stop: int) -> SeveralSets:
        return jax.tree.map(lambda values: values[start : min(stop, length)], scans)

    def rows(start: int, block: SeveralSets, outputs: tuple[Any, np.ndarray]) -> xr.Dataset:
        estimates, association = outputs
        numbers = slice(start, start + len(association))
        data = estimated(since[numbers], estimates, planar())
        data = data.assign(_of_observers(bearings, numbers, block, association))
        number = {"units": "1", "long_name": "number of the observer"}
        return data.assign_coords(observer=("observer", bearings.observers, number)).assign_attrs(attributes)

    return Plan(
        scenario=with_targets(chosen(scenario), tracker),
        step=SetsStep(tracker),
        state=begun(tracker, scenario.filter.seed),
        read=read,
        rows=rows,
        length=length,
        size=BLOCK_SCANS,
        seed=scenario.filter.seed,
        within=NEAR * max(ends[1] - ends[0] for ends in (table.range, table.x, table.y) if ends is not None),
    )


def _of_observers(
    bearings: Bearings, numbers: slice, block: SeveralSets, association: Float[np.ndarray, "scan observer entry"]
) -> dict[str, Any]:
    """What the observers of some scans reported, whether it was the target's, and where they were."""
    sets, entries = block.sets, ("time", "observer", "entry")
    degrees = np.where(sets.there, (90 - np.degrees(sets.bearing)) % 360, np.nan)
    reported = {"units": "degree", "long_name": "bearings of the scan", "reference": NORTH}
    chance = {"units": "1", "long_name": "probability that the bearing is the target's"}
    variables: dict[str, Any] = {
        "reported": (entries, degrees, reported),
        "association": (entries, np.where(sets.there, association, np.nan), chance),
    }
    for axis, name in enumerate("xy"):
        attributes = {"units": "m", "long_name": f"{name} of the observer"}
        variables[f"observer_{name}"] = (("time", "observer"), bearings.place[numbers, :, axis], attributes)
    return variables
