"""Recordings behind the gate for values: NaN where samples are missing, and in a scale whose squares are numbers."""

from dataclasses import replace

import numpy as np

from faintrack.data.missing import Missing, gated
from faintrack.data.recording import Recording


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
