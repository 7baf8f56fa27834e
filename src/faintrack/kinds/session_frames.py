"""A sequence of frames through background and tracker, block by block.

What `faintrack.kinds.session` is for recordings of an array this is for images, range-time and range-Doppler matrices.
One compiled step serves every block, and memory does not grow with the length: of images `SNAPSHOTS` frames are kept
for the report, of profiles every frame, a few bytes a cell.
"""

from collections.abc import Iterator
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Array, Float, Int

from faintrack.data.sequence import Sequence
from faintrack.errors import InputError, naming
from faintrack.kinds.session import BLOCK_BYTES, LONGEST_BLOCK, collect
from faintrack.results.result import Result, pictures_dataset, sequence_dataset
from faintrack.scenario.build_frames import build_background, build_frame_tracker, holds_power
from faintrack.scenario.model import FramesTable, Scenario
from faintrack.sensors.cells import Cells, cell_surface
from faintrack.signal.scans import Background
from faintrack.trackers.single import Estimate, Following, SingleTargetTracker

SNAPSHOTS = 8
"""Images kept at most."""

LARGEST_VALUE = 1e15
"""Of a frame: squares of many values are added up in single precision."""


def track_frames(sequence: Sequence, scenario: Scenario | None = None) -> Result:
    """Tracks of the targets in a sequence of frames.

    Parameters
    ----------
    sequence : frames with the axes y and x, range, or range and range_rate.
    scenario : what to run; defaults where not given.

    Raises
    ------
    InputError : sequence and scenario do not fit together, or a frame cannot be read.

    Examples
    --------
    >>> from faintrack.data.sequence import from_frames
    >>> noise = np.random.default_rng(0).normal(size=(20, 24, 32))
    >>> result = track_frames(from_frames(noise))
    >>> result.tracks, result.existence.sizes["time"], result.data.frame.dims
    ([], 20, ('snapshot', 'y', 'x'))
    """
    scenario = with_frames(scenario)
    return collect(track_frame_blocks(sequence, scenario), scenario, None)


def with_frames(scenario: Scenario | None) -> Scenario:
    """Scenario with a table of frames; defaults where there is none."""
    scenario = Scenario() if scenario is None else scenario
    return scenario if scenario.frames is not None else scenario.model_copy(update={"frames": FramesTable()})


def track_frame_blocks(sequence: Sequence, scenario: Scenario, block_frames: int | None = None) -> Iterator[xr.Dataset]:
    """Yield what is known of consecutive frames, a block at a time, and of images the snapshots at the end.

    Parameters
    ----------
    sequence, scenario : as `track_frames`.
    block_frames : frames held at once; from their size where not given.
    """
    with naming(sequence.source):
        background, tracker = build_background(scenario, sequence), build_frame_tracker(scenario, sequence)
    cells, images = Cells(sequence.axes), len(sequence.axes) > 1
    if block_frames is None:
        block_frames = int(np.clip(BLOCK_BYTES // (4 * cells.size), 1, min(LONGEST_BLOCK, sequence.length)))
    snapshots = snapshots_of(sequence.length if images else 0)
    count = len(snapshots)
    key = jax.random.key(scenario.filter.seed)
    power = holds_power(scenario, sequence)
    first = jnp.asarray(_checked(sequence.read(0, 1), 0, power, sequence.source)[0])
    surfaces = jnp.full((count, *cells.shape), -jnp.inf, jnp.float32)
    carried = background.init(first), tracker.init(jax.random.fold_in(key, 2**31 - 1)), surfaces
    kept = []
    number = 0
    for file_times, frames in sequence.blocks(block_frames):
        frames = _checked(frames, number, power, sequence.source)
        used, missing = len(frames), block_frames - len(frames)
        numbers = np.arange(number, number + used)
        kept += list(frames[np.isin(numbers, snapshots)])
        slots = slots_of(numbers, snapshots)
        # From the first frame: single precision resolves no day in frames of a video.
        times = file_times - sequence.times[0]
        padding = [(0, missing)]
        carried, (estimates, rows) = _take_in(
            background,
            tracker,
            cells,
            carried,
            (
                jnp.asarray(np.pad(times, padding, mode="edge"), jnp.float32),
                jnp.asarray(np.pad(frames, padding + [(0, 0)] * (frames.ndim - 1), mode="edge")),
                jnp.asarray(np.pad(slots, padding, constant_values=count)),
            ),
            key,
        )
        estimates, rows = jax.tree.map(lambda values, used=used: np.asarray(values)[:used], (estimates, rows))
        yield sequence_dataset(times, estimates, rows, sequence)
        number += used
    if images:
        yield pictures_dataset(
            sequence.times[snapshots] - sequence.times[0], np.stack(kept), np.asarray(carried[2]), sequence
        )


def snapshots_of(length: int) -> Int[np.ndarray, " snapshot"]:
    """Numbers of the scans of which more is kept: `SNAPSHOTS` at most, evenly spaced, the last one among them.

    Examples
    --------
    >>> snapshots_of(20).tolist(), snapshots_of(3).tolist()
    ([1, 4, 6, 9, 11, 14, 16, 19], [0, 1, 2])
    """
    count = min(SNAPSHOTS, length)
    return (np.arange(1, count + 1) * length) // max(count, 1) - 1


def slots_of(numbers: Int[np.ndarray, " scan"], snapshots: Int[np.ndarray, " snapshot"]) -> Int[np.ndarray, " scan"]:
    """Place of every scan among those of which more is kept; their number where it is none of them."""
    return np.where(np.isin(numbers, snapshots), np.searchsorted(snapshots, numbers), len(snapshots))


def _checked(frames: np.ndarray, number: int, power: bool, source: str) -> Float[np.ndarray, "frame *cells"]:
    """Frames in single precision, the first of which has this number; refuses what nothing can be told from."""
    flat = np.asarray(frames).reshape(len(frames), -1)
    low, high = flat.min(axis=1), flat.max(axis=1)
    for good, problem in (
        (
            (low >= -LARGEST_VALUE) & (high <= LARGEST_VALUE),
            f"values beyond {LARGEST_VALUE:g} or NaN; expected smaller ones",
        ),
        ((low >= 0) | (not power), "values below 0; expected power or envelope"),
    ):
        if not good.all():
            raise InputError(f"{source}: frame {number + int(np.argmin(good))} holds {problem}.")
    return np.asarray(frames, np.float32)


@eqx.filter_jit
def _take_in(
    background: Background,
    tracker: SingleTargetTracker,
    cells: Cells,
    carried: tuple[Any, Following, Array],
    block: tuple[Array, Array, Array],
    key: Array,
) -> tuple[tuple[Any, Following, Array], tuple[Estimate, dict[str, Array]]]:
    """Memory, tracker and surfaces after a block; the estimates and, of profiles, the rows of the pictures."""

    def advance(carried: Any, item: Any) -> Any:
        memory, following, surfaces = carried
        time, frame, slot = item
        memory, scan, relative = background.step(memory, time, frame)
        following, estimate = tracker.step(following, scan, key)
        if len(cells.axes) == 1:
            rows = {"record": relative, "surface": cell_surface(following.belief, cells)}
            return (memory, following, surfaces), (estimate, rows)
        surfaces = jax.lax.cond(
            slot < len(surfaces),
            lambda held: held.at[slot].set(cell_surface(following.belief, cells)),
            lambda held: held,
            surfaces,
        )
        return (memory, following, surfaces), (estimate, {})

    return jax.lax.scan(advance, carried, block)
