"""Bearing-time records as files: npz, HDF5, Zarr, CSV.

What `faintrack.io.recordings` is for samples this is for the energies of beams. In npz, HDF5 and Zarr they are an array
with the axes time and bearing, called `energy` where the file holds others; beside it an array `time` in seconds and
one `bearing` in degrees:

.. code-block:: python

    np.savez("south.npz", energy=energy, time=seconds, bearing=np.arange(181.0))

In CSV the first column is the time and every other one a beam, named by its bearing; what was not measured is empty:

.. code-block:: text

    time_s,0,1,2,3
    0,0.31,-0.42,1.08,0.77
    1,0.12,,-0.65,2.10

Bearings are evenly spaced, in degrees from the axis of a line and clockwise from north for any other array. What is not
a number was not measured. A Zarr folder or an HDF5 file that holds `time_data` is a recording, not a record.
"""

import array
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from faintrack.data.sequence import Sequence
from faintrack.errors import InputError, naming
from faintrack.io.checks import explained
from faintrack.io.sequences import evenly_spaced, read_sequence
from faintrack.io.text import opened
from faintrack.io.variables import Variable, open_hdf5, open_npz, open_zarr

READERS = {".npz": open_npz, ".h5": open_hdf5, ".hdf5": open_hdf5, ".zarr": open_zarr}
ENERGY = "energy"
SUFFIXES = (".csv", *READERS)
TIME = "time_s"


def read_record(path: str | Path, ends_deg: tuple[float, float] | None = None) -> Sequence:
    """Bearing-time record of a file.

    Parameters
    ----------
    path : npz, HDF5, Zarr or CSV, told by suffix.
    ends_deg : bearings of the first and the last beam, degrees; those of the file where not given.

    Returns
    -------
    Sequence with the one axis `bearing`, in degrees; values that were not measured are not numbers. Of CSV all values
    are held in memory, of the others what is asked for.

    Raises
    ------
    InputError : the file is missing, unknown, damaged or empty; energies, times and bearings do not fit together; it
        does not tell its bearings and `ends_deg` neither.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "south.csv"
    ...     _ = path.write_text("time_s,0,90,180\\n0,1.5,2,0\\n10,0,,0.5\\n")
    ...     record = read_record(path)
    >>> record.times.tolist(), record.axes, record.read(1, 2).tolist()
    ([0.0, 10.0], (('bearing', Axis(first=0.0, step=90.0, count=3)),), [[0.0, nan, 0.5]])
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{path}: unknown kind of file; expected {', '.join(SUFFIXES)} for a record.")
    with explained(f"{path} cannot be read as a record"):
        return _read_record(path, suffix, ends_deg)


def _read_record(path: Path, suffix: str, ends_deg: tuple[float, float] | None) -> Sequence:
    variables = {} if suffix == ".csv" else READERS[suffix](path)
    told = suffix == ".csv" or "bearing" in variables
    with naming(path):
        if told and ends_deg is not None:
            raise InputError("the file tells its bearings; expected no beams_deg of the station.")
        if not told and ends_deg is None:
            raise InputError("there is no array bearing; expected degrees, or beams_deg of the station.")
        if suffix == ".csv":
            return _read_csv(path)
        if "time" not in variables:
            raise InputError("there is no array time; expected the seconds of every row.")
        record = read_sequence(path, _energy_name(variables), _dims(variables), gaps=True)
        if record.names != ("bearing",):
            raise InputError(f"energies have the axes time, {', '.join(record.names)}; expected time and bearing.")
        if ends_deg is None:
            return record
        (beams,) = record.shape
        axis, turned = evenly_spaced("beams_deg", beams, np.linspace(*ends_deg, beams))
    return replace(
        record,
        read=lambda start, stop: np.flip(record.read(start, stop), 1) if turned else record.read(start, stop),
        axes=(("bearing", axis),),
    )


def holds_record(path: Path) -> bool:
    """Whether a file can be a record, as far as its suffix and the names in it tell; others may be recordings.

    Raises
    ------
    InputError : it has such a suffix, and is missing or damaged.

    Examples
    --------
    >>> holds_record(Path("south.csv")), holds_record(Path("south.wav"))
    (True, False)
    """
    suffix = path.suffix.lower()
    if suffix in (".csv", ".npz"):
        return True
    return suffix in READERS and "time_data" not in READERS[suffix](path)


def _energy_name(variables: Mapping[str, Variable]) -> str | None:
    """Name of the energies; None where the one array with two axes is it."""
    return ENERGY if ENERGY in variables else None


def _dims(variables: Mapping[str, Variable]) -> tuple[str, str] | None:
    """Axes of the energies, where the file does not name them."""
    found = next((v for name, v in variables.items() if name == ENERGY or len(v.shape) == 2), None)
    return ("time", "bearing") if found is None or found.dims is None else None


def _read_csv(path: Path) -> Sequence:
    with opened(path) as table:
        first, *named = table.names
        if first not in (TIME, "time"):
            raise InputError(
                f"{path}: the first column is {first[:80]!r}; expected {TIME}, and then bearings in degrees."
            )
        bearings = np.array([table.number(name, "row 1: a bearing") for name in named])
        if len(bearings) < 2:
            raise InputError(f"{path}: there are {len(bearings)} beams; expected a column each, named by its bearing.")
        axis, turned = evenly_spaced("the bearing", len(bearings), bearings)
        times, values = array.array("d"), array.array("f")
        for line, row in table:
            times.append(table.seconds(row[0], f"row {line}: {TIME}"))
            values.extend(
                np.nan if text.strip().lower() in ("", "nan") else table.number(text, f"row {line}: the beam at {name}")
                for name, text in zip(named, row[1:], strict=True)
            )
    energies = np.asarray(values, np.float32).reshape(len(times), len(bearings))
    if turned:
        energies = energies[:, ::-1]
    axes = (("bearing", axis),)
    seconds = np.asarray(times, float)
    return Sequence(lambda start, stop: energies[start:stop], seconds, axes, str(path), table.start, table.remarks)
