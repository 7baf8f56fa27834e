"""Data behind the gate for values: what is missing is left out, in a scale that can be squared."""

from dataclasses import replace

import numpy as np

from faintrack.data.missing import Missing, gate_frames, gated, level
from faintrack.data.recording import Recording
from faintrack.data.sequence import Sequence
from faintrack.errors import InputError

LOWEST, HIGHEST = 1e-9, 1e9
"""Levels between which squares of values, and sums of many of them, are numbers in single precision."""


class CleanRecording:
    """A recording whose samples are looked at as they are read; see `faintrack.data.missing`.

    Attributes
    ----------
    recording : the same, NaN where samples are missing, all divided by `level`.
    level : a power of two near the median of the samples' magnitudes.
    """

    def __init__(self, recording: Recording) -> None:
        held = gated(recording)
        self.level = held.level
        self._names, self._rate = recording.channel_names, recording.sample_rate
        self._missing: Missing | None = None
        self._stop = 0

        def read(start: int, stop: int) -> np.ndarray:
            samples, missing = held.read(start, stop)
            # Stretches that are read again were counted.
            if start >= self._stop:
                skipped = start - self._stop
                self._missing = missing if self._missing is None or skipped else self._missing + missing
                self._stop = stop
            return samples if self.level == 1 else samples / np.asarray(self.level, samples.dtype)

        self.recording = replace(recording, read=read)

    def remarks(self) -> tuple[str, ...]:
        """What was left out of what was read so far; one sentence each."""
        return () if self._missing is None else self._missing.sentences(self._names, self._rate)


class CleanRecord:
    """A bearing-time record whose energies are looked at as they are read; see `faintrack.data.missing`.

    Attributes
    ----------
    record : the same, NaN where energies are missing.
    """

    def __init__(self, record: Sequence) -> None:
        self._times = record.times
        self._missing: Missing | None = None
        self._stop = 0
        own = level(np.asarray(record.read(0, 1)))

        def read(start: int, stop: int) -> np.ndarray:
            clean, missing = gate_frames(record.read(start, stop), level=own)
            if start >= self._stop:
                self._missing = missing if self._missing is None else self._missing + missing
                self._stop = stop
            return clean

        self.record = replace(record, read=read)

    def remarks(self) -> tuple[str, ...]:
        """What was left out of what was read so far; one sentence each."""
        return () if self._missing is None else self._missing.sentences(sample_rate=1 / _interval(self._times))


class CleanFrames:
    """Frames whose values are looked at as they are read; see `faintrack.data.missing`.

    Missing cells are filled with what they held last, so that backgrounds stay as they are, and are told apart.
    Values are divided by `level` where it is far from one; power and amplitude alike.

    Attributes
    ----------
    level : a power of two near the median of the values' magnitudes; 1 where squares are numbers as they are.
    """

    def __init__(self, sequence: Sequence, positive: bool, negative: str) -> None:
        self._sequence, self._positive, self._negative = sequence, positive, negative
        own = level(np.asarray(sequence.read(0, 1)))
        # Whatever is told in the unit of the frames, such as the level of the noise, stays as it is where it can.
        self.level = own if not LOWEST < own < HIGHEST else 1.0
        self._last: np.ndarray | None = None
        self._missing: Missing | None = None
        self._stop = 0

    def read(self, start: int, stop: int) -> tuple[np.ndarray, np.ndarray]:
        """Frames in single precision, and which of their cells are missing.

        Raises
        ------
        InputError : a frame of power holds values below 0, or the file cannot be read.
        """
        clean, missing = gate_frames(self._sequence.read(start, stop), level=self.level)
        left_out = np.isnan(clean)
        if self._positive:
            low = np.where(left_out, 0, clean).reshape(len(clean), -1).min(axis=1)
            if (low < 0).any():
                raise InputError(
                    f"{self._sequence.source}: frame {start + int(np.argmax(low < 0))} holds {self._negative}."
                )
        if start >= self._stop:
            self._missing = missing if self._missing is None else self._missing + missing
            self._stop = stop
        frames = (clean if self.level == 1 else clean / self.level).astype(np.float32)
        for number in np.flatnonzero(left_out.reshape(len(frames), -1).any(axis=1)):
            before = frames[number - 1] if number else self._last
            holes = left_out[number]
            if before is None:
                good = frames[number][~holes]
                frames[number][holes] = np.median(good) if good.size else 1.0
            else:
                frames[number][holes] = before[holes]
        self._last = frames[-1].copy()
        return frames, left_out

    def remarks(self) -> tuple[str, ...]:
        """What was left out of what was read so far; one sentence each."""
        if self._missing is None:
            return ()
        return self._missing.sentences(sample_rate=1 / _interval(self._sequence.times))


def _interval(times: np.ndarray) -> float:
    """Between two frames; seconds."""
    return float(np.median(np.diff(times))) if len(times) > 1 else 1.0
