"""Files of several arrays: which is whose, and the paths of arrays that move.

A path is a CSV file with the time on the clock of the array's record, where the array is, and perhaps how its axis
lies; between its rows all of them change evenly:

.. code-block:: text

    time_s,x_m,y_m,heading_deg
    0,100,250,90
    600,1700,260,92

`latitude_deg` and `longitude_deg` stand in place of `x_m` and `y_m` where the scenario is in degrees.
"""

from collections.abc import Sequence as Several
from pathlib import Path

import numpy as np

from faintrack.data.recording import Recording
from faintrack.data.sequence import Sequence
from faintrack.errors import InputError
from faintrack.io.columns import read_columns
from faintrack.io.recordings import read as read_recording
from faintrack.io.records import ENERGY, READERS, TIME, holds_record, read_record
from faintrack.kinds.records.data import Records
from faintrack.kinds.records.sections import RecordsScenario, StationSection

PLACES = {"x_m": ("x_m", "y_m"), "latitude_deg": ("latitude_deg", "longitude_deg")}
"""Columns of a path by the first of them."""


def holds(path: Path) -> bool:
    """Whether a file can be nothing but a record: it has energies with bearings, or columns named by bearings.

    Raises
    ------
    InputError : it is damaged.
    """
    suffix = path.suffix.lower()
    if suffix == ".csv":
        with path.open(encoding="utf-8-sig", errors="replace") as file:
            names = [name.strip() for name in file.readline().split(",")]
        return names[0] == TIME and len(names) > 2 and all(map(_is_number, names[1:]))
    return suffix in READERS and {ENERGY, "time", "bearing"} <= READERS[suffix](path).keys()


def read(files: tuple[Path, ...], scenario: RecordsScenario | None) -> Records:
    """Open the records or recordings of a scenario's stations.

    Parameters
    ----------
    files : one for each station. They are in the order of the stations, or the stations name them. Those of a station
        by itself that has channels are put side by side.
    scenario : with the stations; without it every file is a record.

    Raises
    ------
    InputError : more or fewer files than stations, files that no station names, and whatever is wrong with one of them.
    """
    if scenario is None:
        return Records(tuple(read_record(file) for file in files))
    stations = scenario.stations
    pairs = zip(stations, _in_order(list(files), stations), strict=True)
    return Records(tuple(_read_station(table, mine) for table, mine in pairs))


def _read_station(table: StationSection, files: list[Path]) -> Sequence | Recording:
    """Record or recording of a station."""
    file = files[0]
    if holds_record(file):
        if table.array is not None:
            raise InputError(f"{file} is a record; expected a recording for station {table.name}, which has array.")
        return read_record(file, table.beams_deg)
    if table.array is None:
        raise InputError(
            f"{file} is no record; expected array with the channels of station {table.name}, if it is a recording."
        )
    return read_recording(*files)


def read_path(path: str | Path, degrees: bool = False, heading: bool = False) -> dict[str, np.ndarray]:
    """Where an array moves.

    Parameters
    ----------
    path : CSV file, see the module.
    degrees : whether places are latitudes and longitudes.
    heading : whether the array is a line, whose `heading_deg` may be told.

    Returns
    -------
    Columns by name.

    Raises
    ------
    InputError : the file is missing or damaged, a column is missing or unknown, a value is missing, or times do not
        ascend.
    """
    path = Path(path)
    needed = ("time_s", *PLACES["latitude_deg" if degrees else "x_m"])
    known = (*needed, "heading_deg") if heading else needed

    def require(names: Several[str], origin: str) -> None:
        for name in needed:
            if name not in names:
                raise InputError(f"{origin}: there is no column {name}; expected {', '.join(needed)}.")
        for name in names:
            if name not in known or list(names).count(name) > 1:
                raise InputError(f"{origin}: there is a column {name!r} too many; expected {', '.join(known)}.")

    columns, lines = read_columns(path, require)
    if not len(lines):
        raise InputError(f"{path}: there is no row; expected one or more.")
    for name, values in columns.items():
        if np.isnan(values).any():
            raise InputError(f"{path}, row {lines[np.argmax(np.isnan(values))]}: {name} is missing; expected a number.")
    late = np.flatnonzero(np.diff(columns["time_s"]) <= 0)
    if late.size:
        raise InputError(
            f"{path}, row {lines[late[0] + 1]}: time_s is not after the row before; expected ascending times."
        )
    return columns


def _in_order(files: list[Path], stations: tuple[StationSection, ...]) -> list[list[Path]]:
    """Files of each station, in their order."""
    if files and len(stations) == 1 and stations[0].array is not None and stations[0].file is None:
        return [files]
    if len(files) != len(stations):
        raise InputError(
            f"there are {len(files)} files for {len(stations)} stations ({', '.join(s.name for s in stations)}); "
            "expected one for each."
        )
    if all(table.file is None for table in stations):
        return [[file] for file in files]
    found = []
    for table in stations:
        named = [file for file in files if table.file is not None and file.name == Path(table.file).name]
        if len(named) != 1:
            raise InputError(
                f"station {table.name} has the file {table.file}; expected one of that name among "
                f"{', '.join(map(str, files))}."
            )
        found.append(named)
    return found


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
