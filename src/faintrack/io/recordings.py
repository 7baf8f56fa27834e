"""Recordings from files: one table from suffix to reader, and channels of several files side by side.

Only headers are read when a file is opened. `Recording.read` then fetches the samples of one stretch, so a
day of data needs no more memory than a second of it.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from faintrack.data.recording import Recording
from faintrack.errors import InputError
from faintrack.io.audio import SUFFIXES, open_audio
from faintrack.io.checks import samples_between
from faintrack.io.hierarchical import open_hdf5, open_zarr
from faintrack.io.miniseed import open_miniseed
from faintrack.io.seismic import open_sac, station_names

READERS: dict[str, Callable[[Path], Recording]] = {
    **dict.fromkeys(SUFFIXES, open_audio),
    ".h5": open_hdf5,
    ".hdf5": open_hdf5,
    ".zarr": open_zarr,
    ".sac": open_sac,
    ".mseed": open_miniseed,
    ".miniseed": open_miniseed,
    ".ms": open_miniseed,
}
_SEISMIC = (open_sac, open_miniseed)


def read(*paths: str | Path) -> Recording:
    """Recording of one file, or of several with their channels side by side.

    Parameters
    ----------
    paths : WAV, FLAC, HDF5 (Acoular's layout), Zarr, SAC or miniSEED, told by suffix. Several files must
        share the sample rate. Those that tell when they start are cut to the time that all of them share;
        those that do not tell must be equally long.

    Returns
    -------
    Recording whose `read` gives samples of shape (time, channel) in the unit of the file; float32, or float64
    from HDF5 and Zarr that hold it. Channels are named after SAC and miniSEED stations, with channel and
    location code where stations repeat; otherwise by the names in the file, otherwise "0", "1", ... across
    all files.

    Raises
    ------
    InputError : a file is missing, unknown, damaged or empty, or the files do not belong together.

    Examples
    --------
    >>> read("array.sio")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    faintrack.errors.InputError: array.sio: unknown kind of file; expected .wav, .flac, ... or .ms.
    """
    if not paths:
        raise InputError("there is no file to read a recording from.")
    files = [Path(path) for path in paths]
    readers = [_reader(file) for file in files]
    parts = [reader(file) for reader, file in zip(readers, files, strict=True)]
    recording = parts[0] if len(parts) == 1 else _side_by_side(parts)
    names = recording.channel_names
    if all(reader in _SEISMIC for reader in readers):
        names = station_names(names)
    if not all(names) or len(set(names)) < len(names):
        names = tuple(str(i) for i in range(len(names)))
    return replace(recording, channel_names=names)


def _reader(file: Path) -> Callable[[Path], Recording]:
    reader = READERS.get(file.suffix.lower())
    if reader is None:
        *others, last = READERS
        raise InputError(f"{file}: unknown kind of file; expected {', '.join(others)} or {last}.")
    return reader


def _side_by_side(parts: Sequence[Recording]) -> Recording:
    first = parts[0]
    for part in parts:
        if part.sample_rate != first.sample_rate:
            raise InputError(
                f"{part.source} has {part.sample_rate:g} Hz and {first.source} {first.sample_rate:g} Hz; "
                "expected one sample rate."
            )
        if (part.start_time is None) != (first.start_time is None):
            raise InputError(
                f"of {part.source} and {first.source} only one tells when it starts; expected both or none."
            )
        if part.start_time is None and part.length != first.length:
            raise InputError(
                f"{part.source} has {part.length} samples and {first.source} {first.length}; "
                "expected equal lengths, as the files do not tell when they start."
            )
    latest = max((part.start_time for part in parts if part.start_time is not None), default=None)
    skips = [0 if latest is None else _skip(part, latest) for part in parts]
    length = min(part.length - skip for part, skip in zip(parts, skips, strict=True))
    if length < 1:
        raise InputError(f"{', '.join(part.source for part in parts)} have no time in common.")

    def read_samples(start: int, stop: int) -> np.ndarray:
        stop = min(stop, length)
        columns = [part.read(start + skip, stop + skip) for part, skip in zip(parts, skips, strict=True)]
        return np.concatenate(columns, axis=1)

    names = tuple(name for part in parts for name in part.channel_names)
    source = f"{first.source} and {len(parts) - 1} more"
    return Recording(read_samples, length, first.sample_rate, names, latest, source)


def _skip(part: Recording, latest: np.datetime64) -> int:
    """Samples of a part before the latest start of all parts."""
    assert part.start_time is not None
    return samples_between(part.start_time, latest, part.sample_rate, part.source)
