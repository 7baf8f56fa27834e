r"""Grey pages of a TIFF file as frames, with the axes and the interval that the file tells.

What an axis is comes from the file's own words (tifffile's `axes`, ImageJ, OME): T is time, Z `depth`, C `channel`. An
axis of unknown meaning is time where it is the only one before y and x. Depths and channels are never taken for times:
`read_sequence` asks which of them is meant, or whether they are times after all. Pages that were written one by one are
one sequence as long as they share size and type. The interval is ImageJ's `finterval` or OME's `TimeIncrement`.

Before a library opens the file its directories are walked: they have to lie in the file, come to an end, and hold no
more tags than a page needs.
"""

import logging
import math
import re
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from faintrack.errors import InputError
from faintrack.io import limits
from faintrack.io.checks import reader, require_file
from faintrack.io.variables import Slices, Variable, in_memory, mapped

_DIMS = ("time", "y", "x")
_AXES = {"T": "time", "Z": "depth", "C": "channel", "Y": "y", "X": "x"}
_UNKNOWN = "QIR"
_WIDTHS = np.array([1, 1, 1, 2, 4, 8, 1, 1, 2, 4, 8, 4, 8, 4, 2, 4, 8, 8, 8])
_SECONDS = {
    "s": 1.0,
    "sec": 1.0,
    "ms": 1e-3,
    "msec": 1e-3,
    "us": 1e-6,
    "µs": 1e-6,
    "ns": 1e-9,
    "min": 60.0,
    "h": 3600.0,
}


@reader("TIFF")
def open_tiff(path: Path) -> dict[str, Variable]:
    """Pages of a TIFF file, as `frames` over (time, y, x) or the axes that the file tells, and `time` where it tells.

    Raises
    ------
    InputError : no such file, damaged, pages in colour, of several sizes or types, or compressed in a way that
        needs the package imagecodecs.
    """
    import tifffile

    require_file(path)
    _require_directories(path)
    # Other files that OME names are left alone.
    with _damage_raised(path), tifffile.TiffFile(path, _multifile=False) as file:
        series = file.series
        first = file.pages.first
        photometric = tifffile.PHOTOMETRIC(first.photometric)
        coloured = photometric == tifffile.PHOTOMETRIC.RGB and first.samplesperpixel == 3
        if not coloured and (first.samplesperpixel != 1 or photometric != tifffile.PHOTOMETRIC.MINISBLACK):
            raise InputError(f"{path} holds {photometric.name} pages; expected grey images in which black is 0.")
        axes = series[0].axes.replace("S", "") if coloured else series[0].axes
        counts = [
            count
            for letter, count in zip(series[0].axes, series[0].shape, strict=True)
            if letter != "S" or not coloured
        ]
        height, width = (counts[axes.index(letter)] if letter in axes else 1 for letter in "YX")
        _require_size(path, height, width, np.dtype(series[0].dtype), file, first)
        interval = _interval(file)
        if len(series) > 1:
            return _page_by_page(path, file, (height, width), coloured, interval)
        outer = [(letter, count) for letter, count in zip(axes, counts, strict=True) if letter not in "YX"]
        dims, shape = _named(path, outer, (height, width), series[0].shape)
        dtype = np.dtype(series[0].dtype).newbyteorder(file.byteorder)
        if coloured or series[0].dataoffset is None or axes[-2:] != "YX":
            return _packed(path, shape, dims, dtype, coloured, interval)
        found = mapped(path, f"{path} cannot be read as TIFF", dtype, shape, series[0].dataoffset, dims=dims)
        return _timed(found, interval)


def _named(
    path: Path, outer: list[tuple[str, int]], size: tuple[int, int], told: tuple[int, ...]
) -> tuple[tuple[str, ...], tuple[int, ...]]:
    """Names and lengths of the axes; those of one place are left out, but for time."""
    kept = [(letter, count) for letter, count in outer if count > 1]
    unknown = [letter for letter, _ in kept if letter in _UNKNOWN]
    known = [_AXES.get(letter, "") for letter, _ in kept if letter not in _UNKNOWN]
    if len(unknown) > 1 or (unknown and "time" in known) or not all(known):
        raise InputError(f"{path} has shape {told}; expected one axis, time, before y and x.")
    names = [_AXES.get(letter, "time") for letter, _ in kept]
    counts = [count for _, count in kept]
    if not names:
        names, counts = ["time"], [1]
    return (*names, "y", "x"), (*counts, *size)


