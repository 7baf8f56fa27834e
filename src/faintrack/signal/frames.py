"""Samples cut into frames, a block at a time, with what is not a number masked and counted."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from faintrack.data.recording import Recording


@dataclass(frozen=True)
class FrameBlock:
    """Consecutive frames of a recording.

    Attributes
    ----------
    time : shape (frame,); middle of each frame, seconds from the start of the recording.
    samples : shape (frame, sample, channel); a masked channel is zero throughout its frame.
    usable : shape (frame, channel); False where a frame has a sample that is not finite.
    """

    time: Float[np.ndarray, " frame"]
    samples: Float[np.ndarray, "frame sample channel"]
    usable: Bool[np.ndarray, "frame channel"]


def frames(recording: Recording, length: int, block: int, dtype: type = np.float32) -> Iterator[FrameBlock]:
    """Yield the whole frames of a recording, `block` of them at a time; a rest shorter than a frame is left out.

    Parameters
    ----------
    recording : where the samples come from.
    length : samples in a frame; frames follow each other without overlap.
    block : frames held in memory at once; the last block may have fewer.
    dtype : of the samples that are yielded.

    Examples
    --------
    >>> from faintrack.data.recording import from_samples
    >>> samples = np.arange(14.0).reshape(7, 2)
    >>> samples[3, 1] = np.nan
    >>> one, = frames(from_samples(samples, 1.0), length=3, block=8)
    >>> one.samples.shape, one.time.tolist(), one.usable.tolist()
    ((2, 3, 2), [1.5, 4.5], [[True, True], [True, False]])
    """
    count = recording.length // length
    for first in range(0, count, block):
        yield framed(recording, length, first, min(block, count - first), dtype)


def framed(recording: Recording, length: int, first: int, number: int, dtype: type = np.float32) -> FrameBlock:
    """Some consecutive frames of a recording.

    Parameters
    ----------
    recording, length, dtype : as `frames`.
    first, number : of the frames.

    Examples
    --------
    >>> from faintrack.data.recording import from_samples
    >>> framed(from_samples(np.zeros((70, 2)), 10.0), length=10, first=2, number=3).time.tolist()
    [2.5, 3.5, 4.5]
    """
    samples: np.ndarray = recording.read(first * length, (first + number) * length).astype(dtype)
    samples = samples.reshape(number, length, recording.channels)
    usable = np.isfinite(samples).all(axis=1)
    if not usable.all():
        samples = np.where(usable[:, None, :], samples, 0)
    time = (first + np.arange(number) + 0.5) * length / recording.sample_rate
    return FrameBlock(time, samples, usable)
