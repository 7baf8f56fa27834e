"""What names of files tell: when a recording began, and which frame an image is."""

import re
from collections.abc import Sequence
from datetime import datetime

import numpy as np

from faintrack.errors import InputError
from faintrack.io import limits

_FIELDS = {
    "Y": r"\d{4}",
    "y": r"\d\d",
    "m": r"\d\d",
    "d": r"\d\d",
    "j": r"\d{3}",
    "H": r"\d\d",
    "M": r"\d\d",
    "S": r"\d\d",
    "f": r"\d{1,6}",
    "b": r"[A-Za-z]{3}",
}


def start_in_name(name: str, pattern: str) -> np.datetime64:
    """Time in UTC that stands in the name of a file.

    Parameters
    ----------
    name : of the file.
    pattern : of the time, as of `datetime.strptime`, with %Y %y %m %d %j %b %H %M %S %f; it may stand anywhere in the
        name.

    Raises
    ------
    InputError : the pattern is none, or the name holds no such time.

    Examples
    --------
    >>> str(start_in_name("node3_20240229T120000.500.wav", "%Y%m%dT%H%M%S.%f"))
    '2024-02-29T12:00:00.500000000'
    """
    form = expression(pattern)
    if "%" not in pattern:
        raise InputError(f"the pattern of start times is {pattern!r}; expected one such as '%Y%m%d_%H%M%S'.")
    # The last one: numbers of recorders stand before times.
    matches = re.findall(f"(?=((?<![0-9]){form}))", name) if len(name) < 1024 else []
    for text in reversed(matches):
        try:
            moment = datetime.strptime(text, pattern)
        except (ValueError, re.error):
            continue
        if limits.FIRST_YEAR <= moment.year <= limits.LAST_YEAR:
            return np.datetime64(moment, "ns")
    raise InputError(f"{name}: there is no time such as {pattern!r} in the name.")


def expression(pattern: str) -> str:
    """Regular expression of the texts that a pattern of times, as of `start_in_name`, may stand for.

    Raises
    ------
    InputError : the pattern has fields that are not known.

    Examples
    --------
    >>> expression("a%Y.")
    'a\\\\d{4}\\\\.'
    """
    form = re.sub(r"%(.)|([^%]+)", _as_expression, pattern)
    if "\0" in form:
        raise InputError(f"the pattern of start times is {pattern!r}; expected one such as '%Y%m%d_%H%M%S'.")
    return form


def _as_expression(part: re.Match[str]) -> str:
    return re.escape(part[2]) if part[2] else _FIELDS.get(part[1], "\0")


def numbers_in_names(names: Sequence[str]) -> list[int] | None:
    """Number of each name, where names differ in one number alone; None where they differ in others or in words.

    Examples
    --------
    >>> numbers_in_names(["f_0002.png", "f_0009.png", "f_0010.png"]), numbers_in_names(["a1.png", "b1.png"])
    ([2, 9, 10], None)
    """
    parts = [re.split(r"(\d+)", name) for name in names]
    if len({len(part) for part in parts}) != 1 or len({tuple(part[::2]) for part in parts}) != 1:
        return None
    columns = list(zip(*(part[1::2] for part in parts), strict=True))
    varying = [column for column in columns if len({int(text) for text in column}) > 1]
    if len(varying) != 1 or any(len(text) > 15 for text in varying[0]):
        return None
    return [int(text) for text in varying[0]]
