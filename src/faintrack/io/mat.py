"""MAT files up to version 7.2: numbers alone, and those in structures.

A file is a row of elements, each with its type and length in front, some of them packed by zlib. Lengths are compared
with what is there before anything is taken for true, and nothing but numbers is made of it. Plain arrays are read where
they stand, a part at a time; packed ones are unpacked when they are asked for, and kept.
"""

import math
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from faintrack.errors import InputError
from faintrack.io import limits
from faintrack.io.checks import require_room
from faintrack.io.variables import Slices, Variable, in_memory, mapped

_HEAD = 128
_MATRIX, _COMPRESSED = 14, 15
_CELL, _STRUCT, _OBJECT, _CHAR, _SPARSE = 1, 2, 3, 4, 5
_STORED = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_CLASSES = {6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8"}
_OLD = {0: "f8", 1: "f4", 2: "i4", 3: "i2", 4: "u2", 5: "u1"}
_DEEPEST = 8


@dataclass(frozen=True)
class _Bytes:
    """A stretch of a file, or of what was unpacked from one."""

    content: memoryview
    order: str

    def element(self, place: int, end: int) -> tuple[int, int, int, int]:
        """Type, first byte and length of the element at a place, and the place of the next."""
        if end - place < 8:
            raise InputError("an element is cut short.")
        kind, size = struct.unpack_from(f"{self.order}II", self.content, place)
        if kind >> 16:
            kind, size = kind & 0xFFFF, kind >> 16
            if size > 4:
                raise InputError(f"a short element claims {size} bytes; expected at most 4.")
            return kind, place + 4, size, place + 8
        if size > end - place - 8:
            raise InputError(f"an element claims {size} bytes; there are {end - place - 8}.")
        return kind, place + 8, size, place + 8 + size + (0 if kind == _COMPRESSED else -size % 8)

    def numbers(self, start: int, size: int, kind: int) -> np.ndarray:
        """Numbers of an element."""
        stored = np.dtype(self.order + _STORED[kind])
        return np.frombuffer(self.content[start : start + size // stored.itemsize * stored.itemsize], stored)


def mat_variables(path: Path) -> dict[str, Variable]:
    """Arrays of a MAT file up to version 7.2; fields of structures are named `structure.field`.

    Parameters
    ----------
    path : of a file that is no HDF5.

    Raises
    ------
    InputError : it is damaged, or holds something else.
    """
    content = memoryview(np.memmap(path, np.uint8, "r"))  # type: ignore[arg-type]
    if len(content) < 20:
        raise InputError("the file is too short.")
    if 0 in bytes(content[:4]):
        return dict(_old(path, content))
    mark = bytes(content[126:128])
    if len(content) < _HEAD or mark not in (b"IM", b"MI"):
        raise InputError(f"{path} is no MAT file.")
    whole = _Bytes(content, "<" if mark == b"IM" else ">")
    found: dict[str, Variable] = {}
    place, end = _HEAD, len(content)
    while end - place >= 8:
        kind, start, size, place = whole.element(place, end)
        if kind == _COMPRESSED:
            found |= _packed(path, whole, start, size)
        elif kind == _MATRIX:
            found |= dict(_matrix(path, whole, start, start + size, "", True))
        if len(found) > limits.MOST_NAMES:
            raise InputError(f"{path} holds more than {limits.MOST_NAMES} arrays.")
    return found


def _packed(path: Path, whole: _Bytes, start: int, size: int) -> dict[str, Variable]:
    """Arrays of an element that zlib packed: its head now, its numbers when they are asked for."""

    def unpacked(most: int) -> memoryview:
        return memoryview(zlib.decompressobj().decompress(whole.content[start : start + size], most))

    head = unpacked(8)
    if len(head) < 8:
        raise InputError("a packed element is cut short.")
    kind, claimed = struct.unpack(f"{whole.order}II", head)
    if kind != _MATRIX:
        return {}
    require_room(claimed, size, f"{path}: a packed array")
    if claimed > limits.MOST_HELD:
        raise InputError(f"{path}: a packed array has {claimed} bytes; expected at most {limits.MOST_HELD}.")
    content = unpacked(claimed + 8)
    if len(content) < claimed + 8:
        raise InputError(f"{path}: a packed array holds {len(content) - 8} of the {claimed} bytes that it claims.")
    return dict(_matrix(path, _Bytes(content, whole.order), 8, 8 + claimed, "", False))


def _matrix(
    path: Path, held: _Bytes, place: int, end: int, name: str, in_file: bool, depth: int = 0
) -> Iterator[tuple[str, Variable]]:
    """Name and variable of a matrix, or of every field of a structure."""
    if depth > _DEEPEST:
        raise InputError(f"{path} holds structures within structures, more than {_DEEPEST}.")
    if place == end:
        return
    kind, start, size, place = held.element(place, end)
    if kind != 6 or size != 8:
        raise InputError("a matrix begins without its flags.")
    flags = int(held.numbers(start, 4, 6)[0])
    matrix, is_complex = flags & 0xFF, bool(flags & 0x0800)
    kind, start, size, place = held.element(place, end)
    if kind != 5:
        raise InputError("a matrix has no shape.")
    shape = tuple(held.numbers(start, size, kind).tolist())
    if len(shape) > 32 or any(count < 0 for count in shape):
        raise InputError(f"a matrix has the shape {str(shape)[:80]}.")
    kind, start, size, place = held.element(place, end)
    name = name or bytes(held.content[start : start + min(size, 256)]).decode("latin-1")
    if matrix in _CLASSES:
        kind, start, size, place = held.element(place, end)
        dtype = np.dtype(_CLASSES[matrix])
        if is_complex:
            yield name, Variable(shape, np.dtype(complex), _unread)
            return
        if kind not in _STORED:
            raise InputError(f"{name} holds numbers of an unknown type, {kind}.")
        stored = np.dtype(held.order + _STORED[kind])
        if math.prod(shape) * stored.itemsize > size:
            raise InputError(f"{name} has shape {shape}, and {size} bytes.")
        yield name, _vector(_numbers(path, held, start, stored, dtype, shape, in_file))
    elif matrix == _STRUCT and math.prod(shape) == 1:
        kind, start, size, place = held.element(place, end)
        width = int(held.numbers(start, size, 5)[0]) if size >= 4 else 0
        kind, start, size, place = held.element(place, end)
        if not 0 < width <= 64:
            raise InputError(f"{name} has names of {width} letters.")
        names = [
            bytes(held.content[at : at + width]).split(b"\0")[0].decode("latin-1")
            for at in range(start, start + size, width)
        ]
        for field in names[: limits.MOST_NAMES]:
            kind, start, size, place = held.element(place, end)
            if kind == _MATRIX:
                yield from _matrix(path, held, start, start + size, f"{name}.{field}", in_file, depth + 1)
    else:
        yield name, in_memory(np.empty((), object))


def _unread(part: Slices) -> np.ndarray:
    raise InputError("the values are complex; expected real ones.")


def _numbers(
    path: Path, held: _Bytes, start: int, stored: np.dtype, dtype: np.dtype, shape: tuple[int, ...], in_file: bool
) -> Variable:
    if in_file and 0 not in shape and shape:
        found = mapped(path, f"{path} cannot be read as MAT", stored, shape, start, "F")
    else:
        count = math.prod(shape)
        found = in_memory(
            np.frombuffer(held.content[start : start + count * stored.itemsize], stored).reshape(shape, order="F")
        )
    return Variable(shape, dtype, lambda part: found.read(part).astype(dtype))


def _vector(found: Variable) -> Variable:
    """The same, a row or a column with one axis."""
    if len(found.shape) != 2 or 1 not in found.shape:
        return found
    length = math.prod(found.shape)
    return Variable((length,), found.dtype, lambda part: found.read((slice(None), slice(None))).ravel()[part])


def _old(path: Path, content: memoryview) -> Iterator[tuple[str, Variable]]:
    """Arrays of version 4: a head of five numbers, a name, the numbers column by column."""
    place, end = 0, len(content)
    order = "<" if struct.unpack_from("<i", content)[0] < 5000 else ">"
    number = 0
    while end - place >= 20:
        form, rows, columns, is_complex, letters = struct.unpack_from(f"{order}5i", content, place)
        stored = _OLD.get(form // 10 % 10)
        if not 0 <= form < 5000 or stored is None or rows < 0 or columns < 0 or not 0 < letters < 256 or form % 10 > 2:
            raise InputError(f"{path} is no MAT file.")
        kind = np.dtype(order + stored)
        size = rows * columns * kind.itemsize * (2 if is_complex else 1)
        start = place + 20 + letters
        if start + size > end:
            raise InputError(f"an array claims {size} bytes; there are {max(end - start, 0)}.")
        name = bytes(content[place + 20 : start]).split(b"\0")[0].decode("latin-1")
        if is_complex:
            yield name, Variable((rows, columns), np.dtype(complex), _unread)
        elif form % 10 == 0:
            yield (
                name,
                _vector(
                    _numbers(path, _Bytes(content, order), start, kind, kind.newbyteorder("="), (rows, columns), True)
                ),
            )
        place = start + size
        number += 1
        if number > limits.MOST_NAMES:
            raise InputError(f"{path} holds more than {limits.MOST_NAMES} arrays.")
    if place != end:
        raise InputError(f"{path} ends within an array.")
