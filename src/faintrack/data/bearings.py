"""Sets of bearings: what a detector of one or several observers reported, scan by scan, the target's among false ones.

What `faintrack.data.returns` is for an active sonar this is for passive ones. `from_columns` makes them from named
columns in the units of files; `faintrack.io.bearings` reads those. Observers that report at one time are one scan.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from faintrack.data.tables import require_columns, table
from faintrack.errors import InputError

NEEDED = ("time_s", "bearing_deg", "observer_x_m", "observer_y_m")
OBSERVER = "observer"
COLUMNS = (*NEEDED, OBSERVER)

MOST_OBSERVERS = 64
"""Observers of a file at most: every scan has room for all of them."""


@dataclass(frozen=True)
class Bearings:
    """Bearings of consecutive scans.

    Attributes
    ----------
    times : of the scans, ascending; seconds.
    observers : their numbers in the file, ascending.
    heard : whether an observer reported in a scan, if only that it heard nothing.
    place : where it then was: metres east and north; not a number where it did not report.
    scan, observer : that every bearing belongs to, counted from 0.
    bearing : radians anticlockwise from +x.
    rows : number of the row that every bearing stands in, for messages.
    origin : where the bearings come from, for messages.
    remarks : what was assumed or left out; one sentence each.
    """

    times: Float[np.ndarray, " scan"]
    observers: Int[np.ndarray, " observer"]
    heard: Bool[np.ndarray, "scan observer"]
    place: Float[np.ndarray, "scan observer 2"]
    scan: Int[np.ndarray, " bearing"]
    observer: Int[np.ndarray, " bearing"]
    bearing: Float[np.ndarray, " bearing"]
    rows: Int[np.ndarray, " bearing"]
    origin: str
    remarks: tuple[str, ...] = ()

    @property
    def length(self) -> int:
        """Number of scans."""
        return len(self.times)


def from_columns(
    columns: Mapping[str, Any], rows: np.ndarray | None = None, origin: str = "bearings in memory"
) -> Bearings:
    """Bearings from columns of numbers, a row a bearing.

    Parameters
    ----------
    columns : `time_s`; `bearing_deg`, clockwise from north; `observer_x_m` and `observer_y_m`, east and north; where
        there are several observers `observer`, the number of each. Rows of one time are a scan. An observer that heard
        nothing has a row whose bearing is not a number.
    rows : number of every row, for messages; from 0 where not given.
    origin : where the columns come from, for messages.

    Raises
    ------
    InputError : a column is missing or unknown, columns differ in length, or there is no row; times do not ascend; a
        value is missing, not finite, or beyond what it can be; an observer is in two places at one time, or heard
        something and nothing.

    Examples
    --------
    >>> heard = from_columns({
    ...     "time_s": [0.0, 0.0, 1.0], "bearing_deg": [90.0, 0.0, np.nan], "observer_x_m": [0.0, 0.0, 10.0],
    ...     "observer_y_m": [0.0, 0.0, 0.0],
    ... })
    >>> heard.times.tolist(), np.bincount(heard.scan, minlength=2).tolist(), np.degrees(heard.bearing).round(6).tolist()
    ([0.0, 1.0], [2, 0], [0.0, 90.0])
    """
    require_names(list(columns), origin)
    read = table(columns, rows, origin, "scan", "bearing")
    values, rows, refuse, time = read.values, read.rows, read.refuse, read.values["time_s"]
    number = values.get(OBSERVER, np.zeros(len(time)))
    for name in ("observer_x_m", "observer_y_m"):
        refuse(~np.isfinite(values[name]), name, "metres in every row")
    if OBSERVER in values:
        refuse(~((number == np.floor(number)) & (np.abs(number) < 1e9)), OBSERVER, "a whole number in every row")
    bearing = values["bearing_deg"]
    silent = np.isnan(bearing)
    refuse(
        ~silent & ~((bearing >= -180) & (bearing <= 360)), "bearing_deg", "-180 to 360 degrees, clockwise from north"
    )

    scan = np.cumsum(read.first) - 1
    observers, observer = np.unique(number.astype(int), return_inverse=True)
    if len(observers) > MOST_OBSERVERS:
        raise InputError(f"{origin}: there are {len(observers)} observers; expected at most {MOST_OBSERVERS}.")
    _, first, group, size = np.unique(
        scan * len(observers) + observer, return_index=True, return_inverse=True, return_counts=True
    )
    for name in ("observer_x_m", "observer_y_m"):
        refuse(values[name] != values[name][first][group], name, "the same in all rows of an observer and a time")
    refuse(silent & (size[group] > 1), "bearing_deg", "a bearing, where the observer has several rows at that time")

    shape = scan[-1] + 1, len(observers)
    heard, place = np.zeros(shape, bool), np.full((*shape, 2), np.nan)
    heard[scan, observer] = True
    place[scan, observer] = np.stack([values["observer_x_m"], values["observer_y_m"]], axis=-1)
    there = ~silent
    return Bearings(
        time[read.first],
        observers,
        heard,
        place,
        scan[there],
        observer[there],
        np.radians(90 - bearing[there]),
        rows[there],
        origin,
    )


def to_columns(bearings: Bearings) -> dict[str, Float[np.ndarray, " row"]]:
    """Columns of bearings in the units of files, the inverse of `from_columns`; bearings from 0 to 360 degrees.

    Examples
    --------
    >>> columns = {"time_s": [0.0, 9.0], "bearing_deg": [np.nan, 270.0], "observer_x_m": [1.0, 2.0],
    ...            "observer_y_m": [0.0, 0.0]}
    >>> to_columns(from_columns(columns))["bearing_deg"].tolist()
    [nan, 270.0]
    """
    count = np.zeros(bearings.heard.shape, int)
    np.add.at(count, (bearings.scan, bearings.observer), 1)
    silent = np.argwhere(bearings.heard & (count == 0))
    scan = np.concatenate([bearings.scan, silent[:, 0]])
    observer = np.concatenate([bearings.observer, silent[:, 1]])
    degrees = np.concatenate([(90 - np.degrees(bearings.bearing)) % 360, np.full(len(silent), np.nan)])
    order = np.lexsort((observer, scan))
    scan, observer = scan[order], observer[order]
    columns = {
        "time_s": bearings.times[scan],
        "bearing_deg": degrees[order],
        "observer_x_m": bearings.place[scan, observer, 0],
        "observer_y_m": bearings.place[scan, observer, 1],
    }
    if len(bearings.observers) > 1:
        columns[OBSERVER] = bearings.observers[observer].astype(float)
    return columns


def require_names(names: Sequence[str], origin: str) -> None:
    """Refuse names of columns that are not those of bearings, see `faintrack.data.tables.require_columns`."""
    require_columns(names, NEEDED, COLUMNS, origin)
