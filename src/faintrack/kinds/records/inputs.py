"""Inputs of several arrays: which file is whose, recordings as records, and the paths of arrays that move.

A path is a CSV file with the time on the clock of the array's record, where the array is, and perhaps how its axis
lies; between its rows all of them change evenly:

.. code-block:: text

    time_s,x_m,y_m,heading_deg
    0,100,250,90
    600,1700,260,92

`latitude_deg` and `longitude_deg` stand in place of `x_m` and `y_m` where the scenario is in degrees.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from faintrack.kinds.session_stations import beamformed
from faintrack.scenario.model import Scenario
from faintrack.scenario.stations import StationTable

from faintrack.data import sequence
from faintrack.errors import InputError, naming
from faintrack.io.arrays import match_channels
from faintrack.io.columns import read_columns
from faintrack.io.recordings import read
from faintrack.io.records import holds_record, read_record
from faintrack.scenario.array import build
from faintrack.sensors.array import SensorArray

PLACES = {"x_m": ("x_m", "y_m"), "latitude_deg": ("latitude_deg", "longitude_deg")}
"""Columns of a path by the first of them."""


@dataclass(frozen=True)
class Inputs:
    """What is tracked in, as `faintrack.kinds.session_stations.track_records` takes it.

    Attributes
    ----------
    records : one for each station, in their order.
    paths : of the stations that move, by name.
    arrays : of the stations whose records were made of recordings, by name.
    """

    records: tuple[sequence.Sequence, ...]
    paths: dict[str, dict[str, np.ndarray]]
    arrays: dict[str, SensorArray]


def open_stations(files: Sequence[str | Path], scenario: Scenario, folder: str | Path = ".") -> Inputs:
    """Open the records or recordings of a scenario's stations.

    Parameters
    ----------
    files : one for each station. They are in the order of the stations, or the stations name them. Those of a station
        by itself that has channels are put side by side.
    scenario : with stations.
    folder : where the scenario stands; paths and files of positions are relative to it.

    Raises
    ------
    InputError : more or fewer files than stations, files that no station names, and whatever is wrong with one of them.
    """
    stations, folder = scenario.stations or (), Path(folder)
    records, paths, arrays = [], {}, {}
    for table, mine in zip(stations, _in_order([Path(file) for file in files], stations), strict=True):
        file = mine[0]
        if table.path is not None:
            degrees = scenario.region is not None and scenario.region.latitude is not None
            paths[table.name] = read_path(folder / table.path, degrees, table.is_line)
        if holds_record(file):
            if table.array is not None:
                raise InputError(f"{file} is a record; expected a recording for station {table.name}, which has array.")
            records.append(read_record(file, table.beams_deg))
            continue
        if table.array is None:
            raise InputError(
                f"{file} is no record; expected array with the channels of station {table.name}, if it is a recording."
            )
        recording = read(*mine)
        with naming(f"station {table.name}"):
            arrays[table.name] = match_channels(build(table.array, folder), recording)
            records.append(beamformed(recording, arrays[table.name], scenario))
    return Inputs(tuple(records), paths, arrays)


def located(scenario: Scenario, folder: str | Path) -> Scenario:
    """Scenario whose paths are absolute, so that it runs again from any folder.

    Parameters
    ----------
    scenario : with stations.
    folder : that their paths are relative to.

    Examples
    --------
    >>> what = Scenario.model_validate({
    ...     "stations": [{"name": "towed", "path": "towed.csv"}],
    ...     "region": {"x": [0, 1000], "y": [0, 1000], "cell": 50.0, "speed": 3.0},
    ... })
    >>> located(what, "/data").stations[0].path
    '/data/towed.csv'
    """
    found = tuple(
        table if table.path is None else table.model_copy(update={"path": str(Path(folder, table.path).resolve())})
        for table in scenario.stations or ()
    )
    return scenario.model_copy(update={"stations": found})


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

    def require(names: Sequence[str], origin: str) -> None:
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


def _in_order(files: list[Path], stations: tuple[StationTable, ...]) -> list[list[Path]]:
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
