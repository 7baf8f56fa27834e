"""Returns of an active sonar as files: CSV, or Zarr in xarray's way.

What `faintrack.io.recordings` is for samples this is for returns. Both kinds of file have the columns of
`faintrack.data.returns.from_columns`, a row for every return and one with its time alone for a ping without any:

.. code-block:: text

    time_s,delay_s,bearing_deg,snr_db
    0,9.4512,318.4,10.31
    0,21.0077,12.1,11.90
    180,,,
    360,9.3820,318.6,15.72

Where there are several receivers or sources, columns `receiver` and `source` hold the name or number of each. In CSV
the first row names the columns, in any order, and a missing value is empty; semicolons, decimal commas and dates in UTC
are understood (`faintrack.io.text`). A row that stands there twice counts once. In Zarr every column is an array
with one axis, `return`, and a missing value is not a number.
"""

from dataclasses import replace
from pathlib import Path

from faintrack.data.ping_tables import LABELS
from faintrack.data.returns import Returns, from_columns, require_names, to_columns
from faintrack.io.checks import explained
from faintrack.io.columns import read_table, without_repeats, write_table


def read_returns(path: str | Path) -> Returns:
    """Returns of a file.

    Parameters
    ----------
    path : CSV file or Zarr folder, told by suffix.

    Returns
    -------
    Returns; their rows are those of the file, in CSV as an editor counts its lines, in Zarr from 0.

    Raises
    ------
    InputError : the file is missing, unknown, damaged or empty; its columns are not those of returns; a value is not
        what it has to be, see `faintrack.data.returns.from_columns`.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "returns.csv"
    ...     _ = path.write_text("time_s,delay_s,bearing_deg,snr_db\\n0,9.5,90,13\\n180,,,\\n")
    ...     returns = read_returns(path)
    >>> returns.times.tolist(), returns.counts.tolist()
    ([0.0, 180.0], [1, 0])
    """
    path = Path(path)
    with explained(f"{path} cannot be read as returns"):
        columns, rows, remarks = read_table(path, "returns", "return", require_names, LABELS)
        columns, rows, repeats = without_repeats(columns, rows)
        return replace(from_columns(columns, rows, str(path)), remarks=remarks + repeats)


def write_returns(path: str | Path, returns: Returns) -> None:
    """Write returns to a file, beside its place first and then renamed; `read_returns` gives them back.

    Parameters
    ----------
    path : CSV file or Zarr folder, told by suffix. An earlier one is replaced.
    returns : what to write. Numbers have nine digits in CSV.

    Raises
    ------
    InputError : the suffix is unknown, or the file cannot be written.
    """
    write_table(Path(path), "returns", "return", to_columns(returns))
