"""Contacts of a file as the stack of scans that a likelihood reads."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from faintrack.data.contacts import Contacts
from faintrack.errors import InputError
from faintrack.sensors.bistatic import Bistatic
from faintrack.sensors.contact_sets import ContactSensor, ContactSet
from faintrack.sensors.several_sets import SeveralSets
from faintrack.signal.pings import capacity_of

EDGE = 1e-9
"""Of a turn, or of the largest value: what is read just beyond an edge by rounding lies on it."""


def in_contact_sets(contacts: Contacts, sensor: ContactSensor, pairs: Sequence[Bistatic]) -> SeveralSets:
    """Scans with room for the contacts of the largest ping; times are from the first.

    Parameters
    ----------
    contacts : as reported.
    sensor : that reports them.
    pairs : source and receiver in every ping, components of shape (ping,); one for each of the contacts' pairs.

    Raises
    ------
    InputError : a contact beyond what the sensor reports; a Doppler shift where it measures none, or none where it
        does; a range where it measures delays, or a delay where ranges.

    Examples
    --------
    >>> from faintrack.data.contacts import from_columns
    >>> contacts = from_columns({"time_s": [5.0, 5.0, 6.0], "range_m": [900.0, 500.0, np.nan],
    ...                          "bearing_deg": [90.0, 0.0, np.nan]})
    >>> sensor = ContactSensor((10.0, 0.02), 0.9, 5.0, ((100.0, 9000.0), (-np.pi, np.pi)), ranged=True)
    >>> from faintrack.targets.states import PlanarState
    >>> here = PlanarState(*(jnp.zeros(2),) * 4)
    >>> scans = in_contact_sets(contacts, sensor, [Bistatic(here, here)])
    >>> scans.time.tolist(), scans.sets.there.sum(axis=-1).tolist()
    ([0.0, 1.0], [[2], [0]])
    """
    measured = len(sensor.errors) == 3
    if contacts.ranged != sensor.ranged:
        column, field = ("range_m", "range and range_std") if contacts.ranged else ("delay_s", "delay and delay_std")
        raise InputError(f"there is a column {column}; expected contacts.{field.replace(' and ', ' and contacts.')}.")
    if (contacts.doppler is not None) != measured:
        told = "no column doppler_hz" if measured else "a column doppler_hz"
        raise InputError(f"there is {told}; expected it where contacts.doppler is given, only there.")
    columns = [contacts.distance, contacts.bearing]
    names = ["range_m" if sensor.ranged else "delay_s", "bearing_deg"]
    if contacts.doppler is not None:
        columns.append(contacts.doppler)
        names.append("doppler_hz")
    for number, (name, values, (low, high)) in enumerate(zip(names, columns, sensor.ends, strict=True)):
        if name == "bearing_deg":
            after = (values - low) % (2 * np.pi)
            wrong = (after > sensor.width + EDGE) & (after < 2 * np.pi - EDGE)
            shown, ends = (90 - np.degrees(values)) % 360, [(90 - np.degrees(end)) % 360 for end in (high, low)]
            expected = f"one of the sector, {ends[0]:g} to {ends[1]:g} degrees clockwise"
        else:
            slack = EDGE * max(abs(low), abs(high))
            wrong = (values < low - slack) | (values > high + slack)
            shown, expected = values, f"{low:g} to {high:g}, of contacts.{('range', 'delay')[not sensor.ranged]}"
            expected = expected if number == 0 else f"{low:g} to {high:g}, of contacts.doppler"
        if wrong.any():
            first = int(np.argmax(wrong))
            raise InputError(f"row {contacts.rows[first]}: {name} is {shown[first]:.6g}; expected {expected}.")
    shape = contacts.counts.shape
    capacity = capacity_of(int(contacts.counts.max(initial=0)))
    pair = np.zeros(len(contacts.ping), int) if contacts.pair is None else contacts.pair
    # The number of each contact within its ping and pair: rows of one stand together once sorted.
    order = np.lexsort((pair, contacts.ping))
    group = (contacts.ping * shape[1] + pair)[order]
    starts = np.flatnonzero(np.append(True, np.diff(group) > 0)) if len(group) else np.zeros(0, int)
    entry = np.arange(len(group)) - np.repeat(starts, np.diff(np.append(starts, len(group))))
    held = np.zeros((*shape, capacity, len(columns)))
    there = np.zeros((*shape, capacity), bool)
    at = contacts.ping[order], pair[order], entry
    held[at], there[at] = np.stack(columns, axis=-1)[order], True
    since = contacts.times - contacts.times[0]
    placed = jax.tree.map(lambda *leaves: jnp.stack(leaves, axis=1), *pairs)
    sets = ContactSet(
        jnp.asarray(np.broadcast_to(since[:, None], shape), float),
        jnp.asarray(held, float),
        jnp.asarray(there),
        placed,
    )
    return SeveralSets(jnp.asarray(since, float), sets, jnp.asarray(contacts.heard))
