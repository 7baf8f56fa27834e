"""The samples of a segment's chain: files opened when they are reached, missing where there is none."""

import hashlib
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from types import TracebackType
from typing import Any

import numpy as np

from faintrack.archive.cut import Segment
from faintrack.archive.pieces import SECOND, Piece, reason_of
from faintrack.archive.remote import on_disk, stamp
from faintrack.data.recording import Recording
from faintrack.errors import InputError
from faintrack.io.recordings import read

OPEN = 4
"""Files that are kept open."""

FAR = 2**62
"""Length of a recording of which the end is nobody's business."""


class Unreadable(Exception):
    """A file that is to be left out: its path, and why."""

    def __init__(self, piece: Piece, reason: str) -> None:
        super().__init__(piece.paths[0], reason)
        self.piece, self.reason = piece, reason


class Samples:
    """Samples of a segment's chain; a context manager.

    Attributes
    ----------
    segment : of the chain.
    bytes_read : samples that were read, in the bytes that they take in their files.
    digest : of the samples of the segment's own scans, in their order.
    """

    def __init__(self, segment: Segment) -> None:
        self.segment = segment
        self.bytes_read = 0.0
        self.digest = hashlib.blake2b(digest_size=16)
        self._opened: OrderedDict[Piece, tuple[Recording, ExitStack]] = OrderedDict()
        self._used: set[Piece] = set()

    def __enter__(self) -> "Samples":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        while self._opened:
            self._opened.popitem()[1][1].close()

    def recording(self) -> Recording:
        """Recording of the chain, from its origin on, as if it were read while it is made."""
        first, origin = self.segment.pieces[0], self.segment.origin
        rate = first.sample_rate
        places = [round((piece.begin - origin) * rate / SECOND) for piece in self.segment.pieces]

        def read_samples(start: int, stop: int) -> np.ndarray:
            samples = np.full((stop - start, len(first.channel_names)), np.nan, np.float32)
            for piece, place in zip(self.segment.pieces, places, strict=True):
                low, high = max(start, place), min(stop, place + piece.length)
                if low < high:
                    samples[low - start : high - start] = self._read(piece, low - place, high - place)
            return samples

        begun = np.datetime64(origin, "ns")
        source = f"{self.segment.station} from {np.datetime_as_string(begun, unit='s')}Z"
        return Recording(read_samples, FAR, rate, first.channel_names, begun, source, live=True)

    def require_unchanged(self) -> None:
        """Refuse what was read if a file has changed meanwhile.

        Raises
        ------
        Unreadable : a file has changed or vanished since headers were read.
        """
        for piece in sorted(self._used, key=lambda piece: piece.begin):
            _require_stamps(piece)

    def _read(self, piece: Piece, start: int, stop: int) -> np.ndarray:
        recording = self._recording(piece)
        self._used.add(piece)
        self.bytes_read += piece.size * (stop - start) / (piece.length + piece.skip)
        try:
            return recording.read(piece.skip + start, piece.skip + stop)
        except (InputError, OSError) as error:
            raise Unreadable(piece, reason_of(error, piece.paths[0])) from error

    def _recording(self, piece: Piece) -> Recording:
        if piece not in self._opened:
            _require_stamps(piece)
            if len(self._opened) >= OPEN:
                self._opened.popitem(last=False)[1][1].close()
            held = ExitStack()
            try:
                recording = read(*held.enter_context(on_disk(piece.paths)))
            except (InputError, OSError) as error:
                held.close()
                raise Unreadable(piece, reason_of(error, piece.paths[0])) from error
            if (recording.sample_rate, recording.channel_names) != piece.layout:
                raise Unreadable(piece, "it is not what its header was")
            self._opened[piece] = recording, held
        self._opened.move_to_end(piece)
        return self._opened[piece][0]


def _require_stamps(piece: Piece) -> None:
    for path, before in zip(piece.paths, piece.stamps, strict=True):
        try:
            now = stamp(path)
        except (OSError, InputError) as error:
            raise Unreadable(piece, "it has vanished since the archive was planned") from error
        if now != before:
            raise Unreadable(piece, "it has changed since the archive was planned")


class ReadAhead:
    """Blocks of a plan, the next of which is read while the one before is computed; a context manager.

    Parameters
    ----------
    read : of a `faintrack.kinds.kind.Plan`; called by one thread at a time.
    """

    def __init__(self, read: Callable[[int, int], Any]) -> None:
        self._read, self._next = read, dict[tuple[int, int], Future[Any]]()
        self._thread = ThreadPoolExecutor(1)

    def __enter__(self) -> "ReadAhead":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._thread.shutdown(cancel_futures=True)

    def __call__(self, start: int, stop: int, until: int) -> Any:
        """Block of some scans; that of as many scans after it, none beyond `until`, is begun.

        Raises
        ------
        InputError : as of `read`.
        """
        waiting = self._next.pop((start, stop), None)
        for other in self._next.values():
            other.cancel()
        self._next.clear()
        block = self._thread.submit(self._read, start, stop).result() if waiting is None else waiting.result()
        after = stop, min(2 * stop - start, until)
        if after[1] > after[0]:
            self._next[after] = self._thread.submit(self._read, *after)
        return block
