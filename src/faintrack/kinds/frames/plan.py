"""How a sequence of frames becomes a result: background, tracker, and what is kept for pictures.

Memory does not grow with the length: of images a few frames are kept for the report, of profiles every frame, a
few bytes a cell.
"""

from dataclasses import replace
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Array, PRNGKeyArray

from faintrack.data.sequence import Sequence
from faintrack.errors import InputError, naming
from faintrack.kinds.clean import CleanFrames
from faintrack.kinds.frames.build import (
    TAILS,
    build_background,
    build_tracker,
    chosen,
    frame_interval,
    holds_power,
    units_of,
)
from faintrack.kinds.frames.sections import FramesScenario
from faintrack.kinds.kind import Plan
from faintrack.kinds.loop import begun
from faintrack.kinds.several import Tracker, with_targets
from faintrack.kinds.snapshots import slots_of, snapshots_of
from faintrack.results.schema import HALF, Component, estimated
from faintrack.sensors.cells import Cells, CellScan, cell_surface
from faintrack.signal.fit import Fit
from faintrack.signal.scans import Background, OverScene, Scene
from faintrack.trackers.with_scene import with_scene

BLOCK_BYTES = 8 * 2**20
"""Of the frames held at once; frames a block follow from it."""

LONGEST_BLOCK = 32
"""Frames a block at most."""

NEAR_CELLS = 3.0
"""Cells from a known target within which a track is one of it."""

NEGATIVE = "values below 0; expected power or envelope"
"""What is wrong with frames of power that hold such."""

SURFACE = "log of the target likelihood ratio"


class Frames(NamedTuple):
    """Frames as they are taken in, or one.

    Attributes
    ----------
    time : from the first frame; seconds.
    values : of the cells.
    missing : cells that say nothing.
    slot : among the snapshots.
    """

    time: Any
    values: Any
    missing: Any
    slot: Any


class FramesStep(eqx.Module):
    """Frames through background and tracker.

    Attributes
    ----------
    background, tracker : what turns a frame into a scan, and what takes it in.
    cells : of a frame.
    """

    background: Background
    tracker: Tracker
    cells: Cells = eqx.field(static=True)

    def scans(self, block: Frames) -> Frames:
        """Some frames."""
        return block

    def advance(
        self, state: tuple[Any, Any, Array], scan: Frames, key: PRNGKeyArray
    ) -> tuple[tuple[Any, Any, Array], Any]:
        """Memory, tracker and snapshots of the surface; the estimate and, of profiles, the rows of the pictures."""
        memory, following, surfaces = state
        time, frame, missing, slot = scan
        memory, cells, relative = self.background.step(memory, time, frame)
        # Of a value that is not a number a likelihood says nothing.
        cells = eqx.tree_at(lambda cells: cells.values, cells, jnp.where(missing, jnp.nan, cells.values))
        if isinstance(cells, CellScan) and cells.moved is not None:
            following = with_scene(following, cells.moved, self.cells)
        following, estimate = self.tracker.step(following, cells, key)
        if len(self.cells.axes) == 1:
            rows = {"record": relative, "surface": self._surface(following)}
            return (memory, following, surfaces), (estimate, rows)
        surfaces = jax.lax.cond(
            slot < len(surfaces),
            lambda held: held.at[slot].set(self._surface(following)),
            lambda held: held,
            surfaces,
        )
        return (memory, following, surfaces), (estimate, {})

    def _surface(self, following: Any) -> Array:
        """Log of the target likelihood ratio of every cell, of all targets."""
        return jax.nn.logsumexp(jnp.stack([cell_surface(belief, self.cells) for belief in following.beliefs]), axis=0)


