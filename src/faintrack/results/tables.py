"""Tables and exchange formats of tracks, written from the schema of results alone: CSV, GeoJSON, Stone Soup.

`states.csv` has a row for each track and scan, `tracks.csv` a row for each track. `tracks.geojson` has a line for each
track and is written where there is a place on earth, as its standard (RFC 7946) knows no metres; the property
`coordTimes` tells the time of each scan.
"""

import csv
import json
import math
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from jaxtyping import Float

from faintrack.errors import InputError
from faintrack.results.schema import column, places, units
from faintrack.results.track import DEGREES, Track, tracks_of


def state_columns(data: xr.Dataset) -> list[str]:
    """Names in `states.csv`: time, label, existence, then every component and its deviation, units in the names."""
    names = [column(name, unit) for name, unit in units(data).items()]
    clock = ["time_s", "utc"] if data.attrs.get("start_time") else ["time_s"]
    earth = [f"{name}_deg" for name in DEGREES if name in data]
    return [*clock, "label", "existence", *(f"{name}{end}" for name in names for end in ("", "_std")), *earth]


def state_rows(data: xr.Dataset) -> Iterator[list[Any]]:
    """Rows of `states.csv`, tracks one after the other."""
    for track in tracks_of(data):
        utc, std = track.utc, track.std
        for scan in range(len(track.time)):
            moment = [] if utc is None else [f"{np.datetime_as_string(utc[scan], unit='ms')}Z"]
            state = [float(part[name][scan]) for name in track.mean for part in (track.mean, std)]
            earth = [float(values[scan]) for values in track.earth.values()]
            yield [float(track.time[scan]), *moment, track.label, float(track.existence[scan]), *state, *earth]


def write_states(path: Path, data: xr.Dataset) -> None:
    """Write `states.csv`."""
    _write(path, state_columns(data), ([_text(value) for value in row] for row in state_rows(data)))


def track_columns(data: xr.Dataset) -> list[str]:
    """Names in `tracks.csv`, as `Track.summary` has them."""
    of, place = units(data), places(data)
    columns = ["label", "start_s", "end_s"]
    for name, unit in of.items():
        title = column(name, unit)
        columns += [title, f"{title}_std"]
        columns += [f"{title}_start", f"{title}_end"] if name in place else []
    columns += [f"{name}_deg_{end}" for name in DEGREES if name in data for end in ("start", "end")]
    return [*columns, column("speed", f"{of[place[0]]}/s"), "existence_max"]


def write_tracks(path: Path, data: xr.Dataset) -> None:
    """Write `tracks.csv`."""
    columns = track_columns(data)
    rows = (track.summary() for track in tracks_of(data))
    _write(path, columns, ([_text(row[name]) for name in columns] for row in rows))


def write_geojson(path: Path, data: xr.Dataset) -> None:
    """Write tracks as GeoJSON, a line each; one of a single scan is a point.

    Parameters
    ----------
    path : of the file.
    data : of a result with latitude and longitude.
    """
    features = []
    for track in tracks_of(data):
        points = np.stack([track.earth["longitude"], track.earth["latitude"]], axis=-1)
        geometry = _line(points)
        row = track.summary()
        utc = track.utc
        times = track.time.tolist() if utc is None else [f"{np.datetime_as_string(t, unit='ms')}Z" for t in utc]
        names = [name for name in row if name in ("label", "start_s", "end_s", "existence_max") or name[:5] == "speed"]
        properties = {**{name: row[name] for name in names}, "coordTimes": times}
        features.append({"type": "Feature", "geometry": geometry, "properties": properties})
    text = json.dumps({"type": "FeatureCollection", "features": features})
    path.write_text(text + "\n", encoding="utf-8")


def _line(points: Float[np.ndarray, "point 2"]) -> dict[str, Any]:
    """Geometry of a track; a line that crosses 180 degrees is cut there, as RFC 7946 wants it.

    Examples
    --------
    >>> _line(np.array([[179.0, 1.0], [-179.0, 3.0]]))["coordinates"]
    [[[179.0, 1.0], [180.0, 2.0]], [[-180.0, 2.0], [-179.0, 3.0]]]
    """
    if len(points) == 1:
        return {"type": "Point", "coordinates": points[0].round(7).tolist()}
    lines = [[points[0].tolist()]]
    for before, after in pairwise(points):
        edge = math.copysign(180.0, before[0])
        way = math.remainder(after[0] - before[0], 360)
        if abs(after[0] - before[0]) > 180:
            latitude = before[1] + (edge - before[0]) / way * (after[1] - before[1])
            lines[-1].append([edge, latitude])
            lines.append([[-edge, latitude]])
        lines[-1].append(after.tolist())
    rounded = [np.round(line, 7).tolist() for line in lines]
    if len(rounded) == 1:
        return {"type": "LineString", "coordinates": rounded[0]}
    return {"type": "MultiLineString", "coordinates": rounded}


def to_stonesoup(tracks: Sequence[Track]) -> list[Any]:
    """Tracks as tracks of Stone Soup: Gaussian states with their times.

    Parameters
    ----------
    tracks : of a result. Where it is not known when it starts, time 0 is the start of 1970.

    Returns
    -------
    A `stonesoup.types.track.Track` for each, whose `id` is the label. Components stand with their rates, (x, vx, y,
    vy), as the metadata `components` names them; angles are in radians. `metadatas` hold the `existence` of every scan.

    Raises
    ------
    InputError : Stone Soup is not installed.
    """
    try:
        from stonesoup.types.array import CovarianceMatrix, StateVector
        from stonesoup.types.state import GaussianState
        from stonesoup.types.track import Track as StoneSoupTrack
    except ImportError as error:
        raise InputError(
            'tracks of Stone Soup need stonesoup, which is not installed: pip install "faintrack[stonesoup]".'
        ) from error
    made = []
    for track in tracks:
        names = list(track.mean)
        order = track.with_rates
        index = [names.index(name) for name in order]
        scale = np.array([np.radians(1.0) if track.units[name].startswith("degree") else 1.0 for name in order])
        start = np.datetime64(0, "us") if track.start_time is None else track.start_time.astype("datetime64[us]")
        first = datetime.fromtimestamp(0, UTC).replace(tzinfo=None) + (start - np.datetime64(0, "us")).astype(timedelta)
        states = [
            GaussianState(
                StateVector([float(track.mean[name][scan]) for name in order] * scale),
                CovarianceMatrix(track.covariance[scan][np.ix_(index, index)].astype(float) * np.outer(scale, scale)),
                timestamp=first + timedelta(seconds=float(track.time[scan])),
            )
            for scan in range(len(track.time))
        ]
        made.append(StoneSoupTrack(states, id=str(track.label), init_metadata={"components": tuple(order)}))
        for metadata, existence in zip(made[-1].metadatas, track.existence, strict=True):
            metadata["existence"] = float(existence)
    return made


def _text(value: Any) -> Any:
    """A number as a table holds it: as many digits as single precision has and places on earth need."""
    return f"{value:.10g}" if isinstance(value, float) else value


def _write(path: Path, columns: list[str], rows: Iterator[list[Any]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(rows)
