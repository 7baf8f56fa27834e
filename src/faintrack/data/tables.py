"""Tables of what was measured at a time: named columns of numbers, rows of one time together, refused by row and name.

`faintrack.data.returns` and `faintrack.data.bearings` are made from such tables.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from faintrack.errors import InputError


@dataclass(frozen=True)
class Table:
    """Columns of one length, `time_s` among them.

    Attributes
    ----------
    values : of every column.
    rows : number of every row, for messages.
    origin : where the columns come from, for messages.
    """

    values: dict[str, Float[np.ndarray, " row"]]
    rows: Int[np.ndarray, " row"]
    origin: str

    @property
    def first(self) -> Bool[np.ndarray, " row"]:
        """Whether a row is the first of its time."""
        return np.append(True, np.diff(self.values["time_s"]) > 0)

    def refuse(self, wrong: Bool[np.ndarray, " row"], name: str, expected: str) -> None:
        """Name the first row in which a column is wrong.

        Raises
        ------
        InputError : there is one.
        """
        if wrong.any():
            row = int(np.argmax(wrong))
            value = self.values[name][row]
            told = "missing" if np.isnan(value) else f"{value:.10g}"
            raise InputError(f"{self.origin}, row {self.rows[row]}: {name} is {told}; expected {expected}.")


def table(columns: Mapping[str, Any], rows: np.ndarray | None, origin: str, event: str, each: str) -> Table:
    """Table of columns whose names have been looked at.

    Parameters
    ----------
    columns : by name.
    rows : number of every row, for messages; from 0 where None.
    origin : where the columns come from, for messages.
    event, each : what rows of one time are together, and what a row is, for messages.

    Raises
    ------
    InputError : columns differ in length, there is no row, or times are not finite or do not ascend.
    """
    values = {}
    for name, column in columns.items():
        try:
            values[name] = np.asarray(column, float)
        except (TypeError, ValueError):
            raise InputError(f"{origin}: {name} holds something else than numbers; expected numbers.") from None
    time = values["time_s"]
    for name, column in values.items():
        if column.shape != (time.size,):
            raise InputError(
                f"{origin}: {name} has shape {column.shape}; expected ({time.size},), a row each as time_s."
            )
    if not time.size:
        raise InputError(f"{origin}: there is no {event}; expected a row for every {each}.")
    made = Table(values, np.arange(len(time)) if rows is None else np.asarray(rows), origin)
    made.refuse(~np.isfinite(time), "time_s", "seconds")
    made.refuse(np.append(False, np.diff(time) < 0), "time_s", f"ascending times, the rows of a {event} together")
    return made


def require_columns(names: Sequence[str], needed: Sequence[str], known: Sequence[str], origin: str) -> None:
    """Refuse names of columns that are unknown or come twice, and sets of them that lack one.

    Raises
    ------
    InputError : as said.

    Examples
    --------
    >>> require_columns(["time_s", "snr_db"], ["time_s", "delay_s"], ["time_s", "delay_s", "snr_db"], "returns.csv")
    Traceback (most recent call last):
        ...
    faintrack.errors.InputError: returns.csv: there is no column delay_s; expected time_s, delay_s.
    """
    for name in names:
        if name not in known:
            raise InputError(f"{origin}: there is a column {name!r}; expected none but {', '.join(known)}.")
        if names.count(name) > 1:
            raise InputError(f"{origin}: there are two columns {name}; expected one.")
    for name in needed:
        if name not in names:
            raise InputError(f"{origin}: there is no column {name}; expected {', '.join(needed)}.")
