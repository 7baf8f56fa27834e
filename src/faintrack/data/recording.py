"""Raw samples of a sensor with several channels, read when they are asked for.

A recording is a description (sample rate, length, channel names, start) and one function that reads a
stretch of samples. A file of a day and an array in memory are the same thing to whoever reads them block by
block, so memory does not grow with the length of a recording.
"""

import datetime
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

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
    live : whether samples come as they are recorded: what lies ahead cannot be read, and `length` is no more than where
        to stop at the latest.
    """

    read: Callable[[int, int], np.ndarray]
    length: int
    sample_rate: float
    channel_names: tuple[str, ...]
    start_time: np.datetime64 | None = None
    source: str = "samples in memory"
    remarks: tuple[str, ...] = ()
    live: bool = False

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
    samples: Any,
    sample_rate: float,
    channel_names: Iterable[str] | None = None,
    start_time: np.datetime64 | datetime.datetime | str | None = None,
) -> Recording:
    """Recording of samples in memory.

    Parameters
    ----------
    samples : shape (time, channel), real; where they are masked they are NaN.
    sample_rate : Hz.
    channel_names : one for each column; "0", "1", ... where not given.
    start_time : time of the first sample in UTC.

    Raises
    ------
    InputError : the array has not two axes or no real numbers, the names do not fit the columns, or the rate or the
        start is none.

    Examples
    --------
    >>> import numpy as np
    >>> recording = from_samples(np.zeros((300, 2)), sample_rate=100.0)
    >>> recording.duration, recording.channel_names
    (3.0, ('0', '1'))
    """
    samples = as_array(samples, "samples")
    if samples.ndim != 2:
        raise InputError(f"samples have shape {samples.shape}; expected two axes, (time, channel).")
    names = tuple(str(i) for i in range(samples.shape[1])) if channel_names is None else tuple(map(str, channel_names))
    if len(names) != samples.shape[1]:
        raise InputError(f"there are {len(names)} channel names for {samples.shape[1]} columns of samples.")
    try:
        rate = float(sample_rate)
    except (TypeError, ValueError):
        raise InputError(f"the sample rate is {str(sample_rate)[:80]!r}; expected a number above 0 Hz.") from None
    try:
        start = None if start_time is None else np.datetime64(_without_zone(start_time), "ns")
    except (TypeError, ValueError):
        raise InputError(f"start_time is {str(start_time)[:80]!r}; expected a time in UTC.") from None
    return Recording(lambda start, stop: samples[start:stop], len(samples), rate, names, start)


def _without_zone(moment: Any) -> Any:
    """A time in UTC without its zone, which NumPy does not know."""
    if isinstance(moment, datetime.datetime) and moment.tzinfo is not None:
        return moment.astimezone(datetime.UTC).replace(tzinfo=None)
    return moment.removesuffix("Z").removesuffix("+00:00") if isinstance(moment, str) else moment


def as_array(values: Any, name: str) -> np.ndarray:
    """Real numbers as an array, NaN where they are masked.

    Parameters
    ----------
    values : anything that NumPy makes an array of.
    name : of the values, for the message.

    Raises
    ------
    InputError : they are no numbers, or complex.

    Examples
    --------
    >>> as_array(np.ma.masked_array([1, 2], mask=[False, True]), "samples").tolist()
    [1.0, nan]
    """
    try:
        array: Any = values if np.ma.isMaskedArray(values) else np.asarray(values)
    except ValueError:
        raise InputError(f"{name} have rows of different lengths; expected an array.") from None
    if array.dtype.kind == "c":
        raise InputError(
            f"{name} hold {array.dtype}; expected real numbers. Complex samples of coherent receivers need a "
            "beamformer of both sides of the spectrum, which there is not yet."
        )
    if array.dtype.kind not in "biuf":
        raise InputError(f"{name} hold {array.dtype}; expected real numbers.")
    if np.ma.isMaskedArray(array):
        array = np.ma.filled(array.astype(np.promote_types(array.dtype, np.float32)), np.nan)
    return np.asarray(array)
