"""Recordings from files: one table from suffix to reader, and channels of several files side by side.

Only headers are read when a file is opened, and three short stretches of several channels to find copies.
`Recording.read` then fetches the samples of one stretch, so a day of data needs no more memory than a second of it.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from faintrack.data.recording import Recording
from faintrack.errors import InputError
from faintrack.io.audio import SUFFIXES, open_audio
from faintrack.io.checks import require_channels, samples_between
from faintrack.io.hierarchical import open_hdf5, open_zarr
from faintrack.io.miniseed import open_miniseed
from faintrack.io.names import start_in_name
from faintrack.io.seismic import open_sac, station_names
from faintrack.io.sigmf import open_sigmf

READERS: dict[str, Callable[[Path], Recording]] = {
    **dict.fromkeys(SUFFIXES, open_audio),
    ".sigmf-meta": open_sigmf,
    ".sigmf-data": open_sigmf,
    ".h5": open_hdf5,
    ".hdf5": open_hdf5,
    ".zarr": open_zarr,
    ".sac": open_sac,
    ".mseed": open_miniseed,
    ".miniseed": open_miniseed,
    ".ms": open_miniseed,
}
_SEISMIC = (open_sac, open_miniseed)
# Samples that are compared at a time, and how many of them have to differ from the one before.
_PROBE, _CHANGES = 1024, 32


def read(*paths: str | Path | Iterable[str | Path], start_pattern: str | None = None) -> Recording:
    """Recording of one file, or of several with their channels side by side.

    Parameters
    ----------
    paths : WAV and its kin, FLAC, SigMF, HDF5 (Acoular's layout), Zarr, SAC or miniSEED, told by suffix. Several
        files must share the sample rate. Those that tell when they start are put on one time axis, from the first start
        to the last end; those that do not tell must be equally long.
    start_pattern : how names of files tell the start in UTC, such as "%Y%m%d_%H%M%S", see
        `faintrack.io.names.start_in_name`; it takes the place of what the files tell.

    Returns
    -------
    Recording whose `read` gives samples of shape (time, channel) in the unit of the file; float32, or float64
    from files that hold it; NaN where a channel has no samples: in gaps, before it starts, after it has ended, or where
    it is a copy of another. Channels are named after SAC and miniSEED stations, with channel and location code where
    stations repeat; otherwise by the names in the file, otherwise "0", "1", ... across all files. `remarks` say what
    was assumed.

    Raises
    ------
    InputError : a file is missing, unknown, damaged or empty, or given twice, or the files do not belong together.

    Examples
    --------
    >>> read("array.sio")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    faintrack.errors.InputError: array.sio: unknown kind of file; expected .wav, .flac, ... or .ms.
    """
    if not paths:
        raise InputError("there is no file to read a recording from.")
    files = [Path(path) for given in paths for path in (given if isinstance(given, list | tuple) else (given,))]
    readers = [_reader(file) for file in files]
    _require_different(files)
    parts = [reader(file) for reader, file in zip(readers, files, strict=True)]
    if start_pattern is not None:
        starts = [start_in_name(file.name, start_pattern) for file in files]
        parts = [replace(part, start_time=start) for part, start in zip(parts, starts, strict=True)]
    recording = parts[0] if len(parts) == 1 else _side_by_side(parts)
    names = recording.channel_names
    if all(reader in _SEISMIC for reader in readers):
        names = station_names(names)
    if not all(names) or len(set(names)) < len(names):
        names = tuple(str(i) for i in range(len(names)))
    return without_copies(replace(recording, channel_names=names))


def _reader(file: Path) -> Callable[[Path], Recording]:
    reader = READERS.get(file.suffix.lower())
    if reader is None:
        *others, last = READERS
        raise InputError(f"{file}: unknown kind of file; expected {', '.join(others)} or {last}.")
    return reader


def _require_different(files: Sequence[Path]) -> None:
    """Refuse a file that is given twice, by whatever name: its noise would pass for a source."""
    seen: dict[tuple[int, int], Path] = {}
    for file in files if len(files) > 1 else ():
        try:
            found = file.stat()
        except (OSError, ValueError):
            continue  # its reader says what is wrong
        other = seen.setdefault((found.st_dev, found.st_ino), file)
        if other is not file:
            raise InputError(
                f"{file} is given twice{'' if other == file else f', also as {other}'}; expected each once."
            )


def _side_by_side(parts: Sequence[Recording]) -> Recording:
    first = parts[0]
    for part in parts:
        if part.sample_rate != first.sample_rate:
            raise InputError(
                f"{part.source} has {part.sample_rate:.12g} Hz and {first.source} {first.sample_rate:.12g} Hz; "
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
    require_channels(sum(part.channels for part in parts), f"{first.source} and {len(parts) - 1} more")
    earliest = min((part.start_time for part in parts if part.start_time is not None), default=None)
    begins = [
        0
        if part.start_time is None or earliest is None
        else samples_between(earliest, part.start_time, part.sample_rate, part.source)
        for part in parts
    ]
    ends = [begin + part.length for begin, part in zip(begins, parts, strict=True)]
    _require_common_time(parts, begins, ends)
    length = max(ends)

    def read_samples(start: int, stop: int) -> np.ndarray:
        columns = []
        for part, begin in zip(parts, begins, strict=True):
            low, high = (min(max(place - begin, 0), part.length) for place in (start, stop))
            samples = part.read(low, high)
            edges = (low + begin - start if high > low else stop - start, 0)
            rest = (edges[0], stop - start - edges[0] - len(samples))
            columns.append(np.pad(samples, (rest, (0, 0)), constant_values=np.nan) if any(rest) else samples)
        return np.concatenate(columns, axis=1)

    remarks = [f"{part.source}: {remark}" for part in parts for remark in part.remarks]
    for part, begin, end in zip(parts, begins, ends, strict=True):
        lacks = [
            f"{count / first.sample_rate:.6g} s at the {place}"
            for count, place in ((begin, "beginning"), (length - end, "end"))
            if count
        ]
        if lacks:
            remarks.append(f"{part.source} has no samples in {' and '.join(lacks)}; they are missing.")
    names = tuple(name for part in parts for name in part.channel_names)
    source = f"{first.source} and {len(parts) - 1} more"
    return Recording(read_samples, length, first.sample_rate, names, earliest, source, tuple(remarks))


def _require_common_time(parts: Sequence[Recording], begins: Sequence[int], ends: Sequence[int]) -> None:
    """Refuse files that leave a time without any of them, or one that meets no other."""
    for number, part in enumerate(parts):
        others = [k for k in range(len(parts)) if k != number]
        if not any(begins[k] < ends[number] and begins[number] < ends[k] for k in others):
            raise InputError(f"{part.source} and {parts[others[0]].source} have no time in common.")
    covered = 0
    for begin, end in sorted(zip(begins, ends, strict=True)):
        if begin > covered:
            raise InputError(f"{', '.join(part.source for part in parts)} have no time in common.")
        covered = max(covered, end)


def without_copies(recording: Recording) -> Recording:
    """Recording in which a channel that is a copy of another is missing, with a remark.

    Two copies share their noise, which is what a source looks like. Three stretches are compared, of live samples the
    first; a channel that does not change in them is no copy but dead.

    Parameters
    ----------
    recording : as read.

    Examples
    --------
    >>> from faintrack.data.recording import from_samples
    >>> noise = np.random.default_rng(0).normal(size=(500, 2))
    >>> recording = without_copies(from_samples(noise[:, [0, 1, 0]], 100.0))
    >>> recording.remarks
    ('Channel 2 is a copy of channel 0; it is missing.',)
    >>> np.isnan(recording.read(0, 500)).all(axis=0).tolist()
    [False, False, True]
    """
    if recording.channels < 2:
        return recording
    size = min(_PROBE, recording.length)
    places = {0} if recording.live else {0, (recording.length - size) // 2, recording.length - size}
    samples = np.concatenate([recording.read(place, place + size) for place in sorted(places)])
    first: dict[bytes, int] = {}
    copies = {}
    for number, column in enumerate(np.ascontiguousarray(samples.T)):
        # NaN is unequal to itself, and changes nothing.
        if np.count_nonzero(np.abs(np.diff(column)) > 0) >= _CHANGES:
            original = first.setdefault(column.tobytes(), number)
            if original != number:
                copies[number] = original
    if not copies:
        return recording
    names = recording.channel_names
    said = [
        f"Channel {names[copy]} is a copy of channel {names[original]}; it is missing."
        for copy, original in copies.items()
    ]
    columns = list(copies)

    def read_samples(start: int, stop: int) -> np.ndarray:
        samples = recording.read(start, stop).copy()
        samples[:, columns] = np.nan
        return samples

    return replace(recording, read=read_samples, remarks=(*recording.remarks, *said))
