"""Grey images as frames: the pages of a TIFF file, the PNG files of a folder.

Pages and files are read when their frames are asked for; opening reads headers, and one page where they are compressed.
"""

import logging
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from faintrack.errors import InputError
from faintrack.io.checks import explained, require_file
from faintrack.io.variables import Slices, Variable, mapped

_DIMS = ("time", "y", "x")
_GREY = {"L": np.uint8, "I;16": np.uint16, "I;16B": np.uint16, "I": np.int32, "F": np.float32}


def open_tiff(path: Path) -> dict[str, Variable]:
    """Pages of a TIFF file, as `frames` over (time, y, x).

    Raises
    ------
    InputError : no such file, damaged, pages in colour, of several sizes or types, or compressed in a way that
        needs the package imagecodecs.
    """
    import tifffile

    require_file(path)
    complaint = f"{path} cannot be read as TIFF"
    with explained(complaint), _damage_raised(path), tifffile.TiffFile(path) as file:
        photometric = tifffile.PHOTOMETRIC(file.pages.first.photometric)
        if file.pages.first.samplesperpixel != 1 or photometric != tifffile.PHOTOMETRIC.MINISBLACK:
            raise InputError(f"{path} holds {photometric.name} pages; expected grey images in which black is 0.")
        series = file.series[0]
        if len(file.series) > 1:
            kinds = " and ".join(f"{part.shape[-2:]} {part.dtype}" for part in file.series[:2])
            raise InputError(f"{path} holds pages of {kinds}; expected one size and type.")
        height, width = file.pages.first.shape
        shape = (series.size // (height * width), height, width)
        # An axis with one place may be left out of the series' own shape, also where it is that of y or x.
        if sorted(count for count in series.shape if count > 1) != sorted(count for count in shape if count > 1):
            raise InputError(f"{path} has shape {series.shape}; expected one axis, time, before y and x.")
        dtype = np.dtype(series.dtype).newbyteorder(file.byteorder)
        if series.dataoffset is not None:
            return {"frames": mapped(path, complaint, dtype, shape, series.dataoffset, dims=_DIMS)}

    def read(part: Slices) -> np.ndarray:
        start, stop, _ = part[0].indices(shape[0])
        if stop <= start:
            return np.empty((0, *shape[1:]), dtype)[:, *part[1:]]
        with explained(complaint), _damage_raised(path), tifffile.TiffFile(path) as file:
            return file.asarray(key=range(start, stop)).reshape(-1, *shape[1:])[:, *part[1:]]

    # A compression that cannot be undone here is refused now, not in the middle of a run.
    read((slice(1), slice(None), slice(None)))
    return {"frames": Variable(shape, dtype, read, _DIMS)}


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


def open_folder(path: Path) -> dict[str, Variable]:
    """PNG files of a folder, as `frames` over (time, y, x), in natural order: 9.png before 10.png.

    Raises
    ------
    InputError : no PNG file, one that is damaged or in colour, or files of several sizes or types.
    """
    files = sorted(
        (file for file in path.iterdir() if file.suffix.lower() == ".png"),
        key=lambda file: (_natural(file.name), file.name),
    )
    if not files:
        raise InputError(f"{path} holds no PNG file; expected one for each frame.")
    kinds = [_png_kind(file) for file in files]
    (height, width), dtype = kinds[0]
    for file, kind in zip(files, kinds, strict=True):
        if kind != kinds[0]:
            size, other = kind
            raise InputError(
                f"{file} is {size} {other} and {files[0].name} {height, width} {dtype}; expected one kind."
            )

    def read(part: Slices) -> np.ndarray:
        frames = [_png_values(file) for file in files[part[0]]]
        return np.array(frames, dtype).reshape(-1, height, width)[:, *part[1:]]

    return {"frames": Variable((len(files), height, width), dtype, read, _DIMS)}


def _natural(name: str) -> list[tuple[int, str]]:
    """Key that sorts runs of digits by their number."""
    return [(int(run), "") if run.isdecimal() else (0, run) for run in re.split(r"(\d+)", name) if run]


def _png_kind(file: Path) -> tuple[tuple[int, int], np.dtype]:
    """Height and width, and type of the values, from the header."""
    from PIL import Image

    require_file(file)
    with explained(f"{file} cannot be read as PNG"), Image.open(file, formats=["PNG"]) as image:
        if image.mode not in _GREY:
            raise InputError(f"{file} holds {image.mode}; expected a grey image.")
        return (image.height, image.width), np.dtype(_GREY[image.mode])


def _png_values(file: Path) -> np.ndarray:
    from PIL import Image

    with explained(f"{file} cannot be read as PNG"), Image.open(file, formats=["PNG"]) as image:
        return np.asarray(image)
