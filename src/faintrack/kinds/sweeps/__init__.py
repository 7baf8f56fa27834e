"""Sweeps of a scanning radar: azimuth and range, spoke 0 beside the last, around an antenna that may move.

Every part of the picture that holds an echo has a belief in what stands and what moves there
(`faintrack.kinds.sweeps.windows`); what moves is declared and followed (`faintrack.kinds.sweeps.tracker`), east and
north, in metres.
"""

from pathlib import Path

import numpy as np

from faintrack.kinds.kind import Kind
from faintrack.kinds.rooms import room
from faintrack.kinds.sweeps.data import Sweeps, from_sweeps
from faintrack.kinds.sweeps.sections import SweepsScenario

__all__ = ["KIND", "Sweeps", "SweepsScenario", "from_sweeps"]


def _holds(paths: tuple[Path, ...]) -> bool:
    from faintrack.kinds.sweeps.files import holds_sweeps

    return holds_sweeps(paths)


def _read(paths: tuple[Path, ...], scenario: SweepsScenario | None) -> Sweeps:
    from faintrack.errors import InputError
    from faintrack.kinds.sweeps.files import read_sweeps

    if len(paths) > 1:
        raise InputError(f"{len(paths)} files of sweeps were given; expected one.")
    return read_sweeps(paths[0], (SweepsScenario() if scenario is None else scenario).sweeps)


def _describe(sweeps: Sweeps) -> dict[str, str]:
    first = np.asarray(sweeps.read(0, 1))
    spokes, samples = sweeps.shape
    start = sweeps.start_time
    levels = np.unique(first)
    look = sweeps.look(0, sweeps.length)
    moved = np.hypot(look.x[-1, -1] - look.x[0, 0], look.y[-1, -1] - look.y[0, 0])
    return {
        "holds": f"{sweeps.length} sweeps, {sweeps.interval:g} s apart",
        "axes": f"{spokes} spokes of {samples} samples, {sweeps.spacing:g} m apart, to {samples * sweeps.spacing:g} m",
        "times": f"of each {'sweep' if sweeps.times.ndim == 1 else 'spoke'}",
        "span": f"{sweeps.middle[-1] - sweeps.middle[0]:g} s",
        "start": "not known" if start is None else f"{start}Z",
        "antenna": "place not known" if sweeps.x is None else f"{moved:g} m on at the end",
        "levels": f"{len(levels)}, {levels[0]:g} to {levels[-1]:g}; {np.mean(first > 0):.1%} of cells above 0",
    }


KIND = Kind(
    name="sweeps",
    title="Sweeps of a radar",
    scenario=SweepsScenario,
    data=Sweeps,
    holds=_holds,
    read=_read,
    write=room("faintrack.kinds.sweeps.files", "write_sweeps"),
    plan=room("faintrack.kinds.sweeps.plan", "plan"),
    simulate=room("faintrack.kinds.sweeps.simulate", "simulate"),
    targets=room("faintrack.kinds.sweeps.simulate", "targets"),
    silence=room("faintrack.kinds.sweeps.simulate", "silence"),
    describe=_describe,
    about=room("faintrack.kinds.sweeps.report", "about"),
    draw=room("faintrack.kinds.sweeps.pictures", "draw"),
    shown="Plan position, existence",
    surrogate=room("faintrack.kinds.sweeps.quiet", "surrogate"),
    stretch=room("faintrack.kinds.sweeps.quiet", "stretch"),
)
