"""Returns of an active sonar: the echoes of every ping that stood above a threshold, as they were measured.

What `faintrack.data.recording` is for samples and `faintrack.data.sequence` for frames this is for returns. A few
numbers say all that is kept of a ping, so they are held in memory, forty bytes a return. `from_columns` makes them from
named columns in the units of files; `faintrack.io.returns` reads those.
"""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from faintrack.data.ping_tables import (
    DOPPLER,
    PLACED,
    needed_of_platforms,
    ping_columns,
    ping_table,
    taken,
)
from faintrack.data.tables import require_columns

MEASURED = ("delay_s", "bearing_deg", "snr_db")
COLUMNS = ("time_s", *MEASURED, DOPPLER, *PLACED)

LOUDEST_DB = 100.0
"""Of a return: beyond it single precision adds up the logarithms of a ping no better than to a tenth."""


@dataclass(frozen=True)
class Returns:
    """Returns of consecutive pings.

    Attributes
    ----------
    times : of the pings, ascending; seconds.
    ping : number of the ping of every return, ascending.
    delay : from transmission to arrival; seconds.
    bearing : that the echo comes from, at the receiver; radians anticlockwise from +x.
    power : over the mean power of the noise; linear.
    doppler : shift of the frequency, Hz; None where it is not measured.
    source, receiver : x, y, vx and vy in every ping, metres and m/s; None where they stand still. Where there are
        pairs, of each of them in every ping, not a number where it did not report.
    rows : number of the row that every return stands in, for messages.
    origin : where the returns come from, for messages.
    remarks : what was assumed or left out; one sentence each.
    pairs : labels of source and receiver that returns may belong to, empty where there is no such column; none where
        the returns name neither.
    pair : number of the pair of every return.
    reported : whether a pair reported in a ping, if only that it heard nothing.
    """

    times: Float[np.ndarray, " ping"]
    ping: Int[np.ndarray, " return"]
    delay: Float[np.ndarray, " return"]
    bearing: Float[np.ndarray, " return"]
    power: Float[np.ndarray, " return"]
    doppler: Float[np.ndarray, " return"] | None
    source: Float[np.ndarray, "ping *pair 4"] | None
    receiver: Float[np.ndarray, "ping *pair 4"] | None
    rows: Int[np.ndarray, " return"]
    origin: str
    remarks: tuple[str, ...] = ()
    pairs: tuple[tuple[str, str], ...] = ()
    pair: Int[np.ndarray, " return"] | None = None
    reported: Bool[np.ndarray, "ping pair"] | None = None

    @property
    def length(self) -> int:
        """Number of pings."""
        return len(self.times)

    @functools.cached_property
    def counts(self) -> Int[np.ndarray, " ping"]:
        """Number of returns of every ping."""
        return np.bincount(self.ping, minlength=self.length)

    def of_pair(self, number: int) -> "Returns":
        """Returns of one pair in all pings; platforms of a ping in which it did not report are where they last were."""
        assert self.pair is not None
        assert self.reported is not None
        there = np.flatnonzero(self.reported[:, number])
        last = there[np.maximum(np.searchsorted(there, np.arange(self.length), "right") - 1, 0)]
        return self.taken(
            self.pair == number,
            source=None if self.source is None else self.source[last, number],
            receiver=None if self.receiver is None else self.receiver[last, number],
            pairs=(),
            pair=None,
            reported=None,
        )

    def taken(self, which: np.ndarray, **changes: Any) -> "Returns":
        """Some of the returns, by a mask or their numbers, with changes of other fields."""
        return taken(self, ("ping", "delay", "bearing", "power", "doppler", "rows", "pair"), which, **changes)


