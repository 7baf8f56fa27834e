"""Tracks of several targets for other programs: a table of positions, GeoJSON, tracks of Stone Soup.

`positions.csv` has a row for every track and scan, tracks one after the other; of an array by itself it has bearings.
`tracks.geojson` has a line for each track and is written where latitude and longitude are known, as its standard (RFC
7946) knows no metres; the property `coordTimes` tells the time of each of its points.
"""

import csv
import json
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from faintrack.errors import InputError
from faintrack.results.result import Result, tracks_of
from faintrack.results.stations import COMPONENTS, each_target

POSITIONS = ("label", "time_s", "x_m", "y_m", "vx", "vy", "x_std_m", "y_std_m", "xy_covariance_m2", "existence")
BEARINGS = ("label", "time_s", "bearing_deg", "bearing_std_deg", "bearing_rate_deg", "existence")
DEGREES = ("latitude", "longitude")


def write_positions(path: Path, data: xr.Dataset) -> None:
    """Positions of all tracks as CSV, with latitude and longitude where they are known; or their bearings.

    Parameters
    ----------
    path : of the file.
    data : of a result of several arrays, or of one.
    """
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerows(_places(data) if "x" in data else _bearings(data))


def _places(data: xr.Dataset) -> Iterator[list[Any]]:
    """Rows of positions, the names of the columns first."""
    degrees = [name for name in DEGREES if name in data]
    yield [*POSITIONS, *(f"{name}_deg" for name in degrees)]
    for label, mine in each_target(data, *COMPONENTS, "existence", "covariance", *degrees):
        covariance = mine["covariance"]
        std = np.sqrt(covariance[:, (0, 1), (0, 1)])
        columns = [mine["time"], *(mine[name] for name in COMPONENTS), *std.T, covariance[:, 0, 1]]
        columns += [mine["existence"]]
        for row, place in enumerate(zip(*columns, strict=True)):
            where = (f"{mine[name][row]:.7f}" for name in degrees)
            yield [label, *(f"{value:.9g}" for value in place), *where]


def _bearings(data: xr.Dataset) -> Iterator[list[Any]]:
    """Rows of bearings, the names of the columns first."""
    names = ("bearing", "bearing_std", "bearing_rate", "existence")
    yield [*BEARINGS]
    for label, mine in each_target(data, *names):
        for row in zip(mine["time"], *(mine[name] for name in names), strict=True):
            yield [label, *(f"{value:.9g}" for value in row)]


def write_geojson(path: Path, data: xr.Dataset) -> None:
    """Tracks as GeoJSON, a line each; one of a single scan is a point.

    Parameters
    ----------
    path : of the file.
    data : of a result of several arrays, with latitude and longitude.
    """
    features = []
    told = {track.label: track.as_dict() for track in tracks_of(data)}
    start = data.attrs["start_time"]
    for label, mine in each_target(data, *DEGREES):
        points = np.stack([mine["longitude"], mine["latitude"]], axis=-1).round(7).tolist()
        geometry: dict[str, Any] = {"type": "LineString", "coordinates": points}
        if len(points) == 1:
            geometry = {"type": "Point", "coordinates": points[0]}
        times: Any = mine["time"].tolist()
        if start:
            since = np.round(mine["time"] * 1e3).astype("timedelta64[ms]")
            times = [f"{moment}Z" for moment in np.datetime64(start.removesuffix("Z"), "ms") + since]
        properties = {
            **{name: told[label][name] for name in ("label", "start_s", "end_s", "speed", "existence_max")},
            "coordTimes": times,
        }
        features.append({"type": "Feature", "geometry": geometry, "properties": properties})
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}) + "\n")


def to_stonesoup(result: Result) -> list[Any]:
    """Tracks of several targets as tracks of Stone Soup: Gaussian states of (x, vx, y, vy) with their times.

    Parameters
    ----------
    result : of the records of several arrays. Where they do not tell when they start, time 0 is the start of 1970.

    Returns
    -------
    A `stonesoup.types.track.Track` for each, whose `id` is the label.

    Raises
    ------
    InputError : Stone Soup is not installed, or the result is of something else.
    """
    if result.kind != "records" or result.scenario.region is None:
        told = "an array by itself" if result.kind == "records" else result.kind
        raise InputError(f"the result is of {told}; expected one of the records of several arrays.")
    try:
        from stonesoup.types.array import CovarianceMatrix, StateVector
        from stonesoup.types.state import GaussianState
        from stonesoup.types.track import Track
    except ImportError as error:
        raise InputError(
            "tracks of Stone Soup need stonesoup, which is not installed: pip install stonesoup."
        ) from error
    data = result.data
    start = data.attrs["start_time"]
    first = datetime.fromisoformat(start[:26].removesuffix("Z")) if start else datetime.fromtimestamp(0, UTC)
    first = first.replace(tzinfo=None)
    order = [COMPONENTS.index(name) for name in ("x", "vx", "y", "vy")]
    tracks = []
    for label, mine in each_target(data, *COMPONENTS, "covariance"):
        states = [
            GaussianState(
                StateVector([mine[COMPONENTS[number]][row] for number in order]),
                CovarianceMatrix(mine["covariance"][row][np.ix_(order, order)].astype(float)),
                timestamp=first + timedelta(seconds=float(mine["time"][row])),
            )
            for row in range(len(mine["time"]))
        ]
        tracks.append(Track(states, id=str(label)))
    return tracks