def _timed(frames: Variable, interval: float | None) -> dict[str, Variable]:
    """Frames with their times, where an interval is told."""
    if interval is None or frames.dims is None or "time" not in frames.dims:
        return {"frames": frames}
    times = interval * np.arange(frames.shape[frames.dims.index("time")])
    return {"frames": frames, "time": in_memory(times)}


def _packed(
    path: Path, shape: tuple[int, ...], dims: tuple[str, ...], dtype: np.dtype, coloured: bool, interval: float | None
) -> dict[str, Variable]:
    """Frames that are unpacked page by page."""
    import tifffile

    *outer, height, width = shape
    size = height, width

    def read(part: Slices) -> np.ndarray:
        wanted = np.arange(math.prod(outer)).reshape(outer)[part[:-2]]
        with _damage_raised(path), tifffile.TiffFile(path, _multifile=False) as file:
            pages = file.pages
            frames = [_grey(path, pages[int(number)], size, coloured) for number in wanted.ravel()]
        return np.array(frames, dtype).reshape(*wanted.shape, *size)[..., part[-2], part[-1]]

    # A compression that cannot be undone here is refused now, not in the middle of a run.
    read((*(slice(1),) * len(outer), slice(None), slice(None)))
    return _timed(Variable(shape, dtype, read, dims), interval)


def _page_by_page(
    path: Path, file: Any, size: tuple[int, int], coloured: bool, interval: float | None
) -> dict[str, Variable]:
    """Frames of pages that do not belong together but for their size and type."""
    import tifffile

    numbers, left = [], 0
    kinds: list[tuple[tuple[int, ...], np.dtype]] = []
    for number, page in enumerate(file.pages):
        page = page.aspage() if hasattr(page, "aspage") else page
        if page.is_reduced:
            left += 1
            continue
        kind = tuple(page.shape), np.dtype(page.dtype)
        if kind not in kinds:
            kinds.append(kind)
        if len(kinds) > 1:
            shown = " and ".join(f"{shape} {dtype}" for shape, dtype in kinds)
            raise InputError(f"{path} holds pages of {shown}; expected one size and type.")
        numbers.append(number)
    dtype = kinds[0][1]

    def read(part: Slices) -> np.ndarray:
        with _damage_raised(path), tifffile.TiffFile(path, _multifile=False) as opened:
            frames = [_grey(path, opened.pages[number], size, coloured) for number in numbers[part[0]]]
        return np.array(frames, dtype).reshape(-1, *size)[:, *part[1:]]

    read((slice(1), slice(None), slice(None)))
    remarks = (f"{left} pages of reduced size are left out.",) if left else ()
    return _timed(Variable((len(numbers), *size), dtype, read, _DIMS, remarks=remarks), interval)


def _grey(path: Path, page: Any, size: tuple[int, int], coloured: bool) -> np.ndarray:
    page = page.aspage() if hasattr(page, "aspage") else page
    values = page.asarray()
    return one_of_equal(path, values, page.axes.index("S")) if coloured else values.reshape(size)


def one_of_equal(path: Path, values: np.ndarray, axis: int) -> np.ndarray:
    """Grey image of one that is kept in three equal colours.

    Raises
    ------
    InputError : the colours differ.

    Examples
    --------
    >>> one_of_equal(Path("a.png"), np.array([[[7, 7, 7], [9, 9, 9]]]), 2).tolist()
    [[7, 9]]
    """
    colours = np.moveaxis(values, axis, 0)
    if not (colours == colours[:1]).all():
        raise InputError(f"{path} holds RGB pages; expected grey images in which black is 0.")
    return colours[0]


