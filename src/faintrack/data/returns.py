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

from faintrack.data.tables import require_columns, table
from faintrack.errors import InputError

MEASURED = ("delay_s", "bearing_deg", "snr_db")
DOPPLER = "doppler_hz"
PLATFORMS = {name: (f"{name}_x_m", f"{name}_y_m", f"{name}_vx", f"{name}_vy") for name in ("source", "receiver")}
"""Columns of what moves."""
LABELS = tuple(PLATFORMS)
"""Columns that name source and receiver, where there are several."""
COLUMNS = ("time_s", *MEASURED, DOPPLER, *PLATFORMS["source"], *PLATFORMS["receiver"], *LABELS)

MOST_PAIRS = 64
"""Pairs of a source and a receiver at most."""

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
        mine, there = self.pair == number, np.flatnonzero(self.reported[:, number])
        last = there[np.maximum(np.searchsorted(there, np.arange(self.length), "right") - 1, 0)]
        return replace(
            self,
            ping=self.ping[mine],
            delay=self.delay[mine],
            bearing=self.bearing[mine],
            power=self.power[mine],
            doppler=None if self.doppler is None else self.doppler[mine],
            source=None if self.source is None else self.source[last, number],
            receiver=None if self.receiver is None else self.receiver[last, number],
            rows=self.rows[mine],
            pairs=(),
            pair=None,
            reported=None,
        )


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
    numbers = {name: column for name, column in columns.items() if name not in LABELS}
    read = table(numbers, rows, origin, "ping", "return")
    values, rows, refuse, time = read.values, read.rows, read.refuse, read.values["time_s"]
    first = read.first
    ping = np.cumsum(first) - 1
    named = {name: _labels(columns[name], name, len(time), rows, origin) for name in LABELS if name in columns}
    pairs, pair = _pairs(named, len(time), origin)
    _, firsts, group, size = np.unique(
        ping * len(pairs) + pair, return_index=True, return_inverse=True, return_counts=True
    )

    measured = [name for name in (*MEASURED, DOPPLER) if name in values]
    empty = np.all([np.isnan(values[name]) for name in measured], axis=0)
    for name in measured:
        refuse(~np.isfinite(values[name]) & ~empty, name, "a number, or a row with its time alone")
    crowded = empty & (size[group] > 1)
    if crowded.any():
        row = int(np.argmax(crowded))
        raise InputError(
            f"{origin}, row {rows[row]}: a row with its time alone, {time[row]:.10g} s, in a ping of several rows; "
            "expected delay_s and the others in each of them."
        )
    bearing, snr_db = values["bearing_deg"], values["snr_db"]
    refuse((bearing < -180) | (bearing > 360), "bearing_deg", "-180 to 360 degrees, clockwise from north")
    refuse(snr_db > LOUDEST_DB, "snr_db", f"at most {LOUDEST_DB:g} dB")

    of = " of a pair" if named else ""
    platforms: dict[str, np.ndarray | None] = dict.fromkeys(PLATFORMS)
    for platform, names in PLATFORMS.items():
        if names[0] in values:
            placed = np.full((ping[-1] + 1, len(pairs), len(names)), np.nan)
            for number, name in enumerate(names):
                refuse(~np.isfinite(values[name]), name, "a number in every row")
                refuse(values[name] != values[name][firsts][group], name, f"the same in all rows{of} of a ping")
                placed[ping, pair, number] = values[name]
            platforms[platform] = placed if named else placed[:, 0]
    there = ~empty
    reported = np.zeros((ping[-1] + 1, len(pairs)), bool)
    reported[ping, pair] = True
    return Returns(
        time[first],
        ping[there],
        values["delay_s"][there],
        np.radians(90 - bearing[there]),
        10 ** (snr_db[there] / 10),
        values[DOPPLER][there] if DOPPLER in values else None,
        platforms["source"],
        platforms["receiver"],
        rows[there],
        origin,
        pairs=pairs if named else (),
        pair=pair[there] if named else None,
        reported=reported if named else None,
    )


def _labels(column: Any, name: str, count: int, rows: np.ndarray, origin: str) -> np.ndarray:
    """Names or numbers as text.

    Raises
    ------
    InputError : there is none in a row, or the column has another length.
    """
    values = np.asarray(column)
    if values.shape != (count,):
        raise InputError(f"{origin}: {name} has shape {values.shape}; expected ({count},), a row each as time_s.")
    if values.dtype.kind in "biuf":
        text = np.array(["" if np.isnan(value) else f"{value:g}" for value in values.astype(float)], dtype=str)
    else:
        text = np.array([str(value).strip() for value in values], dtype=str)
    if (text == "").any():
        row = rows[int(np.argmax(text == ""))]
        raise InputError(
            f"{origin}, row {row}: {name} is missing; expected the name or number of the {name} in every row."
        )
    return text


def _pairs(
    named: Mapping[str, np.ndarray], count: int, origin: str
) -> tuple[tuple[tuple[str, str], ...], Int[np.ndarray, " row"]]:
    """Pairs of a source and a receiver, in the order of their labels, and that of every row."""
    if not named:
        return (("", ""),), np.zeros(count, int)
    found: list[np.ndarray] = []
    codes: list[np.ndarray] = []
    for name in LABELS:
        labels, code = np.unique(named.get(name, np.full(count, "")), return_inverse=True)
        found.append(labels)
        codes.append(code)
    both, pair = np.unique(codes[0] * len(found[1]) + codes[1], return_inverse=True)
    if len(both) > MOST_PAIRS:
        raise InputError(
            f"{origin}: there are {len(both)} pairs of a source and a receiver; expected at most {MOST_PAIRS}."
        )
    return tuple((str(found[0][each // len(found[1])]), str(found[1][each % len(found[1])])) for each in both), pair


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
    # A ping, or a pair in it, without a return has a row of its own.
    pair = np.zeros(len(returns.ping), int) if returns.pair is None else returns.pair
    reported = np.ones((returns.length, 1), bool) if returns.reported is None else returns.reported
    count = np.zeros(reported.shape, int)
    np.add.at(count, (returns.ping, pair), 1)
    silent = np.argwhere(reported & (count == 0))
    ping = np.concatenate([returns.ping, silent[:, 0]])
    pair = np.concatenate([pair, silent[:, 1]])
    order = np.argsort(ping, kind="stable")
    ping, pair = ping[order], pair[order]

    def spread(values: np.ndarray) -> np.ndarray:
        return np.concatenate([values, np.full(len(silent), np.nan)])[order]

    columns: dict[str, np.ndarray] = {
        "time_s": returns.times[ping],
        "delay_s": spread(returns.delay),
        "bearing_deg": spread((90 - np.degrees(returns.bearing)) % 360),
        "snr_db": spread(10 * np.log10(returns.power)),
    }
    if returns.doppler is not None:
        columns[DOPPLER] = spread(returns.doppler)
    for platform, names in PLATFORMS.items():
        placed = getattr(returns, platform)
        if placed is not None:
            at = placed[ping, pair] if returns.pairs else placed[ping]
            columns |= dict(zip(names, at.T, strict=True))
    for number, name in enumerate(LABELS):
        labels = np.array([labels[number] for labels in returns.pairs], dtype=str)
        if (labels != "").any():
            columns[name] = labels[pair]
    return columns


def require_names(names: Sequence[str], origin: str) -> None:
    """Refuse names of columns that are not those of returns, see `faintrack.data.tables.require_columns`."""
    needed = ["time_s", *MEASURED]
    for platform in PLATFORMS.values():
        needed += platform if any(name in names for name in platform) else ()
    require_columns(names, needed, COLUMNS, origin)