def plan(sequence: Sequence, scenario: FramesScenario) -> Plan:
    """How a sequence of frames becomes a result.

    Raises
    ------
    InputError : sequence and scenario do not fit together, or a frame cannot be read.
    """
    interval = scenario.frames.frame_interval
    # Frames of a file have it already, with gaps where numbered images are missing.
    if interval is not None and not np.isclose(np.diff(sequence.times).min(initial=np.inf), interval):
        sequence = replace(sequence, times=np.arange(sequence.length) * interval)
    with naming(sequence.source):
        background, tracker = build_background(scenario, sequence), build_tracker(scenario, sequence)
    cells, images = Cells(sequence.axes), len(sequence.axes) > 1
    snapshots = snapshots_of(sequence.length if images else 0)
    power = holds_power(scenario, sequence)
    if scenario.cells.dark and power:
        raise InputError("cells.dark: values are a power or an envelope, which targets raise; expected no dark ones.")
    # A dark target is a bright one where all values change their sign.
    sign = np.float32(-1 if scenario.cells.dark else 1)
    first = jnp.asarray(sign * CleanFrames(sequence, power, NEGATIVE).read(0, 1)[0][0])
    clean = CleanFrames(sequence, power, NEGATIVE)
    surfaces = jnp.full((len(snapshots), *cells.shape), -jnp.inf, jnp.float32)

    def read(start: int, stop: int) -> Frames:
        stop = min(stop, sequence.length)
        frames, missing = clean.read(start, stop)
        times = sequence.times[start:stop] - sequence.times[0]
        return Frames(times, sign * frames, missing, slots_of(np.arange(start, stop), snapshots))

    def rows(start: int, block: Any, outputs: Any) -> xr.Dataset:
        estimates, pictures = outputs
        times = sequence.times[start : start + len(block[0])] - sequence.times[0]
        return _dataset(times, estimates, pictures, sequence)

    expected = TAILS[scenario.cells.amplitude or "student"] if isinstance(background, OverScene) else 0.0
    fit: list[Fit] = []

    def close(state: tuple[Any, Any, Array]) -> xr.Dataset:
        if isinstance(state[0], Scene):
            fit[:] = [state[0].fit]
        shown = np.concatenate([sequence.read(number, number + 1) for number in snapshots.tolist()]).astype(np.float32)
        return _snapshots(sequence.times[snapshots] - sequence.times[0], shown, np.asarray(state[2]), sequence)

    return Plan(
        scenario=with_targets(chosen(scenario, sequence), tracker),
        step=FramesStep(background, tracker, cells),
        state=(background.init(first), begun(tracker, scenario.filter.seed), surfaces),
        read=read,
        rows=rows,
        length=sequence.length,
        size=int(np.clip(BLOCK_BYTES // (4 * cells.size), 1, LONGEST_BLOCK)),
        seed=scenario.filter.seed,
        remarks=lambda: (*clean.remarks(), *(said for seen in fit for said in seen.remarks())),
        misfits=lambda: tuple(said for seen in fit for said in seen.misfits(expected)),
        within=NEAR_CELLS * min(axis.step for _, axis in sequence.axes),
        close=close if images else None,
    )


def _dataset(times: np.ndarray, estimates: Any, pictures: dict[str, np.ndarray], sequence: Sequence) -> xr.Dataset:
    """Estimates of a stretch of a sequence in the schema, with the rows of pictures of profiles."""
    data = estimated(times, estimates, components(sequence))
    names = {"record": "value over what is expected without a target", "surface": SURFACE}
    for name, values in pictures.items():
        half = np.clip(values, -HALF, HALF).astype(np.float16)
        data[name] = (("time", *_dims(sequence)), half, {"units": "1", "long_name": names[name]})
    if pictures:
        data = data.assign_coords(_coordinates(sequence))
    data.time.attrs["long_name"] = "time from the first frame"
    return data.assign_attrs(_attributes(sequence))


def components(sequence: Sequence) -> tuple[Component, ...]:
    """Components of the state of a target in frames."""
    axes = dict(sequence.axes)
    pairs = {"x": "vx", "y": "vy"} if "x" in axes else {"range": "range_rate"}
    return (
        *(Component(name, units_of(name, axes), place=True, rate=rate) for name, rate in pairs.items()),
        *(Component(rate, units_of(rate, axes)) for rate in pairs.values()),
    )


def _snapshots(times: np.ndarray, frames: np.ndarray, surfaces: np.ndarray, sequence: Sequence) -> xr.Dataset:
    """Some images of a sequence and the surfaces after them, both with a snapshot axis in place of time."""
    dims = ("snapshot", *_dims(sequence))
    coordinates = _coordinates(sequence)
    coordinates["snapshot"] = ("snapshot", times, {"units": "s", "long_name": "time from the first frame"})
    variables = {
        "frame": (dims, frames, {"units": "1", "long_name": "value in the file"}),
        "surface": (dims, surfaces, {"units": "1", "long_name": SURFACE}),
    }
    return xr.Dataset(variables, coordinates)


def _dims(sequence: Sequence) -> tuple[str, ...]:
    """Names of the axes of a frame; those of the components are taken by the means."""
    return tuple(f"axis_{name}" for name, _ in sequence.axes)


def _coordinates(sequence: Sequence) -> dict[str, Any]:
    axes = dict(sequence.axes)
    return {
        f"axis_{name}": (f"axis_{name}", axis.values, {"units": units_of(name, axes), "long_name": name})
        for name, axis in sequence.axes
    }


def _attributes(sequence: Sequence) -> dict[str, Any]:
    start = ""
    if sequence.start_time is not None:
        start = f"{sequence.start_time + np.timedelta64(round(float(sequence.times[0]) * 1e9), 'ns')}Z"
    return {
        "kind": "frames",
        "source": sequence.source,
        "start_time": start,
        "first_scan_time": float(sequence.times[0]),
        "scan_interval": frame_interval(sequence),
    }
