"""Records of miniSEED looked at before a library decodes them: whether every length in a header stays in its record.

The decoder trusts the lengths that it finds, and reads beyond a record where they lie.
"""

import struct
from pathlib import Path

from faintrack.errors import InputError

_SMALLEST, _LARGEST = 7, 18
# Bytes of one sample at least, by the code of the encoding; Steim packs 4 or 7 samples into 4 bytes.
_BYTES = {
    0: 1.0,
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


def require_sound(path: Path, content: bytes, origin: int) -> None:
    """Refuse a piece of a file in which a record makes no sense.

    Parameters
    ----------
    path : for messages.
    content : whole records; one at the end may be cut short.
    origin : place of the piece in the file; bytes.

    Raises
    ------
    InputError : as said; the sentence tells the place of the record.
    """
    place = 0
    while len(content) - place >= 48:
        record = content[place : place + 2**_LARGEST]
        what = _wrong(record)
        if isinstance(what, str):
            raise InputError(
                f"{path} is damaged or cut short: only {place} of the {len(content)} bytes from byte {origin} are "
                f"records, as {what}."
            )
        place += what
    if place != len(content):
        raise InputError(
            f"{path} is damaged or cut short: only {min(place, len(content))} of the {len(content)} bytes from byte "
            f"{origin} are records."
        )


def _wrong(record: bytes) -> str | int:
    """What is wrong with a record, or its length."""
    if not record[:6].replace(b" ", b"0").replace(b"\0", b"0").isdigit() or record[6:7] not in (b"D", b"R", b"Q", b"M"):
        return "the next begins with no number and quality"
    year, day = struct.unpack_from(">HH", record, 20)
    order = ">" if 1900 <= year <= 2100 and 1 <= day <= 366 else "<"
    year, day, hour, minute, second = struct.unpack_from(f"{order}HHBBB", record, 20)
    if not (1900 <= year <= 2100 and 1 <= day <= 366 and hour < 24 and minute < 60 and second <= 60):
        return "the next has no date"
    samples, _, _ = struct.unpack_from(f"{order}Hhh", record, 30)
    blockettes = record[39]
    data, place = struct.unpack_from(f"{order}HH", record, 44)
    length, encoding = 0, -1
    for _ in range(blockettes):
        if not 48 <= place <= len(record) - 8:
            return "the next has a blockette outside"
        kind, following = struct.unpack_from(f"{order}HH", record, place)
        if kind == 1000:
            encoding, _, exponent = struct.unpack_from("BBB", record, place + 4)
            if not _SMALLEST <= exponent <= _LARGEST:
                return f"the next is 2^{exponent} bytes long"
            length = 1 << exponent
        if not following:
            break
        if following <= place:
            return "the blockettes of the next go round"
        place = following
    if not length:
        return "the next does not tell its length"
    if length > len(record):
        return f"the next is {length} bytes long"
    if samples:
        if encoding not in _BYTES:
            return f"the next is packed in an unknown way ({encoding})"
        if not 48 <= data < length or samples * _BYTES[encoding] > length - data:
            return f"the next claims {samples} samples"
    return length
