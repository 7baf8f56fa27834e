"""Frames: images, range profiles and range-Doppler matrices, tracked in the plane or in range.

A background model turns frames into scans (`faintrack.signal.scans`), a likelihood of cells reads them, and a Bernoulli
filter on the cells of the sensor, or with particles, follows one target at a time.
"""

from pathlib import Path

import numpy as np

from faintrack.data.sequence import Sequence
from faintrack.kinds.frames.sections import FramesScenario
from faintrack.kinds.kind import Kind
from faintrack.kinds.rooms import room


def _holds(paths: tuple[Path, ...]) -> bool:
    if len(paths) != 1:
        return False
    from faintrack.io.sequences import holds_frames

    return holds_frames(paths[0]) and not _has_bearings(paths[0])


def _has_bearings(path: Path) -> bool:
    """Whether an axis is a direction, which no target in frames has a component for."""
    from faintrack.errors import InputError
    from faintrack.io.variables import open_npz

    try:
        return path.suffix.lower() == ".npz" and "bearing" in open_npz(path)
    except InputError:
        return False


def _read(paths: tuple[Path, ...], scenario: FramesScenario | None) -> Sequence:
    from faintrack.errors import InputError
    from faintrack.io.sequences import read_sequence

    if len(paths) > 1:
        raise InputError(f"{len(paths)} files of frames were given; expected one file, or one folder of images.")
    section = FramesScenario().frames if scenario is None else scenario.frames
    return read_sequence(
        paths[0],
        section.variable,
        section.dims,
        section.frame_interval,
        # Pixels that are no numbers are missing.
        gaps=True,
        coordinates=section.coordinates,
        select=section.select,
        start_pattern=section.start_pattern,
    )


def _write(path: Path, sequence: Sequence) -> None:
    from faintrack.io.write_sequences import write_sequence

    write_sequence(path, sequence)


def _describe(sequence: Sequence) -> dict[str, str]:
    first = np.asarray(sequence.read(0, 1), float)
    times = sequence.times
    apart = f", {np.median(np.diff(times)):g} s apart" if len(times) > 1 else ""
    start = sequence.start_time
    return {
        "holds": f"{sequence.length} frames{apart}",
        "axes": "; ".join(
            f"{name}: {axis.count} cells from {axis.first:g} to {axis.last:g}" for name, axis in sequence.axes
        ),
        "span": f"{times[-1] - times[0]:g} s",
        "start": "not known" if start is None else f"{start}Z",
        "levels": f"{np.nanmin(first):.4g} to {np.nanmax(first):.4g} in the first frame",
    }


KIND = Kind(
    name="frames",
    title="Frames",
    scenario=FramesScenario,
    data=Sequence,
    holds=_holds,
    read=_read,
    write=_write,
    plan=room("faintrack.kinds.frames.plan", "plan"),
    simulate=room("faintrack.kinds.frames.simulate", "simulate"),
    targets=room("faintrack.kinds.frames.simulate", "targets"),
    silence=room("faintrack.kinds.frames.simulate", "silence"),
    describe=_describe,
    about=room("faintrack.kinds.frames.report", "about"),
    draw=room("faintrack.kinds.frames.pictures", "draw"),
    shown="Frames, existence, position",
    surrogate=lambda data, scenario, seed: room("faintrack.kinds.surrogates", "reordered")(data, seed),
    stretch=room("faintrack.kinds.stretches", "of_sequence"),
    gained=room("faintrack.kinds.promise", "gained_by_target"),
)
