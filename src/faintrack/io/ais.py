"""Where ships really were, from AIS: CSV, or the sentences of a receiver (NMEA) through pyais.

A CSV file has a row for every report. The first row names the columns, in any order and case, others are passed over:

====================  ==========================================================
`time`                ISO text in UTC; or `time_s`, seconds on the records' clock
`mmsi`                number of the ship; or `name`
`latitude`            degrees; also `latitude_deg`, `latitude_degrees`, `lat`
`longitude`           degrees; also `longitude_deg`, `longitude_degrees`, `lon`
====================  ==========================================================

or `x_m` and `y_m`, or whatever components a place has, in place of the last two. Files of NMEA sentences (`.nmea`,
`.ais`, `.txt`, `.log`) need the time of each sentence in its tag block, :code:`\\\\c:1452603731*5C\\\\!AIVDM,...`, in
seconds or milliseconds since 1970.
"""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from faintrack.data.ships import Ship
from faintrack.errors import InputError
from faintrack.io.checks import explained, number, require_file, utc
from faintrack.io.text import opened

COLUMNS = {
    "time": ("time",),
    "time_s": ("time_s",),
    "ship": ("mmsi", "name"),
    "latitude": ("latitude", "latitude_deg", "latitude_degrees", "lat"),
    "longitude": ("longitude", "longitude_deg", "longitude_degrees", "lon"),
}
"""Names in files of what a report tells."""

NMEA = (".nmea", ".ais", ".txt", ".log")
NOT_AVAILABLE = 91.0
"""Latitude that stands for none in AIS."""


def read_ships(path: str | Path, components: Sequence[str] = ("x_m", "y_m")) -> list[Ship]:
    """Ships of a file of AIS reports, in the order in which they appear.

    Parameters
    ----------
    path : CSV file, or NMEA sentences, told by suffix; see the module.
    components : columns of a place that is not told in degrees.

    Raises
    ------
    InputError : the file is missing, unknown, damaged or empty, a column is missing, a value is no number or no time;
        sentences have no time, or pyais is not installed.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "ais.csv"
    ...     _ = path.write_text("Time,MMSI,Lat,Lon\\n2016-01-12 13:02:11.5,235,50.77,-1.09\\n")
    ...     (ship,) = read_ships(path)
    >>> ship.name, ship.times.tolist(), ship.places.tolist()
    ('235', [1452603731.5], [[50.77, -1.09]])
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix != ".csv" and suffix not in NMEA:
        raise InputError(f"{path}: unknown kind of file; expected .csv, or {', '.join(NMEA)} for NMEA sentences.")
    require_file(path)
    with explained(f"{path} cannot be read as reports of ships"):
        return _read(path, suffix, components)


def _read(path: Path, suffix: str, components: Sequence[str]) -> list[Ship]:
    reports, in_utc, degrees = _read_csv(path, components) if suffix == ".csv" else (_read_nmea(path), True, True)
    if not reports:
        raise InputError(f"{path}: there is no report of a position.")
    return _ships(reports, in_utc, degrees)


def _ships(reports: Iterable[tuple[Any, ...]], in_utc: bool, degrees: bool) -> list[Ship]:
    """Reports put together by ship, in the order of time; of several at one time the first."""
    by_name: dict[str, list[list[float]]] = {}
    for name, *report in reports:
        by_name.setdefault(name, []).append(report)
    ships = []
    for name, rows in by_name.items():
        values = np.array(rows)
        times, first = np.unique(values[:, 0], return_index=True)
        ships.append(Ship(name, times, in_utc, values[first, 1:], degrees))
    return ships


def _read_csv(path: Path, components: Sequence[str]) -> tuple[list[tuple[Any, ...]], bool, bool]:
    with opened(path) as table:
        names = [name.lower() for name in table.names]
        found = {}
        for what, known in {**COLUMNS, **{name: (name,) for name in components}}.items():
            number_of = next((names.index(name) for name in known if name in names), None)
            if number_of is not None:
                found[what] = number_of
        in_utc, degrees = "time" in found, "latitude" in found
        axes = ("latitude", "longitude") if degrees else tuple(components)
        for what in ("time" if in_utc else "time_s", "ship", *axes):
            if what not in found:
                raise InputError(
                    f"{path}: there is no column {COLUMNS.get(what, (what,))[0]}; expected time, mmsi, latitude and "
                    f"longitude, or time_s, name, {' and '.join(components)}."
                )
        reports = []
        for line, row in table:
            where = f"{path}, row {line}"
            if in_utc:
                moment = utc(row[found["time"]], f"{where}: time")
                time = float((moment - np.datetime64(0, "ns")) / np.timedelta64(1, "ns")) / 1e9
            else:
                time = table.number(row[found["time_s"]], f"row {line}: time_s")
            place = [table.number(row[found[axis]], f"row {line}: {axis}") for axis in axes]
            if degrees and place[0] == NOT_AVAILABLE:
                continue
            for axis, value, most in zip(axes, place, (90, 360), strict=True) if degrees else ():
                if abs(value) > most:
                    raise InputError(f"{where}: {axis} is {value:g}; expected -{most} to {most} degrees.")
            reports.append((row[found["ship"]].strip(), time, *place))
    return reports, in_utc, degrees


def _read_nmea(path: Path) -> list[tuple[Any, ...]]:
    try:
        from pyais.stream import FileReaderStream
    except ImportError as error:
        raise InputError(f'{path} needs pyais, which is not installed: pip install "faintrack[ais]".') from error
    reports = []
    with explained(f"{path} cannot be read as NMEA sentences"):
        for sentence in FileReaderStream(str(path)):
            message: Any = sentence.decode()
            latitude, longitude = (getattr(message, name, None) for name in ("lat", "lon"))
            if latitude is None or longitude is None or latitude >= NOT_AVAILABLE:
                continue
            block: Any = sentence.tag_block
            if block is not None:
                block.init()
            moment = None if block is None else block.receiver_timestamp
            if moment is None:
                raise InputError(f"{path}: sentences have no tag block with a time c:; expected one for each.")
            seconds = number(str(moment), f"{path}: the time of a sentence")
            seconds = seconds / 1000 if seconds > 1e11 else seconds
            reports.append((str(message.mmsi), seconds, float(latitude), float(longitude)))
    return reports
