"""Grey images of a folder as frames: PNG, BMP or JPEG, one file a frame.

Files are read when their frames are asked for; opening reads headers. Where the names differ in one number alone, the
numbers are the times: frames that were lost are gaps. Hidden files, and those that another system left beside the
images (`._frame_1.png`), are passed over. An image in colour is taken where its colours are equal.
"""

import re
from math import gcd
from pathlib import Path

import numpy as np

from faintrack.errors import InputError
from faintrack.io import limits
from faintrack.io.checks import explained, reader, require_file
from faintrack.io.names import numbers_in_names, start_in_name
from faintrack.io.tiff import one_of_equal
from faintrack.io.variables import Slices, Variable, in_memory

FRAMES = "frames"
"""Unit of times that count frames."""

_DIMS = ("time", "y", "x")
_KINDS = {".png": "PNG", ".bmp": "BMP", ".jpg": "JPEG", ".jpeg": "JPEG"}
_GREY = {"L": np.uint8, "I;16": np.uint16, "I;16B": np.uint16, "I": np.int32, "F": np.float32, "RGB": np.uint8}


@reader("a folder of images")
def open_folder(path: Path, start_pattern: str | None = None) -> dict[str, Variable]:
    """Images of a folder, as `frames` over (time, y, x), and `time` where the names tell.

    Parameters
    ----------
    path : of the folder.
    start_pattern : how names tell the time of a frame, see `faintrack.io.names.start_in_name`; numbers otherwise.

    Raises
    ------
    InputError : no image, one that is damaged or in colour, files of several kinds, sizes or types, or numbers twice.
    """
    files, remarks = _files(path)
    kinds = [_kind(file) for file in files]
    (height, width), dtype = kinds[0]
    for file, kind in zip(files, kinds, strict=True):
        if kind != kinds[0]:
            size, other = kind
            raise InputError(
                f"{file} is {size} {other} and {files[0].name} {height, width} {dtype}; expected one kind."
            )
    units, times, said = _times(path, files, start_pattern)
    if times is not None:
        order = np.argsort(times, kind="stable")
        files, times = [files[number] for number in order], times[order]

    def read(part: Slices) -> np.ndarray:
        frames = [_values(file) for file in files[part[0]]]
        return np.array(frames, dtype).reshape(-1, height, width)[:, *part[1:]]

    frames = Variable((len(files), height, width), dtype, read, _DIMS, remarks=(*remarks, *said))
    if times is None:
        return {"frames": frames}
    return {"frames": frames, "time": Variable(times.shape, times.dtype, in_memory(times).read, None, {"units": units})}


def _files(path: Path) -> tuple[list[Path], list[str]]:
    """Images in natural order, and what was passed over."""
    every = []
    for file in path.iterdir():
        if file.suffix.lower() in _KINDS:
            every.append(file)
        if len(every) > limits.MOST_FILES:
            raise InputError(f"{path} holds more than {limits.MOST_FILES} images.")
    files = sorted((f for f in every if not f.name.startswith(".")), key=lambda file: (_natural(file.name), file.name))
    if not files:
        raise InputError(f"{path} holds no PNG file; expected one for each frame.")
    kinds = sorted({_KINDS[file.suffix.lower()] for file in files})
    if len(kinds) > 1:
        raise InputError(f"{path} holds {' and '.join(kinds)} files; expected one kind, the frames.")
    hidden = len(every) - len(files)
    return files, [f"{hidden} hidden files are left out."] if hidden else []


def _times(path: Path, files: list[Path], pattern: str | None) -> tuple[str, np.ndarray | None, list[str]]:
    """Unit and times of files as their names tell, and what was taken."""
    if pattern is not None:
        moments = np.array([start_in_name(file.name, pattern) for file in files])
        first = moments.min()
        return f"s since {first}", (moments - first) / np.timedelta64(1, "s"), []
    if len(files) < 2:
        return FRAMES, None, []
    numbers = numbers_in_names([file.stem for file in files])
    if numbers is None:
        return FRAMES, None, ["The names differ in more than one number; frames are counted in their order."]
    values = np.array(numbers, np.int64)
    counts = {number: numbers.count(number) for number in numbers} if len(set(numbers)) < len(numbers) else {}
    for number, count in counts.items():
        if count > 1:
            raise InputError(f"{path} holds {count} files with the number {number}; expected each once.")
    steps = np.diff(np.sort(values))
    step = gcd(*steps.tolist())
    said = []
    if step > 1:
        said.append(f"Numbers go up by {step}; that is taken as one frame.")
    lost = int((steps // step - 1).sum())
    if lost:
        said.append(f"{lost} of {lost + len(files)} numbers are missing; frames keep the times of their numbers.")
    return FRAMES, (values - values.min()) / step, said


def _natural(name: str) -> list[tuple[int, str]]:
    """Key that sorts runs of digits by their number."""
    return [(int(run[:300]), "") if run.isdecimal() else (0, run) for run in re.split(r"(\d+)", name) if run]


def _kind(file: Path) -> tuple[tuple[int, int], np.dtype]:
    """Height and width, and type of the values, from the header."""
    from PIL import Image

    require_file(file)
    kind = _KINDS[file.suffix.lower()]
    with explained(f"{file} cannot be read as {kind}"), Image.open(file, formats=[kind]) as image:
        if image.mode not in _GREY:
            raise InputError(f"{file} holds {image.mode}; expected a grey image.")
        if image.height * image.width > limits.MOST_CELLS:
            raise InputError(f"{file} is {image.height} by {image.width}; expected at most {limits.MOST_CELLS} pixels.")
        return (image.height, image.width), np.dtype(_GREY[image.mode])


def _values(file: Path) -> np.ndarray:
    from PIL import Image

    kind = _KINDS[file.suffix.lower()]
    with explained(f"{file} cannot be read as {kind}"), Image.open(file, formats=[kind]) as image:
        if image.height * image.width > limits.MOST_CELLS:
            raise InputError(f"{file} is {image.height} by {image.width}.")
        values = np.asarray(image)
    return one_of_equal(file, values, 2) if values.ndim == 3 else values
