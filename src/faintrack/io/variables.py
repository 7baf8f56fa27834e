"""Named arrays of npz, npy, MAT, Zarr and HDF5 files, not read before they are asked for.

Each reader gives a table from name to `Variable`: shape, type and one function that reads a part. What a part costs
differs with the format:

==================================  =======================================
file                                a part is read
==================================  =======================================
npy; npz written by `numpy.savez`   alone
npz written compressed              out of the whole array, kept in memory
Zarr                                by the chunks that it touches
MAT up to version 7.2               alone; compressed: out of the array, kept
MAT of version 7.3, which is HDF5   alone, or by the chunks that it touches
HDF5                                alone, or by the chunks that it touches
==================================  =======================================

What HDF5 and Zarr do not hold is NaN, see `faintrack.io.stored`. A chunk of Zarr that is cut short is refused.
"""

import math
import struct
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from faintrack.errors import InputError
from faintrack.io import limits
from faintrack.io.checks import explained, reader, require_file, require_folder, require_room
from faintrack.io.stored import Slices, attributes_of, hdf5_values, zarr_values

__all__ = ["Slices", "Variable", "in_memory", "mapped", "open_hdf5", "open_mat", "open_npy", "open_npz", "open_zarr"]


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
    remarks : what was assumed or left out; one sentence each.
    """

    shape: tuple[int, ...]
    dtype: np.dtype
    read: Callable[[Slices], np.ndarray]
    dims: tuple[str, ...] | None = None
    attributes: Mapping[str, Any] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()


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

    size = path.stat().st_size
    if offset + math.prod(shape) * dtype.itemsize > size:
        raise InputError(
            f"{complaint} (an array of {math.prod(shape) * dtype.itemsize} bytes from byte {offset} on, in a file of "
            f"{size} bytes)."
        )
    read((slice(0),) * len(shape))
    return Variable(shape, dtype, read, dims)


@reader("npy")
def open_npy(path: Path) -> dict[str, Variable]:
    """The one array of an npy file, which is called `frames`.

    Raises
    ------
    InputError : no such file, or damaged.
    """
    require_file(path)
    with path.open("rb") as file:
        shape, fortran, dtype = _header(file)
        offset = file.tell()
    if dtype.hasobject or 0 in shape:
        return {"frames": in_memory(np.empty((0,) * len(shape), dtype))}
    return {"frames": mapped(path, f"{path} cannot be read as npy", dtype, shape, offset, "F" if fortran else "C")}


@reader("npz")
def open_npz(path: Path) -> dict[str, Variable]:
    """Arrays of an npz file.

    Raises
    ------
    InputError : no such file, or damaged.
    """
    require_file(path)
    with zipfile.ZipFile(path) as archive:
        members = [member for member in archive.infolist() if member.filename.endswith(".npy")]
        if len(members) > limits.MOST_NAMES:
            raise InputError(f"{path} holds {len(members)} arrays; expected at most {limits.MOST_NAMES}.")
        return {member.filename.removesuffix(".npy"): _npz_variable(path, archive, member) for member in members}


def _header(file: Any) -> tuple[tuple[int, ...], bool, np.dtype]:
    """Shape, whether in Fortran's order, and type of an array in NumPy's format."""
    readers = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
    version = np.lib.format.read_magic(file)
    if version not in readers:
        raise InputError(f"an array has version {version} of NumPy's format; expected 1 or 2.")
    shape, fortran, dtype = readers[version](file)
    if len(shape) > 32 or any(type(count) is not int or count < 0 for count in shape):
        raise InputError(f"an array has the shape {str(shape)[:80]}.")
    return shape, fortran, dtype


def _npz_variable(path: Path, archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> Variable:
    name = member.filename.removesuffix(".npy")
    if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) or member.flag_bits & 1:
        raise InputError(f"{path}: {name} is packed or locked in another way than NumPy does.")
    with archive.open(member) as file:
        shape, fortran, dtype = _header(file)
        skipped = file.tell()
    size = math.prod(shape) * dtype.itemsize
    if dtype.hasobject or 0 in shape:
        return Variable(shape, dtype, _refused_objects)
    if member.file_size != skipped + size:
        raise InputError(f"{path}: {name} has shape {shape} and {member.file_size - skipped} bytes; expected {size}.")
    if shape and member.compress_type == zipfile.ZIP_STORED:
        with path.open("rb") as raw:
            # The local header stands before a member: 30 bytes, of which the last 4 tell lengths of name and extra.
            raw.seek(member.header_offset)
            local = raw.read(30)
        if local[:4] != b"PK\x03\x04" or len(local) < 30:
            raise InputError(f"{path}: {name} has no header of its own.")
        lengths = struct.unpack("<HH", local[26:])
        offset = member.header_offset + 30 + sum(lengths) + skipped
        return mapped(path, f"{path} cannot be read as npz", dtype, shape, offset, "F" if fortran else "C")
    require_room(member.file_size, min(member.compress_size, path.stat().st_size), f"{path}: {name}")
    if size > limits.MOST_HELD:
        raise InputError(
            f"{path}: {name} is compressed and has {size} bytes; expected at most {limits.MOST_HELD}, or numpy.savez."
        )

    def read_whole(part: Slices) -> np.ndarray:
        with zipfile.ZipFile(path) as archive, archive.open(member.filename) as file:
            file.read(skipped)
            content = file.read(size)
            # Its checksum is looked at where the content ends.
            if len(content) < size or file.read(1):
                raise InputError(f"{path}: {name} holds {len(content)} of {size} bytes.")
        return np.asarray(np.frombuffer(content, dtype).reshape(shape, order="F" if fortran else "C")[part])

    return kept(Variable(shape, dtype, read_whole))


def _refused_objects(part: Slices) -> np.ndarray:
    raise InputError("the array holds objects of Python, or nothing; expected numbers.")


def kept(variable: Variable) -> Variable:
    """The same, read whole when first asked for and kept."""
    values: list[np.ndarray] = []

    def read(part: Slices) -> np.ndarray:
        if not values:
            values.append(variable.read((slice(None),) * len(variable.shape)))
        return np.asarray(values[0][part])

    return Variable(variable.shape, variable.dtype, read)


@reader("a Zarr folder")
def open_zarr(path: Path) -> dict[str, Variable]:
    """Arrays of a Zarr folder: of a group, or one bare array, which is then called `frames`.

    Axes are named by the dimension names of version 3, or by xarray's attribute in version 2.

    Raises
    ------
    InputError : no such folder, or damaged.
    """
    import zarr

    require_folder(path)
    store = zarr.open(path, mode="r")
    arrays = [("frames", store)] if isinstance(store, zarr.Array) else list(store.arrays())
    return {name: _zarr_variable(path, array) for name, array in arrays}


def _zarr_variable(path: Path, array: Any) -> Variable:
    read, attributes = zarr_values(path, array)
    dims = getattr(array.metadata, "dimension_names", None) or attributes.get("_ARRAY_DIMENSIONS")
    named = isinstance(dims, list | tuple) and len(dims) == array.ndim and all(isinstance(d, str) and d for d in dims)
    names = tuple(dims) if named and dims is not None else None
    return Variable(array.shape, np.dtype(array.dtype), read, names, attributes)


@reader("MAT")
def open_mat(path: Path) -> dict[str, Variable]:
    """Arrays of a MAT file of any version; its rows and columns of numbers become arrays of one axis.

    Fields of a structure are named `structure.field`.

    Raises
    ------
    InputError : no such file, or damaged.
    """
    import h5py

    from faintrack.io.mat import mat_variables

    require_file(path)
    if not h5py.is_hdf5(path):
        return mat_variables(path)
    with h5py.File(path, "r") as file:
        found: dict[str, Variable] = {}
        for name in [name for name in file if name[0] != "#"][: limits.MOST_NAMES]:
            item = file[name]
            if isinstance(item, h5py.Group):
                fields = [field for field in item if isinstance(item[field], h5py.Dataset)][: limits.MOST_NAMES]
                found |= {f"{name}.{field}": _mat_variable(path, item[field]) for field in fields}
            else:
                found[name] = _mat_variable(path, item)
        return found


@reader("HDF5")
def open_hdf5(path: Path) -> dict[str, Variable]:
    """Arrays at the top of an HDF5 file; axes are named by their scales or labels, where every one has one.

    Raises
    ------
    InputError : no such file, or damaged.
    """
    import h5py

    require_file(path)

    def variable(dataset: h5py.Dataset) -> Variable:
        if dataset.shape is None or dataset.dtype.kind not in "iufc":
            return Variable(dataset.shape or (), dataset.dtype, _refused_objects)
        dims = tuple(dim.label or (dim[0].name.lstrip("/") if len(dim) else "") for dim in dataset.dims)
        named = dims if dims and all(dims) else None
        return Variable(dataset.shape, dataset.dtype, hdf5_values(path, dataset), named, attributes_of(dataset))

    with h5py.File(path, "r") as file:
        names = [name for name in file if isinstance(file.get(name, getclass=True), type)][: limits.MOST_NAMES]
        return {name: variable(file[name]) for name in names if file.get(name, getclass=True) is h5py.Dataset}


def _mat_variable(path: Path, dataset: Any) -> Variable:
    import h5py

    if not isinstance(dataset, h5py.Dataset) or dataset.attrs.get("MATLAB_class") == b"char" or not dataset.shape:
        return in_memory(np.empty((), object))
    if dataset.dtype.names == ("real", "imag"):
        return Variable(dataset.shape[::-1], np.dtype(complex), _refused_objects)
    if dataset.dtype.kind not in "iuf":
        return in_memory(np.empty((), object))
    values = hdf5_values(path, dataset)
    if len(dataset.shape) == 2 and 1 in dataset.shape:
        whole = (slice(None), slice(None))
        return Variable((dataset.size,), dataset.dtype, lambda part: values(whole).ravel()[part])
    # MATLAB's first index runs fastest, HDF5's last: the file holds the axes in reverse.
    return Variable(dataset.shape[::-1], dataset.dtype, lambda part: values(part[::-1]).T)
