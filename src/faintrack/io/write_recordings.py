"""Recordings to files, block by block.

Samples go to a file in a hidden folder beside their place, which takes the file's name once it is complete: whoever
finds `rec.h5` finds all of it, and an interrupted run leaves an older `rec.h5` as it was.

HDF5 and Zarr keep names and start time (layout: `faintrack.io.hierarchical`); WAV has no place for either.
"""

import glob
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from itertools import chain
from pathlib import Path

import numpy as np

from faintrack.errors import InputError
from faintrack.io.checks import explained, require_numeric
from faintrack.io.writers import Append, Content, open_hdf5_writer, open_wav_writer, open_zarr_writer

_WRITERS: dict[str, Callable[[Path, Content], AbstractContextManager[Append]]] = {
    ".h5": open_hdf5_writer,
    ".hdf5": open_hdf5_writer,
    ".zarr": open_zarr_writer,
    ".wav": open_wav_writer,
}


MARK = ".faintrack"
"""File that tells a folder of ours from a user's."""


def write_recording(
    path: str | Path,
    blocks: Iterable[np.ndarray],
    sample_rate: float,
    channel_names: tuple[str, ...] | None = None,
    start_time: np.datetime64 | None = None,
) -> None:
    """Write samples as float32 while they arrive; memory holds a block or a chunk of 256 KiB.

    Parameters
    ----------
    path : .h5, .hdf5 (Acoular's layout), .zarr or .wav (RF64 beyond 4 GB); replaced if it exists.
    blocks : arrays of shape (time, channel), in order of time.
    sample_rate : Hz; a whole number for WAV.
    channel_names : one for each channel; not kept by WAV.
    start_time : time of the first sample in UTC; not kept by WAV.

    Raises
    ------
    InputError : the kind of file is unknown, the file cannot be written, or the blocks do not fit together.
        What the blocks themselves raise passes unchanged. In every case `path` is as before.

    Examples
    --------
    >>> write_recording("rec.mat", [np.zeros((4, 2))], 100.0)
    Traceback (most recent call last):
        ...
    faintrack.errors.InputError: rec.mat: unknown kind of file; expected .h5, .hdf5, .zarr or .wav.
    """
    path = Path(path)
    writer = _WRITERS.get(path.suffix.lower())
    if writer is None:
        *others, last = _WRITERS
        raise InputError(f"{path}: unknown kind of file; expected {', '.join(others)} or {last}.")
    if not (np.isfinite(sample_rate) and sample_rate > 0):
        raise InputError(f"{path}: the sample rate is {sample_rate}, expected a number above 0 Hz.")
    if writer is open_wav_writer and sample_rate != round(sample_rate):
        raise InputError(f"{path}: the sample rate is {sample_rate} Hz; WAV keeps whole numbers only.")
    _require_place(path)
    remaining = iter(blocks)
    first = _checked(path, next(remaining, np.empty((0, 0))))
    channels = first.shape[1]
    if channel_names is not None and len(channel_names) != channels:
        raise InputError(f"{path}: there are {len(channel_names)} channel names for {channels} channels.")
    content = Content(channels, sample_rate, channel_names, start_time)
    complaint = f"{path} cannot be written"
    with completed(path, complaint) as partial, ExitStack() as opened:
        with explained(complaint):
            append = opened.enter_context(writer(partial, content))
        length = 0
        for block in chain([first], remaining):
            samples = _checked(path, block, channels)
            with explained(complaint):
                append(samples)
            length += len(samples)
        if length == 0:
            raise InputError(f"{path}: there are no samples to write.")
        with explained(complaint):
            opened.close()


def _require_place(path: Path) -> None:
    if not path.parent.is_dir():
        raise InputError(f"{path} cannot be written; {path.parent} is not a folder.")
    if not path.exists():
        return
    replaceable = (path / "zarr.json").exists() if path.suffix.lower() == ".zarr" else path.is_file()
    if not replaceable:
        raise InputError(f"{path} is something else than the kind of file to write; it is left as it is.")


def _checked(path: Path, block: np.ndarray, channels: int | None = None) -> np.ndarray:
    """A block as float32, or an InputError where it does not fit."""
    samples = np.asarray(block)
    if samples.ndim != 2 or channels not in (None, samples.shape[1]):
        expected = "(time, channel)" if channels is None else f"(time, {channels})"
        raise InputError(f"{path}: a block has shape {samples.shape}; expected {expected}.")
    if samples.shape[1] == 0:
        raise InputError(f"{path}: there are no samples to write.")
    require_numeric(samples.dtype, f"{path}: a block")
    return samples.astype(np.float32, copy=False)


@contextmanager
def completed(path: Path, complaint: str) -> Iterator[Path]:
    """Name to write under; it becomes `path` if the block ends well, and is removed if it does not.

    It is in a folder of its own, whose name nobody else has; one with our mark is of a run that was killed.
    """
    with explained(complaint):
        if path.exists() and not (path.is_file() or path.is_dir()):
            raise InputError(f"{path} is a pipe, a socket or a device; expected a file.")
        for abandoned in path.parent.glob(f".{glob.escape(path.name)}.*.partial"):
            if (abandoned / MARK).is_file() and not abandoned.is_symlink():
                shutil.rmtree(abandoned, ignore_errors=True)
        own = Path(tempfile.mkdtemp(prefix=f".{path.name}.", suffix=".partial", dir=path.parent))
        (own / MARK).touch()
    try:
        yield own / path.name
        with explained(complaint):
            # A folder cannot take the place of another in one step; the older goes when the new one is there.
            if path.is_dir():
                path.rename(own / "older")
            (own / path.name).replace(path)
    finally:
        shutil.rmtree(own, ignore_errors=True)
