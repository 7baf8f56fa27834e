"""Named arrays of npz, MAT, Zarr and HDF5 files, not read before they are asked for.

Each reader gives a table from name to `Variable`: shape, type and one function that reads a part. What a part costs
differs with the format:

==================================  =======================================
file                                a part is read
==================================  =======================================
npz written by `numpy.savez`        alone
npz written compressed              out of the whole array, kept in memory
Zarr                                by the chunks that it touches
MAT up to version 7.2               out of the whole array, kept in memory
MAT of version 7.3, which is HDF5   alone, or by the chunks that it touches
HDF5                                alone, or by the chunks that it touches
==================================  =======================================

A chunk that a Zarr folder lacks reads as the array's fill value. One that is cut short is refused, except where Blosc
packed it for version 2 of the format: numcodecs does not compare its length with its header.
"""

import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from faintrack.errors import InputError
from faintrack.io.checks import explained, require_file

Slices = tuple[slice, ...]


@dataclass(frozen=True)
class Variable:
    """An array in a file.

    Attributes
    ----------
    shape : of the array.
    dtype : of its values.
    read : function of one slice an axis, to the values there.
    dims : names of the axes, where the file tells.
    attributes : what else the file tells of it.
    """

    shape: tuple[int, ...]
    dtype: np.dtype
    read: Callable[[Slices], np.ndarray]
    dims: tuple[str, ...] | None = None
    attributes: Mapping[str, Any] = field(default_factory=dict)


def in_memory(values: np.ndarray) -> Variable:
    """Variable of an array that is read already.

    Examples
    --------
    >>> in_memory(np.arange(5)).read((slice(1, 3),)).tolist()
    [1, 2]
    """
    return Variable(values.shape, values.dtype, lambda part: values[part])


def mapped(
    path: Path,
    complaint: str,
    dtype: np.dtype,
    shape: tuple[int, ...],
    offset: int,
    order: Literal["C", "F"] = "C",
    dims: tuple[str, ...] | None = None,
) -> Variable:
    """Variable whose values stand in the file one after the other.

    Parameters
    ----------
    path : of the file.
    complaint : as for `faintrack.io.checks.explained`.
    dtype, shape : of the values, with their byte order.
    offset : of the first value; bytes.
    order : "C" where the last axis runs fastest, "F" where the first does.
    dims : as `Variable.dims`.

    Raises
    ------
    InputError : the file ends before the values do.
    """

    def read(part: Slices) -> np.ndarray:
        with explained(complaint):
            return np.array(np.memmap(path, dtype, "r", offset, shape, order)[part])

    read((slice(0),) * len(shape))
    return Variable(shape, dtype, read, dims)


def open_npz(path: Path) -> dict[str, Variable]:
    """Arrays of an npz file.

    Raises
    ------
    InputError : no such file, or damaged.
    """
    require_file(path)
    complaint = f"{path} cannot be read as npz"
    with explained(complaint), zipfile.ZipFile(path) as archive:
        members = [member for member in archive.infolist() if member.filename.endswith(".npy")]
        return {
            member.filename.removesuffix(".npy"): _npz_variable(path, complaint, archive, member) for member in members
        }


