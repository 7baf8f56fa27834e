"""CSV files with a row of names and numbers below them.

The first row names the columns, in any order; a missing value is empty; rows without any value are passed over.
"""

import array
import csv
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from faintrack.errors import InputError
from faintrack.io.checks import explained, number, require_file


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
