"""The files of a station put on one clock: what lies where, what overlaps, and what does not belong there.

Names tell times in whole seconds and clocks of recorders drift. A file that begins within `SLACK` of where the one
before it ended goes on from there; where it begins later there is a gap, and where it begins earlier its first samples
are left out, since they were recorded twice.
"""

from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from faintrack.archive.remote import on_disk, size_of, stamp
from faintrack.archive.sources import Source
from faintrack.data.recording import Recording
from faintrack.errors import InputError
from faintrack.io.recordings import read

SLACK = 1_000_000_000
"""Between two files on end, where the later one tells its start in whole seconds; ns."""

READERS = 8
"""Headers that are read side by side."""

SECOND = 1_000_000_000
"""In nanoseconds."""

LeftOut = tuple[str, str, str]
"""Path, stamp and reason of a file that is left out."""


@dataclass(frozen=True)
class Piece:
    """A recording of a station, as its headers tell.

    Attributes
    ----------
    paths : of its files, channels side by side.
    stamps : of the files when the headers were read.
    station : its name.
    begin : of the first sample that is used; ns since 1970 in UTC.
    skip : samples before it.
    length : samples that are used.
    sample_rate : Hz.
    channel_names : of the columns.
    overlap : samples that were recorded before as well, and are left out.
    """

    paths: tuple[str, ...]
    stamps: tuple[str, ...]
    station: str
    begin: int
    skip: int
    length: int
    sample_rate: float
    channel_names: tuple[str, ...]
    overlap: int = 0

    @property
    def end(self) -> int:
        """Time after the last sample; ns."""
        return self.begin + round(self.length * SECOND / self.sample_rate)

    @property
    def size(self) -> int:
        """Bytes of its files."""
        return sum(map(size_of, self.stamps))

    @property
    def layout(self) -> tuple[float, tuple[str, ...]]:
        """Sample rate and channels."""
        return self.sample_rate, self.channel_names


def pieces_of(
    sources: Iterable[Source],
    left_out: Mapping[str, LeftOut],
    known: Mapping[tuple[str, ...], Piece],
    progress: Callable[[int, int | None], None] = lambda done, total: None,
) -> tuple[list[Piece], list[LeftOut]]:
    """Pieces of an archive by station and time, and the files that cannot be read.

    Parameters
    ----------
    sources : files of the archive.
    left_out : files by path that were left out before; they are again, unless they have changed since.
    known : pieces by paths whose headers were read before, and are not again, unless the files have changed since.
    progress : is called with the files that were looked at just now, and the number of all.
    """
    listed = list(sources)
    pieces: list[Piece] = []
    unreadable: list[LeftOut] = []
    with ThreadPoolExecutor(READERS) as readers:
        for found in readers.map(lambda source: _opened(source, left_out, known), listed):
            if isinstance(found, Piece):
                pieces.append(found)
            else:
                unreadable.append(found)
            progress(1, len(listed))
    return sorted(pieces, key=lambda piece: (piece.station, piece.begin, piece.paths)), unreadable


def laid(pieces: Iterable[Piece]) -> tuple[list[Piece], list[LeftOut]]:
    """Pieces of one station on one clock, and those that do not belong to it.

    Parameters
    ----------
    pieces : by time.

    Examples
    --------
    >>> def piece(begin: float, seconds: int) -> Piece:
    ...     return Piece((f"{begin:g}.wav",), ("9 9",), "north", round(begin * SECOND), 0, 10 * seconds, 10.0, ("0",))
    >>> on_clock, left_out = laid([piece(0, 60), piece(61, 60), piece(119, 10), piece(125, 20), piece(126, 5)])
    >>> [(one.begin / SECOND, one.length, one.overlap) for one in on_clock]
    [(0.0, 600, 0), (60.0, 600, 0), (120.0, 100, 0), (130.0, 150, 50)]
    >>> left_out[0][2]
    'what it holds was recorded by a file before it'
    """
    kept: list[Piece] = []
    left_out: list[LeftOut] = []
    for piece in pieces:
        if not kept:
            kept.append(piece)
            continue
        before = kept[-1]
        if piece.layout != kept[0].layout:
            left_out += _refused(piece, _other_layout(piece, kept[0]))
            continue
        offset = piece.begin - before.end
        whole = piece.begin % SECOND == 0
        if abs(offset) <= (SLACK if whole else 1.5 * SECOND / piece.sample_rate):
            piece = replace(piece, begin=before.end)
        elif offset < 0:
            twice = round(-offset * piece.sample_rate / SECOND)
            if twice >= piece.length:
                left_out += _refused(piece, "what it holds was recorded by a file before it")
                continue
            piece = replace(piece, begin=before.end, skip=twice, length=piece.length - twice, overlap=twice)
        kept.append(piece)
    return kept, left_out


def _opened(source: Source, left_out: Mapping[str, LeftOut], known: Mapping[tuple[str, ...], Piece]) -> Piece | LeftOut:
    try:
        stamps = tuple(map(stamp, source.paths))
    except (OSError, InputError) as error:
        return source.paths[0], "", str(error)
    before = left_out.get(source.paths[0])
    if before is not None and before[1] == " ".join(stamps):
        return before
    piece = known.get(source.paths)
    same = piece is not None and (piece.stamps, piece.station) == (stamps, source.station)
    if piece is not None and same and source.start in (None, np.datetime64(piece.begin, "ns")):
        return piece
    try:
        with on_disk(source.paths, head=True) as paths:
            piece = _described(source, stamps, read(*paths))
    except (InputError, OSError):
        # Some formats tell their length at their end: then the whole is looked at.
        try:
            with on_disk(source.paths) as paths:
                piece = _described(source, stamps, read(*paths))
        except (InputError, OSError) as error:
            return source.paths[0], " ".join(stamps), reason_of(error, source.paths[0])
    return piece


def reason_of(error: Exception, path: str) -> str:
    """Why a file is left out, to stand behind its path.

    Examples
    --------
    >>> reason_of(InputError("night/a.wav cannot be read (no samples)."), "night/a.wav")
    'cannot be read (no samples)'
    """
    return str(error).removeprefix(path).lstrip(": ").removesuffix(".")


def _described(source: Source, stamps: tuple[str, ...], recording: Recording) -> Piece:
    start = recording.start_time if source.start is None else source.start
    if start is None:
        raise InputError("neither the name nor the file tells when it starts")
    begin = int(start.astype("datetime64[ns]").astype(np.int64))
    length, rate, names = recording.length, recording.sample_rate, recording.channel_names
    return Piece(source.paths, stamps, source.station, begin, 0, length, rate, names)


def _refused(piece: Piece, reason: str) -> list[LeftOut]:
    return [(piece.paths[0], " ".join(piece.stamps), reason)]


def _other_layout(piece: Piece, first: Piece) -> str:
    one, other = len(piece.channel_names), len(first.channel_names)
    if one != other or piece.sample_rate != first.sample_rate:
        return (
            f"it has {one} channels at {piece.sample_rate:g} Hz; {first.paths[0]}, the station's first, has {other} at "
            f"{first.sample_rate:g} Hz"
        )
    return f"its channels are {', '.join(piece.channel_names[:8])}; the station's, {', '.join(first.channel_names[:8])}"
