r"""Arrays of HDF5 and Zarr as they are stored: what is there, what is not, and what may be run to unpack it.

Both formats give an array a shape that nothing has to fill. A chunk that was never written, a source of a virtual
dataset that is not beside it, a mark for "no value": the libraries give zeros or the mark for them, and here they are
NaN. What is refused:

- HDF5 whose samples stand in other files by path (external storage), or virtual datasets without all of their sources;
- Zarr packed by anything but the codecs in `CODECS`: some run code (pickle);
- a shape that the bytes that there are could not fill, a chunk beyond `limits.MOST_CHUNK`.

A fill value of 0 marks nothing, unless an attribute `_FillValue` or `missing_value` says so: zero is a value.
"""

import math
import os
import struct
from collections.abc import Callable, Iterable, Mapping
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from faintrack.errors import InputError
from faintrack.io import limits
from faintrack.io.checks import require_room

_UNPACKING = ("gzip", "zlib", "zstd", "blosc", "lz4", "bz2", "lzma", "shuffle", "crc32c")
CODECS = frozenset(
    ("bytes", "transpose", "sharding_indexed", "delta", *_UNPACKING, *(f"numcodecs.{name}" for name in _UNPACKING))
)
"""Of Zarr, that only unpack numbers."""

Slices = tuple[slice, ...]
Read = Callable[[Slices], np.ndarray]


def marks(attributes: Mapping[str, Any], stored: Any = None) -> tuple[float, ...]:
    """Values that stand for none: the attributes of CF, and the fill value of the format where it is not 0.

    Examples
    --------
    >>> marks({"_FillValue": -1, "missing_value": [-9.0]}, 0.0), marks({}, 1e20)
    ((-1.0, -9.0), (1e+20,))
    """
    found = [attributes[name] for name in ("_FillValue", "missing_value") if name in attributes]
    if stored is not None and np.asarray(stored).dtype.kind in "iuf" and np.any(np.asarray(stored) != 0):
        found.append(stored)
    values = [np.asarray(value).ravel()[:8] for value in found]
    numbers = [float(number) for value in values if value.dtype.kind in "iuf" for number in value]
    return tuple(dict.fromkeys(number for number in numbers if not math.isnan(number)))


def with_gaps(values: np.ndarray, fills: tuple[float, ...]) -> np.ndarray:
    """Values as floats, with NaN where one of the fills stands; as they are where there is none.

    Examples
    --------
    >>> with_gaps(np.array([1, -9999, 3], np.int16), (-9999.0,)).tolist()
    [1.0, nan, 3.0]
    """
    if not fills or values.dtype.kind not in "iuf":
        return values
    # A fill is told in double precision and stands there in that of the array.
    kind = values.dtype.type
    with np.errstate(over="ignore", invalid="ignore"):
        alike = [
            np.asarray(fill).astype(kind) for fill in fills if values.dtype.kind == "f" or float(fill).is_integer()
        ]
    where = np.isin(values, alike)
    if not where.any():
        return values
    made = values.astype(np.float64 if values.dtype.itemsize > 4 and values.dtype.kind == "f" else np.float32)
    made[where] = np.nan
    return made


