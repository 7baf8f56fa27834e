"""The seam between whatever brings samples and the loop that takes them in.

A source of samples is written as a function that returns a `Stream`; it knows nothing of buffers, scans and trackers.
It may block in `next`, and runs in a thread of its own.
"""

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from jaxtyping import Float


class Piece(NamedTuple):
    """Consecutive samples of all channels.

    Attributes
    ----------
    time : of the first sample; seconds from the first sample of the stream.
    values : samples.
    gap : samples that are missing before the first.
    """

    time: float
    values: Float[np.ndarray, "sample channel"]
    gap: int


@dataclass(frozen=True)
class Stream:
    """Samples as they come.

    Attributes
    ----------
    pieces : in order of time; it ends where the stream does.
    sample_rate : Hz.
    channel_names : of the columns.
    source : where they come from, for messages.
    start_time : of the first sample in UTC; None where it is not known.
    pace : seconds of samples a second of time; infinite where samples are stored and wait.
    counts : what went wrong on the way, by name; the source counts as it goes.
    """

    pieces: Iterator[Piece]
    sample_rate: float
    channel_names: tuple[str, ...]
    source: str
    start_time: np.datetime64 | None = None
    pace: float = 1.0
    counts: Counter[str] = field(default_factory=Counter)

    @property
    def stored(self) -> bool:
        """Whether samples wait until they are asked for."""
        return math.isinf(self.pace)


def numbered(channels: int) -> tuple[str, ...]:
    """Names of channels that have none.

    Examples
    --------
    >>> numbered(3)
    ('0', '1', '2')
    """
    return tuple(map(str, range(channels)))
