"""The result folder: what command line, figures and reports share.

.. code-block:: text

    result.zarr      one entry a frame or ping, axes and units in the attributes (xarray)
    tracks.csv       one row a track
    positions.csv    of several arrays: one row a track and scan
    tracks.geojson   of several arrays, where latitude and longitude are known
    scenario.toml    what was run, with the array if there is one; runs again as it is
    versions.json    of the software, and what the run took

It is written under another name beside its place and renamed when it is whole.
"""

import csv
import importlib.metadata
import json
import platform
import shutil
import time as clock
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import xarray as xr
import zarr

from faintrack.errors import InputError
from faintrack.io.tracks import write_geojson, write_positions
from faintrack.results.result import Result, track_fields, tracks_of
from faintrack.results.tracks import BearingTrack, PositionTrack
from faintrack.scenario.array import build, describe
from faintrack.scenario.model import Scenario, read, to_toml
from faintrack.sensors.array import SensorArray

CHUNK = 512
"""Frames written at a time, and in one chunk of the store."""


@contextmanager
def result_folder(path: str | Path) -> Iterator[Path]:
    """Yield a folder to write to; it takes the place of `path` when the block ends, and vanishes when it fails.

    Raises
    ------
    InputError : `path` is something other than an earlier result, or its parent is missing or cannot be written.
    """
    path = Path(path)
    if path.exists() and not (path / "result.zarr").exists() and not (path.is_dir() and not any(path.iterdir())):
        raise InputError(f"{path} exists and is no result of faintrack; expected another name for --out.")
    partial = path.with_name(path.name + ".partial")
    try:
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir()
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror}).") from error
    try:
        yield partial
        if path.exists():
            shutil.rmtree(path)
        partial.rename(path)
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror or error}).") from error
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def make_folder(path: Path) -> None:
    """Make a folder unless it is there.

    Raises
    ------
    InputError : it cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror}).") from error


def write_result(folder: Path, blocks: Iterable[xr.Dataset], scenario: Scenario, array: SensorArray | None) -> Result:
    """Write a result block by block and return it, its data read from the folder as needed.

    Parameters
    ----------
    folder : that exists and is empty.
    blocks : consecutive frames; see `faintrack.kinds.session.track_blocks` and, for those without a time axis, which
    are
        added as they are, `faintrack.kinds.session_frames.track_frame_blocks`.
    scenario, array : what was run; no array for frames, returns and bearings.
    """
    start = clock.perf_counter()
    store = folder / "result.zarr"
    held: list[xr.Dataset] = []
    written = False

    def flush() -> None:
        nonlocal written
        data = xr.concat(held, "time", combine_attrs="override")
        if written:
            data.to_zarr(store, append_dim="time", consolidated=False)
        else:
            encoding = {
                name: {"chunks": (CHUNK, *values.shape[1:])}
                for name, values in data.variables.items()
                if "time" in values.dims
            }
            # Format 2: it has consolidated metadata in its specification, and every reader of Zarr knows it.
            data.to_zarr(store, mode="w", encoding=encoding, consolidated=False, zarr_format=2)
        written = True
        held.clear()

    timeless: list[xr.Dataset] = []
    for block in blocks:
        (held if "time" in block.sizes else timeless).append(block)
        if sum(part.sizes["time"] for part in held) >= CHUNK:
            flush()
    if held:
        flush()
    for block in timeless:
        block.to_zarr(store, mode="a", consolidated=False)
    zarr.consolidate_metadata(store)
    seconds = clock.perf_counter() - start
    described = scenario if array is None else scenario.model_copy(update={"array": describe(array)})
    (folder / "scenario.toml").write_text(to_toml(described))
    (folder / "versions.json").write_text(json.dumps({"seconds": seconds, **versions()}, indent=2) + "\n")
    data = _open(folder)
    tracks = tracks_of(data)
    write_tracks(folder / "tracks.csv", tracks, track_fields(data))
    if "slot" in data.sizes:
        write_positions(folder / "positions.csv", data)
    if "slot" in data.sizes and "latitude" in data:
        write_geojson(folder / "tracks.geojson", data)
    return Result(data, tracks, scenario, array, seconds)


def read_result(folder: str | Path) -> Result:
    """Result of a folder.

    Raises
    ------
    InputError : the folder is missing, or is no whole result.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder; expected the result of faintrack track --out.")
    if not (folder / "result.zarr").exists():
        raise InputError(f"{folder} has no result.zarr; expected the result of faintrack track --out.")
    scenario = read(folder / "scenario.toml")
    if all(getattr(scenario, name) is None for name in ("array", "frames", "sonar", "bearings", "stations")):
        raise InputError(
            f"{folder / 'scenario.toml'} has no [array], [frames], [sonar], [bearings] or [[stations]]; "
            "expected what was used."
        )
    try:
        seconds = float(json.loads((folder / "versions.json").read_text())["seconds"])
        data = _open(folder)
        tracks = tracks_of(data)
    except (OSError, KeyError, ValueError, TypeError, AttributeError) as error:
        raise InputError(f"{folder} is damaged or incomplete ({error}).") from error
    array = None if scenario.array is None else build(scenario.array, folder)
    return Result(data, tracks, scenario, array, seconds)


def write_tracks(path: Path, tracks: list[BearingTrack] | list[PositionTrack], names: list[str]) -> None:
    """Tracks as CSV: a header with the names of what is told of each, a row a track."""
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, names)
        writer.writeheader()
        writer.writerows(track.as_dict() for track in tracks)


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that a result depends on."""
    names = ("faintrack", "jax", "jaxlib", "equinox", "numpy", "scipy", "xarray", "zarr")
    return {"python": platform.python_version(), **{name: importlib.metadata.version(name) for name in names}}


def _open(folder: Path) -> xr.Dataset:
    data = xr.open_zarr(folder / "result.zarr", chunks=None)
    # Of a variable that is gone xarray would read empty values.
    for name in data.variables:
        if not (folder / "result.zarr" / str(name)).exists():
            raise OSError(f"{name} is missing in result.zarr")
    return data
