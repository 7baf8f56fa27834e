"""Sequences of frames from files: image stacks, range-time and range-Doppler matrices, bearing-time records.

What `faintrack.io.recordings` is for samples this is for frames. A file gives named arrays
(`faintrack.io.variables`, `faintrack.io.images`); here one of them becomes the frames, its axes get names, and arrays
of those names give the times and the values along the axes. Frames are read when they are asked for.
"""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from faintrack.beliefs.axis import Axis
from faintrack.data.sequence import Sequence
from faintrack.errors import InputError, naming
from faintrack.io.checks import as_float, require_numeric, utc
from faintrack.io.images import open_folder, open_tiff
from faintrack.io.variables import Variable, open_hdf5, open_mat, open_npz, open_zarr

READERS: dict[str, Callable[[Path], dict[str, Variable]]] = {
    ".npz": open_npz,
    ".mat": open_mat,
    ".zarr": open_zarr,
    ".h5": open_hdf5,
    ".hdf5": open_hdf5,
    ".tif": open_tiff,
    ".tiff": open_tiff,
}
_DIMS = {2: ("time", "range"), 3: ("time", "y", "x")}
_SECONDS = {"days": 86400.0, "hours": 3600.0, "minutes": 60.0, "seconds": 1.0, "s": 1.0}
_SECONDS |= {"milliseconds": 1e-3, "microseconds": 1e-6, "nanoseconds": 1e-9}


def read_sequence(
    path: str | Path,
    variable: str | None = None,
    dims: tuple[str, ...] | None = None,
    frame_interval: float | None = None,
    gaps: bool = False,
) -> Sequence:
    """Sequence of the frames in a file or folder.

    Parameters
    ----------
    path : npz, MAT, Zarr, HDF5 or TIFF, told by suffix; any other folder is one of PNG files, one a frame.
    variable : name of the array that holds the frames. Where not given the largest of the numeric arrays with 2 to 4
        axes, if no other one has as many axes.
    dims : names of its axes in the order of the file, one of them `time`, the others components of a state. Where not
        given those that the file names (Zarr, HDF5), else (time, range) or (time, y, x).
    frame_interval : seconds from frame to frame, the first at 0. Where not given the file's array `time`, in seconds
        or in the `units` that Zarr and HDF5 tell, else 1 second. Units of "seconds since" a time in UTC tell the
        sequence's `start_time`.
    gaps : whether values may be missing, which is not a number.

    Returns
    -------
    Sequence whose `read` gives frames in float32, or float64 where the file has it. Arrays
    named like an axis give its values, otherwise cells are numbered from 0; an axis with descending values is
    turned around. `read` raises InputError where a frame is damaged or holds infinity or, without gaps, NaN.

    Raises
    ------
    InputError : a file is missing, unknown, damaged or empty; it is not told which array holds the frames, or they
        are no real numbers; axes, times and values do not fit the frames, or values are not evenly spaced.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     np.savez(f"{folder}/radar.npz", power=np.ones((4, 30)), range=np.arange(100.0, 250.0, 5.0))
    ...     sequence = read_sequence(f"{folder}/radar.npz", frame_interval=0.5)
    >>> sequence.times.tolist(), sequence.axes
    ([0.0, 0.5, 1.0, 1.5], (('range', Axis(first=100.0, step=5.0, count=30)),))
    """
    path = Path(path)
    variables = _reader(path)(path)
    with naming(path):
        name = _frames_name(variables) if variable is None else variable
        if name not in variables:
            raise InputError(f"there is no array {name}; the file holds {_listed(variables)}.")
        frames = variables.pop(name)
        _require_plain(name, frames)
        names = _dims(name, frames, dims)
        counts = dict(zip(names, frames.shape, strict=True))
        length = counts.pop("time")
        times, start_time = _times(variables, length, frame_interval)
        found = [(dim, *evenly_spaced(dim, count, _coordinate(variables, dim, count))) for dim, count in counts.items()]
    time_axis = names.index("time")
    turned = tuple(number for number, (_, _, descends) in enumerate(found, start=1) if descends)

    def read(start: int, stop: int) -> np.ndarray:
        part = tuple(slice(start, stop) if dim == "time" else slice(None) for dim in names)
        values = np.flip(np.moveaxis(as_float(frames.read(part)), time_axis, 0), turned)
        good = ~np.isinf(values) if gaps else np.isfinite(values)
        wrong = ~good.all(axis=tuple(range(1, values.ndim)))
        if wrong.any():
            number, what = start + int(np.argmax(wrong)), "infinity" if gaps else "NaN or infinity"
            raise InputError(f"{path}: frame {number} of {name} holds {what}; expected finite values.")
        return values

    return Sequence(read, times, tuple((dim, axis) for dim, axis, _ in found), str(path), start_time)


def holds_frames(path: Path) -> bool:
    """Whether a path can be nothing else than frames: TIFF, npz, a folder but of Zarr; the others hold samples too.

    Examples
    --------
    >>> holds_frames(Path("stack.tif")), holds_frames(Path("night.zarr"))
    (True, False)
    """
    suffix = path.suffix.lower()
    return suffix in (".npz", ".tif", ".tiff") or (path.is_dir() and suffix not in READERS)


