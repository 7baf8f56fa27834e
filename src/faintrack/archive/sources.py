"""Which files an archive consists of: folders, patterns of names, lists, and addresses of object stores.

Stations and times stand in names: the pattern ``{station}/%Y%m%d_%H%M%S`` says where. A list is a CSV file with a
column `path` and, where it knows them, `station` and `start`. Addresses such as ``s3://bucket/night`` are those of
fsspec.
"""

import csv
import glob
import os
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np

from faintrack.archive.remote import is_address, listed_at
from faintrack.errors import InputError
from faintrack.io import limits
from faintrack.io.names import expression
from faintrack.io.recordings import READERS

STATION = "{station}"
"""Place of a station's name in a pattern."""

ALONE = "station"
"""Name of the station where nothing tells one."""


@dataclass(frozen=True)
class Source:
    """Files that begin together and belong to one station, their channels side by side.

    Attributes
    ----------
    paths : of the files, or addresses.
    station : its name.
    start : of the first sample in UTC, where names or a list tell it.
    """

    paths: tuple[str, ...]
    station: str
    start: np.datetime64 | None


def sources_of(given: Iterable[str | Path], pattern: str | None = None) -> tuple[list[Source], list[tuple[str, str]]]:
    """Files of an archive, and those of which the name tells no station or time, with the reason.

    Parameters
    ----------
    given : folders, which are searched through, files, patterns such as `night/*.wav`, lists, addresses.
    pattern : how paths tell station and start: fields of `faintrack.io.names.start_in_name` and `{station}`.

    Raises
    ------
    InputError : there is no such file, the list cannot be read, or the pattern is none.
    """
    expression_of(pattern or STATION)
    sources, left_out = dict[tuple[str, str], Source](), []
    for path, station, start in _listed(given):
        try:
            named_station, named_start = (None, None) if pattern is None else told_by(path, pattern)
        except InputError as error:
            left_out.append((path, str(error)))
            continue
        station, start = station or named_station or ALONE, named_start if start is None else start
        # Files of one station that begin together hold channels of one recording.
        key = station, path if start is None else str(start)
        paths = sources[key].paths if key in sources else ()
        sources[key] = Source(tuple(sorted({*paths, path})), station, start)
    if not sources and not left_out:
        raise InputError(f"there is no recording in {', '.join(map(str, given))}.")
    return sorted(sources.values(), key=lambda source: (source.station, source.paths)), left_out


def expression_of(pattern: str) -> str:
    """Regular expression of a pattern of paths.

    Raises
    ------
    InputError : it has fields that are not known, or names the station twice.
    """
    before, mark, after = pattern.partition(STATION)
    if STATION in after:
        raise InputError(f"the pattern {pattern!r} has two stations; expected one {STATION}.")
    if not mark and "%" not in pattern:
        raise InputError(f"the pattern {pattern!r} tells neither station nor start; expected {STATION}/%Y%m%d_%H%M%S.")
    first = "" if mark and not before else "(?<![0-9])"
    return first + expression(before) + ("(?P<station>[^/]+)" if mark else "") + expression(after)


def told_by(path: str, pattern: str) -> tuple[str | None, np.datetime64 | None]:
    """Station and start that a path tells, as far as the pattern has them.

    Raises
    ------
    InputError : the path does not fit the pattern.

    Examples
    --------
    >>> told_by("data/north/rec_20240229T120000.wav", "{station}/rec_%Y%m%dT%H%M%S")
    ('north', np.datetime64('2024-02-29T12:00:00.000000000'))
    """
    text = path.replace(os.sep, "/")
    for match in reversed(list(re.finditer(expression_of(pattern), text))):
        station = match.groupdict().get("station")
        form = pattern if station is None else pattern.replace(STATION, station.replace("%", "%%"))
        if "%" not in pattern:
            return station, None
        try:
            moment = datetime.strptime(match[0], form)
        except (ValueError, re.error):
            continue
        if limits.FIRST_YEAR <= moment.year <= limits.LAST_YEAR:
            return station, np.datetime64(moment, "ns")
    raise InputError(f"the name does not fit the pattern {pattern!r}")


def _listed(given: Iterable[str | Path]) -> Iterator[tuple[str, str | None, np.datetime64 | None]]:
    for one in map(placed, given):
        if is_address(one):
            yield from ((path, None, None) for path in listed_at(one) if _readable(path))
        elif one.lower().endswith(".csv"):
            yield from _manifest(Path(one))
        elif Path(one).is_dir() and not _readable(one):
            yield from ((path, None, None) for path in _within(one))
        else:
            found = sorted(glob.glob(one, recursive=True)) if glob.has_magic(one) else [one]
            for path in found:
                if not os.path.exists(path):
                    raise InputError(f"{path} does not exist.")
                yield path, None, None


def placed(path: str | Path) -> str:
    """An address as it is, a path from the root: workers stand elsewhere."""
    return str(path) if is_address(str(path)) else os.path.abspath(path)


def _within(folder: str) -> Iterator[str]:
    """Recordings in a folder and those in it; a Zarr folder is one recording."""
    for root, folders, files in os.walk(folder):
        held = [name for name in folders if _readable(name)]
        folders[:] = sorted(name for name in folders if name not in held and not name.startswith("."))
        for name in sorted([*files, *held]):
            if _readable(name) and not name.startswith("."):
                yield os.path.join(root, name)


def _readable(name: str) -> bool:
    return os.path.splitext(name)[1].lower() in READERS


def _manifest(file: Path) -> Iterator[tuple[str, str | None, np.datetime64 | None]]:
    try:
        with file.open(newline="", encoding="utf-8") as opened:
            rows = list(csv.DictReader(opened))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{file} cannot be read ({error}).") from error
    if not rows or "path" not in rows[0]:
        raise InputError(f"{file} has no column path; expected path and, where they are known, station and start.")
    for number, row in enumerate(rows, 2):
        start, path = row.get("start"), row["path"]
        try:
            moment = np.datetime64(start.removesuffix("Z"), "ns") if start else None
        except ValueError:
            raise InputError(f"{file}, line {number}: start is {start!r}; expected a time in UTC.") from None
        yield path if is_address(path) else placed(file.parent / path), row.get("station") or None, moment
