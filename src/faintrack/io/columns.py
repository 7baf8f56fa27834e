"""Columns of numbers as files: CSV with a row of names and numbers below them, or Zarr in xarray's way.

In CSV the first row names the columns, in any order; a missing value is empty; rows without any value are passed over.
In Zarr every column is an array with one axis, and a missing value is not a number.
"""

import array
import csv
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from faintrack.errors import InputError, naming
from faintrack.io.checks import explained, number, require_file, require_numeric
from faintrack.io.variables import open_zarr
from faintrack.io.write_recordings import completed

SUFFIXES = (".csv", ".zarr")

Columns = Mapping[str, Float[np.ndarray, " row"]]


def read_columns(
    path: Path, require: Callable[[Sequence[str], str], Any]
) -> tuple[dict[str, Float[np.ndarray, " row"]], Int[np.ndarray, " row"]]:
    """Columns of a CSV file, and the line in the file of every row, as an editor counts.

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
    require_file(path)
    with explained(f"{path} cannot be read as CSV"), path.open(newline="", encoding="utf-8-sig") as file:
        reader = csv.reader(file)
        names = [name.strip() for name in next(reader)]
        require(names, str(path))
        columns = [array.array("d") for _ in names]
        lines = array.array("q")
        for row in reader:
            if not any(map(str.strip, row)):
                continue
            if len(row) != len(names):
                raise InputError(
                    f"{path}, row {reader.line_num}: {len(row)} values; expected {len(names)}, as the names."
                )
            lines.append(reader.line_num)
            for name, column, text in zip(names, columns, row, strict=True):
                value = text.strip()
                column.append(number(value, f"{path}, row {reader.line_num}: {name}") if value else np.nan)
    return dict(zip(names, map(np.asarray, columns), strict=True)), np.array(lines, np.int64)


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
    path: Path, what: str, row: str, require: Callable[[Sequence[str], str], Any]
) -> tuple[dict[str, Float[np.ndarray, " row"]], Int[np.ndarray, " row"] | None]:
    """Columns of a CSV file or a Zarr folder, and in CSV the line of every row.

    Parameters
    ----------
    path : told by suffix.
    what : the file holds, for messages: returns, bearings.
    row : name of the axis in Zarr, whose own numbers are no column.
    require : as of `read_columns`; Zarr is left to the caller.

    Raises
    ------
    InputError : the file is missing, unknown or damaged, or a value is no number.
    """
    if _suffix(path, what) == ".csv":
        return read_columns(path, require)
    return _read_zarr(path, row), None


def write_table(path: Path, what: str, row: str, columns: Columns) -> None:
    """Write columns to a file, beside its place first and then renamed; numbers have nine digits in CSV.

    Parameters
    ----------
    path, what, row : as in `read_table`. An earlier file is replaced.
    columns : what to write.

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
                    writer.writerow(["" if np.isnan(value) else f"{value:.9g}" for value in each])
        else:
            data = xr.Dataset({name: (row, column) for name, column in columns.items()})
            data.to_zarr(partial, zarr_format=2)


def _suffix(path: Path, what: str) -> str:
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{path}: unknown kind of file; expected {' or '.join(SUFFIXES)} for {what}.")
    return suffix


def _read_zarr(path: Path, row: str) -> dict[str, np.ndarray]:
    columns = {}
    with naming(path):
        for name, variable in open_zarr(path).items():
            if name == row:  # numbers of the rows
                continue
            require_numeric(variable.dtype, name)
            packed = variable.attributes.keys() & {"scale_factor", "add_offset"}
            if packed:
                raise InputError(f"{name} is packed with {min(packed)}; expected plain values.")
            columns[name] = variable.read((slice(None),) * len(variable.shape))
    return columns