def _reader(path: Path) -> Callable[[Path], dict[str, Variable]]:
    reader = READERS.get(path.suffix.lower(), open_folder if path.is_dir() else None)
    if not path.exists():
        raise InputError(f"{path} does not exist.")
    if reader is None:
        *others, last = READERS
        raise InputError(
            f"{path}: unknown kind of file; expected {', '.join(others)} or {last}, or a folder of PNG files."
        )
    return reader


def _frames_name(variables: Mapping[str, Variable]) -> str:
    """The largest array that can be frames, unless another has as many axes."""
    able = {name: v for name, v in variables.items() if v.dtype.kind in "iufc" and 2 <= len(v.shape) <= 4}
    if not able:
        raise InputError(f"there is no numeric array with 2 to 4 axes; the file holds {_listed(variables)}.")
    largest = max(able, key=lambda name: np.prod(able[name].shape))
    rivals = [name for name in able if len(able[name].shape) >= len(able[largest].shape)]
    if len(rivals) > 1:
        raise InputError(f"{', '.join(rivals)} can each be the frames; expected variable to name one of them.")
    return largest


def _listed(variables: Mapping[str, Variable]) -> str:
    return ", ".join(variables) or "nothing"


def _require_plain(name: str, frames: Variable) -> None:
    """Refuse frames that are not real numbers as they stand."""
    if frames.dtype.kind == "c":
        raise InputError(f"{name} holds {frames.dtype}; expected real values, such as the power or the amplitude.")
    require_numeric(frames.dtype, name)
    packed = frames.attributes.keys() & {"scale_factor", "add_offset"}
    if packed:
        raise InputError(f"{name} is packed with {min(packed)}; expected plain values.")
    if 0 in frames.shape:
        raise InputError(f"{name} has shape {frames.shape}; expected at least one frame and one cell.")


def _dims(name: str, frames: Variable, dims: tuple[str, ...] | None) -> tuple[str, ...]:
    names = tuple(dims or frames.dims or _DIMS.get(len(frames.shape), ()))
    if not names:
        raise InputError(f"{name} has shape {frames.shape}; expected dims to name its axes.")
    if len(names) != len(frames.shape):
        raise InputError(f"{name} has shape {frames.shape}; expected the axes {', '.join(names)}.")
    if names.count("time") != 1 or len(set(names)) < len(names):
        raise InputError(
            f"{name} has the axes {', '.join(names)}; expected dims with different names, one of them time."
        )
    return names


def _coordinate(variables: Mapping[str, Variable], dim: str, count: int) -> np.ndarray | None:
    """Values of the array that is named like an axis."""
    variable = variables.get(dim)
    if variable is None:
        return None
    require_numeric(variable.dtype, dim)
    if variable.shape != (count,):
        raise InputError(
            f"{dim} has shape {variable.shape}; expected {(count,)}, one value for each place of its axis."
        )
    values = variable.read((slice(None),)).astype(float)
    if not np.isfinite(values).all():
        raise InputError(f"{dim} holds NaN or infinity at index {np.argmin(np.isfinite(values))}; expected numbers.")
    return values


def _times(
    variables: Mapping[str, Variable], length: int, frame_interval: float | None
) -> tuple[np.ndarray, np.datetime64 | None]:
    """Seconds of every frame, and what second 0 is in UTC."""
    if frame_interval is not None and not 0 < frame_interval < np.inf:
        raise InputError(f"frame_interval is {frame_interval:g}; expected seconds above 0.")
    values = _coordinate(variables, "time", length) if frame_interval is None else None
    if values is None:
        return np.arange(length) * (frame_interval or 1.0), None
    units = variables["time"].attributes.get("units", "s")
    unit, _, since = (units.decode() if isinstance(units, bytes) else str(units)).partition(" since ")
    if unit not in _SECONDS:
        raise InputError(f"time has the units {unit!r}; expected one of {', '.join(_SECONDS)}.")
    # Some count from a moment of their own in other words: then only the seconds are known.
    start_time = utc(since, "the units of time") if since[:1].isdigit() else None
    return values * _SECONDS[unit], start_time


def evenly_spaced(name: str, count: int, values: np.ndarray | None) -> tuple[Axis, bool]:
    """Axis of the values, and whether they descend.

    Parameters
    ----------
    name : of the axis, for the message.
    count : of the cells.
    values : of the cells; numbers from 0 where there are none.

    Raises
    ------
    InputError : a value is further from its even place than a tenth of a cell.

    Examples
    --------
    >>> evenly_spaced("bearing", 3, np.array([180.0, 90.0, 0.0]))
    (Axis(first=0.0, step=90.0, count=3), True)
    """
    if values is None or count == 1:
        return Axis(0.0 if values is None else float(values[0]), 1.0, count), False
    first, step = float(values[0]), float(values[-1] - values[0]) / (count - 1)
    # Values may be rounded, but a tenth of a cell would shift what is seen.
    if not (np.abs(values - first - step * np.arange(count)) < 0.1 * abs(step)).all():
        steps = np.diff(values)
        index = int(np.argmax(np.abs(steps - np.median(steps)))) + 1
        raise InputError(
            f"{name} is uneven at index {index}, {values[index]:g} after {values[index - 1]:g}; "
            "expected evenly spaced values."
        )
    return (Axis(first, step, count), False) if step > 0 else (Axis(float(values[-1]), -step, count), True)
