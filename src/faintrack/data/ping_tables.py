"""Tables of what a sonar measured after each ping: rows of one time are a ping, each with the place of what moves.

`faintrack.data.returns` and `faintrack.data.contacts` are made from such tables. Where there are several sources or
receivers, each row names its own; rows of one ping and one pair belong together, and a pair that heard nothing has a
row without measured values.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Bool, Float, Int

from faintrack.data.tables import Table, table
from faintrack.errors import InputError

DOPPLER = "doppler_hz"
PLATFORMS = {name: (f"{name}_x_m", f"{name}_y_m", f"{name}_vx", f"{name}_vy") for name in ("source", "receiver")}
"""Columns of what moves."""
LABELS = tuple(PLATFORMS)
"""Columns that name source and receiver, where there are several."""
PLACED = (*PLATFORMS["source"], *PLATFORMS["receiver"], *LABELS)

MOST_PAIRS = 64
"""Pairs of a source and a receiver at most."""


@dataclass(frozen=True)
class PingTable:
    """Columns of pings, looked at.

    Attributes
    ----------
    read : the columns.
    times : of the pings, ascending; seconds.
    there : rows that hold something measured.
    ping, pair : of every such row; the pair is None where rows name neither source nor receiver.
    pairs : labels of source and receiver.
    source, receiver : x, y, vx and vy in every ping, metres and m/s; of each pair where there are such. None where
        there are no columns of it.
    reported : whether a pair reported in a ping; None where rows name neither.
    """

    read: Table
    times: Float[np.ndarray, " ping"]
    there: Bool[np.ndarray, " row"]
    ping: Int[np.ndarray, " report"]
    pair: Int[np.ndarray, " report"] | None
    pairs: tuple[tuple[str, str], ...]
    source: Float[np.ndarray, "ping *pair 4"] | None
    receiver: Float[np.ndarray, "ping *pair 4"] | None
    reported: Bool[np.ndarray, "ping pair"] | None


def ping_table(
    columns: Mapping[str, Any], rows: np.ndarray | None, origin: str, measured: Sequence[str], each: str
) -> PingTable:
    """Table of columns whose names have been looked at.

    Parameters
    ----------
    columns : by name; those of `LABELS` may hold text.
    rows : number of every row, for messages; from 0 where None.
    origin : where the columns come from, for messages.
    measured : names of the columns that are missing in a row without a report; the first is named in messages.
    each : what a row is, for messages.

    Raises
    ------
    InputError : columns differ in length, or there is no row; times do not ascend; a value is missing or not finite; a
        platform is in two places during a ping.
    """
    numbers = {name: column for name, column in columns.items() if name not in LABELS}
    read = table(numbers, rows, origin, "ping", each)
    values, rows, refuse, time = read.values, read.rows, read.refuse, read.values["time_s"]
    first = read.first
    ping = np.cumsum(first) - 1
    named = {name: _labels(columns[name], name, len(time), rows, origin) for name in LABELS if name in columns}
    pairs, pair = _pairs(named, len(time), origin)
    _, firsts, group, size = np.unique(
        ping * len(pairs) + pair, return_index=True, return_inverse=True, return_counts=True
    )

    present = [name for name in measured if name in values]
    empty = np.all([np.isnan(values[name]) for name in present], axis=0)
    for name in present:
        refuse(~np.isfinite(values[name]) & ~empty, name, "a number, or a row with its time alone")
    crowded = empty & (size[group] > 1)
    if crowded.any():
        row = int(np.argmax(crowded))
        raise InputError(
            f"{origin}, row {rows[row]}: a row with its time alone, {time[row]:.10g} s, in a ping of several rows; "
            f"expected {present[0]} and the others in each of them."
        )
    if "bearing_deg" in values:
        bearing = values["bearing_deg"]
        refuse((bearing < -180) | (bearing > 360), "bearing_deg", "-180 to 360 degrees, clockwise from north")

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
    return PingTable(
        read,
        time[first],
        there,
        ping[there],
        pair[there] if named else None,
        pairs if named else (),
        platforms["source"],
        platforms["receiver"],
        reported if named else None,
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


def ping_columns(data: Any, measured: Mapping[str, Float[np.ndarray, " report"]]) -> dict[str, np.ndarray]:
    """Columns of what was measured, the inverse of `ping_table`; a ping, or a pair in it, without a report has a row.

    Parameters
    ----------
    data : `times`, `ping`, `pairs`, `pair`, `reported` and platforms, as `PingTable` has them.
    measured : values of every report, by the name of their column.
    """
    length = len(data.times)
    pair = np.zeros(len(data.ping), int) if data.pair is None else data.pair
    reported = np.ones((length, 1), bool) if data.reported is None else data.reported
    count = np.zeros(reported.shape, int)
    np.add.at(count, (data.ping, pair), 1)
    silent = np.argwhere(reported & (count == 0))
    ping = np.concatenate([data.ping, silent[:, 0]])
    pair = np.concatenate([pair, silent[:, 1]])
    order = np.argsort(ping, kind="stable")
    ping, pair = ping[order], pair[order]
    columns: dict[str, np.ndarray] = {"time_s": data.times[ping]}
    for name, values in measured.items():
        columns[name] = np.concatenate([values, np.full(len(silent), np.nan)])[order]
    for platform, names in PLATFORMS.items():
        placed = getattr(data, platform)
        if placed is not None:
            at = placed[ping, pair] if data.pairs else placed[ping]
            columns |= dict(zip(names, at.T, strict=True))
    for number, name in enumerate(LABELS):
        labels = np.array([labels[number] for labels in data.pairs], dtype=str)
        if (labels != "").any():
            columns[name] = labels[pair]
    return columns


Data = TypeVar("Data", bound=Any)


def taken(data: Data, names: Sequence[str], which: np.ndarray, **changes: Any) -> Data:
    """Data with some of its reports, in the order that is given.

    Parameters
    ----------
    data : a frozen dataclass.
    names : of its fields that have a value for every report; one that is None stays so.
    which : a mask, or numbers of reports.
    changes : of other fields.
    """
    kept = {name: getattr(data, name) for name in names}
    kept = {name: None if values is None else values[which] for name, values in kept.items()}
    return replace(data, **(kept | changes))


def needed_of_platforms(names: Sequence[str]) -> tuple[str, ...]:
    """Columns of platforms that must be there, since one of each is.

    Examples
    --------
    >>> needed_of_platforms(["time_s", "source_x_m"])
    ('source_x_m', 'source_y_m', 'source_vx', 'source_vy')
    """
    return tuple(
        column for columns in PLATFORMS.values() if any(name in names for name in columns) for column in columns
    )
