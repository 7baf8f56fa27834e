"""Contacts of an active sonar: what its detector reported after every ping, one for each echo, some of them false.

What `faintrack.data.bearings` is for a passive detector this is for an active one. The columns are those of
`faintrack.data.returns`, of which contacts are made by clustering; a contact may tell a range in place of a delay, and
need not tell its level. `from_columns` makes them from named columns in the units of files; `faintrack.io.contacts`
reads those.
"""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from faintrack.data.ping_tables import DOPPLER, PLACED, needed_of_platforms, ping_columns, ping_table, taken
from faintrack.data.tables import require_columns
from faintrack.errors import InputError

DISTANCES = {"delay_s": False, "range_m": True}
"""Columns of which a file has one, and whether it is a range."""
LEVEL = "snr_db"
COLUMNS = ("time_s", *DISTANCES, "bearing_deg", LEVEL, DOPPLER, *PLACED)


@dataclass(frozen=True)
class Contacts:
    """Contacts of consecutive pings.

    Attributes
    ----------
    times : of the pings, ascending; seconds.
    ping : number of the ping of every contact, ascending.
    distance : from transmission to arrival, seconds; or from the receiver, metres, where `ranged`.
    ranged : whether distances are ranges.
    bearing : that the echo comes from, at the receiver; radians anticlockwise from +x.
    doppler : shift of the frequency, Hz; None where it is not measured.
    source, receiver : x, y, vx and vy in every ping, metres and m/s; None where they stand still. Where there are
        pairs, of each of them in every ping, not a number where it did not report.
    rows : number of the row that every contact stands in, for messages.
    origin : where the contacts come from, for messages.
    remarks : what was assumed or left out; one sentence each.
    pairs : labels of source and receiver that contacts may belong to, empty where there is no such column; none where
        the contacts name neither.
    pair : number of the pair of every contact.
    reported : whether a pair reported in a ping, if only that it heard nothing.
    """

    times: Float[np.ndarray, " ping"]
    ping: Int[np.ndarray, " contact"]
    distance: Float[np.ndarray, " contact"]
    ranged: bool
    bearing: Float[np.ndarray, " contact"]
    doppler: Float[np.ndarray, " contact"] | None
    source: Float[np.ndarray, "ping *pair 4"] | None
    receiver: Float[np.ndarray, "ping *pair 4"] | None
    rows: Int[np.ndarray, " contact"]
    origin: str
    remarks: tuple[str, ...] = ()
    pairs: tuple[tuple[str, str], ...] = ()
    pair: Int[np.ndarray, " contact"] | None = None
    reported: Bool[np.ndarray, "ping pair"] | None = None

    @property
    def length(self) -> int:
        """Number of pings."""
        return len(self.times)

    @functools.cached_property
    def counts(self) -> Int[np.ndarray, "ping pair"]:
        """Number of contacts of every ping and pair."""
        count = np.zeros((self.length, max(len(self.pairs), 1)), int)
        np.add.at(count, (self.ping, np.zeros(len(self.ping), int) if self.pair is None else self.pair), 1)
        return count

    @property
    def heard(self) -> Bool[np.ndarray, "ping pair"]:
        """Whether a pair reported in a ping; always, where there is one that contacts do not name."""
        return np.ones((self.length, 1), bool) if self.reported is None else self.reported

    def taken(self, which: np.ndarray, **changes: Any) -> "Contacts":
        """Some of the contacts, by a mask or their numbers, with changes of other fields."""
        return taken(self, ("ping", "distance", "bearing", "doppler", "rows", "pair"), which, **changes)


def from_columns(
    columns: Mapping[str, Any], rows: np.ndarray | None = None, origin: str = "contacts in memory"
) -> Contacts:
    """Contacts from columns of numbers, a row a contact.

    Parameters
    ----------
    columns : `time_s`; `delay_s` or `range_m`, the distance from the receiver; `bearing_deg` (clockwise from north);
        where it is measured `doppler_hz`; `snr_db`, which is not read; where they move `source_x_m`, `source_y_m`,
        `source_vx`, `source_vy`, and the same of the `receiver`; where there are several, `source` and `receiver`, the
        name or number of each. Rows of one time are a ping. One without any contact, or in which a pair of a source and
        a receiver has none, is a row whose measured values are not numbers.
    rows : number of every row, for messages; from 0 where not given.
    origin : where the columns come from, for messages.

    Raises
    ------
    InputError : a column is missing or unknown, columns differ in length, or there is no row; times do not ascend; a
        value is missing, not finite, or beyond what it can be; a platform is in two places during a ping.

    Examples
    --------
    >>> contacts = from_columns({
    ...     "time_s": [0.0, 0.0, 60.0], "range_m": [950.0, 1200.0, np.nan], "bearing_deg": [0.0, 90.0, np.nan],
    ... })
    >>> contacts.times.tolist(), contacts.counts.ravel().tolist(), contacts.distance.tolist(), contacts.ranged
    ([0.0, 60.0], [2, 0], [950.0, 1200.0], True)
    """
    require_names(list(columns), origin)
    distance = next(name for name in DISTANCES if name in columns)
    kept = {name: column for name, column in columns.items() if name != LEVEL}
    pings = ping_table(kept, rows, origin, (distance, "bearing_deg", DOPPLER), "contact")
    values, there = pings.read.values, pings.there
    pings.read.refuse(values[distance] < 0, distance, "at least 0")
    level = (f"{LEVEL} of the contacts is not read: whether one is loud does not count.",) if LEVEL in columns else ()
    return Contacts(
        pings.times,
        pings.ping,
        values[distance][there],
        DISTANCES[distance],
        np.radians(90 - values["bearing_deg"][there]),
        values[DOPPLER][there] if DOPPLER in values else None,
        pings.source,
        pings.receiver,
        pings.read.rows[there],
        origin,
        level,
        pings.pairs,
        pings.pair,
        pings.reported,
    )


def to_columns(contacts: Contacts) -> dict[str, np.ndarray]:
    """Columns of contacts in the units of files, the inverse of `from_columns`; bearings from 0 to 360 degrees.

    Examples
    --------
    >>> columns = {"time_s": [0.0, 9.0], "delay_s": [np.nan, 4.5], "bearing_deg": [np.nan, -90.0]}
    >>> to_columns(from_columns(columns))["bearing_deg"].tolist()
    [nan, 270.0]
    """
    measured = {
        "range_m" if contacts.ranged else "delay_s": contacts.distance,
        "bearing_deg": (90 - np.degrees(contacts.bearing)) % 360,
    }
    if contacts.doppler is not None:
        measured[DOPPLER] = contacts.doppler
    return ping_columns(contacts, measured)


def require_names(names: Sequence[str], origin: str) -> None:
    """Refuse names of columns that are not those of contacts, see `faintrack.data.tables.require_columns`."""
    told = [name for name in DISTANCES if name in names]
    if len(told) != 1:
        known = " and ".join(DISTANCES)
        raise InputError(f"{origin}: there is {'both' if told else 'neither'} of {known}; expected one of them.")
    require_columns(names, ("time_s", told[0], "bearing_deg", *needed_of_platforms(names)), COLUMNS, origin)
