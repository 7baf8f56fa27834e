"""One writer for each format: a block of code that is given a function to append samples with.

A writer makes the file at the path that it is told, knows nothing of what the file will be called in the end,
and leaves it whole when its block ends. Layout of HDF5 and Zarr: `faintrack.io.hierarchical`.
"""

import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from io import BufferedIOBase
from pathlib import Path
from typing import Any

import numpy as np

from faintrack.io.containers import data_chunk
from faintrack.io.hierarchical import HDF5_RATE, ZARR_RATE

# Numbers in one chunk of HDF5 or Zarr: 256 KiB, a compromise between reading little and seeking seldom.
_CHUNK = 2**16
# The most that the 32-bit sizes of a plain WAV file can count; beyond, the file stays RF64.
_WAV_BYTES = 2**32 - 1

Append = Callable[[np.ndarray], Any]


@dataclass(frozen=True)
class Content:
    """What a file is told besides its samples."""

    channels: int
    sample_rate: float
    channel_names: tuple[str, ...] | None
    start_time: np.datetime64 | None

    @property
    def chunk(self) -> int:
        """Samples of each channel in one chunk of HDF5 or Zarr."""
        return max(1, _CHUNK // self.channels)

    def attributes(self, rate_field: str) -> dict[str, Any]:
        """Attributes as HDF5 and Zarr keep them."""
        found: dict[str, Any] = {rate_field: float(self.sample_rate)}
        if self.channel_names is not None:
            found["channel_names"] = list(self.channel_names)
        if self.start_time is not None:
            found["start_time"] = f"{np.datetime_as_string(self.start_time, unit='ns')}Z"
        return found


@contextmanager
def open_hdf5_writer(path: Path, content: Content) -> Iterator[Append]:
    """HDF5 file in Acoular's layout; `append` extends `time_data`."""
    import h5py

    with h5py.File(path, "w") as file:
        samples = file.create_dataset(
            "time_data",
            shape=(0, content.channels),
            maxshape=(None, content.channels),
            chunks=(content.chunk, content.channels),
            dtype=np.float32,
        )
        samples.attrs.update(content.attributes(HDF5_RATE))

        def append(block: np.ndarray) -> None:
            start = len(samples)
            samples.resize(start + len(block), axis=0)
            samples[start:] = block

        yield append


@contextmanager
def open_zarr_writer(path: Path, content: Content) -> Iterator[Append]:
    """Zarr folder; `append` extends `time_data`."""
    import zarr

    group = zarr.open_group(path, mode="w", zarr_format=3, attributes=content.attributes(ZARR_RATE))
    samples = group.create_array(
        "time_data",
        shape=(0, content.channels),
        chunks=(content.chunk, content.channels),
        dtype=np.float32,
        fill_value=np.nan,
        dimension_names=("time", "channel"),
    )
    # Zarr writes a whole chunk again for every append to it, so blocks wait until they fill one.
    waiting: list[np.ndarray] = []

    def flush() -> None:
        if waiting:
            samples.append(np.concatenate(waiting))
            waiting.clear()

    def append(block: np.ndarray) -> None:
        waiting.append(block.copy())  # the caller may use its array again
        if sum(len(block) for block in waiting) >= content.chunk:
            flush()

    yield append
    flush()


@contextmanager
def open_wav_writer(path: Path, content: Content) -> Iterator[Append]:
    """WAV file of float32 samples, RF64 where it has grown beyond 4 GB."""
    import soundfile

    rate = round(content.sample_rate)
    # The length is not known yet: leave room for long sizes, although some programs cannot read those.
    with soundfile.SoundFile(path, "w", rate, content.channels, "FLOAT", format="RF64") as file:
        yield file.write
    length = path.stat().st_size - 8
    if length <= _WAV_BYTES:
        with path.open("r+b") as header:
            _turn_to_plain_wav(header, length)


def _turn_to_plain_wav(file: BufferedIOBase, length: int) -> None:
    """Write the long sizes of an RF64 header where a plain WAV file has its short ones."""
    chunk = data_chunk(file)
    assert chunk is not None
    start, size = chunk
    for place, content in (
        (0, b"RIFF" + struct.pack("<I", length)),
        (12, b"JUNK"),
        (start - 4, struct.pack("<I", size)),
    ):
        file.seek(place)
        file.write(content)
