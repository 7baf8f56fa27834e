"""Columns of numbers as files: CSV with a row of names and numbers below them, or Zarr in xarray's way.

In CSV the first row names the columns, in any order; a missing value is empty; rows without any value are passed over.
In Zarr every column is an array with one axis, and a missing value is not a number.
"""

import array
import csv
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from faintrack.errors import InputError, naming
from faintrack.io import limits
from faintrack.io.checks import explained, require_numeric
from faintrack.io.text import opened
from faintrack.io.variables import open_zarr
from faintrack.io.write_recordings import completed

SUFFIXES = (".csv", ".zarr")
TIME = "time_s"

Columns = Mapping[str, np.ndarray]
"""Numbers by name, or text in columns of labels."""


def read_columns(
    path: Path, require: Callable[[Sequence[str], str], Any]
) -> tuple[dict[str, Float[np.ndarray, " row"]], Int[np.ndarray, " row"]]:
    """Columns of a CSV file, and the line in the file of every row, as an editor counts.

    A column `time` is one of `time_s`; dates in UTC become seconds since the first (`faintrack.io.text`).

    Parameters
    ----------
    path : of the file.
    require : function of the names and the file's name that raises InputError where they are not what is expected.

    Returns
    -------
    Values by name, not a number where they are missing; lines.

    Raises
    ------
    InputError : the file is missing, empty or not text; a row is too short or too long; a value is no number.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "path.csv"
    ...     _ = path.write_text("time_s,x_m\\n0,5\\n\\n9,\\n")
    ...     columns, lines = read_columns(path, lambda names, where: None)
    >>> columns["x_m"].tolist(), lines.tolist()
    ([5.0, nan], [2, 4])
    """
    columns, lines, _ = _read_text(path, require)
    return columns, lines


def _read_text(
    path: Path, require: Callable[[Sequence[str], str], Any], labels: Sequence[str] = ()
) -> tuple[dict[str, np.ndarray], np.ndarray, tuple[str, ...]]:
    """The same, and what was taken; columns of labels are text."""
    with opened(path) as table:
        names = [TIME if name == "time" else name for name in table.names]
        require(names, str(path))
        columns: list[Any] = [[] if name in labels else array.array("d") for name in names]
        lines = array.array("q")
        for line, row in table:
            lines.append(line)
            for name, column, text in zip(names, columns, row, strict=True):
                if name in labels:
                    column.append(text.strip())
                    continue
                value = table.seconds if name == TIME else table.number
                column.append(value(text, f"row {line}: {name}") if text.strip() else np.nan)
    found = dict(zip(names, map(np.asarray, columns), strict=True))
    return found, np.array(lines, np.int64), table.remarks


def column_names(path: Path) -> frozenset[str]:
    """Names of the columns of a CSV file or a Zarr folder, by which kinds of data are told apart; none of other files.

    Raises
    ------
    InputError : the file is damaged, or not text.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "path.csv"
    ...     _ = path.write_text("time_s, x_m\\n0,5\\n")
    ...     sorted(column_names(path))
    ['time_s', 'x_m']
    """
    suffix = path.suffix.lower()
    if suffix == ".zarr":
        return frozenset(open_zarr(path))
    if suffix != ".csv":
        return frozenset()
    with explained(f"{path} cannot be read as CSV"), path.open(newline="", encoding="utf-8-sig") as file:
        return frozenset(name.strip() for name in next(csv.reader(file), []))


def read_table(
    path: Path, what: str, row: str, require: Callable[[Sequence[str], str], Any], labels: Sequence[str] = ()
) -> tuple[dict[str, np.ndarray], Int[np.ndarray, " row"] | None, tuple[str, ...]]:
    """Columns of a CSV file or a Zarr folder, in CSV the line of every row, and what was taken.

    Parameters
    ----------
    path : told by suffix.
    what : the file holds, for messages: returns, bearings.
    row : name of the axis in Zarr, whose own numbers are no column.
    require : as of `read_columns`; Zarr is left to the caller.
    labels : names of the columns that may hold text.

    Raises
    ------
    InputError : the file is missing, unknown or damaged, or a value is no number.
    """
    if _suffix(path, what) == ".csv":
        return _read_text(path, require, labels)
    return _read_zarr(path, row, labels), None, ()


