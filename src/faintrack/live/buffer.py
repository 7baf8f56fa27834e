"""Samples between a stream and the loop: bounded, sparse, with holes that stay holes.

Samples are addressed by their number since the watch began. A gap takes no memory; what is read of it is NaN, which the
gate takes for missing, so that nothing is shifted in time and nothing passes for silence. A stream that is ahead of the
clock is made to wait while the buffer is full; one that keeps step with it cannot wait, and then everything held is
left out at once, so that the loop stands beside the stream again and not a buffer's length behind it.
"""

import threading
import time
from collections import deque

import numpy as np
from jaxtyping import Float

from faintrack.data.missing import CONSTANT_RUN
from faintrack.data.recording import Recording
from faintrack.errors import InputError
from faintrack.live.stream import Stream

SECONDS = 64.0
"""Of samples held at most: the scale of the values is found in a minute of them at most (`faintrack.data.missing`)."""

MOST_VALUES = 3 * 2**23
"""Numbers held at most, 100 MB of them, which that minute never exceeds."""

AHEAD = 5.0
"""Seconds by which a stream is ahead of the clock before it is made to wait."""

LOOKAHEAD = CONSTANT_RUN
"""Samples on either side of a stretch that the gate looks at."""

FAR = 2**50
"""Length of a recording without an end; samples."""

TICK = 0.2
"""Between looks at whether to stop; seconds."""


class Buffer:
    """What has come of a stream and was not taken in yet; one thread fills it, another reads.

    Parameters
    ----------
    stream : whose samples it holds; it must not be iterated by anyone else.
    base : number of its first sample.
    opening : samples from number 0 on that an earlier run began with, and made its plan from.
    stop : event at which whoever waits gives up.
    """

    def __init__(
        self,
        stream: Stream,
        base: int = 0,
        opening: Float[np.ndarray, "sample channel"] | None = None,
        stop: threading.Event | None = None,
    ) -> None:
        self.stream = stream
        self.stop = threading.Event() if stop is None else stop
        self._opening = np.empty((0, len(stream.channel_names)), np.float32) if opening is None else opening
        self._capacity = max(
            8 * LOOKAHEAD, min(round(SECONDS * stream.sample_rate), MOST_VALUES // len(stream.channel_names))
        )
        self._changed = threading.Condition()
        self._held: deque[tuple[int, np.ndarray]] = deque()
        self._count = 0
        self._base, self._end = base, base
        self._left_out_before = base
        self._furthest = 0
        self._begun: float | None = None
        self._over = False
        self._error: BaseException | None = None
        self._gaps: deque[tuple[int, int]] = deque(maxlen=1000)

    @property
    def end(self) -> int:
        """Number of the sample after the last that has come."""
        return self._end

    @property
    def left_out_before(self) -> int:
        """Number of the first sample that was not left out because nobody took it in; that of the stream's first."""
        return self._left_out_before

    @property
    def over(self) -> bool:
        """Whether the stream has ended."""
        return self._over

    def start(self) -> None:
        """Begin to take in the stream, in a thread that ends with the process."""
        threading.Thread(target=self._fill, name="stream", daemon=True).start()

    def put(self, values: Float[np.ndarray, "sample channel"], gap: int = 0) -> None:
        """Add the samples that have come, after a gap; waits where the buffer is full and the stream can."""
        part = self._capacity // 8
        for start in range(0, max(len(values), 1), part):
            self._put(values[start : start + part], gap if start == 0 else 0)

    def _put(self, values: np.ndarray, gap: int) -> None:
        with self._changed:
            if self._begun is None:
                self._begun = time.monotonic()
            while self._count + len(values) > self._capacity and self._can_wait() and not self.stop.is_set():
                self._changed.wait(TICK)
            if self._count + len(values) > self._capacity:
                self._held.clear()
                self._count = 0
                self._left_out_before = self._end
            if gap:
                self._gaps.append((self._end, gap))
            self._end += gap
            self._held.append((self._end, values))
            self._count += len(values)
            self._end += len(values)
            self._changed.notify_all()

    def finish(self, error: BaseException | None = None) -> None:
        """Tell that nothing more comes."""
        with self._changed:
            self._over, self._error = True, error
            self._changed.notify_all()

    def wait(self, stop: int) -> bool:
        """Wait for the samples before number `stop`; whether they are there, or else the stream has ended.

        Raises
        ------
        InputError : the stream broke, and why.
        """
        with self._changed:
            while self._end < stop and not self._over and not self.stop.is_set():
                self._changed.wait(TICK)
            if self._end < stop and self._error is not None:
                raise (
                    self._error
                    if isinstance(self._error, InputError)
                    else InputError(f"{self.stream.source} broke ({str(self._error) or type(self._error).__name__}).")
                ) from self._error
            return self._end >= stop

    def read(self, start: int, stop: int) -> Float[np.ndarray, "sample channel"]:
        """Samples `start` to before `stop`, NaN where there are none; fewer where the stream has ended before.

        Raises
        ------
        InputError : more is asked for than is ever held.
        """
        if stop - start > self._capacity:
            held = self._capacity / self.stream.sample_rate
            raise InputError(
                f"{self.stream.source}: {(stop - start) / self.stream.sample_rate:g} s are needed at once and "
                f"{held:.3g} s are held; expected a shorter analysis.frame or likelihood.noise_seconds."
            )
        if stop > len(self._opening):
            self.wait(stop)
        with self._changed:
            self._furthest = max(self._furthest, stop)
            there = max(0, min(stop, max(self._end, len(self._opening))) - start)
            values = np.full((there, self._opening.shape[1]), np.nan, np.float32)
            for first, piece in ((0, self._opening), *self._held):
                low, high = max(first, start), min(first + len(piece), start + len(values))
                if low < high:
                    values[low - start : high - start] = piece[low - first : high - first]
            return values

    def opening(self) -> Float[np.ndarray, "sample channel"]:
        """Samples from the first on, as far as they were read."""
        return self.read(0, min(self._furthest, self._capacity))

    def discard(self, before: int) -> None:
        """Let go of the samples before a number."""
        with self._changed:
            while self._held and self._held[0][0] + len(self._held[0][1]) <= before:
                self._count -= len(self._held.popleft()[1])
            self._changed.notify_all()

    def next_held(self, start: int) -> int:
        """Number of the first sample from `start` on that is there, or of the one that comes next."""
        with self._changed:
            for first, piece in self._held:
                if first + len(piece) > start:
                    return max(first, start)
            return max(self._end, start)

    def gaps(self, before: int) -> list[tuple[int, int]]:
        """First sample and length of the gaps that begin before a sample; each is told once."""
        with self._changed:
            told = []
            while self._gaps and self._gaps[0][0] < before:
                told.append(self._gaps.popleft())
            return told

    def recording(self) -> Recording:
        """The stream as a recording, whose samples are waited for where they have not come."""
        stream = self.stream
        return Recording(
            self.read, FAR, stream.sample_rate, stream.channel_names, stream.start_time, stream.source, live=True
        )

    def _can_wait(self) -> bool:
        if self.stream.stored:
            return True
        elapsed = time.monotonic() - (self._begun or 0.0)
        return (self._end - self._base) / self.stream.sample_rate / self.stream.pace - elapsed > AHEAD

    def _fill(self) -> None:
        try:
            for piece in self.stream.pieces:
                self.put(piece.values, piece.gap)
                if self.stop.is_set():
                    break
        # Whatever a source raises ends the watch with its reason, in the thread that waits.
        except BaseException as error:
            self.finish(error)
            return
        self.finish()
