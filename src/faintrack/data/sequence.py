"""Frames of a sensor with many cells, read when they are asked for: images, range profiles, range-Doppler matrices.

What `faintrack.data.recording` is for samples this is for frames: a description and one function that reads a stretch
of them, so that memory does not grow with the length.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from faintrack.beliefs.axis import Axis, Lattice
from faintrack.errors import InputError


@dataclass(frozen=True)
class Sequence(Lattice):
    """Frames on one clock.

    Attributes
    ----------
    read : function of (start, stop), frame numbers, to an array of frames.
    times : of the frames, ascending; seconds.
    axes : name and values of each axis of a frame, in the order of the array; the names are components of a state.
    source : where the frames come from, for messages.
    start_time : what time 0 is in UTC, or None where the source does not tell.
    remarks : what was assumed, left out, or does not fit; one sentence each.
    """

    read: Callable[[int, int], np.ndarray]
    times: np.ndarray
    axes: tuple[tuple[str, Axis], ...]
    source: str = "frames in memory"
    start_time: np.datetime64 | None = None
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if len(self.times) < 1:
            raise InputError(f"{self.source}: there are no frames.")
        late = np.flatnonzero(~(np.diff(self.times) > 0))
        if late.size or not np.isfinite(self.times).all():
            where = f"frame {late[0] + 1}" if late.size else "a frame"
            raise InputError(
                f"{self.source}: the time of {where} is not after the one before; expected ascending times."
            )

    @property
    def length(self) -> int:
        """Number of frames."""
        return len(self.times)

    def blocks(self, size: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield times and frames of consecutive blocks of `size` frames; the last may be shorter."""
        for start in range(0, self.length, size):
            stop = min(start + size, self.length)
            yield self.times[start:stop], self.read(start, stop)


def from_frames(
    frames: np.ndarray, times: np.ndarray | None = None, axes: tuple[tuple[str, Axis], ...] | None = None
) -> Sequence:
    """Sequence of frames in memory.

    Parameters
    ----------
    frames : as many axes as the cells have, after one of the frames.
    times : seconds; one second apart from 0 where not given.
    axes : as `Sequence.axes`; where not given the cells of an image (y, x), or of a profile (range), numbered from 0.

    Raises
    ------
    InputError : axes and times do not fit the frames, or there is no default for them.

    Examples
    --------
    >>> sequence = from_frames(np.zeros((5, 20, 30)))
    >>> sequence.shape, float(sequence.times[-1])
    ((20, 30), 4.0)
    """
    frames = np.asarray(frames)
    times = np.arange(len(frames), dtype=float) if times is None else np.asarray(times, float)
    if axes is None:
        names = {2: ("range",), 3: ("y", "x")}.get(frames.ndim)
        if names is None:
            raise InputError(f"frames have shape {frames.shape}; expected (frame, y, x) or (frame, range), or axes.")
        axes = tuple((name, Axis(0.0, 1.0, count)) for name, count in zip(names, frames.shape[1:], strict=True))
    sequence = Sequence(lambda start, stop: frames[start:stop], times, axes)
    expected = (sequence.length, *sequence.shape)
    if frames.shape != expected:
        raise InputError(f"frames have shape {frames.shape}; the times and axes {expected}.")
    return sequence
