"""Frames to files: Zarr in xarray's way, or npz; written frame by frame beside the place and renamed."""

from pathlib import Path

import numpy as np

from faintrack.data.sequence import Sequence
from faintrack.errors import InputError
from faintrack.io.checks import explained
from faintrack.io.write_recordings import completed

FRAMES = 64
"""Frames held at once."""


def write_sequence(path: str | Path, sequence: Sequence) -> None:
    """Write frames with their times and axes, as `faintrack.io.read_sequence` reads them.

    Parameters
    ----------
    path : .zarr, which holds any number of frames, or .npz; replaced if it exists.
    sequence : frames; float32 in the file.

    Raises
    ------
    InputError : the kind of file is unknown, or the file cannot be written.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in (".zarr", ".npz"):
        raise InputError(f"{path}: unknown kind of file; expected .zarr or .npz.")
    complaint = f"{path} cannot be written"
    with completed(path, complaint) as partial, explained(complaint):
        coordinates = {name: axis.values for name, axis in sequence.axes} | {"time": sequence.times}
        if suffix == ".npz":
            frames = np.concatenate([block for _, block in sequence.blocks(FRAMES)]).astype(np.float32)
            with partial.open("wb") as file:
                np.savez(file, allow_pickle=False, frames=frames, **coordinates)
            return
        import zarr

        group = zarr.open_group(partial, mode="w", zarr_format=3)
        names = ("time", *(name for name, _ in sequence.axes))
        shape = (sequence.length, *sequence.shape)
        stored = group.create_array(
            "frames", shape=shape, chunks=(1, *shape[1:]), dtype=np.float32, dimension_names=names
        )
        for name, values in coordinates.items():
            group.create_array(name, data=np.asarray(values), dimension_names=(name,))
        for start in range(0, sequence.length, FRAMES):
            stop = min(start + FRAMES, sequence.length)
            stored[start:stop] = sequence.read(start, stop)
