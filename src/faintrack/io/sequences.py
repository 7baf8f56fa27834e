"""Sequences of frames from files: image stacks, range-time and range-Doppler matrices, bearing-time records.

What `faintrack.io.recordings` is for samples this is for frames. A file gives named arrays
(`faintrack.io.variables`, `faintrack.io.images`); here one of them becomes the frames, its axes get names, and arrays
of those names give the times and the values along the axes. Frames are read when they are asked for.
"""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from faintrack.beliefs.axis import Axis
from faintrack.data.sequence import Sequence
from faintrack.errors import InputError, naming
from faintrack.io import limits
from faintrack.io.checks import as_float, explained, require_numeric, utc
from faintrack.io.images import FRAMES, open_folder
from faintrack.io.tiff import open_tiff
from faintrack.io.variables import Variable, open_hdf5, open_mat, open_npy, open_npz, open_zarr

READERS: dict[str, Callable[..., dict[str, Variable]]] = {
    ".npz": open_npz,
    ".npy": open_npy,
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
# Names under which programs keep the times of frames, besides `time`.
_TIMES = ("times", "time_s", "timestamps", "t")
# Files in which the order of the axes is anybody's, and what belongs to them is not named after them.
_FITTING = (".mat", ".h5", ".hdf5")
# Axes of which one place has to be picked: they are no part of a target's state.
_PICKED = ("channel", "depth")


def read_sequence(
    path: str | Path,
    variable: str | None = None,
    dims: tuple[str, ...] | None = None,
    frame_interval: float | None = None,
    gaps: bool = False,
    *,
    coordinates: Mapping[str, str] | None = None,
    select: Mapping[str, int] | None = None,
    start_pattern: str | None = None,
) -> Sequence:
    """Sequence of the frames in a file or folder.

    Parameters
    ----------
    path : npz, npy, MAT, Zarr, HDF5 or TIFF, told by suffix; any other folder is one of images, one a frame.
    variable : name of the array that holds the frames. Where not given the largest of the numeric arrays with 2 to 4
        axes, if no other one has as many axes.
    dims : names of its axes in the order of the file, one of them `time`, the others components of a state. Where not
        given those that the file names (Zarr, HDF5, TIFF), else (time, range) or (time, y, x).
    frame_interval : seconds from frame to frame, the first at 0; of numbered images from number to number. Where not
        given the file's array `time` (or `times`, `time_s`, `timestamps`, `t`), in seconds or in the `units` that Zarr
        and HDF5 tell, or the interval of TIFF, else 1 second. Units of "seconds since" a time in UTC, and dates, tell
        the sequence's `start_time`.
    gaps : whether values may be missing, which is NaN: not a number in the file, a mark for none, a chunk that is not
        there.
    coordinates : names of the arrays that hold the values along an axis, `{"range": "rng"}`. Where not given arrays
        named like the axes; in MAT and HDF5 else the one array of evenly spaced values that fits that axis alone.
    select : which place to take of an axis that is no part of a state, `{"channel": 0}`.
    start_pattern : how names of images tell their time, see `faintrack.io.names.start_in_name`.

    Returns
    -------
    Sequence whose `read` gives frames in float32, or float64 where the file has it. Arrays
    named like an axis give its values, otherwise cells are numbered from 0; an axis with descending values is
    turned around. `read` raises InputError where a frame is damaged or holds infinity or, without gaps, NaN. `remarks`
    say what was assumed.

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
    opening = _reader(path)
    if start_pattern is not None and opening is not open_folder:
        raise InputError(f"{path}: start_pattern is for folders of images; expected none.")
    variables = dict(opening(path) if start_pattern is None else opening(path, start_pattern))
    with explained(f"{path} cannot be read"), naming(path):
        name = _frames_name(variables) if variable is None else variable
        if name not in variables:
            raise InputError(f"there is no array {name}; the file holds {_listed(variables)}.")
        frames = variables.pop(name)
        _require_plain(name, frames)
        remarks = list(frames.remarks)
        fitting = path.suffix.lower() in _FITTING
        names, said = _dims(name, frames, dims, variables if fitting else {}, coordinates or {})
        remarks += said
        picked = _picked(name, names, frames.shape, select or {})
        counts = {dim: count for dim, count in zip(names, frames.shape, strict=True) if dim not in picked}
        length = counts.pop("time")
        if math.prod(counts.values()) > limits.MOST_CELLS:
            raise InputError(
                f"{name} has frames of {math.prod(counts.values())} cells; expected at most {limits.MOST_CELLS}."
            )
        vectors, said = _vectors(
            variables, {"time": length} | counts, dict(coordinates or {}), fitting and frames.dims is None
        )
        remarks += said
        times, start_time = _times(vectors, length, frame_interval)
        found = [(dim, *evenly_spaced(dim, count, _coordinate(vectors, dim, count))) for dim, count in counts.items()]
    kept = [dim for dim in names if dim not in picked]
    time_axis = kept.index("time")
    turned = tuple(number for number, (_, _, descends) in enumerate(found, start=1) if descends)

    def read(start: int, stop: int) -> np.ndarray:
        part = tuple(
            slice(start, stop)
            if dim == "time"
            else slice(picked[dim], picked[dim] + 1)
            if dim in picked
            else slice(None)
            for dim in names
        )
        with explained(f"{path} cannot be read"):
            values = frames.read(part)
            values = values.reshape(
                [count for dim, count in zip(names, values.shape, strict=True) if dim not in picked]
            )
            values = np.flip(np.moveaxis(as_float(values), time_axis, 0), turned)
            good = ~np.isinf(values) if gaps else np.isfinite(values)
            wrong = ~good.all(axis=tuple(range(1, values.ndim)))
            if wrong.any():
                number, what = start + int(np.argmax(wrong)), "infinity" if gaps else "NaN or infinity"
                raise InputError(f"{path}: frame {number} of {name} holds {what}; expected finite values.")
        return values

    axes = tuple((dim, axis) for dim, axis, _ in found)
    return Sequence(read, times, axes, str(path), start_time, tuple(remarks))


def holds_frames(path: Path) -> bool:
    """Whether a path can be nothing else than frames: TIFF, npz, a folder but of Zarr; the others hold samples too.

    Examples
    --------
    >>> holds_frames(Path("stack.tif")), holds_frames(Path("night.zarr"))
    (True, False)
    """
    suffix = path.suffix.lower()
    return suffix in (".npz", ".npy", ".tif", ".tiff") or (path.is_dir() and suffix not in READERS)


def _reader(path: Path) -> Callable[..., dict[str, Variable]]:
    with explained(f"{path} cannot be looked at"):
        reader = READERS.get(path.suffix.lower(), open_folder if path.is_dir() else None)
        if not path.exists():
            raise InputError(f"{path} does not exist.")
    if reader is None:
        *others, last = READERS
        raise InputError(
            f"{path}: unknown kind of file; expected {', '.join(others)} or {last}, or a folder of images."
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
    return ", ".join(list(variables)[:20]) or "nothing"


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


def _dims(
    name: str,
    frames: Variable,
    dims: tuple[str, ...] | None,
    variables: Mapping[str, Variable],
    coordinates: Mapping[str, str],
) -> tuple[tuple[str, ...], list[str]]:
    """Names of the axes, and what was taken."""
    told = tuple(dims or frames.dims or ())
    said: list[str] = []
    if not told:
        told = _DIMS.get(len(frames.shape), ())
        if not told:
            raise InputError(f"{name} has shape {frames.shape}; expected dims to name its axes.")
        fitting = _fitting(told, frames.shape, variables, coordinates)
        if fitting != told:
            said.append(
                f"The axes of {name} are {', '.join(fitting)}, as the lengths of the arrays of these names say."
            )
            told = fitting
    if len(told) != len(frames.shape):
        raise InputError(f"{name} has shape {frames.shape}; expected the axes {', '.join(told)}.")
    if told.count("time") != 1 or len(set(told)) < len(told):
        raise InputError(
            f"{name} has the axes {', '.join(told)}; expected dims with different names, one of them time."
        )
    return told, said


def _fitting(
    usual: tuple[str, ...], shape: tuple[int, ...], variables: Mapping[str, Variable], coordinates: Mapping[str, str]
) -> tuple[str, ...]:
    """Names of the axes, moved where an array of such a name fits another axis and that one alone."""
    placed: dict[int, str] = {}
    for dim in usual:
        vector = variables.get(coordinates.get(dim, dim))
        if vector is None or len(vector.shape) != 1:
            continue
        fits = [number for number, count in enumerate(shape) if count == vector.shape[0]]
        if len(fits) == 1:
            placed.setdefault(fits[0], dim)
    left = iter([dim for dim in usual if dim not in placed.values()])
    return tuple(placed[number] if number in placed else next(left) for number in range(len(shape)))


def _picked(name: str, names: tuple[str, ...], shape: tuple[int, ...], select: Mapping[str, int]) -> dict[str, int]:
    """Places of the axes that are no part of a state."""
    counts = dict(zip(names, shape, strict=True))
    for dim, place in select.items():
        if dim not in counts or dim == "time" or not 0 <= place < counts[dim]:
            raise InputError(
                f"select has {dim}: {place}; {name} has {', '.join(f'{d}: {n}' for d, n in counts.items())}."
            )
    for dim in _PICKED:
        if dim in counts and dim not in select:
            raise InputError(
                f"{name} has {counts[dim]} places along its axis {dim}; expected select, such as {dim}: 0, or dims "
                "that call it time."
            )
    return {dim: int(place) for dim, place in select.items()}


def _vectors(
    variables: Mapping[str, Variable], counts: Mapping[str, int], coordinates: dict[str, str], search: bool
) -> tuple[dict[str, Variable], list[str]]:
    """Arrays with the values along the axes, by the name of the axis; and what was taken.

    Raises
    ------
    InputError : several can each be the values of one axis, or a name is none.
    """
    found, said = {}, []
    for dim, name in coordinates.items():
        if dim not in counts or name not in variables:
            raise InputError(
                f"coordinates has {dim}: {name}; the axes are {', '.join(counts)}, the arrays {_listed(variables)}."
            )
        found[dim] = variables[name]
    found |= {dim: variables[dim] for dim in counts if dim in variables and dim not in found}
    if "time" not in found:
        names = [name for name in _TIMES if name in variables and variables[name].shape == (counts["time"],)]
        if len(names) > 1:
            raise InputError(f"{' and '.join(names)} can each be the times; expected coordinates to name one of them.")
        for name in names:
            found["time"] = variables[name]
            said.append(f"The times are those of {name}, in seconds.")
    if not search:
        return found, said
    used = {id(value) for value in found.values()}
    free = {
        name: value
        for name, value in variables.items()
        if id(value) not in used and len(value.shape) == 1 and value.shape[0] > 2 and value.dtype.kind in "iuf"
    }
    # An axis of the same length as another can be neither's for certain.
    for dim, count in counts.items():
        if dim in found or list(counts.values()).count(count) > 1:
            continue
        able = [name for name, value in free.items() if value.shape == (count,) and _ascends(value, dim == "time")]
        if len(able) > 1:
            raise InputError(
                f"{' and '.join(able[:4])} can each be the values of {dim}; expected coordinates to name one of them."
            )
        for name in able:
            found[dim] = free[name]
            said.append(f"The values along {dim} are those of {name}, the one array that fits.")
    return found, said


def _ascends(vector: Variable, uneven: bool) -> bool:
    """Whether values can be those along an axis: ascending, or evenly spaced."""
    if vector.shape[0] > limits.MOST_CELLS:
        return False
    values = vector.read((slice(None),)).astype(float)
    steps = np.diff(values)
    if not np.isfinite(values).all() or not (steps != 0).all():
        return False
    return bool((steps > 0).all()) if uneven else bool((np.abs(steps - steps.mean()) < 0.1 * abs(steps.mean())).all())


def _coordinate(vectors: Mapping[str, Variable], dim: str, count: int) -> np.ndarray | None:
    """Values along an axis."""
    variable = vectors.get(dim)
    if variable is None:
        return None
    if dim != "time" or variable.dtype.kind != "M":
        require_numeric(variable.dtype, dim)
    if variable.shape != (count,):
        raise InputError(
            f"{dim} has shape {variable.shape}; expected {(count,)}, one value for each place of its axis."
        )
    values = variable.read((slice(None),))
    if values.dtype.kind == "M":
        return values
    values = values.astype(float)
    if not np.isfinite(values).all():
        raise InputError(f"{dim} holds NaN or infinity at index {np.argmin(np.isfinite(values))}; expected numbers.")
    return values


def _times(
    vectors: Mapping[str, Variable], length: int, frame_interval: float | None
) -> tuple[np.ndarray, np.datetime64 | None]:
    """Seconds of every frame, and what second 0 is in UTC."""
    if frame_interval is not None and not 0 < frame_interval < np.inf:
        raise InputError(f"frame_interval is {frame_interval:g}; expected seconds above 0.")
    told = vectors.get("time")
    units: Any = "s" if told is None else told.attributes.get("units", "s")
    units = units.decode() if isinstance(units, bytes) else str(units)
    counted = told is not None and units == FRAMES
    if frame_interval is not None and not counted:
        return frame_interval * np.arange(length), None
    values = _coordinate(vectors, "time", length)
    if values is None:
        return np.arange(length, dtype=float), None
    if counted:
        return values * (frame_interval or 1.0), None
    if values.dtype.kind == "M":
        moments = values.astype("datetime64[ns]")
        if np.isnat(moments).any():
            raise InputError(f"time holds no date at index {np.argmax(np.isnat(moments))}; expected dates.")
        return (moments - moments[0]) / np.timedelta64(1, "s"), moments[0]
    unit, _, since = units.partition(" since ")
    if unit not in _SECONDS:
        raise InputError(f"time has the units {unit[:80]!r}; expected one of {', '.join(_SECONDS)}.")
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
