"""Returns of an active sonar: the echoes of every ping that stood above a threshold, as they were measured.

What `faintrack.data.recording` is for samples and `faintrack.data.sequence` for frames this is for returns. A few
numbers say all that is kept of a ping, so they are held in memory, forty bytes a return. `from_columns` makes them from
named columns in the units of files; `faintrack.io.returns` reads those.
"""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from faintrack.data.tables import require_columns, table
from faintrack.errors import InputError

MEASURED = ("delay_s", "bearing_deg", "snr_db")
DOPPLER = "doppler_hz"
PLATFORMS = {name: (f"{name}_x_m", f"{name}_y_m", f"{name}_vx", f"{name}_vy") for name in ("source", "receiver")}
"""Columns of what moves."""
COLUMNS = ("time_s", *MEASURED, DOPPLER, *PLATFORMS["source"], *PLATFORMS["receiver"])

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
    source, receiver : x, y, vx and vy in every ping, metres and m/s; None where they stand still.
    rows : number of the row that every return stands in, for messages.
    origin : where the returns come from, for messages.
    remarks : what was assumed or left out; one sentence each.
    """

    times: Float[np.ndarray, " ping"]
    ping: Int[np.ndarray, " return"]
    delay: Float[np.ndarray, " return"]
    bearing: Float[np.ndarray, " return"]
    power: Float[np.ndarray, " return"]
    doppler: Float[np.ndarray, " return"] | None
    source: Float[np.ndarray, "ping 4"] | None
    receiver: Float[np.ndarray, "ping 4"] | None
    rows: Int[np.ndarray, " return"]
    origin: str
    remarks: tuple[str, ...] = ()

    @property
    def length(self) -> int:
        """Number of pings."""
        return len(self.times)

    @functools.cached_property
    def counts(self) -> Int[np.ndarray, " ping"]:
        """Number of returns of every ping."""
        return np.bincount(self.ping, minlength=self.length)


def from_columns(
    columns: Mapping[str, Any], rows: np.ndarray | None = None, origin: str = "returns in memory"
) -> Returns:
    """Returns from columns of numbers, a row a return.

    Parameters
    ----------
    columns : `time_s`, `delay_s`, `bearing_deg` (clockwise from north), `snr_db` (power over the mean power of the
        noise); where it is measured `doppler_hz`; where they move `source_x_m`, `source_y_m`, `source_vx`,
        `source_vy`, and the same of the `receiver`. Rows of one time are a ping. One without any return is a row whose
        measured values are not numbers.
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
    read = table(columns, rows, origin, "ping", "return")
    values, rows, refuse, time = read.values, read.rows, read.refuse, read.values["time_s"]
    first = read.first
    ping = np.cumsum(first) - 1

    measured = [name for name in (*MEASURED, DOPPLER) if name in values]
    empty = np.all([np.isnan(values[name]) for name in measured], axis=0)
    for name in measured:
        refuse(~np.isfinite(values[name]) & ~empty, name, "a number, or a row with its time alone")
    crowded = empty & (np.bincount(ping)[ping] > 1)
    if crowded.any():
        row = int(np.argmax(crowded))
        raise InputError(
            f"{origin}, row {rows[row]}: a row with its time alone, {time[row]:.10g} s, in a ping of several rows; "
            "expected delay_s and the others in each of them."
        )
    bearing, snr_db = values["bearing_deg"], values["snr_db"]
    refuse((bearing < -180) | (bearing > 360), "bearing_deg", "-180 to 360 degrees, clockwise from north")
    refuse(snr_db > LOUDEST_DB, "snr_db", f"at most {LOUDEST_DB:g} dB")

    platforms: dict[str, np.ndarray | None] = dict.fromkeys(PLATFORMS)
    for platform, names in PLATFORMS.items():
        if names[0] in values:
            for name in names:
                refuse(~np.isfinite(values[name]), name, "a number in every row")
                held = values[name][first][ping]
                refuse(values[name] != held, name, "the same in all rows of a ping")
            platforms[platform] = np.stack([values[name][first] for name in names], axis=-1)
    there = ~empty
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
    )


def to_columns(returns: Returns) -> dict[str, Float[np.ndarray, " row"]]:
    """Columns of returns in the units of files, the inverse of `from_columns`; bearings from 0 to 360 degrees.

    Examples
    --------
    >>> nan = np.nan
    >>> columns = {"time_s": [0.0, 9.0], "delay_s": [nan, 4.5], "bearing_deg": [nan, 270.0], "snr_db": [nan, 10.0]}
    >>> to_columns(from_columns(columns))["bearing_deg"].tolist()
    [nan, 270.0]
    """
    # A ping without a return has a row of its own.
    ping = np.sort(np.concatenate([returns.ping, np.flatnonzero(returns.counts == 0)]))
    there = returns.counts[ping] > 0

    def spread(values: np.ndarray) -> np.ndarray:
        column = np.full(len(ping), np.nan)
        column[there] = values
        return column

    columns = {
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
            columns |= dict(zip(names, placed[ping].T, strict=True))
    return columns


def require_names(names: Sequence[str], origin: str) -> None:
    """Refuse names of columns that are not those of returns, see `faintrack.data.tables.require_columns`."""
    needed = ["time_s", *MEASURED]
    for platform in PLATFORMS.values():
        needed += platform if any(name in names for name in platform) else ()
    require_columns(names, needed, COLUMNS, origin)
