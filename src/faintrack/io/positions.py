"""Where channels are, from tables and from what recorders tell: CSV, headers of SAC files, StationXML.

A CSV file has a row for every channel: `name`, and `x_m`, `y_m` and where they differ `z_m` (metres east, north, up),
or `latitude`, `longitude` and `elevation_m`. Seismic files tell latitude, longitude and elevation of every station.
Degrees become metres on a plane that touches the earth in the middle of the array (extra `geo`).

None of them tells a sound speed, and water and air differ by a factor of four: it is asked for.
"""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from faintrack.errors import InputError, naming
from faintrack.io.checks import explained, require_channels, require_file
from faintrack.io.seismic import obspy_module, station_names
from faintrack.io.text import opened
from faintrack.scenario.plane import Plane
from faintrack.sensors.array import SensorArray, sensor_array

NAMES = {
    "name": ("name", "channel", "station"),
    "x": ("x_m", "x"),
    "y": ("y_m", "y"),
    "z": ("z_m", "z", "elevation_m", "elevation"),
    "latitude": ("latitude", "latitude_deg", "lat"),
    "longitude": ("longitude", "longitude_deg", "lon"),
}
"""Names of columns, in any order and case."""

LARGEST = 1e6
"""Metres from the middle of an array to a channel at most."""

_StationPlaces = list[tuple[str, float, float, float]]


def read_positions(*paths: str | Path, sound_speed: float) -> SensorArray:
    """Array of the channels in a CSV file, in StationXML, or in the headers of several SAC files.

    Parameters
    ----------
    paths : one CSV (.csv) or StationXML (.xml) file, or SAC files (.sac), one a channel.
    sound_speed : m/s.

    Raises
    ------
    InputError : a file is missing, unknown or damaged, tells no place, or a place that makes no sense; there are fewer
        than two channels, or names come twice.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "array.csv"
    ...     _ = path.write_text("name;x_m;y_m\\nsouth;0;0\\nnorth;0;2,5\\n")
    ...     array = read_positions(path, sound_speed=1500.0)
    >>> array.channel_names, array.positions[:, 1].tolist()
    (('south', 'north'), [-1.25, 1.25])
    """
    files = [Path(path) for path in paths]
    if not files:
        raise InputError("there is no file to read positions from.")
    suffix = files[0].suffix.lower()
    with explained(f"{files[0]} cannot be read as positions"), naming(files[0]):
        if not (sound_speed > 0 and np.isfinite(sound_speed)):
            raise InputError(f"sound_speed is {sound_speed}; expected m/s above 0.")
        if suffix == ".csv" and len(files) == 1:
            names, places = _table(files[0])
        elif suffix == ".xml" and len(files) == 1:
            names, places = _on_plane(_inventory(files[0]))
        elif all(file.suffix.lower() == ".sac" for file in files):
            names, places = _on_plane([_sac(file) for file in files])
        else:
            raise InputError("unknown kind of file; expected one .csv or .xml, or several .sac.")
        require_channels(len(names), "it")
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise InputError(f"channel {twice[0]} comes twice; expected each once.")
        far = np.abs(places - places.mean(axis=0)).max() if len(places) else 0.0
        if not far <= LARGEST:
            raise InputError(f"a channel is {far:g} m from the middle; expected at most {LARGEST:g} m.")
        return sensor_array(places, float(sound_speed), channel_names=tuple(names))


def _table(path: Path) -> tuple[list[str], np.ndarray]:
    with opened(path) as table:
        own = [name.lower() for name in table.names]
        columns = {what: next((own.index(name) for name in known if name in own), -1) for what, known in NAMES.items()}
        axes = ("latitude", "longitude", "z") if columns["latitude"] >= 0 else ("x", "y", "z")
        if columns["latitude"] >= 0 and columns["x"] >= 0:
            raise InputError("there are columns in metres and in degrees; expected one of both.")
        for what in ("name", *axes[:2]):
            if columns[what] < 0:
                raise InputError(f"there is no column {NAMES[what][0]}; expected name, x_m and y_m, or degrees.")
        names, rows = [], []
        for line, row in table:
            names.append(row[columns["name"]].strip())
            rows.append([
                table.number(row[columns[axis]], f"row {line}: {axis}") if columns[axis] >= 0 else 0.0 for axis in axes
            ])  # fmt: skip
    places = np.array(rows).reshape(-1, 3)
    if axes[0] == "x":
        return names, places
    return _on_plane([(name, *place) for name, place in zip(names, places.tolist(), strict=True)])


def _sac(path: Path) -> tuple[str, float, float, float]:
    require_file(path)
    header = obspy_module("obspy.io.sac", path).SACTrace.read(str(path), headonly=True)
    if header.stla is None or header.stlo is None:
        raise InputError(f"{path} tells no place of its station (STLA, STLO).")
    codes = ".".join((code or "").strip() for code in (header.knetwk, header.kstnm, header.khole, header.kcmpnm))
    return codes, float(header.stla), float(header.stlo), float(header.stel or 0.0)


def _inventory(path: Path) -> _StationPlaces:
    require_file(path)
    found: _StationPlaces = []
    for network in obspy_module("obspy", path).read_inventory(str(path), format="STATIONXML"):
        for station in network:
            channels = station.channels or [station]
            for channel in channels:
                codes = (network.code, station.code, getattr(channel, "location_code", ""), channel.code)
                last = "" if channel is station else codes[3]
                found.append((
                    ".".join((codes[0], codes[1], codes[2] or "", last)),
                    float(channel.latitude), float(channel.longitude), float(channel.elevation or 0.0),
                ))  # fmt: skip
    # A channel has an entry for every time at which something of it changed.
    latest: dict[str, tuple[str, float, float, float]] = {}
    for entry in found:
        if latest.setdefault(entry[0], entry)[1:] != entry[1:]:
            raise InputError(f"channel {entry[0]} has several places; expected one.")
    return list(latest.values())


def _on_plane(stations: Sequence[tuple[str, float, float, float]]) -> tuple[list[str], np.ndarray]:
    """Names as short as tells the channels apart, and places in metres."""
    if not stations:
        raise InputError("there is no station.")
    names = [name for name, *_ in stations]
    short = _short(names)
    degrees = np.array([place for _, *place in stations])
    if not (np.abs(degrees[:, 0]) <= 90).all() or not (np.abs(degrees[:, 1]) <= 360).all():
        raise InputError("a latitude or longitude is beyond the earth; expected degrees.")
    # Longitudes about the first: an array may lie on the date line.
    longitude = degrees[0, 1] + (degrees[:, 1] - degrees[0, 1] + 180) % 360 - 180
    plane = Plane(float(degrees[:, 0].mean()), float(longitude.mean()))
    x, y = plane.metres(degrees[:, 0], longitude)
    return short, np.stack([x, y, degrees[:, 2]], axis=1)


def _short(names: Iterable[str]) -> list[str]:
    names = list(names)
    return list(station_names(names)) if all(name.count(".") == 3 for name in names) else names
