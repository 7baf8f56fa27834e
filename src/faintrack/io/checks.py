"""What every reader asks of a file before its contents count: that it is there, makes sense, and is numeric.

Libraries say what went wrong in many ways and few of them name the file. Here each way becomes an InputError
of one sentence.
"""

import functools
import re
import stat
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from faintrack.data.recording import Recording
from faintrack.errors import InputError, naming
from faintrack.io import limits

_UTC = re.compile(r"(\d{4}-\d\d-\d\d(?:[T ]\d\d:\d\d(?::\d\d(?:\.\d{1,9})?)?)?)(?:Z|\+00:00)?")


def require_file(path: Path) -> None:
    """Refuse a path that is not a regular file with something in it.

    A named pipe or a device is refused before it is opened: who opens a pipe waits for its other end.

    Raises
    ------
    InputError : the path does not exist or cannot be looked at, is a folder, a pipe or a device, or is an empty file.

    Examples
    --------
    >>> require_file(Path("nowhere/rec.wav"))
    Traceback (most recent call last):
        ...
    faintrack.errors.InputError: nowhere/rec.wav does not exist.
    """
    try:
        found = path.stat()
    except (FileNotFoundError, NotADirectoryError):
        raise InputError(f"{path} does not exist.") from None
    # ValueError: a zero byte in the name.
    except (OSError, ValueError) as error:
        raise InputError(f"{path} cannot be looked at ({getattr(error, 'strerror', None) or error}).") from error
    if stat.S_ISDIR(found.st_mode):
        raise InputError(f"{path} is a folder; expected a file.")
    if not stat.S_ISREG(found.st_mode):
        raise InputError(f"{path} is a pipe, a socket or a device; expected a file.")
    if found.st_size == 0:
        raise InputError(f"{path} is empty.")


def require_folder(path: Path, kind: str = "a Zarr folder") -> None:
    """Refuse a path that is no folder.

    Raises
    ------
    InputError : the path does not exist, or is a file.

    Examples
    --------
    >>> require_folder(Path("nowhere/night.zarr"))
    Traceback (most recent call last):
        ...
    faintrack.errors.InputError: nowhere/night.zarr does not exist.
    """
    with explained(f"{path} cannot be looked at"):
        if not path.is_dir():
            raise InputError(f"{path} {f'is a file; expected {kind}' if path.exists() else 'does not exist'}.")


@contextmanager
def explained(complaint: str) -> Iterator[None]:
    """Turn whatever a library raises inside the block into an InputError that starts with `complaint`.

    There is no list of exceptions: lack of memory and too deep a recursion are content that cannot be used as well.

    Parameters
    ----------
    complaint : what failed, with the name of the file: "rec.wav cannot be read as a WAV file".

    Raises
    ------
    InputError : the complaint with the library's reason in parentheses; one from inside passes unchanged.

    Examples
    --------
    >>> with explained("rec.h5 cannot be read as HDF5"):
    ...     raise OSError("file signature not found")
    Traceback (most recent call last):
        ...
    faintrack.errors.InputError: rec.h5 cannot be read as HDF5 (file signature not found).
    """
    try:
        yield
    except InputError:
        raise
    # The libraries share no base class for a damaged file: struct.error, KeyError, bare Exception all occur.
    except Exception as error:
        said = getattr(error, "strerror", None)
        reason = said if isinstance(said, str) else " ".join(_words(error)[:2000].split())
        raise InputError(f"{complaint} ({(reason or type(error).__name__).rstrip('.')}).") from error


