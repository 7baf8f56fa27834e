"""Raw samples of a sensor with several channels, read when they are asked for.

A recording is a description (sample rate, length, channel names, start) and one function that reads a
stretch of samples. A file of a day and an array in memory are the same thing to whoever reads them block by
block, so memory does not grow with the length of a recording.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from faintrack.errors import InputError


@dataclass(frozen=True)
class Recording:
    """Samples of several channels on one clock.

    Attributes
    ----------
    read : function of (start, stop), sample numbers, to an array of shape (stop - start, channels).
    length : number of samples in each channel.
    sample_rate : samples a second; Hz.
    channel_names : a name for each channel, in the order of the columns.
    start_time : time of the first sample in UTC, or None where the source does not tell.
    source : where the samples come from, for messages.
    remarks : what was assumed, left out, or does not fit; one sentence each.
    """

    read: Callable[[int, int], np.ndarray]
    length: int
    sample_rate: float
    channel_names: tuple[str, ...]
    start_time: np.datetime64 | None = None
    source: str = "samples in memory"
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not (np.isfinite(self.sample_rate) and self.sample_rate > 0):
            raise InputError(f"{self.source}: the sample rate is {self.sample_rate}, expected a number above 0 Hz.")
        if self.length < 1 or not self.channel_names:
            raise InputError(f"{self.source}: there are no samples.")

    @property
    def channels(self) -> int:
        """Number of channels."""
        return len(self.channel_names)

    @property
    def duration(self) -> float:
        """Length in seconds."""
        return self.length / self.sample_rate

    def blocks(self, size: int) -> Iterator[np.ndarray]:
        """Yield consecutive arrays of `size` samples (time, channel); the last may be shorter."""
        for start in range(0, self.length, size):
            yield self.read(start, min(start + size, self.length))


def from_samples(
    samples: np.ndarray,
    sample_rate: float,
    channel_names: tuple[str, ...] | None = None,
    start_time: np.datetime64 | None = None,
) -> Recording:
    """Recording of samples in memory.

    Parameters
    ----------
    samples : shape (time, channel).
    sample_rate : Hz.
    channel_names : one for each column; "0", "1", ... where not given.
    start_time : time of the first sample in UTC.

    Raises
    ------
    InputError : the array has not two axes, or the names do not fit the columns.

    Examples
    --------
    >>> import numpy as np
    >>> recording = from_samples(np.zeros((300, 2)), sample_rate=100.0)
    >>> recording.duration, recording.channel_names
    (3.0, ('0', '1'))
    """
    samples = np.asarray(samples)
    if samples.ndim != 2:
        raise InputError(f"samples have shape {samples.shape}; expected two axes, (time, channel).")
    names = tuple(str(i) for i in range(samples.shape[1])) if channel_names is None else channel_names
    if len(names) != samples.shape[1]:
        raise InputError(f"there are {len(names)} channel names for {samples.shape[1]} columns of samples.")
    return Recording(lambda start, stop: samples[start:stop], len(samples), sample_rate, names, start_time)
