"""The result folder: what command line, figures and reports share.

.. code-block:: text

    result.zarr      one entry a scan, axes and units in the attributes (xarray); see `faintrack.results.schema`
    states.csv       one row a track and scan
    tracks.csv       one row a track
    tracks.geojson   where there is a place on earth
    scenario.toml    what was run, with what was chosen for the data; runs again as it is
    about.json       versions of the software, what the run took, remarks
    report.html      the same for a person, drawn when all else is in its place

It is written under another name beside its place and renamed when it is whole.
"""

import glob
import importlib.metadata
import json
import os
import platform
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from faintrack.errors import InputError
from faintrack.io.locks import Held, locked
from faintrack.io.stored import require_codecs
from faintrack.results.result import Result
from faintrack.results.tables import write_geojson, write_states, write_tracks
from faintrack.scenario.section import to_toml

CHUNK = 512
"""Scans written at a time, and in one chunk of the store."""

ABOUT = "about.json"

MARK = ".faintrack"
"""File that tells a folder of ours that is not whole from a user's."""

PARTIAL = ".partial"
"""End of the name of a result that is not whole yet."""

OURS = ("result.zarr", "states.csv", "tracks.csv", "tracks.geojson", "scenario.toml", ABOUT, "report.html")
"""What a result consists of."""


@contextmanager
def result_folder(path: str | Path) -> Iterator[Path]:
    """Yield a folder to write to; it takes the place of `path` when the block ends, and vanishes when it fails.

    Of an earlier result only what we write is replaced: what else a user has put there stays. One process at a time
    writes to a path.

    Raises
    ------
    InputError : `path` is a link, or something other than an earlier result; another run writes to it; its parent is
        missing or cannot be written.
    """
    path = require_place(path)
    with ExitStack() as held:
        try:
            held.enter_context(locked(path.with_name(f".{path.name}.lock")))
            _remove_abandoned(path)
            partial = Path(tempfile.mkdtemp(prefix=f".{path.name}.", suffix=PARTIAL, dir=path.parent))
        except Held as error:
            raise InputError(f"{path} is being written by another run; expected another name for --out.") from error
        except OSError as error:
            raise InputError(f"{path} cannot be written ({error.strerror}).") from error
        try:
            (partial / MARK).touch()
            yield partial
            flush_files(partial)
            (partial / MARK).unlink()
            partial.chmod(0o755)
            _put(partial, path)
        except OSError as error:
            raise InputError(f"{path} cannot be written ({error.strerror or error}).") from error
        finally:
            shutil.rmtree(partial, ignore_errors=True)


def require_place(path: Any) -> Path:
    """Place of a result; refuses what is none.

    Raises
    ------
    InputError : as `result_folder`.
    """
    if not isinstance(path, str | Path):
        raise InputError(f"out is a {type(path).__name__}; expected the path of a folder.")
    path = Path(path)
    if path.is_symlink():
        raise InputError(f"{path} is a link; expected the folder itself for --out.")
    if not path.parent.is_dir():
        raise InputError(f"{path} cannot be written: there is no folder {path.parent}.")
    if not os.access(path.parent, os.W_OK):
        raise InputError(f"{path} cannot be written: {path.parent} is read-only.")
    if path.exists() and (not path.is_dir() or not ((path / "result.zarr").exists() or not any(path.iterdir()))):
        raise InputError(f"{path} exists and is no result of faintrack; expected another name for --out.")
    return path


def _remove_abandoned(path: Path) -> None:
    """Remove what an interrupted run to the same path has left; it carries our mark."""
    for abandoned in path.parent.glob(f".{glob.escape(path.name)}.*{PARTIAL}"):
        if (abandoned / MARK).is_file() and not abandoned.is_symlink():
            shutil.rmtree(abandoned, ignore_errors=True)


def replaced(path: Path, write: Callable[[Path], Any]) -> None:
    """Write a file beside its place and rename it when it is on the disk.

    Parameters
    ----------
    path : of the file.
    write : function of the path beside it, that writes it.

    Raises
    ------
    InputError : it cannot be written.
    """
    beside = path.with_name(f".{path.name}{PARTIAL}")
    try:
        write(beside)
        with beside.open("rb+") as file:
            os.fsync(file.fileno())
        beside.replace(path)
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror or error}).") from error
    finally:
        beside.unlink(missing_ok=True)


def flush_files(folder: Path) -> None:
    """Have the system write all files of a folder to the disk."""
    for file in folder.rglob("*"):
        if file.is_file():
            with file.open("rb+") as opened:
                os.fsync(opened.fileno())


def _put(partial: Path, path: Path) -> None:
    """Give a finished folder its name, and what a user has put beside an earlier result to it."""
    if path.exists():
        older = Path(tempfile.mkdtemp(prefix=f".{path.name}.", suffix=".older", dir=path.parent))
        path.replace(older)
        partial.replace(path)
        for entry in older.iterdir():
            if entry.name not in OURS:
                entry.replace(path / entry.name)
        shutil.rmtree(older, ignore_errors=True)
    else:
        partial.replace(path)


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
    attributes: dict[str, Any] = {}

    def flush() -> None:
        nonlocal written
        attributes.update(held[0].attrs)
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
    for block in blocks:
        (held if "time" in block.sizes else timeless).append(block)
        if sum(part.sizes["time"] for part in held) >= CHUNK:
            flush()
    if held:
        flush()
    for block in timeless:
        # Attributes of a store are those that were written last.
        block.assign_attrs(attributes).to_zarr(store, mode="a", consolidated=False)
    zarr.consolidate_metadata(store)


def write_rest(folder: Path, result: Result) -> None:
    """Write scenario, facts of the run and tables beside the data of a result."""
    data = result.data
    (folder / "scenario.toml").write_text(to_toml(result.scenario), encoding="utf-8")
    about = {"kind": result.kind.name, "seconds": result.seconds, "remarks": list(result.remarks)}
    about |= {"misfits": list(result.misfits), **versions()}
    (folder / ABOUT).write_text(json.dumps(about, indent=2) + "\n", encoding="utf-8")
    write_states(folder / "states.csv", data)
    write_tracks(folder / "tracks.csv", data)
    if "latitude" in data:
        write_geojson(folder / "tracks.geojson", data)


def save_result(result: Result, path: str | Path) -> Path:
    """Write a result that is held in memory; see the module. The report is drawn by `Result.save`.

    Raises
    ------
    InputError : as `result_folder`.
    """
    with result_folder(path) as folder:
        write_blocks(folder, _blocks(result.data))
        write_rest(folder, result)
    return Path(path)


def open_blocks(folder: Path) -> xr.Dataset:
    """Data that `write_blocks` wrote, read as they are needed."""
    import zarr

    # Results of strangers run nothing.
    for name, array in zarr.open_group(folder / "result.zarr", mode="r").arrays():
        require_codecs(f"{folder}: {name}", array)
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
            "misfits": tuple(str(misfit) for misfit in about.get("misfits", ())),
        }
        data = open_blocks(folder)
        for name in ("existence", "label", "track_existence", "covariance"):
            np.asarray(data[name].values)
    except InputError:
        raise
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
