"""Headings of an array that turns: CSV with a row for every time.

.. code-block:: text

    time_s,heading_deg
    0,358.5
    10,1.0

`time_s` counts from the start of the recording, or is a date in UTC; `heading_deg` is in degrees clockwise from true
north, in any turn.
"""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from faintrack.errors import InputError
from faintrack.io.text import opened

COLUMNS = ("time_s", "heading_deg")


def read_headings(
    path: str | Path, start: np.datetime64 | None = None
) -> tuple[Float[np.ndarray, " row"], Float[np.ndarray, " row"]]:
    """Times and headings of a CSV file.

    Parameters
    ----------
    path : of the file.
    start : of the recording in UTC, which dates are counted from; None where it is not known.

    Returns
    -------
    Seconds from the start of the recording, ascending; degrees without jumps, the way from row to row the shorter one.

    Raises
    ------
    InputError : the file is missing, damaged or empty; a column is missing or unknown; a value is no number; times do
        not ascend, or are dates and it is not known when the recording starts.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "heading.csv"
    ...     _ = path.write_text("time_s,heading_deg\\n0,358\\n10,2\\n")
    ...     times, degrees = read_headings(path)
    >>> times.tolist(), degrees.tolist()
    ([0.0, 10.0], [358.0, 362.0])
    """
    path = Path(path)
    with opened(path) as table:
        names = ["time_s" if name == "time" else name for name in table.names]
        if sorted(names) != sorted(COLUMNS):
            raise InputError(f"{path}: the columns are {', '.join(names)}; expected {', '.join(COLUMNS)}.")
        time, heading = (names.index(name) for name in COLUMNS)
        times: list[float] = []
        degrees: list[float] = []
        for line, row in table:
            times.append(table.seconds(row[time], f"row {line}: time_s"))
            degrees.append(table.number(row[heading], f"row {line}: heading_deg"))
            if not np.isfinite([times[-1], degrees[-1]]).all():
                raise InputError(f"{path}, row {line}: expected finite numbers.")
            if len(times) > 1 and times[-1] <= times[-2]:
                raise InputError(f"{path}, row {line}: time_s is not after the row before; expected ascending times.")
        if not times:
            raise InputError(f"{path}: there is no row; expected one or more.")
        offset = 0.0
        if table.start is not None:
            if start is None:
                raise InputError(
                    f"{path}: times are dates, and the recording does not tell when it starts; expected seconds."
                )
            offset = float((table.start - start) / np.timedelta64(1, "ns")) / 1e9
    return np.array(times) + offset, np.unwrap(degrees, period=360.0)
