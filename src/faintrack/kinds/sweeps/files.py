"""Sweeps from npz and Zarr, and to them.

The arrays have names of their own (`faintrack.kinds.sweeps.sections.SweepsSection`); those that `write_sweeps` gives
are the ones that `read_sweeps` looks for where a scenario says nothing.
"""

from pathlib import Path

import numpy as np

from faintrack.errors import InputError, naming
from faintrack.io.checks import explained, require_numeric, utc
from faintrack.io.variables import Variable, open_npz, open_zarr
from faintrack.io.write_recordings import completed
from faintrack.kinds.sweeps.data import Sweeps
from faintrack.kinds.sweeps.sections import SweepsSection

READERS = {".npz": open_npz, ".zarr": open_zarr}

NAMES = {"times": "time", "x": "antenna_x", "y": "antenna_y", "heading": "heading_deg"}
"""Names of arrays where a scenario gives none."""


def holds_sweeps(paths: tuple[Path, ...]) -> bool:
    """Whether a path holds sweeps and tells so itself: an intensity with three axes and the spacing of its samples."""
    if len(paths) != 1 or paths[0].suffix.lower() not in READERS:
        return False
    variables = READERS[paths[0].suffix.lower()](paths[0])
    return "sample_spacing" in variables and "intensity" in variables and len(variables["intensity"].shape) == 3


def read_sweeps(path: Path, section: SweepsSection) -> Sweeps:
    """Sweeps of a file; they are read when they are asked for.

    Parameters
    ----------
    path : npz or Zarr.
    section : names of the arrays, and what the file does not tell.

    Raises
    ------
    InputError : the file is missing, damaged or unknown, an array is missing or has wrong axes, or the spacing of the
        samples is not known.
    """
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: unknown kind of file; expected {' or '.join(READERS)}.")
    variables = reader(path)
    with naming(path):
        name = section.variable
        if name not in variables:
            raise InputError(f"there is no array {name}; the file holds {', '.join(variables) or 'nothing'}.")
        intensity = variables[name]
        require_numeric(intensity.dtype, name)
        if intensity.dtype.kind == "c" or len(intensity.shape) != 3:
            raise InputError(
                f"{name} holds {intensity.dtype} of shape {intensity.shape}; expected real values on the axes "
                "(sweep, spoke, sample)."
            )
        arrays = {field: _values(variables, getattr(section, field), field) for field in NAMES}
        times, length = arrays.pop("times"), intensity.shape[0]
        remarks, start_time = [], None
        if section.interval is not None or times is None:
            times = (section.interval or 1.0) * np.arange(length)
            if section.interval is None:
                remarks.append("No times were given; sweeps are taken as 1 s apart.")
        else:
            start_time = _start(variables[section.times or NAMES["times"]])
        if len(times) != length:
            raise InputError(f"times has shape {times.shape}; expected {length} sweeps, as {name} has.")
        if arrays["heading"] is None:
            remarks.append("No heading was given; spoke 0 is taken to look north.")
        else:
            arrays["heading"] = np.radians(arrays["heading"])
        spacing = section.sample_spacing
        if spacing is None:
            spacing = _spacing(variables)
        read = intensity.read
        return Sweeps(
            lambda start, stop: read((slice(start, stop), slice(None), slice(None))),
            intensity.shape[1:],
            times,
            spacing,
            arrays["x"],
            arrays["y"],
            arrays["heading"],
            source=str(path),
            start_time=start_time,
            remarks=tuple(remarks),
        )


def write_sweeps(path: str | Path, sweeps: Sweeps) -> None:
    """Write sweeps as `read_sweeps` reads them.

    Parameters
    ----------
    path : .zarr, written sweep by sweep, or .npz; replaced if it exists.
    sweeps : to write.

    Raises
    ------
    InputError : the kind of file is unknown, or the file cannot be written.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in READERS:
        raise InputError(f"{path}: unknown kind of file; expected {' or '.join(READERS)}.")
    complaint = f"{path} cannot be written"
    others = {"time": sweeps.times, "sample_spacing": np.array(sweeps.spacing)}
    others |= {
        NAMES[name]: values
        for name, values in (("x", sweeps.x), ("y", sweeps.y), ("heading", sweeps.heading))
        if values is not None
    }
    if "heading_deg" in others:
        others["heading_deg"] = np.degrees(others["heading_deg"])
    with completed(path, complaint) as partial, explained(complaint):
        if suffix == ".npz":
            with partial.open("wb") as file:
                np.savez_compressed(file, allow_pickle=False, intensity=sweeps.read(0, sweeps.length), **others)
            return
        import zarr

        group = zarr.open_group(partial, mode="w", zarr_format=3)
        for number in range(sweeps.length):
            sweep = sweeps.read(number, number + 1)
            if number == 0:
                shape, names = (sweeps.length, *sweeps.shape), ("sweep", "spoke", "sample")
                intensity = group.create_array(
                    "intensity", shape=shape, chunks=sweep.shape, dtype=sweep.dtype, dimension_names=names
                )
            intensity[number : number + 1] = sweep
        for name, values in others.items():
            group.create_array(name, data=np.asarray(values))


def _values(variables: dict[str, Variable], given: str | None, field: str) -> np.ndarray | None:
    """Values of the array of a field; None where none was named and there is none of the usual name."""
    name = given or NAMES[field]
    if name not in variables:
        if given is not None:
            raise InputError(f"sweeps.{field} is {given!r}, and there is no such array; expected one of the file's.")
        return None
    variable = variables[name]
    require_numeric(variable.dtype, name)
    return np.asarray(variable.read((slice(None),) * len(variable.shape)), float)


def _start(times: Variable) -> np.datetime64 | None:
    """What second 0 is in UTC, where the array of times tells."""
    units = times.attributes.get("units", "s")
    _, _, since = (units.decode() if isinstance(units, bytes) else str(units)).partition(" since ")
    return utc(since, "the units of time") if since[:1].isdigit() else None


def _spacing(variables: dict[str, Variable]) -> float:
    if "sample_spacing" not in variables:
        raise InputError("there is no sample_spacing; expected sweeps.sample_spacing, metres from sample to sample.")
    values = np.asarray(variables["sample_spacing"].read(()), float)
    if values.size != 1:
        raise InputError(f"sample_spacing has shape {values.shape}; expected one number.")
    return float(values.ravel()[0])
