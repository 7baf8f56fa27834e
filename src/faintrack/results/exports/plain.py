"""The files of the result folder alone: the table of states, and GeoJSON where there is a place on earth."""

from pathlib import Path

from faintrack.results.exports import require_earth
from faintrack.results.result import Result
from faintrack.results.tables import write_geojson, write_states


def write_csv(path: Path, result: Result) -> None:
    """Write the table of states; see `faintrack.results.tables`."""
    write_states(path, result.data)


def write_geojson_of(path: Path, result: Result) -> None:
    """Write GeoJSON; see `faintrack.results.tables`.

    Raises
    ------
    InputError : the result has no place on earth.
    """
    require_earth(result, "GeoJSON")
    write_geojson(path, result.data)