def from_columns(
    columns: Mapping[str, Any], rows: np.ndarray | None = None, origin: str = "returns in memory"
) -> Returns:
    """Returns from columns of numbers, a row a return.

    Parameters
    ----------
    columns : `time_s`, `delay_s`, `bearing_deg` (clockwise from north), `snr_db` (power over the mean power of the
        noise); where it is measured `doppler_hz`; where they move `source_x_m`, `source_y_m`, `source_vx`,
        `source_vy`, and the same of the `receiver`; where there are several, `source` and `receiver`, the name or
        number of each. Rows of one time are a ping. One without any return, or in which a pair of a source and a
        receiver has none, is a row whose measured values are not numbers.
    rows : number of every row, for messages; from 0 where not given.
    origin : where the columns come from, for messages.

    Raises
    ------
    InputError : a column is missing or unknown, columns differ in length, or there is no row; times do not ascend; a
        value is missing, not finite, or beyond what it can be; a platform is in two places during a ping.

    Examples
    --------
    >>> returns = from_columns({
    ...     "time_s": [0.0, 0.0, 60.0], "delay_s": [9.5, 12.0, np.nan], "bearing_deg": [0.0, 90.0, np.nan],
    ...     "snr_db": [10.0, 13.0, np.nan],
    ... })
    >>> returns.times.tolist(), returns.counts.tolist(), returns.power.round(1).tolist()
    ([0.0, 60.0], [2, 0], [10.0, 20.0])
    >>> np.degrees(returns.bearing).round(9).tolist()
    [90.0, 0.0]
    """
    require_names(list(columns), origin)
    pings = ping_table(columns, rows, origin, (*MEASURED, DOPPLER), "return")
    values, there = pings.read.values, pings.there
    snr_db = values["snr_db"]
    pings.read.refuse(snr_db > LOUDEST_DB, "snr_db", f"at most {LOUDEST_DB:g} dB")
    return Returns(
        pings.times,
        pings.ping,
        values["delay_s"][there],
        np.radians(90 - values["bearing_deg"][there]),
        10 ** (snr_db[there] / 10),
        values[DOPPLER][there] if DOPPLER in values else None,
        pings.source,
        pings.receiver,
        pings.read.rows[there],
        origin,
        pairs=pings.pairs,
        pair=pings.pair,
        reported=pings.reported,
    )


def together(parts: Mapping[tuple[str, str], Returns]) -> Returns:
    """Returns of several pairs of a source and a receiver, which all report in the same pings.

    Parameters
    ----------
    parts : by the labels of source and receiver; of one without labels that part itself.

    Examples
    --------
    >>> columns = {"time_s": [0.0, 9.0], "delay_s": [4.0, 4.5], "bearing_deg": [0.0, 0.0], "snr_db": [12.0, 10.0]}
    >>> both = together({("", "a"): from_columns(columns), ("", "b"): from_columns(columns)})
    >>> both.counts.tolist(), both.pair.tolist(), both.of_pair(1).delay.tolist()
    ([2, 2], [0, 1, 0, 1], [4.0, 4.5])
    """
    whole = next(iter(parts.values()))
    if list(parts) == [("", "")]:
        return whole
    every = list(parts.values())
    ping = np.concatenate([part.ping for part in every])
    order = np.argsort(ping, kind="stable")
    pair = np.repeat(np.arange(len(every)), [len(part.ping) for part in every])

    def joined(name: str) -> Any:
        return np.concatenate([getattr(part, name) for part in every])[order]

    def placed(name: str) -> Any:
        values = [getattr(part, name) for part in every]
        return None if values[0] is None else np.stack(values, axis=1)

    return replace(
        whole,
        ping=ping[order],
        delay=joined("delay"),
        bearing=joined("bearing"),
        power=joined("power"),
        doppler=None if whole.doppler is None else joined("doppler"),
        source=placed("source"),
        receiver=placed("receiver"),
        rows=np.arange(len(ping)),
        pairs=tuple(parts),
        pair=pair[order],
        reported=np.ones((whole.length, len(every)), bool),
    )


def to_columns(returns: Returns) -> dict[str, np.ndarray]:
    """Columns of returns in the units of files, the inverse of `from_columns`; bearings from 0 to 360 degrees.

    Examples
    --------
    >>> nan = np.nan
    >>> columns = {"time_s": [0.0, 9.0], "delay_s": [nan, 4.5], "bearing_deg": [nan, 270.0], "snr_db": [nan, 10.0]}
    >>> to_columns(from_columns(columns))["bearing_deg"].tolist()
    [nan, 270.0]
    """
    measured = {
        "delay_s": returns.delay,
        "bearing_deg": (90 - np.degrees(returns.bearing)) % 360,
        "snr_db": 10 * np.log10(returns.power),
    }
    if returns.doppler is not None:
        measured[DOPPLER] = returns.doppler
    return ping_columns(returns, measured)


def require_names(names: Sequence[str], origin: str) -> None:
    """Refuse names of columns that are not those of returns, see `faintrack.data.tables.require_columns`."""
    require_columns(names, ("time_s", *MEASURED, *needed_of_platforms(names)), COLUMNS, origin)
