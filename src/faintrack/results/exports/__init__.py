"""Files for other programs, one writer a format, all from the schema of results alone.

A writer is a function of a path and a result. What a format cannot say of a result, as a place on earth that nobody
knows, is one sentence; a file is written beside its place and renamed when it is whole.
"""

import os
import tempfile
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from faintrack.errors import InputError

if TYPE_CHECKING:
    from faintrack.results.result import Result


@dataclass(frozen=True)
class Format:
    """A format of files.

    Attributes
    ----------
    suffix : of its files, with the dot.
    title : what it is, in a few words.
    writer : module within `faintrack.results` and the name of the function there, as "exports.earth:write_kml".
    """

    suffix: str
    title: str
    writer: str


FORMATS = {
    "csv": Format(".csv", "table of states", "exports.plain:write_csv"),
    "geojson": Format(".geojson", "GeoJSON lines, cut at 180 degrees", "exports.plain:write_geojson_of"),
    "kml": Format(".kml", "KML tracks and ellipses over time", "exports.earth:write_kml"),
    "czml": Format(".czml", "CZML tracks and ellipses of Cesium", "exports.earth:write_czml"),
    "geoparquet": Format(".parquet", "GeoParquet, a point a scan", "exports.parquet:write_geoparquet"),
    "netcdf": Format(".nc", "NetCDF trajectories by the CF conventions", "exports.trajectories:write_netcdf"),
    "matlab": Format(".mat", "MATLAB structs with the fields of objectTrack", "exports.matlab:write_mat"),
    "audacity": Format(".labels.txt", "labels of Audacity", "exports.sound:write_audacity"),
    "raven": Format(".selections.txt", "selection table of Raven", "exports.sound:write_raven"),
    "napari": Format(".npy", "array of a tracks layer of napari", "exports.images:write_napari"),
    "mot": Format(".mot.txt", "text of MOTChallenge", "exports.images:write_mot"),
}
"""Formats by name."""


def format_named(name: str) -> Format:
    """Format of a name.

    Raises
    ------
    InputError : there is none.
    """
    if name not in FORMATS:
        import difflib

        near = difflib.get_close_matches(name, FORMATS, 1)
        hint = f"; did you mean {near[0]}?" if near else f"; expected one of {', '.join(FORMATS)}."
        raise InputError(f"there is no format {name}{hint}")
    return FORMATS[name]


def format_of(path: str | Path) -> Format:
    """Format that the end of a path tells.

    Raises
    ------
    InputError : it tells none.

    Examples
    --------
    >>> format_of("night.selections.txt").title
    'selection table of Raven'
    """
    name = Path(path).name.lower()
    for one in FORMATS.values():
        if name.endswith(one.suffix):
            return one
    listed = " ".join(one.suffix for one in FORMATS.values())
    raise InputError(f"{path}: the name tells no format; expected one of {listed}, or the format with --to.")


def export(result: "Result", path: str | Path, to: str | None = None) -> Path:
    """Write the tracks of a result for another program; returns the path.

    Parameters
    ----------
    result : whose tracks are written.
    path : of the file; one that is there is replaced.
    to : name of the format in `FORMATS`; as the end of the path tells where None.

    Raises
    ------
    InputError : there is no such format, the result lacks what it needs, or the file cannot be written.
    """
    path = Path(path)
    one = format_of(path) if to is None else format_named(to)
    module, _, function = one.writer.partition(":")
    write = getattr(import_module(f"faintrack.results.{module}"), function)
    if path.exists() and not path.is_file():
        raise InputError(f"{path} cannot be written: it is no file.")
    try:
        with tempfile.TemporaryDirectory(prefix=f".{path.name}.", dir=path.parent) as folder:
            # Some libraries read the format from the end of the name.
            partial = Path(folder) / f"partial{one.suffix}"
            write(partial, result)
            os.replace(partial, path)
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror or error}).") from error
    return path


def require_earth(result: "Result", title: str) -> None:
    """Refuse a result that knows no places on earth."""
    if "latitude" not in result.data:
        raise InputError(
            f"{_source(result)} has no latitude and longitude; {title} needs places on earth, as a region in degrees "
            "gives."
        )


def require_utc(result: "Result", title: str) -> None:
    """Refuse a result that does not know when it was."""
    if not result.data.attrs.get("start_time"):
        raise InputError(f"{_source(result)} does not tell its time in UTC; {title} needs it.")


def _source(result: "Result") -> str:
    return f"the result of {result.data.attrs.get('source', 'data')}"
