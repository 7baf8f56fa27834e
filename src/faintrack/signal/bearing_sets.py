"""Bearings of a file as the stack of scans that a likelihood reads."""

import jax.numpy as jnp
import numpy as np

from faintrack.data.bearings import Bearings
from faintrack.errors import InputError
from faintrack.sensors.bearing_sets import BearingSensor, BearingSet
from faintrack.sensors.several_sets import SeveralSets
from faintrack.targets.states import PlanarState


def in_sets(bearings: Bearings, sensor: BearingSensor, capacity: int) -> SeveralSets:
    """Scans with room for so many bearings of each observer; times are from the first.

    Parameters
    ----------
    bearings : as reported.
    sensor : that reports them.
    capacity : entries of an observer in a scan.

    Raises
    ------
    InputError : more bearings of an observer in a scan than the capacity, or a bearing outside the sector.

    Examples
    --------
    >>> from faintrack.data.bearings import from_columns
    >>> heard = from_columns({
    ...     "time_s": [5.0, 5.0, 6.0], "bearing_deg": [90.0, 0.0, np.nan], "observer_x_m": [0.0, 0.0, 10.0],
    ...     "observer_y_m": [0.0, 0.0, 0.0],
    ... })
    >>> scans = in_sets(heard, BearingSensor(0.02, 0.9, 5.0), capacity=3)
    >>> scans.time.tolist(), scans.sets.there[:, 0].tolist()
    ([0.0, 1.0], [[True, True, False], [False, False, False]])
    """
    shape = bearings.heard.shape
    count = np.zeros(shape, int)
    np.add.at(count, (bearings.scan, bearings.observer), 1)
    if count.max(initial=0) > capacity:
        scan, observer = np.argwhere(count > capacity)[0]
        raise InputError(
            f"the scan with time_s {bearings.times[scan]:.10g} has {count[scan, observer]} bearings of one observer; "
            f"expected at most bearings.capacity, {capacity}."
        )
    # In double precision: a bearing at the very edge of the sector is in it.
    after = (bearings.bearing - sensor.start) % (2 * np.pi)
    wrong = (after > sensor.width + 1e-9) & (after < 2 * np.pi - 1e-9)
    if wrong.any():
        first = int(np.argmax(wrong))
        edges = [(90 - np.degrees(each)) % 360 for each in (sensor.start + sensor.width, sensor.start)]
        raise InputError(
            f"row {bearings.rows[first]}: bearing_deg is {(90 - np.degrees(bearings.bearing[first])) % 360:.6g}; "
            f"expected one of the sector, {edges[0]:g} to {edges[1]:g} degrees clockwise."
        )
    # The number of each bearing within its scan and observer: rows of one stand together once sorted.
    order = np.lexsort((bearings.observer, bearings.scan))
    group = (bearings.scan * shape[1] + bearings.observer)[order]
    starts = np.flatnonzero(np.append(True, np.diff(group) > 0)) if len(group) else np.zeros(0, int)
    entry = np.arange(len(group)) - np.repeat(starts, np.diff(np.append(starts, len(group))))
    values, there = np.zeros((*shape, capacity)), np.zeros((*shape, capacity), bool)
    at = bearings.scan[order], bearings.observer[order], entry
    values[at], there[at] = bearings.bearing[order], True
    since = bearings.times - bearings.times[0]
    place = np.nan_to_num(bearings.place)
    still = np.zeros(shape)
    observer_state = PlanarState(*(jnp.asarray(part, float) for part in (*np.moveaxis(place, 2, 0), still, still)))
    sets = BearingSet(
        jnp.asarray(np.broadcast_to(since[:, None], shape), float),
        jnp.asarray(values, float),
        jnp.asarray(there),
        observer_state,
    )
    return SeveralSets(jnp.asarray(since, float), sets, jnp.asarray(bearings.heard))