def _interval(file: Any) -> float | None:
    """Seconds between frames, where ImageJ or OME tell."""
    told = file.imagej_metadata if file.is_imagej else None
    interval: Any = None
    unit = "s"
    if told:
        interval, unit = told.get("finterval"), str(told.get("tunit", "s"))
        if not interval and told.get("fps"):
            interval = 1 / float(told["fps"])
    elif file.is_ome:
        text = str(file.ome_metadata)[: limits.LARGEST_TEXT]
        match = re.search(r'\bTimeIncrement="([0-9.eE+-]{1,40})"', text)
        interval = match and match[1]
        named = re.search(r'\bTimeIncrementUnit="([^"]{1,10})"', text)
        unit = named[1] if named else "s"
    if interval is None or unit not in _SECONDS:
        return None
    seconds = float(interval) * _SECONDS[unit]
    return seconds if 0 < seconds < np.inf else None


def _require_size(path: Path, height: int, width: int, dtype: np.dtype, file: Any, page: Any) -> None:
    """Refuse an image that is larger than any, or larger than its bytes could become."""
    if height * width > limits.MOST_CELLS:
        raise InputError(f"{path} has pages of {height} by {width}; expected at most {limits.MOST_CELLS} pixels.")
    held = min(sum(page.databytecounts), path.stat().st_size)
    if page.size * dtype.itemsize > limits.MOST_UNPACKED_CHUNK * max(held, 1):
        raise InputError(f"{path} has pages of {height} by {width}, of which {held} bytes can be none.")


def _require_directories(path: Path) -> None:
    """Refuse a file whose directories leave it, go round, or have no end."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(16)
        order = {b"II": "<", b"MM": ">"}.get(head[:2])
        if order is None or len(head) < 8:
            raise InputError(f"{path} is no TIFF file.")
        (version,) = struct.unpack(f"{order}H", head[2:4])
        if version not in (42, 43):
            raise InputError(f"{path} is no TIFF file.")
        big = version == 43
        if big and len(head) < 16:
            raise InputError(f"{path} is cut short.")
        count_form, entry, next_form = ("Q", 20, "Q") if big else ("H", 12, "I")
        kind = np.dtype([("tag", f"{order}u2"), ("type", f"{order}u2"), ("count", f"{order}u{8 if big else 4}")])
        place = struct.unpack_from(f"{order}{next_form}", head, 8 if big else 4)[0]
        seen: set[int] = set()
        while place:
            if place in seen or place >= size or len(seen) >= limits.MOST_FILES:
                raise InputError(f"{path} is damaged: its pages go round, lie outside, or have no end.")
            seen.add(place)
            file.seek(place)
            width = struct.calcsize(f"{order}{count_form}")
            told = file.read(width)
            number = struct.unpack(f"{order}{count_form}", told)[0] if len(told) == width else 0
            if not 0 < number <= limits.MOST_TAGS:
                raise InputError(f"{path} is damaged: a page has {number} tags; expected 1 to {limits.MOST_TAGS}.")
            content = file.read(number * entry)
            following = file.read(struct.calcsize(next_form))
            if len(content) < number * entry or len(following) < struct.calcsize(f"{order}{next_form}"):
                raise InputError(f"{path} is damaged or cut short.")
            rows = np.frombuffer(content, np.uint8).reshape(number, entry)[:, : kind.itemsize]
            tags = np.ascontiguousarray(rows).view(kind)[:, 0]
            types = np.minimum(tags["type"], len(_WIDTHS) - 1)
            if (tags["count"].astype(float) * _WIDTHS[types] > size).any():
                raise InputError(f"{path} is damaged: a tag is longer than the file.")
            (place,) = struct.unpack(f"{order}{next_form}", following)


@contextmanager
def _damage_raised(path: Path) -> Iterator[None]:
    """Raise what tifffile only logs: a file that is cut short would otherwise pass as a shorter one."""

    class Raising(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            raise InputError(f"{path} is damaged or cut short.")

    handler = Raising(logging.ERROR)
    logger = logging.getLogger("tifffile")
    logger.addHandler(handler)
    try:
        yield
    finally:
        logger.removeHandler(handler)
