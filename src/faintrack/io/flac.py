r"""The length of a FLAC file, found where it cannot be wrong: in its last frame.

The header tells the number of samples, or 0 where the writer did not know it (a pipe, a segment). Every frame tells its
own place and length, with two checksums. The last frame of the file is the one whose checksum ends with the file; what
it says is the length. libsndfile then gets the header with that number in it.
"""

import io
from pathlib import Path
from typing import Any

_TAIL = 2**24
_STREAMINFO = 8, 42


def true_length(path: Path) -> tuple[int, int | None]:
    """Samples of each channel that the header tells, and that the last frame tells; None where it is not whole.

    Parameters
    ----------
    path : of a file that begins with the four letters of FLAC.
    """
    with path.open("rb") as file:
        head = file.read(_STREAMINFO[1])
        if head[:4] != b"fLaC" or len(head) < _STREAMINFO[1]:
            return 0, None
        size = file.seek(0, 2)
        file.seek(max(size - _TAIL, _STREAMINFO[1]))
        tail = file.read()
    promised = int.from_bytes(head[21:26], "big") & (2**36 - 1)
    block = int.from_bytes(head[8:10], "big")
    if tail[-128:-125] == b"TAG":
        tail = tail[:-128]
    place = len(tail)
    for _ in range(1000):
        place = max(tail.rfind(b"\xff\xf8", 0, place), tail.rfind(b"\xff\xf9", 0, place))
        if place < 0:
            break
        found = _frame(tail, place, block)
        if found is not None and _crc16(tail[place:]) == 0:
            return promised, found
    return promised, None


class Patched(io.RawIOBase):
    """A FLAC file whose header tells a number of samples.

    Parameters
    ----------
    path : of the file.
    length : what the header shall tell.
    """

    def __init__(self, path: Path, length: int) -> None:
        self._file = path.open("rb")
        head = bytearray(self._file.read(26))
        told = int.from_bytes(head[21:26], "big") >> 36 << 36 | length
        head[21:26] = told.to_bytes(5, "big")
        self._head = bytes(head)
        self._file.seek(0)

    def readable(self) -> bool:
        """Yes."""
        return True

    def seekable(self) -> bool:
        """Yes."""
        return True

    def seek(self, place: int, whence: int = 0) -> int:
        """As of the file."""
        return self._file.seek(place, whence)

    def tell(self) -> int:
        """As of the file."""
        return self._file.tell()

    def readinto(self, buffer: Any) -> int:
        """Bytes of the file, those of the header changed."""
        place = self._file.tell()
        content = self._file.read(len(buffer))
        if place < len(self._head):
            known = self._head[place : place + len(content)]
            content = known + content[len(known) :]
        buffer[: len(content)] = content
        return len(content)

    def close(self) -> None:
        """Close the file."""
        self._file.close()
        super().close()


def _frame(content: bytes, place: int, block: int) -> int | None:
    """Number of the sample after a frame whose head stands at a place; None where none stands there."""
    head = content[place : place + 16]
    if len(head) < 6 or head[3] & 1 or head[2] & 15 == 15 or head[3] >> 4 > 10 or (head[3] >> 1) & 7 == 3:
        return None
    at, first = 5, head[4]
    more = 0
    while more < 7 and first & (0x80 >> more):
        more += 1
    if more == 1 or (more == 7 and first != 0xFE):
        return None
    number = first if more == 0 else first & (0x7F >> more)
    for byte in head[5 : 4 + max(more, 1)]:
        if byte & 0xC0 != 0x80:
            return None
        number = number << 6 | byte & 0x3F
        at += 1
    code = head[2] >> 4
    if code == 0:
        return None
    if code == 1:
        size = 192
    elif code < 6:
        size = 576 << (code - 2)
    elif code < 8:
        size = int.from_bytes(head[at : at + code - 5], "big") + 1
        at += code - 5
    else:
        size = 256 << (code - 8)
    at += {12: 1, 13: 2, 14: 2}.get(head[2] & 15, 0)
    if at >= len(head) or _crc8(head[:at]) != head[at]:
        return None
    return (number if head[1] & 1 else number * block) + size


def _crc8(content: bytes) -> int:
    value = 0
    for byte in content:
        value ^= byte
        for _ in range(8):
            value = (value << 1 ^ 0x107 if value & 0x80 else value << 1) & 0xFF
    return value


def _table() -> list[int]:
    table = []
    for byte in range(256):
        value = byte << 8
        for _ in range(8):
            value = (value << 1 ^ 0x8005 if value & 0x8000 else value << 1) & 0xFFFF
        table.append(value)
    return table


_CRC16 = _table()


def _crc16(content: bytes) -> int:
    """Checksum of a frame; 0 over the frame with its own."""
    value = 0
    for byte in content:
        value = (value << 8 & 0xFFFF) ^ _CRC16[value >> 8 ^ byte]
    return value