def hdf5_values(path: Path, dataset: Any) -> Read:
    """Function that reads parts of a dataset of an HDF5 file, NaN where there is nothing.

    Parameters
    ----------
    path : of the file, which is opened again for every part.
    dataset : of h5py.

    Raises
    ------
    InputError : as the module says.
    """
    import h5py

    name, field = dataset.name, f"{path}: {dataset.name.lstrip('/')}"
    shape, width = dataset.shape, dataset.dtype.itemsize
    if dataset.external:
        raise InputError(f"{field} stands in another file, {str(dataset.external[0][0])[:80]!r}; expected values here.")
    if dataset.is_virtual:
        _require_sources(path, field, dataset)
    elif dataset.dtype.kind in "iufc" and shape:
        held = dataset.id.get_storage_size()
        if not held:
            raise InputError(f"{field} was made and never written; expected values.")
        if held > path.stat().st_size:
            raise InputError(f"{field} claims {held} bytes of a file of {path.stat().st_size}.")
        require_room(math.prod(shape) * width, held, field)
    chunks: tuple[int, ...] | None = None
    there: set[tuple[int, ...]] = set()
    if dataset.chunks is not None and dataset.dtype.kind in "iuf":
        _require_chunk(field, dataset.chunks, width)
        number = dataset.id.get_num_chunks()
        if number < math.prod(-(-count // size) for count, size in zip(shape, dataset.chunks, strict=True)):
            chunks = tuple(dataset.chunks)
            places = (dataset.id.get_chunk_info(k).chunk_offset for k in range(number))
            there = {tuple(place // size for place, size in zip(offset, chunks, strict=True)) for offset in places}
    defined = dataset.id.get_create_plist().fill_value_defined() == h5py.h5d.FILL_VALUE_USER_DEFINED
    fills = marks(dict(_attributes(dataset)), dataset.fillvalue if defined else None)

    def read(part: Slices) -> np.ndarray:
        with h5py.File(path, "r") as file:
            values = np.asarray(file[name][part])
        values = with_gaps(values, fills)
        return values if chunks is None else _emptied(values, _absent(part, shape, chunks, there.__contains__))

    return read


def _attributes(item: Any) -> Iterable[tuple[str, Any]]:
    """Attributes that can be read; those of unknown types are passed over."""
    for name in list(item.attrs)[: limits.MOST_NAMES]:
        try:
            yield name, item.attrs[name]
        except Exception:
            continue


def attributes_of(item: Any) -> dict[str, Any]:
    """Attributes of an HDF5 object that can be read."""
    return dict(_attributes(item))


def _require_sources(path: Path, field: str, dataset: Any) -> None:
    """Refuse a virtual dataset that is not whole: the library puts zeros in the place of what is not there."""
    import h5py

    covered = 0
    for source in dataset.virtual_sources():
        file = path if source.file_name == "." else path.parent / source.file_name
        where = f"{source.dset_name} of {source.file_name}"
        try:
            with h5py.File(file, "r") as held:
                shape = held[source.dset_name].shape
        except Exception as error:
            raise InputError(f"{field} is put together from other files, and {where} is not there.") from error
        if tuple(source.src_space.shape) not in ((), tuple(shape)):
            raise InputError(f"{field} is put together from {where}, which has shape {shape} and not as it should.")
        covered += source.vspace.get_select_npoints()
    if covered < math.prod(dataset.shape):
        raise InputError(
            f"{field} is put together from other files, which fill {covered} of {math.prod(dataset.shape)} values."
        )


def zarr_values(path: Path, array: Any) -> tuple[Read, dict[str, Any]]:
    """Function that reads parts of a Zarr array, NaN where there is nothing; and its attributes.

    Parameters
    ----------
    path : of the folder of the whole store.
    array : of zarr.

    Raises
    ------
    InputError : as the module says.
    """
    field = f"{path}: {array.path or 'the array'}"
    attributes = array.attrs.asdict()
    told = array.metadata.to_dict()
    require_codecs(field, array)
    codecs = list(_codecs(told))
    folder, shape, chunks, metadata = path / array.path, array.shape, array.chunks, array.metadata
    shard = getattr(array, "shards", None) or chunks
    numeric = np.dtype(array.dtype).kind in "iuf"
    fill = told.get("fill_value")
    if numeric and shape:
        width = np.dtype(array.dtype).itemsize
        _require_chunk(field, chunks, width)
        _require_stored(folder, math.prod(shape) * width, field)
    fills = marks(attributes, array.fill_value if numeric else None)
    empty = isinstance(fill, float) and math.isnan(fill)

    def file_of(place: tuple[int, ...]) -> Path:
        return folder / metadata.encode_chunk_key(place)

    def there(place: tuple[int, ...]) -> bool:
        return file_of(place).exists()

    blosc = numeric and "sharding_indexed" not in codecs and codecs[-1:] and codecs[-1].endswith("blosc")
    size = math.prod(chunks) * np.dtype(array.dtype).itemsize

    def read(part: Slices) -> np.ndarray:
        if blosc:
            for place in _touched(part, shape, chunks):
                _require_blosc(file_of(place), size)
        values = with_gaps(np.asarray(array[part]), fills)
        # Where NaN fills what is not there, nothing has to be looked for.
        return values if empty or not numeric else _emptied(values, _absent(part, shape, shard, there))

    return read, attributes


def require_codecs(field: str, array: Any) -> None:
    """Refuse a Zarr array that is packed by what may do more than unpack numbers and text.

    Parameters
    ----------
    field : file and array, for the message.
    array : of zarr.

    Raises
    ------
    InputError : it is packed with something else than `CODECS`.
    """
    for codec in _codecs(array.metadata.to_dict()):
        if codec not in CODECS:
            raise InputError(f"{field} is packed with {codec!r}; expected one of {', '.join(sorted(CODECS)[:6])}, ...")


def _codecs(told: Any, depth: int = 0) -> Iterable[str]:
    """Names of everything that packs an array, whatever is inside what."""
    if depth > 8:
        return
    for name in ("codecs", "filters", "compressor", "index_codecs", "compressors"):
        found = told.get(name) if isinstance(told, Mapping) else None
        for codec in found if isinstance(found, list | tuple) else [found] if found else []:
            shown = codec if isinstance(codec, Mapping) else getattr(codec, "get_config", dict)()
            if not isinstance(shown, Mapping) or not shown:
                shown = codec.to_dict() if hasattr(codec, "to_dict") else {"name": type(codec).__name__}
            yield str(shown.get("name", shown.get("id")))
            yield from _codecs(shown.get("configuration", {}), depth + 1)


def _require_chunk(field: str, chunks: tuple[int, ...], width: int) -> None:
    size = math.prod(chunks) * width
    if size > limits.MOST_CHUNK:
        raise InputError(f"{field} has chunks of {size} bytes; expected at most {limits.MOST_CHUNK}.")


def _require_stored(folder: Path, claimed: int, field: str) -> None:
    """Refuse a shape that the files of a folder could not fill; looks no further than it has to."""
    held = 0
    for root, _, files in os.walk(folder):
        for file in files:
            held += os.stat(os.path.join(root, file), follow_symlinks=False).st_size
            if claimed <= limits.MOST_UNPACKED_CHUNK * held:
                return
    raise InputError(f"{field} claims {claimed} bytes, of which the folder's {held} can be none.")


def _absent(
    part: Slices, shape: tuple[int, ...], chunks: tuple[int, ...], there: Callable[[tuple[int, ...]], bool]
) -> Iterable[Slices]:
    """Places within a part that belong to chunks that are not there."""
    ranges = [range(*piece.indices(count)) for piece, count in zip(part, shape, strict=True)]
    for place in _touched(part, shape, chunks):
        if not there(place):
            yield tuple(
                slice(max(number * size - each[0], 0), min((number + 1) * size - each[0], len(each)))
                for number, size, each in zip(place, chunks, ranges, strict=True)
            )


def _touched(part: Slices, shape: tuple[int, ...], chunks: tuple[int, ...]) -> Iterable[tuple[int, ...]]:
    """Numbers of the chunks that a part touches."""
    ranges = [range(*piece.indices(count)) for piece, count in zip(part, shape, strict=True)]
    if any(len(each) == 0 for each in ranges):
        return iter(())
    return product(*(range(each[0] // size, each[-1] // size + 1) for each, size in zip(ranges, chunks, strict=True)))


def _require_blosc(file: Path, size: int) -> None:
    """Refuse a chunk whose head does not fit it: Blosc goes by the lengths there, wherever they lead."""
    try:
        held = file.stat().st_size
    except OSError:
        return  # a chunk that is not there
    with file.open("rb") as opened:
        head = opened.read(16)
        if len(head) < 16:
            raise InputError(f"{file} is cut short.")
        flags, unpacked, block, packed = *struct.unpack_from("<xxB", head), *struct.unpack_from("<III", head, 4)
        blocks = -(-unpacked // block) if block else 0
        if unpacked != size or not 0 < block <= max(unpacked, 1) or not 16 <= packed <= held <= packed + 4:
            raise InputError(
                f"{file} is damaged or cut short: {held} bytes that claim {packed}, and {unpacked} of {size}."
            )
        if flags & 2:  # as it is, not packed
            if packed < 16 + unpacked:
                raise InputError(f"{file} is damaged or cut short: {packed} bytes for {unpacked}.")
            return
        starts = np.frombuffer(opened.read(4 * blocks), "<u4")
    if len(starts) < blocks or ((starts < 16 + 4 * blocks) | (starts.astype(int) + 4 > packed)).any():
        raise InputError(f"{file} is damaged: its blocks lie outside.")


def _emptied(values: np.ndarray, places: Iterable[Slices]) -> np.ndarray:
    """Values with NaN in some places."""
    made = values
    for place in places:
        if made is values or made.dtype.kind != "f":
            made = values.astype(np.float64 if values.dtype == np.float64 else np.float32)
            values = made
        made[place] = np.nan
    return made