def without_repeats(
    columns: Columns, lines: Int[np.ndarray, " row"] | None
) -> tuple[dict[str, np.ndarray], Int[np.ndarray, " kept"] | None, tuple[str, ...]]:
    """Columns in which every row stands once, the lines that are left, and a remark where there are fewer.

    Parameters
    ----------
    columns, lines : as of `read_table`.

    Examples
    --------
    >>> columns, lines, remarks = without_repeats({"time_s": np.array([0.0, 0.0, 1.0])}, np.array([2, 3, 4]))
    >>> lines.tolist(), remarks
    ([2, 4], ('1 rows stand in the file twice; each counts once.',))
    """
    values = [_numbered(np.asarray(column)) for column in columns.values()]
    if not values or len({value.shape for value in values}) > 1 or values[0].ndim != 1:
        return dict(columns), lines, ()
    # NaN equals itself here, and 0 its negative.
    rows = np.stack([np.where(np.isnan(value), np.nan, value + 0.0) for value in values], axis=1)
    whole = np.ascontiguousarray(rows).view(np.dtype((np.void, rows.dtype.itemsize * rows.shape[1])))[:, 0]
    kept = np.sort(np.unique(whole, return_index=True)[1])
    if len(kept) == len(rows):
        return dict(columns), lines, ()
    said = f"{len(rows) - len(kept)} rows stand in the file twice; each counts once."
    left = {name: np.asarray(column)[kept] for name, column in columns.items()}
    return left, (kept if lines is None else lines[kept]), (said,)


def _numbered(column: np.ndarray) -> Float[np.ndarray, "..."]:
    """A column as numbers: those that it holds, or one for each of its labels."""
    if column.dtype.kind in "UO":
        column = np.unique(column.astype(str), return_inverse=True)[1]
    return np.asarray(column, float)


def write_table(path: Path, what: str, row: str, columns: Columns) -> None:
    """Write columns to a file, beside its place first and then renamed; numbers have nine digits in CSV.

    Parameters
    ----------
    path, what, row : as in `read_table`. An earlier file is replaced.
    columns : what to write; labels are text.

    Raises
    ------
    InputError : the suffix is unknown, or the file cannot be written.
    """
    import xarray as xr

    suffix = _suffix(path, what)
    complaint = f"{path} cannot be written"
    with completed(path, complaint) as partial, explained(complaint):
        if suffix == ".csv":
            with partial.open("w", newline="", encoding="utf-8") as file:
                writer = csv.writer(file)
                writer.writerow(columns)
                for each in zip(*columns.values(), strict=True):
                    writer.writerow([_written(value) for value in each])
        else:
            data = xr.Dataset({name: (row, column) for name, column in columns.items()})
            data.to_zarr(partial, zarr_format=2)


def _written(value: Any) -> str:
    if isinstance(value, str):
        return value
    return "" if np.isnan(value) else f"{value:.9g}"


def _suffix(path: Path, what: str) -> str:
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{path}: unknown kind of file; expected {' or '.join(SUFFIXES)} for {what}.")
    return suffix


def _read_zarr(path: Path, row: str, labels: Sequence[str] = ()) -> dict[str, np.ndarray]:
    columns = {}
    with naming(path):
        for name, variable in open_zarr(path).items():
            if name == row:  # numbers of the rows
                continue
            if name not in labels or variable.dtype.kind != "U":
                require_numeric(variable.dtype, name)
            packed = variable.attributes.keys() & {"scale_factor", "add_offset"}
            if packed:
                raise InputError(f"{name} is packed with {min(packed)}; expected plain values.")
            if math.prod(variable.shape) * 8 > limits.MOST_HELD:
                raise InputError(f"{name} has shape {variable.shape}; expected a column that memory holds.")
            columns[name] = variable.read((slice(None),) * len(variable.shape))
    return columns