def _npz_variable(path: Path, complaint: str, archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> Variable:
    with archive.open(member) as file:
        header = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
        shape, fortran, dtype = header[np.lib.format.read_magic(file)](file)
        skipped = file.tell()

    def read_whole(part: Slices) -> np.ndarray:
        with explained(complaint), np.load(path) as arrays:
            return arrays[member.filename.removesuffix(".npy")][part]

    if dtype.hasobject or not shape or 0 in shape:
        return Variable(shape, dtype, read_whole)
    if member.compress_type != zipfile.ZIP_STORED:
        return _kept(Variable(shape, dtype, read_whole))
    with path.open("rb") as file:
        # The local header stands before a member: 30 bytes, of which the last 4 tell the lengths of name and extra.
        file.seek(member.header_offset + 26)
        name, extra = np.frombuffer(file.read(4), "<u2").tolist()
    offset = member.header_offset + 30 + name + extra + skipped
    return mapped(path, complaint, dtype, shape, offset, "F" if fortran else "C")


def _kept(variable: Variable) -> Variable:
    """The same, read whole when first asked for and kept."""
    values: list[np.ndarray] = []

    def read(part: Slices) -> np.ndarray:
        if not values:
            values.append(variable.read((slice(None),) * len(variable.shape)))
        return values[0][part]

    return Variable(variable.shape, variable.dtype, read)


def open_zarr(path: Path) -> dict[str, Variable]:
    """Arrays of a Zarr folder: of a group, or one bare array, which is then called `frames`.

    Axes are named by the dimension names of version 3, or by xarray's attribute in version 2.

    Raises
    ------
    InputError : no such folder, or damaged.
    """
    import zarr

    if not path.is_dir():
        raise InputError(f"{path} {'is a file; expected a Zarr folder' if path.exists() else 'does not exist'}.")
    complaint = f"{path} cannot be read as a Zarr folder"
    with explained(complaint):
        store = zarr.open(path, mode="r")
        arrays = [("frames", store)] if isinstance(store, zarr.Array) else store.arrays()
        return {name: _zarr_variable(complaint, array) for name, array in arrays}


def _zarr_variable(complaint: str, array: Any) -> Variable:
    def read(part: Slices) -> np.ndarray:
        with explained(complaint):
            return np.asarray(array[part])

    attributes = array.attrs.asdict()
    dims = getattr(array.metadata, "dimension_names", None) or attributes.get("_ARRAY_DIMENSIONS")
    named = dims is not None and len(dims) == array.ndim and all(dims)
    return Variable(array.shape, np.dtype(array.dtype), read, tuple(dims) if named else None, attributes)


def open_mat(path: Path) -> dict[str, Variable]:
    """Arrays of a MAT file of any version; its rows and columns of numbers become arrays of one axis.

    Raises
    ------
    InputError : no such file, or damaged.
    """
    import h5py
    import scipy.io

    require_file(path)
    complaint = f"{path} cannot be read as MAT"
    with explained(complaint):
        if h5py.is_hdf5(path):
            with h5py.File(path) as file:
                return {name: _hdf5_variable(path, complaint, file[name]) for name in file if name[0] != "#"}
        content = scipy.io.loadmat(path)
    values = {name: value for name, value in content.items() if isinstance(value, np.ndarray) and name[:2] != "__"}
    return {name: in_memory(value.ravel() if _is_vector(value.shape) else value) for name, value in values.items()}


def open_hdf5(path: Path) -> dict[str, Variable]:
    """Arrays at the top of an HDF5 file; axes are named by their scales or labels, where every one has one.

    Raises
    ------
    InputError : no such file, or damaged.
    """
    import h5py

    require_file(path)
    complaint = f"{path} cannot be read as HDF5"

    def variable(dataset: h5py.Dataset) -> Variable:
        name = dataset.name

        def read(part: Slices) -> np.ndarray:
            with explained(complaint), h5py.File(path) as file:
                return np.asarray(file[name][part])

        dims = tuple(dim.label or (dim[0].name.lstrip("/") if len(dim) else "") for dim in dataset.dims)
        return Variable(
            dataset.shape, dataset.dtype, read, dims if dims and all(dims) else None, dict(dataset.attrs.items())
        )

    with explained(complaint), h5py.File(path) as file:
        return {name: variable(item) for name, item in file.items() if isinstance(item, h5py.Dataset)}


def _is_vector(shape: tuple[int, ...]) -> bool:
    return len(shape) == 2 and 1 in shape


def _hdf5_variable(path: Path, complaint: str, dataset: Any) -> Variable:
    import h5py

    name = dataset.name
    if not isinstance(dataset, h5py.Dataset) or dataset.attrs.get("MATLAB_class") == b"char":
        return in_memory(np.empty((), object))
    vector = _is_vector(dataset.shape)

    def read(part: Slices) -> np.ndarray:
        with explained(complaint), h5py.File(path) as file:
            # MATLAB's first index runs fastest, HDF5's last: the file holds the axes in reverse.
            return file[name][()].ravel()[part] if vector else file[name][part[::-1]].T

    dtype = np.dtype(complex) if dataset.dtype.names == ("real", "imag") else dataset.dtype
    return Variable((dataset.size,) if vector else dataset.shape[::-1], dtype, read)
