r"""Where the samples of an audio file stand: RIFF, RIFX, RF64, Wave64, AIFF, CAF.

All of them are chunks, one after the other: a name, a size, content. The size of the chunk with the samples is what
goes wrong: it wraps at 4 GiB, a recorder that lost its power wrote it minutes before the end, a program that writes to
a pipe leaves 0 or a largest number. So it is compared with the file:

- chunks that follow it and end where the file ends prove it;
- a size that is unknown, or wrapped, or followed by no chunk gives way to what is there, with a remark;
- one that is beyond the end of the file is refused with both numbers.

What stands there is read as it is, at any place, without decoding what comes before. Packed samples (µ-law, ADPCM) are
left to libsndfile.
"""

import re
import struct
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timedelta
from io import BufferedIOBase
from pathlib import Path

import numpy as np

from faintrack.errors import InputError
from faintrack.io import limits
from faintrack.io.checks import require_channels, require_rate

_MOST_CHUNKS = 100_000
# A writer that does not know the length beforehand leaves one of these, or a number near them.
_UNKNOWN = 0x7FFFF000
_W64 = {
    b"riff\x2e\x91\xcf\x11\xa5\xd6\x28\xdb\x04\xc1\x00\x00": b"RIFF",
    b"fmt \xf3\xac\xd3\x11\x8c\xd1\x00\xc0\x4f\x8e\xdb\x8a": b"fmt ",
    b"data\xf3\xac\xd3\x11\x8c\xd1\x00\xc0\x4f\x8e\xdb\x8a": b"data",
    b"bext\xf3\xac\xd3\x11\x8c\xd1\x00\xc0\x4f\x8e\xdb\x8a": b"bext",
}
_KNOWN = (b"LIST", b"JUNK", b"bext", b"iXML", b"cue ", b"fact", b"id3 ", b"ID3 ", b"smpl", b"PEAK", b"FLLR", b"_PMX")
_LARGEST_CHUNK = 2**20  # of those that are read as text