def reader(kind: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Decorate a function that opens a file: whatever it raises, or what it gives raises later, is an InputError.

    Parameters
    ----------
    kind : of the file, for messages; where empty the suffix.

    Returns
    -------
    Decorator of a function from a path to a recording, a sequence, or a table of variables. Reads of a recording
    give as many samples as it has between start and stop, or raise.

    Examples
    --------
    >>> from faintrack.data.recording import Recording
    >>> @reader("WAV")
    ... def lost(path):
    ...     return Recording(lambda start, stop: 1 / 0, 10, 100.0, ("a",))
    >>> lost(Path("rec.wav")).read(0, 5)
    Traceback (most recent call last):
        ...
    faintrack.errors.InputError: rec.wav cannot be read as WAV (division by zero).
    """

    def decorate(opening: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(opening)
        def opened(path: Path, *options: Any) -> Any:
            complaint = f"{path} cannot be read as {kind or path.suffix[1:].upper()}"
            with explained(complaint), naming(path):
                found = opening(path, *options)
            if isinstance(found, Mapping):
                return {
                    name: replace(value, read=_explained_read(path, complaint, value.read))
                    for name, value in found.items()
                }
            if isinstance(found, Recording):
                return replace(found, read=_whole_read(path, complaint, found))
            return replace(found, read=_explained_read(path, complaint, found.read))

        return opened

    return decorate


def _explained_read(path: Path, complaint: str, read: Callable[..., np.ndarray]) -> Callable[..., np.ndarray]:
    def explained_read(*part: Any) -> np.ndarray:
        with explained(complaint), naming(path):
            return read(*part)

    return explained_read


def _whole_read(path: Path, complaint: str, recording: Recording) -> Callable[[int, int], np.ndarray]:
    def whole_read(start: int, stop: int) -> np.ndarray:
        start, stop = max(start, 0), min(stop, recording.length)
        expected = max(stop - start, 0), recording.channels
        with explained(complaint), naming(path):
            samples = recording.read(start, stop) if stop > start else np.empty(expected, np.float32)
        if samples.shape != expected:
            raise InputError(f"{complaint} (samples {start} to {stop} have shape {samples.shape}, not {expected}).")
        return samples

    return whole_read


def _words(error: Exception) -> str:
    """What an exception says; some of them raise another when they are asked."""
    try:
        return str(error)
    except Exception:
        return ""


def utc(text: str, field: str) -> np.datetime64:
    """Time from ISO text in UTC, to the nanosecond.

    Parameters
    ----------
    text : date, or date and time, with or without a trailing "Z" or "+00:00".
    field : file and field, for the message.

    Raises
    ------
    InputError : the text is no such time, or stands in another time zone.

    Examples
    --------
    >>> str(utc("2012-04-09T18:00:00.008Z", "rec.h5: start_time"))
    '2012-04-09T18:00:00.008000000'
    """
    complaint = f"{field} is {text[:80]!r}; expected a UTC time such as 2012-04-09T18:00:00.008"
    match = _UTC.fullmatch(text.strip())
    if match is None:
        raise InputError(f"{complaint}.")
    if not limits.FIRST_YEAR <= int(match[1][:4]) <= limits.LAST_YEAR:
        raise InputError(f"{complaint}, from {limits.FIRST_YEAR} to {limits.LAST_YEAR}.")
    with explained(complaint):
        return np.datetime64(match[1], "ns")


def number(text: str, field: str) -> float:
    """Number of a text.

    Parameters
    ----------
    text : as it stands in a file.
    field : file and field, for the message.

    Raises
    ------
    InputError : the text is no number, or one that is not finite.

    Examples
    --------
    >>> number(" 1.5e3", "returns.csv, row 2: delay_s")
    1500.0
    """
    try:
        # Python knows 1_000; files do not.
        value = float("none" if "_" in text else text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise InputError(f"{field} is {text.strip()[:80]!r}; expected a number.")
    return value


def samples_between(first: np.datetime64, later: np.datetime64, sample_rate: float, source: str) -> int:
    """Whole number of samples from one start time to a later one.

    Parameters
    ----------
    first, later : times of two samples in UTC.
    sample_rate : Hz.
    source : what starts at the offset, for the message.

    Raises
    ------
    InputError : the offset is more than a tenth of a sample away from a whole number. The channels were then
        not sampled together, and shifting by whole samples would turn every bearing.

    Examples
    --------
    >>> start = np.datetime64("2012-04-09T18:00:00", "ns")
    >>> samples_between(start, start + np.timedelta64(30, "ms"), 100.0, "a.sac")
    3
    """
    offset = (later - first) / np.timedelta64(1, "s") * sample_rate
    if abs(offset - round(offset)) > 0.1:
        raise InputError(f"{source}: the start times differ by {abs(offset):.2f} samples; expected a whole number.")
    return round(offset)


def require_numeric(dtype: np.dtype, field: str) -> None:
    """Refuse samples that are not real numbers.

    Raises
    ------
    InputError : the type is neither integer nor float.

    Examples
    --------
    >>> require_numeric(np.dtype("int16"), "rec.h5: time_data")
    """
    if dtype.kind not in "iuf":
        raise InputError(f"{field} holds {dtype}; expected real numbers.")


def as_float(samples: np.ndarray) -> np.ndarray:
    """Samples in native byte order; float64 stays, everything else becomes float32.

    Parameters
    ----------
    samples : any shape; integers beyond 24 bits lose their last digits.

    Examples
    --------
    >>> as_float(np.array([1, 2], ">i2")).dtype
    dtype('float32')
    """
    double = samples.dtype.kind == "f" and samples.dtype.itemsize == 8
    return np.asarray(samples, np.float64 if double else np.float32)


def require_rate(rate: float, source: object) -> float:
    """Refuse a sample rate that no recorder has.

    Raises
    ------
    InputError : not a number, or outside `limits.LOWEST_RATE` to `limits.HIGHEST_RATE`.

    Examples
    --------
    >>> require_rate(96000.0, "rec.wav")
    96000.0
    """
    if not rate > 0:
        raise InputError(f"{source}: the sample rate is {rate}, expected a number above 0 Hz.")
    if not limits.LOWEST_RATE <= rate <= limits.HIGHEST_RATE:
        expected = f"{limits.LOWEST_RATE:g} to {limits.HIGHEST_RATE:g} Hz"
        raise InputError(f"{source}: the sample rate is {rate}, expected {expected}.")
    return rate


def require_channels(count: int, source: object) -> int:
    """Refuse more channels than an array has.

    Raises
    ------
    InputError : more than `limits.MOST_CHANNELS`.

    Examples
    --------
    >>> require_channels(56, "rec.h5")
    56
    """
    if count > limits.MOST_CHANNELS:
        raise InputError(f"{source} has {count} channels; expected at most {limits.MOST_CHANNELS}.")
    return count


def require_room(claimed: int, held: int, field: object) -> None:
    """Refuse a size that a header claims and that what is there could not unfold to.

    Parameters
    ----------
    claimed : bytes that the header tells of.
    held : bytes that there are, packed or not.
    field : file and field, for the message.

    Raises
    ------
    InputError : more than `limits.MOST_UNPACKED` times what is there; the sentence has both numbers.

    Examples
    --------
    >>> require_room(10**12, 300, "a.npz: frames")
    Traceback (most recent call last):
        ...
    faintrack.errors.InputError: a.npz: frames claims 1000000000000 bytes, of which the file's 300 can be none.
    """
    if claimed > limits.MOST_UNPACKED * held:
        raise InputError(f"{field} claims {claimed} bytes, of which the file's {held} can be none.")
