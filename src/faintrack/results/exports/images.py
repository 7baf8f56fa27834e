"""Tracks beside images: the array of a tracks layer of napari, and the text of MOTChallenge. Both count pixels."""

from pathlib import Path

import numpy as np

from faintrack.errors import InputError
from faintrack.results.result import Result
from faintrack.results.track import Track

SIGMAS = 2.0
"""Half side of a box of MOTChallenge over the standard deviation of the place."""


def write_napari(path: Path, result: Result) -> None:
    """Write an array with a row (label, number of the frame from 0, y, x) each, as `viewer.add_tracks` takes it.

    Raises
    ------
    InputError : places of the result are no pixels.
    """
    _require_pixels(result, "napari")
    rows = [
        np.stack([np.full(len(track.time), track.label), _frames(result, track), track.mean["y"], track.mean["x"]], 1)
        for track in result.tracks
    ]
    np.save(path, np.concatenate(rows).astype(float) if rows else np.zeros((0, 4)))


def write_mot(path: Path, result: Result) -> None:
    """Write a line (frame, label, left, top, width, height, existence, -1, -1, -1) each.

    Frames and pixels are counted from 1, as MOTChallenge does. A target of a few pixels has no box of its own: it is as
    wide as two standard deviations of the place to either side and a pixel.

    Raises
    ------
    InputError : places of the result are no pixels.
    """
    _require_pixels(result, "MOTChallenge")
    rows = []
    for track in result.tracks:
        std = track.std
        for scan, frame in enumerate(_frames(result, track)):
            width, height = (1 + 2 * SIGMAS * float(std[name][scan]) for name in ("x", "y"))
            left, top = float(track.mean["x"][scan]) + 1 - width / 2, float(track.mean["y"][scan]) + 1 - height / 2
            box = ",".join(f"{value:.3f}" for value in (left, top, width, height))
            rows.append(
                (int(frame), track.label, f"{frame + 1},{track.label},{box},{track.existence[scan]:.4f},-1,-1,-1")
            )
    path.write_text("".join(f"{line}\n" for _, _, line in sorted(rows)), encoding="utf-8")


def _frames(result: Result, track: Track) -> np.ndarray:
    """Numbers of the frames of a track, from 0."""
    return np.searchsorted(result.data.time.values, track.time)


def _require_pixels(result: Result, title: str) -> None:
    place = {
        str(name): str(unit)
        for name, unit, is_place in zip(
            *(result.data[part].values for part in ("component", "unit", "place")), strict=True
        )
        if is_place
    }
    if place != {"x": "pixel", "y": "pixel"}:
        said = ", ".join(f"{name} in {unit}" for name, unit in place.items())
        raise InputError(f"the result of {result.data.attrs['source']} tells {said}; {title} needs x and y in pixels.")
