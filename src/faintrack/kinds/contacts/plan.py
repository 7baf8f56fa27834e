"""How contacts become a result: scans with room for them, tracker, and which contacts were the target's.

The belief starts one interval before the first ping, so that a target may be there from the beginning with the
probability of a birth.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Float

from faintrack.data.contacts import Contacts
from faintrack.errors import naming
from faintrack.kinds.contacts.build import build_pairs, build_sensor, build_tracker, chosen
from faintrack.kinds.contacts.fit import Fit
from faintrack.kinds.contacts.sections import ContactsScenario
from faintrack.kinds.kind import Plan
from faintrack.kinds.loop import begun
from faintrack.kinds.sets import SetsStep
from faintrack.kinds.several import with_targets
from faintrack.results.schema import NORTH, estimated, planar
from faintrack.sensors.contact_sets import BEARING, ContactSensor
from faintrack.sensors.several_sets import SeveralSets
from faintrack.signal.contact_sets import in_contact_sets

BLOCK_PINGS = 32
"""Pings taken in at once. Files of any length then share one compiled step."""

NEAR = 0.05
"""How near a track must be to a known target to be one of it, over the size of the region."""


def plan(contacts: Contacts, scenario: ContactsScenario) -> Plan:
    """How contacts become a result.

    Raises
    ------
    InputError : contacts and scenario do not fit together.
    """
    learnt = scenario.contacts.false_per_ping is None
    scenario = chosen(scenario, contacts)
    table, sensor = scenario.contacts, build_sensor(scenario.contacts)
    with naming(contacts.origin):
        scans = in_contact_sets(contacts, sensor, build_pairs(scenario, contacts))
    length = contacts.length
    since = contacts.times - contacts.times[0]
    interval = float(since[-1] / (length - 1)) if length > 1 else 1.0
    tracker = build_tracker(scenario, interval)
    scans = eqx.tree_at(lambda scans: scans.time, scans, since + interval)
    scans = jax.tree.map(np.asarray, scans)
    names = [" to ".join(label for label in labels if label) for labels in contacts.pairs] or [""]
    fit = Fit(sensor, learnt)
    attributes = {
        "kind": "contacts",
        "source": contacts.origin,
        "start_time": "",
        "first_scan_time": float(contacts.times[0]),
        "scan_interval": interval,
    }

    def read(start: int, stop: int) -> SeveralSets:
        return jax.tree.map(lambda values: values[start : min(stop, length)], scans)

    def rows(start: int, block: SeveralSets, outputs: tuple[Any, np.ndarray]) -> xr.Dataset:
        estimates, association = outputs
        numbers = slice(start, start + len(association))
        fit.add(block, association)
        data = estimated(since[numbers], estimates, planar())
        data = data.assign(_of_pairs(sensor, block, association))
        data.time.attrs["long_name"] = "time from the first ping"
        return data.assign_coords(pair=names).assign_attrs(attributes)

    return Plan(
        scenario=with_targets(scenario, tracker),
        step=SetsStep(tracker),
        state=begun(tracker, scenario.filter.seed),
        read=read,
        rows=rows,
        length=length,
        size=BLOCK_PINGS,
        seed=scenario.filter.seed,
        within=NEAR * max(ends[1] - ends[0] for ends in (table.x, table.y)),
        limits={"x": table.x, "y": table.y},
        remarks=fit.remarks,
        misfits=fit.misfits,
    )


def _of_pairs(
    sensor: ContactSensor, block: SeveralSets, association: Float[np.ndarray, "ping pair entry"]
) -> dict[str, Any]:
    """Contacts of some pings, the places that they tell, whether they were a target's, and where the platforms were."""
    sets, entries = block.sets, ("time", "pair", "entry")
    there = np.asarray(sets.there)
    distance, bearing = (np.asarray(sets.values[..., number], float) for number in (0, BEARING))
    pair: Any = jax.tree.map(lambda leaf: np.asarray(leaf)[..., None], sets.pair)
    if sensor.ranged:
        x, y = pair.receiver.x + distance * np.cos(bearing), pair.receiver.y + distance * np.sin(bearing)
    else:
        x, y = (np.asarray(place) for place in pair.position(jnp.asarray(distance), jnp.asarray(bearing)))
    told = {
        "distance": (
            distance,
            "m" if sensor.ranged else "s",
            f"{'range' if sensor.ranged else 'delay'} of the contact",
        ),
        "contact_x": (x, "m", "x of the place that the contact tells"),
        "contact_y": (y, "m", "y of the place that the contact tells"),
        "association": (association, "1", "probability that the contact is a target's"),
    }
    variables: dict[str, Any] = {
        name: (entries, np.where(there, values, np.nan), {"units": unit, "long_name": long_name})
        for name, (values, unit, long_name) in told.items()
    }
    degrees = np.where(there, (90 - np.degrees(bearing)) % 360, np.nan)
    reported = {"units": "degree", "long_name": "bearing of the contact", "reference": NORTH}
    variables["reported"] = (entries, degrees, reported)
    for platform in ("source", "receiver"):
        for name in ("x", "y"):
            values = np.where(block.heard, getattr(getattr(sets.pair, platform), name), np.nan)
            attributes = {"units": "m", "long_name": f"{name} of the {platform}"}
            variables[f"{platform}_{name}"] = (("time", "pair"), values, attributes)
    return variables
