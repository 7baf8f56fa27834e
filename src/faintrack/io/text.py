"""Tables as text, in the ways in which programs and countries write them: what stands between values, and in numbers.

The row of names tells what stands between values: semicolons or tabs where it has any, commas otherwise. Where values
are not parted by commas a comma in a number is a decimal one; a table with decimal commas and decimal points is
refused, since one of the two would be something else. Times may be dates in UTC; they become seconds since the first.
What was taken is told in `Table.remarks`.
"""

import csv
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from faintrack.errors import InputError
from faintrack.io import limits
from faintrack.io.checks import explained, number, require_file, utc

_SEPARATORS = {";": "semicolons", "\t": "tabs", ",": "commas"}
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+(?:[eE][+-]?\d+)?")
_DATE = re.compile(r"\d{4}-\d\d-\d\d")


@dataclass
class Table:
    """A table that is read row by row, and what was found out of its dialect on the way.

    Attributes
    ----------
    path : of the file.
    names : of the columns.
    separator : what stands between values.
    start : first time, where times are dates in UTC.
    """

    path: Path
    names: list[str]
    separator: str
    start: np.datetime64 | None = None
    _rows: Iterator[tuple[int, list[str]]] = field(default_factory=lambda: iter(()))
    _marks: set[str] = field(default_factory=set)
    _counted: bool = False

    def __iter__(self) -> Iterator[tuple[int, list[str]]]:
        """Line in the file, as an editor counts, and values of every row that has any."""
        for line, row in self._rows:
            if not any(map(str.strip, row)):
                continue
            if len(row) != len(self.names):
                raise InputError(
                    f"{self.path}, row {line}: {len(row)} values; expected {len(self.names)}, as the names."
                )
            yield line, row

    def number(self, text: str, what: str) -> float:
        """Number of a text, with a decimal comma or point.

        Raises
        ------
        InputError : it is no number, or the table has the other mark elsewhere.
        """
        value = text.strip()
        if self.separator != "," and _DECIMAL_COMMA.fullmatch(value):
            self._marks.add(",")
            value = value.replace(",", ".")
        elif "." in value:
            self._marks.add(".")
        if len(self._marks) > 1:
            raise InputError(
                f"{self.path}: {what} is {text.strip()[:80]!r}; expected decimal commas or points, not both."
            )
        return number(value, f"{self.path}, {what}")

    def seconds(self, text: str, what: str) -> float:
        """Seconds of a number, or of a date in UTC since the first one.

        Raises
        ------
        InputError : it is neither, or not what the first one was.
        """
        value = text.strip()
        is_date = _DATE.match(value) is not None
        if not is_date:
            if self.start is not None:
                raise InputError(f"{self.path}, {what} is {value[:80]!r}; expected a date, as in the rows before.")
            self._counted = True
            return self.number(text, what)
        if self._counted:
            raise InputError(f"{self.path}, {what} is {value[:80]!r}; expected seconds, as in the rows before.")
        moment = utc(value, f"{self.path}, {what}")
        if self.start is None:
            self.start = moment
        return float((moment - self.start) / np.timedelta64(1, "ns")) / 1e9

    @property
    def remarks(self) -> tuple[str, ...]:
        """What was taken, where it is not the plain way."""
        said = []
        if self.separator != ",":
            decimal = " and numbers have decimal commas" if "," in self._marks else ""
            said.append(f"Values are parted by {_SEPARATORS[self.separator]}{decimal}.")
        if self.start is not None:
            said.append(f"Times are taken as UTC; second 0 is {np.datetime_as_string(self.start, unit='ms')}.")
        return tuple(said)


@contextmanager
def opened(path: Path) -> Iterator[Table]:
    """Table of a file of text, while it is open.

    Parameters
    ----------
    path : of the file, in UTF-8.

    Raises
    ------
    InputError : the file is missing, empty or not text, or has too many columns; whatever is raised inside.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "a.csv"
    ...     _ = path.write_text("time_s;x_m\\n2024-02-29 12:00:00;1,5\\n2024-02-29 12:00:02;2\\n")
    ...     with opened(path) as table:
    ...         rows = [(table.seconds(time, "time_s"), table.number(x, "x_m")) for _, (time, x) in table]
    >>> rows, table.remarks[0]
    ([(0.0, 1.5), (2.0, 2.0)], 'Values are parted by semicolons and numbers have decimal commas.')
    """
    require_file(path)
    with explained(f"{path} cannot be read as CSV"), path.open(newline="", encoding="utf-8-sig") as file:
        first = file.readline(limits.MOST_FIELDS * 64)
        separator = next((mark for mark in _SEPARATORS if mark in first), ",")
        file.seek(0)
        reader = csv.reader(file, delimiter=separator)
        names = [name.strip() for name in next(reader, [])]
        if not names:
            raise InputError(f"{path}: the first row is empty; expected names of columns.")
        if len(names) > limits.MOST_FIELDS:
            raise InputError(f"{path} has {len(names)} columns; expected at most {limits.MOST_FIELDS}.")
        yield Table(path, names, separator, None, ((reader.line_num, row) for row in reader))