@dataclass(frozen=True)
class Container:
    """Samples of an audio file as they stand in it.

    Attributes
    ----------
    rate : Hz.
    channels : side by side in every sample.
    kind : type of one number in the file; None where it is packed.
    width : bytes of one number.
    start, size : of the samples; bytes.
    start_time : of the first sample, where the file tells.
    remarks : what was assumed.
    """

    rate: float
    channels: int
    kind: np.dtype | None
    width: int
    start: int
    size: int
    start_time: np.datetime64 | None = None
    remarks: tuple[str, ...] = ()

    @property
    def length(self) -> int:
        """Samples of each channel."""
        return self.size // (self.channels * self.width)

    def decode(self, content: np.ndarray) -> np.ndarray:
        """Bytes of whole samples as numbers of shape (time, channel), whole ones scaled to -1 to 1."""
        assert self.kind is not None
        if self.width == 3:
            wide = np.zeros((content.size // 3, 4), np.uint8)
            # The highest bytes of 32 bits, whichever end they stand at.
            wide[:, slice(0, 3) if self.kind.str[0] == ">" else slice(1, 4)] = content.reshape(-1, 3)
            content = wide.ravel()
        values: np.ndarray = content.view(self.kind).reshape(-1, self.channels)
        if self.kind.kind == "f":
            return values.astype(np.float64 if self.width == 8 else np.float32)
        if self.kind.kind == "u":
            return (values.astype(np.float32) - 128) / 128
        return values.astype(np.float32) * np.float32(2.0 ** (1 - 8 * self.kind.itemsize))


@dataclass(frozen=True)
class _Layout:
    """How the chunks of a container are headed: bytes of the head, name and size in it, and what sizes round up to."""

    head: int
    parse: Callable[[bytes], tuple[bytes, int]]
    align: int
    data: bytes
    wraps: bool


def _short(order: str, data: bytes) -> _Layout:
    def parse(head: bytes) -> tuple[bytes, int]:
        return head[:4], int(struct.unpack(f"{order}I", head[4:])[0])

    return _Layout(8, parse, 2, data, True)


_RIFF, _RIFX, _AIFF = _short("<", b"data"), _short(">", b"data"), _short(">", b"SSND")
_WAVE64 = _Layout(
    24, lambda head: (_W64.get(head[:16], head[:16]), struct.unpack("<Q", head[16:])[0] - 24), 8, b"data", False
)
_CAF = _Layout(12, lambda head: (head[:4], struct.unpack(">Q", head[4:])[0]), 1, b"data", False)


def read_container(path: Path, file: BufferedIOBase, end: int) -> Container | None:
    """Where the samples stand; None where it is none of these containers.

    Parameters
    ----------
    path : for messages.
    file : opened for reading; left at any position.
    end : of the file; bytes.

    Raises
    ------
    InputError : there are fewer samples than the header promises, none at all, or the header makes no sense.
    """
    file.seek(0)
    head = file.read(40)
    if head[:4] in (b"RIFF", b"RF64", b"BW64") and head[8:12] == b"WAVE":
        return _wave(path, file, end, _RIFF, 12, "<")
    if head[:4] == b"RIFX" and head[8:12] == b"WAVE":
        return _wave(path, file, end, _RIFX, 12, ">")
    if _W64.get(head[:16]) == b"RIFF" and head[24:28] == b"wave":
        return _wave(path, file, end, _WAVE64, 40, "<")
    if head[:4] == b"FORM" and head[8:12] in (b"AIFF", b"AIFC"):
        return _aiff(path, file, end)
    if head[:4] == b"caff":
        return _caf(path, file, end)
    return None


def data_chunk(file: BufferedIOBase) -> tuple[int, int] | None:
    r"""First byte and number of bytes of the samples in a RIFF or RF64 file; None where there are none.

    Parameters
    ----------
    file : opened for reading; left at any position.

    Examples
    --------
    >>> import io
    >>> data_chunk(io.BytesIO(b"RIFF\x10\0\0\0WAVEdata\x04\0\0\0" + bytes(4)))
    (20, 4)
    """
    end = file.seek(0, 2)
    return _find(Path("recording"), file, 12, end, _RIFF)[0].get(b"data")


def _find(
    path: Path, file: BufferedIOBase, place: int, end: int, layout: _Layout
) -> tuple[dict[bytes, tuple[int, int]], list[str]]:
    """First chunk of each name, as place and size, that of the samples as the file bears it out; and remarks."""
    found: dict[bytes, tuple[int, int]] = {}
    remarks: list[str] = []
    for _ in range(_MOST_CHUNKS):
        head = _at(file, place, layout.head)
        if len(head) < layout.head:
            return found, remarks
        name, size = layout.parse(head)
        start = place + layout.head
        if size < 0:
            raise InputError(f"{path}: a chunk has the size {size}; expected 0 bytes or more.")
        if name == layout.data and name not in found:
            if b"ds64" in found and size == 0xFFFFFFFF:
                size = struct.unpack("<8xQ", _at(file, found[b"ds64"][0], 16).ljust(16, b"\0"))[0]
            size, remark = _true_size(path, file, start, size, end, layout)
            remarks += remark
        found.setdefault(name, (start, size))
        place = start + size + -size % layout.align
    raise InputError(f"{path} has more than {_MOST_CHUNKS} chunks; expected samples.")


def _true_size(
    path: Path, file: BufferedIOBase, start: int, size: int, end: int, layout: _Layout
) -> tuple[int, list[str]]:
    """Bytes of samples that the file bears out."""
    held = end - start
    beyond = size > held
    if beyond and not (size >= _UNKNOWN and layout.wraps) and size < 2**63:
        raise InputError(f"{path} holds {held} of the {size} bytes of samples that its header promises.")
    if not beyond:
        # A size of 32 bits may have wrapped.
        for whole in range(size, held + 1, 2**32) if layout.wraps else (size,):
            if _ends(file, start + whole + -whole % layout.align, end, layout):
                remark = f"The header tells of {size} bytes of samples; the file holds {whole}, all of which are read."
                return whole, [remark] if whole != size else []
    told = "does not tell its length" if beyond or size == 0 else f"tells of {size} bytes of samples"
    return held, [f"The header {told}; the file holds {held} bytes, all of which are read."] if held else []


def _ends(file: BufferedIOBase, place: int, end: int, layout: _Layout) -> bool:
    """Whether from a place on there are chunks to the end of the file, or nothing."""
    for _ in range(1000):
        if end - place < layout.head:
            return True
        name, size = layout.parse(_at(file, place, layout.head))
        if name in _KNOWN:
            return True
        if not all(32 <= letter < 127 for letter in name[:4]) or not 0 <= size <= end - place - layout.head:
            return False
        place += layout.head + size + -size % layout.align
    return True


def _at(file: BufferedIOBase, place: int, count: int) -> bytes:
    if not 0 <= place < 2**63:
        return b""
    file.seek(place)
    return file.read(count)


def _content(file: BufferedIOBase, found: dict[bytes, tuple[int, int]], name: bytes) -> bytes:
    start, size = found.get(name, (0, 0))
    return _at(file, start, min(size, _LARGEST_CHUNK))


def _samples(path: Path, found: dict[bytes, tuple[int, int]], name: bytes) -> tuple[int, int]:
    if name not in found:
        raise InputError(f"{path} ends before its samples begin.")
    return found[name]


def _made(
    path: Path,
    rate: float,
    channels: int,
    kind: np.dtype | None,
    width: int,
    place: tuple[int, int],
    remarks: list[str],
    start_time: np.datetime64 | None = None,
) -> Container:
    """Container whose numbers make sense."""
    if channels < 1 or not 1 <= width <= 8:
        raise InputError(f"{path} has {channels} channels of {width} bytes; expected at least one, of 1 to 8 bytes.")
    require_channels(channels, path)
    require_rate(rate, path)
    rest = place[1] % (channels * width)
    if kind is not None and rest:
        remarks = [*remarks, f"The file ends within a sample; its last {rest} bytes are left out."]
    return Container(rate, channels, kind, width, *place, start_time, tuple(remarks))


def _integers(width: int, order: str, unsigned_bytes: bool = False) -> np.dtype | None:
    if width == 1:
        return np.dtype("u1" if unsigned_bytes else "i1")
    return np.dtype(f"{order}i{4 if width == 3 else width}") if width in (2, 3, 4) else None


def _floats(width: int, order: str) -> np.dtype | None:
    return np.dtype(f"{order}f{width}") if width in (4, 8) else None


def _wave(path: Path, file: BufferedIOBase, end: int, layout: _Layout, place: int, order: str) -> Container:
    found, remarks = _find(path, file, place, end, layout)
    held = _samples(path, found, b"data")
    form = _content(file, found, b"fmt ")
    if len(form) < 16:
        raise InputError(f"{path} does not tell the form of its samples.")
    code, channels, rate, _, together, bits = struct.unpack(f"{order}HHIIHH", form[:16])
    if code == 0xFFFE and len(form) >= 26:
        (code,) = struct.unpack(f"{order}H", form[24:26])
    width = together // channels if channels else 0
    kind = None
    if code in (1, 3) and together == width * channels and bits <= 8 * width:
        kind = _integers(width, order, unsigned_bytes=True) if code == 1 else _floats(width, order)
    start_time, said = start_of(_content(file, found, b"bext"), _content(file, found, b"iXML"), rate)
    return _made(path, float(rate), channels, kind, width or 1, held, remarks + said, start_time)


def _aiff(path: Path, file: BufferedIOBase, end: int) -> Container:
    found, remarks = _find(path, file, 12, end, _AIFF)
    start, size = _samples(path, found, b"SSND")
    form = _content(file, found, b"COMM")
    if len(form) < 18:
        raise InputError(f"{path} does not tell the form of its samples.")
    channels, promised, bits, exponent, mantissa = struct.unpack(">hIhHQ", form[:18])
    rate = float(mantissa) * 2.0 ** ((exponent & 0x7FFF) - 16383 - 63) if exponent & 0x7FFF < 0x7000 else np.inf
    (offset,) = struct.unpack(">I", _at(file, start, 4).rjust(4, b"\0"))
    width = -(-bits // 8)
    packed = form[18:22] or b"NONE"
    kinds = {
        b"NONE": (_integers, ">"),
        b"twos": (_integers, ">"),
        b"in24": (_integers, ">"),
        b"in32": (_integers, ">"),
        b"sowt": (_integers, "<"),
        b"fl32": (_floats, ">"),
        b"FL32": (_floats, ">"),
        b"fl64": (_floats, ">"),
        b"FL64": (_floats, ">"),
    }
    kind = None
    if packed in kinds:
        make, order = kinds[packed]
        kind = make(width, order)
    place = start + 8 + offset, max(size - 8 - offset, 0)
    made = _made(path, rate, channels, kind, width, place, remarks)
    # The number of samples is told a second time; a writer that was interrupted has filled in neither.
    if kind is not None and promised > made.length:
        raise InputError(f"{path} holds {made.length} of the {promised} samples that its header promises.")
    if kind is not None and promised != made.length and not remarks:
        said = f"The header tells of {promised} samples; the file holds {made.length}, all of which are read."
        return _made(path, rate, channels, kind, width, place, [said])
    return made


def _caf(path: Path, file: BufferedIOBase, end: int) -> Container:
    found, remarks = _find(path, file, 8, end, _CAF)
    start, size = _samples(path, found, b"data")
    form = _content(file, found, b"desc")
    if len(form) < 32:
        raise InputError(f"{path} does not tell the form of its samples.")
    rate, code, flags, together, _, channels, bits = struct.unpack(">d4sIIIII", form[:32])
    width = -(-bits // 8)
    order = "<" if flags & 2 else ">"
    kind = None
    if code == b"lpcm" and packet_fits(together, width, channels):
        kind = _floats(width, order) if flags & 1 else _integers(width, order)
    place = start + 4, max(size - 4, 0)  # a count of edits stands before the samples
    return _made(path, rate if np.isfinite(rate) else 0.0, channels, kind, width or 1, place, remarks)


def packet_fits(together: int, width: int, channels: int) -> bool:
    """Whether samples of all channels fill their place without a gap."""
    return 0 < together == width * channels


def start_of(bext: bytes, ixml: bytes, rate: float) -> tuple[np.datetime64 | None, list[str]]:
    r"""Time of the first sample that a broadcast extension chunk or iXML tells, taken as UTC; and a remark.

    Date, and samples since midnight; the time of day in seconds where those are 0.

    Parameters
    ----------
    bext, ixml : content of the chunks, empty where there is none.
    rate : Hz.

    Examples
    --------
    >>> import struct
    >>> chunk = bytes(320) + b"2024-02-2912:00:00" + struct.pack("<Q", 12 * 3600 * 2000 + 1000)
    >>> str(start_of(chunk, b"", 2000)[0])
    '2024-02-29T12:00:00.500000000'
    """
    day, time, samples, source = "", "", 0, "bext"
    if len(bext) >= 346:
        day = bext[320:330].decode("latin-1")
        time = bext[330:338].decode("latin-1")
        (samples,) = struct.unpack("<Q", bext[338:346])
    elif ixml:
        text, source = ixml.decode("utf-8", "replace"), "iXML"
        day, time = (_tagged(text, f"BWF_ORIGINATION_{name}") for name in ("DATE", "TIME"))
        high, low = (_tagged(text, f"TIMESTAMP_SAMPLES_SINCE_MIDNIGHT_{name}") for name in ("HI", "LO"))
        if re.fullmatch(r"\d{1,10}", low):
            samples = int(low) + (int(high) << 32 if re.fullmatch(r"\d{1,10}", high) else 0)
    match = re.fullmatch(r"(\d{4})\D(\d\d)\D(\d\d)", day)
    if match is None or not rate > 0:
        return None, []
    try:
        year, month, date = (int(part) for part in match.groups())
        midnight = datetime(year, month, date)
        clock = re.fullmatch(r"(\d\d)\D(\d\d)\D(\d\d)", time)
        of_day = (
            timedelta(**dict(zip(("hours", "minutes", "seconds"), map(int, clock.groups()), strict=True)))
            if clock
            else timedelta()
        )
    except (ValueError, OverflowError):
        return None, []
    if not limits.FIRST_YEAR <= midnight.year <= limits.LAST_YEAR or samples / rate > 2 * 86400:
        return None, [f"The start time of {source}, {day} and {samples} samples, makes no sense; it is left out."]
    if samples:
        start = np.datetime64(midnight, "ns") + np.timedelta64(round(samples * 1e9 / rate), "ns")
    else:
        start = np.datetime64(midnight + of_day, "ns")
    return start, [f"It starts at {np.datetime_as_string(start, unit='ms')} as {source} says, taken as UTC."]


def _tagged(text: str, name: str) -> str:
    match = re.search(rf"<{name}>\s*([^<>]{{0,40}}?)\s*</{name}>", text)
    return match[1] if match else ""
