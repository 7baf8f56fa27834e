"""Headers of miniSEED records, read without a library: what they tell, and whether every length stays in its record.

The decoder trusts the lengths that it finds, and reads beyond a record where they lie. So each record is looked at
before it is handed over: it begins with a number and a quality, has a date, tells its length, and claims no more
samples than its bytes can hold.
"""

import datetime
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from faintrack.errors import InputError
from faintrack.io import limits

_HEAD = 48
_SMALLEST, _LARGEST = 7, 18
# Bytes of one sample at least, by the code of the encoding; Steim packs 4 or 7 samples into 4 bytes.
_BYTES = {
    1: 2.0,
    2: 3.0,
    3: 4.0,
    4: 4.0,
    5: 8.0,
    10: 1.0,
    11: 4 / 7,
    14: 3.0,
    16: 2.0,
    30: 2.0,
    31: 3.0,
    32: 2.0,
    33: 2.0,
}
_TEXT = 0
_EPOCH = datetime.datetime(1970, 1, 1)
_BUFFER = 2**19


@dataclass(frozen=True, slots=True)
class Record:
    """What the header of a record tells.

    Attributes
    ----------
    channel : "network.station.location.channel".
    time : of the first sample; nanoseconds since 1970, UTC.
    samples : number of them; 0 where they are none that can be used, such as text.
    rate : Hz.
    place, length : in the file; bytes.
    """

    channel: str
    time: int
    samples: int
    rate: float
    place: int
    length: int


def records(path: Path) -> Iterator[Record]:
    """Headers of the records of a file, in its order.

    Parameters
    ----------
    path : of the file.

    Raises
    ------
    InputError : a record makes no sense; the sentence tells how many bytes do.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        content, origin, place = b"", 0, 0
        while place < size:
            if place + 2**_LARGEST > origin + len(content) and origin + len(content) < size:
                file.seek(place)
                content = b""  # not both at once
                content, origin = file.read(_BUFFER), place
            found = _record(content, place - origin, place)
            if isinstance(found, str):
                held = f"only {place} of the {size} bytes are records"
                raise InputError(f"{path} is damaged or cut short: {held}, as the next {found}.")
            yield found
            place += found.length


def _record(content: bytes, at: int, place: int) -> Record | str:
    """Header of a record, or what is wrong with it."""
    held = len(content) - at
    if held < _HEAD:
        return "is cut short"
    head = content[at : at + _HEAD]
    if not head[:6].replace(b" ", b"0").replace(b"\0", b"0").isdigit() or head[6:7] not in (b"D", b"R", b"Q", b"M"):
        return "begins with no number and quality"
    year, day = struct.unpack_from(">HH", head, 20)
    order = ">" if limits.FIRST_YEAR <= year <= limits.LAST_YEAR and 1 <= day <= 366 else "<"
    year, day, hour, minute, second, fraction = struct.unpack_from(f"{order}HHBBBxH", head, 20)
    if not (
        limits.FIRST_YEAR <= year <= limits.LAST_YEAR
        and 1 <= day <= 366
        and (hour < 24 and minute < 60 and second <= 60 and fraction < 10_000)
    ):
        return "has no date"
    samples, factor, multiplier, activity, _, _, blockettes, correction, data, blockette = struct.unpack_from(
        f"{order}HhhBBBBiHH", head, 30
    )
    rate, length, encoding, microseconds = _rate(factor, multiplier), 0, -1, 0
    for _ in range(blockettes):
        if not _HEAD <= blockette <= held - 8:
            return "has a blockette outside"
        kind, following = struct.unpack_from(f"{order}HH", content, at + blockette)
        if kind == 1000:
            encoding, _, exponent = struct.unpack_from("BBB", content, at + blockette + 4)
            if not _SMALLEST <= exponent <= _LARGEST:
                return f"claims 2^{exponent} bytes"
            length = 1 << exponent
        elif kind == 1001:
            (microseconds,) = struct.unpack_from("b", content, at + blockette + 5)
        elif kind == 100:
            (rate,) = struct.unpack_from(f"{order}f", content, at + blockette + 4)
        if not following:
            break
        if following <= blockette:
            return "has blockettes that go round"
        blockette = following
    if not length:
        return "does not tell its length"
    if length > held:
        return f"claims {length} bytes, of which {held} are there"
    if samples and encoding != _TEXT:
        if encoding not in _BYTES:
            return f"is packed in an unknown way ({encoding})"
        if not _HEAD <= data < length or samples * _BYTES[encoding] > length - data:
            return f"claims {samples} samples in {length} bytes"
    moment = datetime.datetime(year, 1, 1) + datetime.timedelta(day - 1, hour * 3600 + minute * 60 + second)
    time = (moment - _EPOCH) // datetime.timedelta(seconds=1) * 1_000_000_000 + fraction * 100_000 + microseconds * 1000
    # The correction of the clock, where it is not in the time already.
    time += 0 if activity & 2 else correction * 100_000
    codes = [head[first:last].decode("latin-1").strip(" \0") for first, last in ((18, 20), (8, 13), (13, 15), (15, 18))]
    usable = samples if encoding != _TEXT and rate else 0
    return Record(".".join(codes), time, usable, rate, place, length)


def _rate(factor: int, multiplier: int) -> float:
    """Samples a second of the two numbers of a header, of which negative ones divide."""
    if not factor or not multiplier:
        return 0.0
    return float(factor if factor > 0 else -1 / factor) * (multiplier if multiplier > 0 else -1 / multiplier)
