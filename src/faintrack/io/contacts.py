"""Contacts of an active sonar as files: CSV, or Zarr in xarray's way.

What `faintrack.io.bearings` is for passive detectors this is for an active one. Both kinds of file have the columns of
`faintrack.data.contacts.from_columns`, a row for every contact and one with its time alone for a ping without any:

.. code-block:: text

    time_s,range_m,bearing_deg
    0,7085,318.4
    0,15760,12.1
    60,,
    120,7032,318.6

In CSV the first row names the columns, in any order, and a missing value is empty; semicolons, decimal commas and dates
in UTC are understood (`faintrack.io.text`). A row that stands there twice counts once. In Zarr every column is an array
with one axis, `contact`, and a missing value is not a number.
"""

from dataclasses import replace
from pathlib import Path

from faintrack.data.contacts import Contacts, from_columns, require_names, to_columns
from faintrack.data.ping_tables import LABELS
from faintrack.io.checks import explained
from faintrack.io.columns import read_table, without_repeats, write_table


def read_contacts(path: str | Path) -> Contacts:
    """Contacts of a file.

    Parameters
    ----------
    path : CSV file or Zarr folder, told by suffix.

    Returns
    -------
    Contacts; their rows are those of the file, in CSV as an editor counts its lines, in Zarr from 0.

    Raises
    ------
    InputError : the file is missing, unknown, damaged or empty; its columns are not those of contacts; a value is not
        what it has to be, see `faintrack.data.contacts.from_columns`.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "contacts.csv"
    ...     _ = path.write_text("time_s,range_m,bearing_deg\\n0,7085,318.4\\n60,,\\n")
    ...     contacts = read_contacts(path)
    >>> contacts.times.tolist(), contacts.counts.ravel().tolist()
    ([0.0, 60.0], [1, 0])
    """
    path = Path(path)
    with explained(f"{path} cannot be read as contacts"):
        columns, rows, remarks = read_table(path, "contacts", "contact", require_names, LABELS)
        columns, rows, repeats = without_repeats(columns, rows)
        contacts = from_columns(columns, rows, str(path))
        return replace(contacts, remarks=remarks + repeats + contacts.remarks)


def write_contacts(path: str | Path, contacts: Contacts) -> None:
    """Write contacts to a file, beside its place first and then renamed; `read_contacts` gives them back.

    Parameters
    ----------
    path : CSV file or Zarr folder, told by suffix. An earlier one is replaced.
    contacts : what to write. Numbers have nine digits in CSV.

    Raises
    ------
    InputError : the suffix is unknown, or the file cannot be written.
    """
    write_table(Path(path), "contacts", "contact", to_columns(contacts))
