"""A recording through beamformer and tracker, block by block.

`track` runs to the end and returns a `Result`; `follow` yields every frame as it comes. Both take the same compiled
step, and neither holds more than a block of samples.
"""

import time as clock
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Array, Float
from pydantic import ValidationError

from faintrack.baselines.detect_and_track import DetectAndTrack
from faintrack.beliefs.belief import Belief
from faintrack.data.recording import Recording
from faintrack.errors import InputError, naming
from faintrack.results.result import Result, frames_dataset, joined, tracks_of
from faintrack.scenario.array import problem
from faintrack.scenario.build import build_beamformer, build_tracker
from faintrack.scenario.model import Analysis, Scenario, TrackerTable
from faintrack.sensors.array import SensorArray
from faintrack.signal.beamformer import Beamformer
from faintrack.signal.energies import energies
from faintrack.signal.frames import FrameBlock, frames
from faintrack.trackers.single import Estimate, SingleTargetTracker

BLOCK_BYTES = 8 * 2**20
"""Beam power held at once; frames a block follow from it. What lies on the way to it takes several times as much:
beyond some 30 MiB the memory of every block is fetched anew from the system, which takes longer than the sums."""

LONGEST_BLOCK = 32
"""Frames a block at most: beyond it the beamformer gains nothing."""


@dataclass(frozen=True)
class Moment:
    """One frame, as `follow` yields it.

    Attributes
    ----------
    time : middle of the frame; seconds from the start of the recording.
    belief : all particles after the frame; None where the tracker has none.
    estimate : what the tracker says.
    record : shape (beam,); the frame's row of the bearing-time record, dB.
    """

    time: float
    belief: Belief | None
    estimate: Estimate
    record: np.ndarray


def track(
    recording: Recording,
    array: SensorArray,
    band: tuple[float, float] | None = None,
    frame: float | None = None,
    scenario: Scenario | None = None,
) -> Result:
    """Tracks of the sources in a recording.

    Parameters
    ----------
    recording : samples of the array's channels, in the array's order.
    array : geometry, sound speed, gains.
    band : lowest and highest frequency, Hz; overrides the scenario's.
    frame : between scans, seconds; overrides the scenario's.
    scenario : everything else; defaults where not given.

    Raises
    ------
    InputError : recording, array, band and frame do not fit together, or nothing usable was recorded.

    Examples
    --------
    >>> from faintrack.data.recording import from_samples
    >>> from faintrack.sensors.array import line_array
    >>> noise = np.random.default_rng(0).normal(size=(4000, 8))
    >>> result = track(from_samples(noise, 1000.0), line_array(8, 1.0), frame=0.5)
    >>> result.tracks, result.existence.sizes["time"]
    ([], 8)
    """
    scenario = with_analysis(scenario, band, frame)
    return collect(track_blocks(recording, array, scenario), scenario, array)


def collect(blocks: Iterable[xr.Dataset], scenario: Scenario, array: SensorArray | None) -> Result:
    """Result of consecutive blocks, held in memory; see `track_blocks` and `faintrack.kinds.session_frames`."""
    start = clock.perf_counter()
    data = joined(blocks)
    return Result(data, tracks_of(data), scenario, array, clock.perf_counter() - start)


def with_analysis(
    scenario: Scenario | None, band: tuple[float, float] | None = None, frame: float | None = None
) -> Scenario:
    """Scenario whose band and frame are replaced where given; defaults where there is no scenario."""
    scenario = Scenario() if scenario is None else scenario
    given = {name: value for name, value in (("band", band), ("frame", frame)) if value is not None}
    try:
        analysis = Analysis(**{**scenario.analysis.model_dump(), **given})
    except ValidationError as error:
        raise InputError(problem(error)) from error
    return scenario.model_copy(update={"analysis": analysis})


def with_method(scenario: Scenario, method: str | None) -> Scenario:
    """Scenario whose tracking method is replaced where one is given."""
    if method is None:
        return scenario
    try:
        table = TrackerTable(**{**scenario.tracker.model_dump(), "method": method})
    except ValidationError as error:
        raise InputError(problem(error)) from error
    return scenario.model_copy(update={"tracker": table})


def follow(recording: Recording, array: SensorArray, scenario: Scenario | None = None) -> Iterator[Moment]:
    """Yield every frame of a recording as it is taken in; see `track` for the arguments and errors.

    Examples
    --------
    >>> from faintrack.data.recording import from_samples
    >>> from faintrack.sensors.array import line_array
    >>> noise = np.random.default_rng(0).normal(size=(4000, 8))
    >>> moments = follow(from_samples(noise, 1000.0), line_array(8, 1.0))
    >>> next(moments).time
    0.5
    """
    scenario = Scenario() if scenario is None else scenario
    for block, following, estimates, record in _advance(recording, array, scenario, block_frames=1):
        belief = getattr(following, "belief", None)
        yield Moment(float(block.time[0]), belief, jax.tree.map(lambda a: a[0], estimates), record[0])


