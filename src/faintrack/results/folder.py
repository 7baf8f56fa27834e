"""The result folder: what command line, figures and reports share.

.. code-block:: text

    result.zarr      one entry a scan, axes and units in the attributes (xarray); the schema is in
    `faintrack.results.schema` states.csv       one row a track and scan tracks.csv       one row a track tracks.geojson
    where there is a place on earth scenario.toml    what was run, with what was chosen for the data; runs again as it
    is about.json       versions of the software, what the run took, remarks report.html      the same for a person

It is written under another name beside its place and renamed when it is whole.
"""

import importlib.metadata
import json
import platform
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from faintrack.errors import InputError
from faintrack.results.result import Result
from faintrack.results.tables import write_geojson, write_states, write_tracks
from faintrack.scenario.section import to_toml

CHUNK = 512
"""Scans written at a time, and in one chunk of the store."""

ABOUT = "about.json"


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


def write_blocks(folder: Path, blocks: Iterable[xr.Dataset]) -> None:
    """Write the data of a result block by block.

    Parameters
    ----------
    folder : that exists and holds no result.
    blocks : consecutive scans; those without a time axis are added as they are.
    """
    import zarr

    store = folder / "result.zarr"
    held: list[xr.Dataset] = []
    written = False

    def flush() -> None:
        nonlocal written
        data = xr.concat(
            held, "time", data_vars="minimal", coords="minimal", compat="override", combine_attrs="override"
        )
        if written:
            timeless = [name for name, values in data.variables.items() if "time" not in values.dims]
            data.drop_vars(timeless).to_zarr(store, append_dim="time", consolidated=False)
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
    attributes: dict[Any, Any] = {}
    for block in blocks:
        if "time" in block.sizes:
            attributes = block.attrs
        (held if "time" in block.sizes else timeless).append(block)
        if sum(part.sizes["time"] for part in held) >= CHUNK:
            flush()
    if held:
        flush()
    for block in timeless:
        # What is added brings attributes that take the place of those of the store.
        block.assign_attrs(attributes).to_zarr(store, mode="a", consolidated=False)
    zarr.consolidate_metadata(store)


def write_rest(folder: Path, result: Result) -> None:
    """Write scenario, facts of the run and tables beside the data of a result."""
    data = result.data
    (folder / "scenario.toml").write_text(to_toml(result.scenario), encoding="utf-8")
    about = {"kind": result.kind.name, "seconds": result.seconds, "remarks": list(result.remarks), **versions()}
    (folder / ABOUT).write_text(json.dumps(about, indent=2) + "\n", encoding="utf-8")
    write_states(folder / "states.csv", data)
    write_tracks(folder / "tracks.csv", data)
    if "latitude" in data:
        write_geojson(folder / "tracks.geojson", data)


def save_result(result: Result, path: str | Path) -> Path:
    """Write a result that is held in memory; see the module.

    Raises
    ------
    InputError : as `result_folder`.
    """
    with result_folder(path) as folder:
        write_blocks(folder, _blocks(result.data))
        write_rest(folder, result)
        result.report(folder / "report.html")
    return Path(path)


def open_blocks(folder: Path) -> xr.Dataset:
    """Data that `write_blocks` wrote, read as they are needed."""
    data = xr.open_zarr(folder / "result.zarr", chunks=None)
    # Of a variable that is gone xarray would read empty values.
    for name in data.variables:
        if not (folder / "result.zarr" / str(name)).exists():
            raise OSError(f"{name} is missing in result.zarr")
    return data


def read_folder(folder: str | Path) -> tuple[xr.Dataset, dict[str, Any]]:
    """Data of a result, read as they are needed, and the facts of its run.

    Raises
    ------
    InputError : the folder is missing, or is no whole result.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder; expected the result of faintrack track --out.")
    if not (folder / "result.zarr").exists():
        raise InputError(f"{folder} has no result.zarr; expected the result of faintrack track --out.")
    try:
        about = json.loads((folder / ABOUT).read_text(encoding="utf-8"))
        if not isinstance(about, dict):
            raise ValueError(f"{ABOUT} is no object")
        about = {
            "kind": str(about["kind"]),
            "seconds": float(about["seconds"]),
            "remarks": tuple(str(remark) for remark in about.get("remarks", ())),
        }
        data = open_blocks(folder)
        for name in ("existence", "label", "track_existence", "covariance"):
            np.asarray(data[name].values)
    # The libraries share no class of errors for a damaged store.
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{folder} is damaged or incomplete ({reason[:200]}).") from error
    return data, about


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that a result depends on."""
    names = ("faintrack", "jax", "jaxlib", "equinox", "numpy", "scipy", "xarray", "zarr")
    return {"python": platform.python_version(), **{name: importlib.metadata.version(name) for name in names}}


def _blocks(data: xr.Dataset) -> Iterator[xr.Dataset]:
    """Data in memory as a loop would give them."""
    timed = [name for name, values in data.data_vars.items() if "time" in values.dims]
    yield data[timed].load()
    rest = [name for name in data.data_vars if name not in timed]
    if rest:
        yield data[rest].drop_vars("time", errors="ignore").load()
