"""How a station's time is cut: chains that begin with a burn-in, segments that pass their state on.

Where chains and segments begin follows from the clock alone: chains at multiples of their length since 1970, segments
at multiples of theirs since their chain began. What a segment's result depends on is its **fingerprint**: the files it
reads, where they lie, and the fingerprint of the segment whose state it begins with. A segment with the same
fingerprint is the same segment, and need not be computed again.
"""

import hashlib
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath

import numpy as np

from faintrack.archive.pieces import SECOND, Piece
from faintrack.errors import InputError

EMPTY = 60
"""Scans on end without a sample that are taken in; more are passed over."""

OPENING = 75.0
"""Seconds from the start of a chain that its plan looks at."""


@dataclass(frozen=True)
class Cut:
    """How an archive is cut; seconds.

    Attributes
    ----------
    segment : of a unit of work.
    chain : of time through which the state is passed on, a multiple of `segment`.
    burn_in : before a chain begins.

    Raises
    ------
    InputError : a length is not above 0, or they do not fit each other.
    """

    segment: float = 3600.0
    chain: float = 86400.0
    burn_in: float = 600.0

    def __post_init__(self) -> None:
        if not (self.segment > 0 and self.chain > 0 and self.burn_in >= 0):
            raise InputError(f"segment, chain and burn-in are {self.segment:g}, {self.chain:g} and {self.burn_in:g} s.")
        if self.chain % self.segment or self.burn_in > self.chain:
            raise InputError(
                f"a chain of {self.chain:g} s has segments of {self.segment:g} s and a burn-in of {self.burn_in:g} s; "
                "expected whole segments, and a burn-in no longer than the chain."
            )


@dataclass(frozen=True)
class Segment:
    """A stretch of a station that is computed at once.

    Attributes
    ----------
    station : its name.
    start, stop : ends of the stretch; ns since 1970.
    chain : when its chain begins; ns since 1970.
    origin : time of the first sample of the chain's recording, before `chain` where there is a burn-in; ns since 1970.
    ranges : scans that are taken in, counted from `origin`, the first and the one after the last of each.
    frame : of a scan; samples.
    pieces : that are read.
    before : name of the segment whose state it begins with; None of the first of a chain.
    fingerprint : of all that its result depends on.
    """

    station: str
    start: int
    stop: int
    chain: int
    origin: int
    ranges: tuple[tuple[int, int], ...]
    frame: int
    pieces: tuple[Piece, ...]
    before: str | None
    fingerprint: str

    @property
    def name(self) -> str:
        """Of its folder."""
        return f"{self.station}/{stamped(self.start)}"

    @property
    def scans(self) -> int:
        """That are taken in, those of a burn-in too."""
        return sum(stop - first for first, stop in self.ranges)

    @property
    def seconds(self) -> float:
        """Of the scans."""
        return self.scans * self.frame / self.pieces[0].sample_rate


def stamped(time: int) -> str:
    """A time as names have it.

    Examples
    --------
    >>> stamped(1_767_225_600 * SECOND), stamped(1_767_225_600 * SECOND + 500_000_000)
    ('20260101T000000Z', '20260101T000000.500Z')
    """
    whole = np.datetime_as_string(np.datetime64(time, "ns"), unit="ms").replace("-", "").replace(":", "")
    return f"{whole.removesuffix('.000')}Z"


def chains_of(pieces: Sequence[Piece], cut: Cut, frame: float, opening: float = OPENING) -> list[tuple[Segment, ...]]:
    """Chains of one station, each the segments in which there is something to take in.

    Parameters
    ----------
    pieces : on one clock, by time, see `faintrack.archive.pieces.laid`.
    cut : how they are cut.
    frame : of a scan; seconds.
    opening : seconds from the start of a chain that its plan looks at.

    Examples
    --------
    >>> piece = Piece(("a.wav",), ("9 9",), "north", 50 * SECOND, 0, 1000, 10.0, ("0",))
    >>> for chain in chains_of([piece], Cut(20, 60, 5), 1.0):
    ...     print([(segment.start // SECOND, segment.ranges) for segment in chain])
    [(40, ((0, 10),))]
    [(60, ((0, 25),)), (80, ((25, 45),)), (100, ((45, 65),))]
    [(120, ((0, 25),)), (140, ((25, 35),))]
    """
    if not pieces:
        return []
    rate = pieces[0].sample_rate
    samples = max(1, round(frame * rate))
    step = samples * SECOND / rate
    length, burn_in = round(cut.chain * SECOND), round(cut.burn_in * SECOND)
    chains = []
    for number in range(pieces[0].begin // length, -(-pieces[-1].end // length)):
        start, stop = number * length, (number + 1) * length
        held = [piece for piece in pieces if piece.end > start - burn_in and piece.begin < stop]
        if not any(piece.end > start for piece in held):
            continue
        first = max(held[0].begin, start - burn_in)
        origin = start + round(math.ceil((first - start) / step - 1e-6) * step)
        chains.append(_segments(held, cut, start, origin, samples, step, opening))
    return [chain for chain in chains if chain]


def _segments(
    pieces: list[Piece], cut: Cut, chain: int, origin: int, samples: int, step: float, opening: float
) -> tuple[Segment, ...]:
    length = round(cut.segment * SECOND)
    ranges = _ranges(pieces, origin, step)
    segments: list[Segment] = []
    for start in range(chain, chain + round(cut.chain * SECOND), length):
        # What precedes the chain belongs to its first segment, whichever that is.
        first = 0 if not segments else _scan(start - origin, step)
        last = _scan(start + length - origin, step)
        mine = tuple((max(low, first), min(high, last)) for low, high in ranges if low < last and high > first)
        if not any(high > _scan(start - origin, step) for _, high in mine):
            continue
        ends = origin + mine[0][0] * step - step, origin + mine[-1][1] * step + step
        read = [
            piece
            for piece in pieces
            if (piece.begin < ends[1] and piece.end > ends[0]) or piece.begin < origin + opening * SECOND
        ]
        before = segments[-1] if segments else None
        facts = [
            [origin, mine, samples, None if before is None else before.fingerprint],
            [[[PurePosixPath(p).name for p in q.paths], q.stamps, q.begin, q.skip, q.length] for q in read],
        ]
        fingerprint = hashlib.sha256(json.dumps(facts).encode()).hexdigest()
        name = None if before is None else before.name
        segments.append(
            Segment(
                *(pieces[0].station, start, start + length, chain, origin, mine, samples, tuple(read), name),
                fingerprint,
            )
        )
    return tuple(segments)


def _ranges(pieces: list[Piece], origin: int, step: float) -> list[tuple[int, int]]:
    """Whole scans that pieces hold, with short gaps in them."""
    runs: list[tuple[int, int]] = []
    for piece in pieces:
        if runs and piece.begin == runs[-1][1]:
            runs[-1] = runs[-1][0], piece.end
        else:
            runs.append((piece.begin, piece.end))
    merged: list[tuple[int, int]] = []
    for begin, end in runs:
        low, high = max(0, _scan(begin - origin, step)), math.floor((end - origin) / step + 1e-6)
        if high <= low:
            continue
        if merged and low - merged[-1][1] <= EMPTY:
            merged[-1] = merged[-1][0], high
        else:
            merged.append((low, high))
    return merged


def _scan(time: float, step: float) -> int:
    """First scan that begins at a time or later."""
    return math.ceil(time / step - 1e-6)
