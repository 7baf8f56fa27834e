"""Sets of bearings as files: CSV, or Zarr in xarray's way.

What `faintrack.io.returns` is for an active sonar this is for passive ones. Both kinds of file have the columns of
`faintrack.data.bearings.from_columns`, a row for every bearing and one without a bearing for an observer that heard
nothing:

.. code-block:: text

    time_s,bearing_deg,observer_x_m,observer_y_m
    0,41.2,0,0
    0,310.5,0,0
    1,,10,0
    2,42.0,20,0

In CSV the first row names the columns, in any order, and a missing value is empty; semicolons, decimal commas and dates
in UTC are understood (`faintrack.io.text`). In Zarr every column is an array
with one axis, `row`, and a missing value is not a number.
"""

from dataclasses import replace
from pathlib import Path

from faintrack.data.bearings import Bearings, from_columns, require_names, to_columns
from faintrack.io.checks import explained
from faintrack.io.columns import read_table, without_repeats, write_table


def read_bearings(path: str | Path) -> Bearings:
    """Bearings of a file.

    Parameters
    ----------
    path : CSV file or Zarr folder, told by suffix.

    Returns
    -------
    Bearings; their rows are those of the file, in CSV as an editor counts its lines, in Zarr from 0.

    Raises
    ------
    InputError : the file is missing, unknown, damaged or empty; its columns are not those of bearings; a value is not
        what it has to be, see `faintrack.data.bearings.from_columns`.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "bearings.csv"
    ...     _ = path.write_text("time_s,bearing_deg,observer_x_m,observer_y_m\\n0,41.2,0,0\\n1,,10,0\\n")
    ...     bearings = read_bearings(path)
    >>> bearings.times.tolist(), bearings.scan.tolist(), bearings.place[1, 0].tolist()
    ([0.0, 1.0], [0], [10.0, 0.0])
    """
    path = Path(path)
    with explained(f"{path} cannot be read as bearings"):
        columns, rows, remarks = read_table(path, "bearings", "row", require_names)
        columns, rows, repeats = without_repeats(columns, rows)
        return replace(from_columns(columns, rows, str(path)), remarks=remarks + repeats)


def write_bearings(path: str | Path, bearings: Bearings) -> None:
    """Write bearings to a file, beside its place first and then renamed; `read_bearings` gives them back.

    Parameters
    ----------
    path : CSV file or Zarr folder, told by suffix. An earlier one is replaced.
    bearings : what to write. Numbers have nine digits in CSV.

    Raises
    ------
    InputError : the suffix is unknown, or the file cannot be written.
    """
    write_table(Path(path), "bearings", "row", to_columns(bearings))
