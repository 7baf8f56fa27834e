"""Samples out of a stream of bytes: raw, or WAV whose header is read as it comes.

Standard input, a named pipe and a file that is being written are read alike. The length that a WAV header tells is that
of a file which is not finished, and is not believed.
"""

import os
import select
import stat
import struct
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from faintrack.errors import InputError
from faintrack.io.checks import require_channels, require_rate
from faintrack.io.containers import Container
from faintrack.live.stream import Piece, Stream, numbered

FORMATS: dict[str, np.dtype[Any]] = {"float32": np.dtype("<f4"), "int16": np.dtype("<i2")}
"""Of raw samples, little-endian, the channels side by side."""

PIECE = 0.25
"""Seconds of samples that are read at a time."""

POLL = 0.1
"""Between looks at a file that grows, or a pipe that is empty; seconds."""

MOST_HEADER = 2**20
"""Bytes before the samples of a WAV stream."""


@dataclass(frozen=True)
class Raw:
    """What bytes without a header hold.

    Attributes
    ----------
    channels : side by side in every sample.
    sample_rate : Hz.
    format : of a number, one of `FORMATS`.
    """

    channels: int
    sample_rate: float
    format: str = "float32"

    def container(self, source: str) -> Container:
        """How bytes become numbers.

        Raises
        ------
        InputError : a field makes no sense.
        """
        if self.format not in FORMATS:
            raise InputError(f"--format is {self.format}; expected {' or '.join(FORMATS)}.")
        if self.channels < 1:
            raise InputError(f"--channels is {self.channels}; expected 1 or more.")
        kind = FORMATS[self.format]
        require_channels(self.channels, source)
        return Container(require_rate(self.sample_rate, source), self.channels, kind, kind.itemsize, 0, 0)


class Bytes:
    """Bytes of an open file, waited for.

    Parameters
    ----------
    descriptor : of the file; closed by whoever opened it.
    stop : event at which it gives up.
    grows : whether the end of the file is only where it is now.
    """

    def __init__(self, descriptor: int, stop: threading.Event, grows: bool = False) -> None:
        self._descriptor, self._stop, self._grows = descriptor, stop, grows
        self._place = 0
        # A pipe that nobody has opened for writing yet reads as one that has ended.
        self._waits = stat.S_ISFIFO(os.fstat(descriptor).st_mode) and not os.get_blocking(descriptor)

    def some(self, most: int) -> bytes:
        """As many bytes as there are, one at least; none at the end.

        Raises
        ------
        InputError : a file that grows has become shorter.
        """
        while not self._stop.is_set():
            if not self._grows and not select.select([self._descriptor], [], [], POLL)[0]:
                continue
            try:
                content = os.read(self._descriptor, most)
            except BlockingIOError:
                continue
            if content:
                self._waits = False
                self._place += len(content)
                return content
            if not (self._grows or self._waits):
                return b""
            if self._grows and os.fstat(self._descriptor).st_size < self._place:
                raise InputError(f"the file was cut to less than the {self._place} bytes that were read of it.")
            time.sleep(POLL)
        return b""

    def exactly(self, count: int) -> bytes:
        """So many bytes; fewer at the end."""
        content = b""
        while len(content) < count:
            more = self.some(count - len(content))
            if not more:
                break
            content += more
        return content


def wave_header(bytes_: Bytes, source: str) -> Container:
    """How the bytes that follow become numbers; the header of a RIFF or RF64 file is read up to its samples.

    Raises
    ------
    InputError : it is no WAV, or packed.
    """
    head = bytes_.exactly(12)
    if head[:4] not in (b"RIFF", b"RF64", b"BW64") or head[8:] != b"WAVE":
        raise InputError(
            f"{source} does not begin as a WAV file; expected one, or --channels and --rate of raw samples."
        )
    form, place = b"", 12
    while place < MOST_HEADER:
        head = bytes_.exactly(8)
        if len(head) < 8:
            break
        name, size = head[:4], struct.unpack("<I", head[4:])[0]
        if name == b"data":
            return _container(form, source)
        if size > MOST_HEADER:
            break
        content = bytes_.exactly(size + size % 2)
        form = content if name == b"fmt " else form
        place += 8 + len(content)
    raise InputError(f"{source} ends before its samples begin.")


def _container(form: bytes, source: str) -> Container:
    if len(form) < 16:
        raise InputError(f"{source} does not tell the form of its samples.")
    code, channels, rate, _, together, _ = struct.unpack("<HHIIHH", form[:16])
    if code == 0xFFFE and len(form) >= 26:
        (code,) = struct.unpack("<H", form[24:26])
    width = together // channels if channels else 0
    kinds = {(1, 1): "u1", (1, 2): "<i2", (1, 3): "<i4", (1, 4): "<i4", (3, 4): "<f4", (3, 8): "<f8"}
    if (code, width) not in kinds or together != width * channels:
        raise InputError(f"{source} holds packed samples (form {code}); expected whole or floating numbers.")
    require_channels(channels, source)
    return Container(require_rate(float(rate), source), channels, np.dtype(kinds[code, width]), width, 0, 0)


def bytestream(
    bytes_: Bytes,
    source: str,
    raw: Raw | None = None,
    pace: float = 1.0,
    start_time: np.datetime64 | None = None,
    start: int = 0,
) -> Stream:
    """Stream of the samples in bytes.

    Parameters
    ----------
    bytes_ : of them.
    source : for messages.
    raw : what they hold; a WAV header is read where not given.
    pace, start_time : see `Stream`.
    start : samples that are passed over.

    Raises
    ------
    InputError : there is no header, or one that makes no sense.
    """
    container = wave_header(bytes_, source) if raw is None else raw.container(source)
    return Stream(
        _pieces(bytes_, container, start),
        container.rate,
        numbered(container.channels),
        source,
        start_time,
        pace,
    )


def _pieces(bytes_: Bytes, container: Container, start: int) -> Iterator[Piece]:
    together = container.channels * container.width
    most = max(1, round(PIECE * container.rate)) * together
    passed, number, rest = start * together, 0, b""
    while content := bytes_.some(most if not passed else min(passed, 2**20)):
        if passed:
            passed -= len(content)
            continue
        content = rest + content
        whole = len(content) // together * together
        rest = content[whole:]
        if whole:
            values = container.decode(np.frombuffer(content[:whole], np.uint8)).astype(np.float32)
            yield Piece(number / container.rate, values, 0)
            number += len(values)


def growing_file(path: Path, stop: threading.Event, raw: Raw | None, start: int = 0) -> Stream:
    """Stream of a file that is being written, WAV or raw: its end is only where it is now.

    Parameters
    ----------
    path : of the file.
    stop, raw, start : as above.

    Raises
    ------
    InputError : the file cannot be opened, or its header makes no sense.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY)
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror}).") from error
    return bytestream(Bytes(descriptor, stop, grows=True), str(path), raw, float("inf"), start=start)


def named_pipe(path: Path, stop: threading.Event, raw: Raw | None) -> Stream:
    """Stream of a named pipe; who writes to it may come later. Its samples begin now.

    Raises
    ------
    InputError : as `growing_file`.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror}).") from error
    return bytestream(Bytes(descriptor, stop), str(path), raw, start_time=now())


def standard_input(stop: threading.Event, raw: Raw | None) -> Stream:
    """Stream of standard input. Its samples begin now.

    Raises
    ------
    InputError : its header makes no sense.
    """
    return bytestream(Bytes(0, stop), "standard input", raw, start_time=now())


def now() -> np.datetime64:
    """UTC."""
    return np.datetime64(time.time_ns(), "ns")
