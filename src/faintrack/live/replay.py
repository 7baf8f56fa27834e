"""A recording played as if it came now, at any speed."""

import math
import threading
import time
from collections.abc import Iterator

import numpy as np

from faintrack.data.recording import Recording
from faintrack.live.stream import Piece, Stream

PIECE = 0.1
"""Seconds of time between pieces."""


def replay(recording: Recording, speed: float, stop: threading.Event, start: int = 0) -> Stream:
    """Stream of a recording.

    Parameters
    ----------
    recording : of any format.
    speed : seconds of it a second; infinite for as fast as it is taken in.
    stop : event at which it ends.
    start : number of the sample to begin with.

    Examples
    --------
    >>> from faintrack.data.recording import from_samples
    >>> played = replay(from_samples(np.zeros((250, 2)), 100.0), math.inf, threading.Event())
    >>> [(piece.time, len(piece.values)) for piece in played.pieces]
    [(0.0, 100), (1.0, 100), (2.0, 50)]
    """
    rate = recording.sample_rate
    size = max(1, round(rate * (1.0 if math.isinf(speed) else PIECE * speed)))

    def pieces() -> Iterator[Piece]:
        begun = time.monotonic()
        for first in range(start, recording.length, size):
            values = np.asarray(recording.read(first, min(first + size, recording.length)), np.float32)
            ahead = (first + len(values) - start) / rate / speed - (time.monotonic() - begun)
            if ahead > 0 and stop.wait(ahead):
                return
            yield Piece((first - start) / rate, values, 0)

    return Stream(pieces(), rate, recording.channel_names, recording.source, recording.start_time, speed)