def track_blocks(recording: Recording, array: SensorArray, scenario: Scenario) -> Iterator[xr.Dataset]:
    """Yield what is known of consecutive frames, a block at a time; together they are `Result.data`.

    Raises
    ------
    InputError : as `track`; that a channel never held a finite sample is known only at the end.
    """
    heard = np.zeros(recording.channels, bool)
    for block, _, estimates, record in _advance(recording, array, scenario):
        heard |= block.usable.any(axis=0)
        yield frames_dataset(block, estimates, record, array, recording)
    silent = [
        name for name, ok, alive in zip(recording.channel_names, heard, array.alive, strict=True) if alive and not ok
    ]
    if silent:
        raise InputError(
            f"{recording.source}: channel {silent[0]} has no frame without samples that are not finite; "
            "expected numbers, or the channel in the array's list of dead ones."
        )


def measure_noise(
    recording: Recording, plan: Beamformer, length: int, seconds: float
) -> Float[np.ndarray, " frequency"]:
    """Mean power of a channel in every bin over the first seconds of a recording.

    Parameters
    ----------
    recording, plan : samples, and how they become scans.
    length : samples in a frame.
    seconds : from the start, as much as is measured.

    Raises
    ------
    InputError : the recording has no whole frame in that time.
    """
    powers = []
    for block in frames(recording, length, block=1):
        if block.time[0] > seconds:
            break
        scan = plan.scan(jnp.asarray(block.time), jnp.asarray(block.samples), jnp.asarray(block.usable))
        if scan.channels[0] > 0:
            powers.append(np.asarray(scan.total_power[0] / (scan.channels[0] * plan.grid.snapshots)))
    if not powers:
        raise InputError(
            f"{recording.source}: no whole frame in the first {seconds:g} s, from which to measure the noise."
        )
    return np.mean(powers, axis=0)


@eqx.filter_jit
def _take_in(
    plan: Beamformer,
    tracker: SingleTargetTracker | DetectAndTrack,
    following: Any,
    block: tuple[Array, Array, Array],
    key: Array,
) -> tuple[Any, Estimate, Array]:
    scans = plan.scan(*block)
    following, estimates = tracker.steps(following, scans, key)
    return following, estimates, 10 * jnp.log10(jnp.maximum(jnp.nan_to_num(energies(scans)), 1e-6))


def plan_frames(recording: Recording, array: SensorArray, scenario: Scenario) -> tuple[Beamformer, int, int]:
    """Beamformer of a recording, samples of a frame, and number of frames.

    Raises
    ------
    InputError : recording, array, band and frame do not fit together.
    """
    if recording.channels != len(array.gains):
        raise InputError(f"{recording.source} has {recording.channels} channels; the array has {len(array.gains)}.")
    with naming(recording.source):
        plan = build_beamformer(scenario, array, recording.sample_rate)
    length = round(scenario.analysis.frame * recording.sample_rate)
    count = recording.length // length
    if count == 0:
        raise InputError(
            f"{recording.source} lasts {recording.duration:g} s; "
            f"expected at least one frame of {scenario.analysis.frame:g} s."
        )
    return plan, length, count


def _advance(
    recording: Recording, array: SensorArray, scenario: Scenario, block_frames: int | None = None
) -> Iterator[tuple[FrameBlock, Any, Any, np.ndarray]]:
    """Yield blocks of frames with the tracker's state after them, its estimates and the rows of the record."""
    plan, length, count = plan_frames(recording, array, scenario)
    seconds = scenario.likelihood.noise_seconds
    noise_power = None if seconds is None else measure_noise(recording, plan, length, seconds)
    with naming(recording.source):
        tracker = build_tracker(scenario, array, plan, noise_power)
    key = jax.random.key(scenario.filter.seed)
    following = tracker.init(jax.random.fold_in(key, 2**31 - 1))
    if block_frames is None:
        frame_bytes = 4 * max(plan.grid.frequency.size * plan.grid.beams, length * recording.channels)
        block_frames = int(np.clip(BLOCK_BYTES // frame_bytes, 1, min(LONGEST_BLOCK, count)))
    for block in frames(recording, length, block_frames):
        used = len(block.time)
        arrays = _filled(block, block_frames)
        following, estimates, record = _take_in(plan, tracker, following, arrays, key)
        yield block, following, jax.tree.map(partial(_first, used), estimates), _first(used, record)


def _filled(block: FrameBlock, size: int) -> tuple[Array, Array, Array]:
    """Fields of a block, filled up to `size` frames that say nothing, so that one compiled step serves every block."""
    missing = size - len(block.time)
    return (
        jnp.asarray(np.pad(block.time, (0, missing), mode="edge")),
        jnp.asarray(np.pad(block.samples, ((0, missing), (0, 0), (0, 0)))),
        jnp.asarray(np.pad(block.usable, ((0, missing), (0, 0)))),
    )


def _first(count: int, values: Array) -> np.ndarray:
    return np.asarray(values)[:count]
