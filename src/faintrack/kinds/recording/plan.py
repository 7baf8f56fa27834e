"""How the recording of an array becomes a result: beamformer, tracker, and the rows of the bearing-time record."""

import math
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from faintrack.baselines.detect_and_track import DetectAndTrack
from faintrack.data.recording import Recording
from faintrack.errors import InputError, naming
from faintrack.io.arrays import matched
from faintrack.io.recordings import without_copies
from faintrack.kinds.beamforming import plan_frames
from faintrack.kinds.checks import about_array, about_levels, as_heard
from faintrack.kinds.clean import CleanRecording
from faintrack.kinds.kind import Plan
from faintrack.kinds.loop import begun
from faintrack.kinds.recording.build import (
    build_background,
    build_tones,
    build_tracker,
    default_snr_db,
    default_tone_db,
    for_tones,
)
from faintrack.kinds.recording.channels import FRAMES, LoudFrames
from faintrack.kinds.recording.heading import STARBOARD, TRUE_BEARING, read_course, with_true_bearing
from faintrack.kinds.recording.hum import about_hum
from faintrack.kinds.recording.sections import RecordingScenario
from faintrack.kinds.recording.trace import COMPONENTS, with_trace_velocity
from faintrack.kinds.several import Tracker, about_targets, with_targets
from faintrack.likelihoods.array_field import in_noise
from faintrack.numerics.traced import traced
from faintrack.results.schema import AXIS, NORTH, Component, bearing, estimated, of_scans
from faintrack.scenario.array import build, describe
from faintrack.sensors.array import SensorArray
from faintrack.sensors.beams import bearings, lobe_width
from faintrack.signal.array_background import ArrayBackground, Learnt
from faintrack.signal.beamformer import Beamformer
from faintrack.signal.energies import energies
from faintrack.signal.frames import framed, frames
from faintrack.signal.tones import ToneAnalysis, tone_analysis
from faintrack.targets.turning import turned_beliefs
from faintrack.trackers.many import Hand

BLOCK_BYTES = 8 * 2**20
"""Beam power held at once; frames a block follow from it. What lies on the way to it takes several times as much:
beyond some 30 MiB the memory of every block is fetched anew from the system, which takes longer than the sums."""

TURN_KEY = 2**31 - 2
"""Number of the key of turns; scans count from 0."""

AT_END_DB = 0.5
"""Below the largest SNR of targets, from which on it is the end that is told; dB."""

LONGEST_BLOCK = 32
"""Frames a block at most: beyond it the beamformer gains nothing."""


class Samples(NamedTuple):
    """Frames of samples as they are taken in.

    Attributes
    ----------
    time : of the middle of each; seconds.
    samples : of all channels; a masked one is zero.
    usable : channels that are not masked.
    turn, unsure : of the array since the frame before, and its deviation, radians; None where no heading is told.
    since : when it last turned, up to the frame before; seconds.
    """

    time: Any
    samples: Any
    usable: Any
    turn: Any = None
    unsure: Any = None
    since: Any = None


class RecordingStep(eqx.Module):
    """Frames through beamformer, background and tracker."""

    beamformer: Beamformer | ToneAnalysis
    background: ArrayBackground | None
    tracker: Tracker | DetectAndTrack

    def scans(self, block: Samples) -> tuple[Any, Float[Array, "frame beam"], tuple[Array, Array, Array] | None]:
        """Scans of some frames, rows of the record in dB, and turns of the array (`Course.turns`).

        Of several rings of beams a row has the loudest at every bearing.
        """
        turns = None if block.turn is None else (block.turn, block.unsure, block.since)
        if isinstance(self.beamformer, ToneAnalysis):
            scans: Any = self.beamformer.scan(block.time, block.samples, block.usable)
            record = self.beamformer.record(scans)
        else:
            scans = self.beamformer.scan(block.time, block.samples, block.usable)
            grid, record = self.beamformer.grid, energies(scans)
            if grid.elevations:
                record = jnp.max(record.reshape(-1, grid.rings, grid.beams), axis=1)
        return scans, 10 * jnp.log10(jnp.maximum(jnp.nan_to_num(record), 1e-6)), turns

    def advance(
        self,
        state: Any,
        scan: tuple[Any, Float[Array, " beam"], tuple[Array, Array, Array] | None],
        key: PRNGKeyArray,
    ) -> tuple[Any, tuple[Any, Float[Array, " beam"]]]:
        """As `faintrack.kinds.kind.Step.advance`."""
        (memory, following), (frame, row, turn) = state, scan
        if turn is not None:
            for_turn = jax.random.fold_in(jax.random.fold_in(key, TURN_KEY), following.scans)
            following = turned_beliefs(following, *turn, for_turn)
        if self.background is None:
            following, estimate = self.tracker.step(following, frame, key)
            return (memory, following), (estimate, row)
        tracker: Any = self.tracker
        background = self.background

        def taken_in(known: Learnt, loudest_db: Array) -> tuple[Any, Any, Learnt, Array]:
            noise = background.noise(known, frame, loudest_db)
            after, estimate = tracker.step(following, in_noise(frame, noise), key)
            hand = after.hand
            learnt = background.learn(memory, frame, lambda: tracker.beside(frame, hand), loudest(hand))
            return after, estimate, learnt, loudest(hand)

        take_in, shapes = traced(taken_in, memory, loudest(following.hand))

        def body(carried: Any) -> Any:
            number, (_, _, learnt, loudest_db) = carried
            first = number == 0
            known = jax.tree.map(lambda old, new: jnp.where(first, old, new), memory, learnt)
            return number + 1, take_in(known, jnp.where(first, loudest(following.hand), loudest_db))

        def unfinished(carried: Any) -> Array:
            # The first frame is its own background, and is taken in again without the sources that it holds.
            return (carried[0] == 0) | ((carried[0] == 1) & (memory.frames == 0))

        start = jax.tree.map(lambda shape: jnp.zeros(shape.shape, shape.dtype), shapes)
        _, (following, estimate, memory, _) = jax.lax.while_loop(unfinished, body, (0, start))
        return (memory, following), (estimate, row)


def loudest(hand: Hand) -> Float[Array, ""]:
    """Largest SNR of the sources in hand; dB."""
    states = hand.beliefs.states
    return jnp.max(jnp.where(hand.active, jnp.mean(states.snr_db, axis=1), -jnp.inf))


def plan(recording: Recording, scenario: RecordingScenario) -> Plan:
    """How a recording becomes a result.

    Raises
    ------
    InputError : there is no array, or recording, array, band and frame do not fit together.
    """
    recording, scenario = without_copies(recording), for_tones(scenario)
    array, rule = array_of(recording, scenario)
    band = scenario.analysis.band
    array, straight = as_heard(array, recording.sample_rate / 2 if band is None else band[1])
    analysis, elevation = scenario.analysis, scenario.target.elevation_deg
    beamformer, length, count = plan_frames(recording, array, analysis, analysis.taper, elevation)
    clean = CleanRecording(recording)
    described: Any = scenario.array
    likelihood = scenario.likelihood
    noise_power = None
    if likelihood.noise_power is not None:
        noise_power = np.full(beamformer.grid.frequency.size, likelihood.noise_power / clean.level**2)
    elif likelihood.noise_seconds is not None:
        noise_power = measure_noise(CleanRecording(recording).recording, beamformer, length, likelihood.noise_seconds)
    with naming(recording.source):
        tones = _tones(recording, array, scenario)
        tracker: Tracker | DetectAndTrack = (
            build_tracker(scenario, array, beamformer, noise_power)
            if tones is None
            else build_tones(scenario, array, tones)
        )
    background = None if tones else build_background(scenario, tracker, beamformer)
    course = None
    if scenario.heading is not None:
        lobe = lobe_width(array, float(beamformer.grid.frequency[-1]))
        course = read_course(scenario.heading, recording, array, analysis.frame, lobe)
    grid = beamformer.grid
    values = grid.frequency.size * grid.beams * grid.rings if tones is None else 4 * tones.grid.count * tones.grid.beams
    frame_bytes = 4 * max(values, length * recording.channels)
    # Of a run that is taken up again it is not known what was heard before.
    heard = np.ones(recording.channels, bool)
    loud = LoudFrames(beamformer)
    loudest_db, ends = _levels(scenario, array, beamformer, tones)[1], set[int]()
    heard_at: dict[int, float] = {}

    def read(start: int, stop: int) -> Samples:
        block = framed(clean.recording, length, start, min(stop, count) - start)
        turns = () if course is None else course.turns(start, start + len(block.time))
        return Samples(block.time, block.samples, block.usable, *turns)

    def rows(start: int, block: Samples, outputs: tuple[Any, np.ndarray]) -> xr.Dataset:
        usable = block.usable
        heard[:] &= start > 0
        np.logical_or(heard, usable.any(axis=0), out=heard)
        if start + len(usable) == count:
            _require_heard(recording, array, heard)
        estimates = outputs[0]
        loud.take(
            start, block.samples, np.asarray(estimates.existence).reshape(len(usable), -1), np.asarray(outputs[1])
        )
        if tones is not None:
            declared = np.asarray(estimates.label) > 0
            labels, hertz = (np.asarray(x)[declared] for x in (estimates.label, estimates.mean.frequency))
            heard_at.update(zip(labels.tolist(), hertz.tolist(), strict=True))
        ends.update(np.unique(estimates.label[np.asarray(estimates.mean.snr_db) > loudest_db - AT_END_DB]).tolist())
        heading = None if course is None else course.at(np.arange(start, start + len(usable)))
        return _dataset(block.time, usable, *outputs, array, recording, scenario.analysis.frame, heading)

    def check() -> tuple[str, ...]:
        spread = LoudFrames(beamformer)
        for number in np.unique(np.linspace(0, count - 1, FRAMES).round().astype(int)).tolist():
            spread.take(number, read(number, number + 1).samples, np.zeros((1, 1)))
        return spread.checked(recording.channel_names)

    def remarks() -> tuple[str, ...]:
        return (
            *clean.remarks(),
            *_rest(recording, count * length),
            *_louder(ends - {0}, loudest_db),
            *about_hum(heard_at),
        )

    return Plan(
        scenario=with_targets(_chosen(scenario, array, beamformer, tones, recording.sample_rate), tracker),
        step=RecordingStep(tones or beamformer, background, tracker),
        state=(None if background is None else background.init(), begun(tracker, scenario.filter.seed)),
        read=read,
        rows=rows,
        length=count,
        size=int(np.clip(BLOCK_BYTES // frame_bytes, 1, LONGEST_BLOCK)),
        seed=scenario.filter.seed,
        checks=(
            *recording.remarks,
            *rule,
            *straight,
            *about_array(array, described, beamformer, recording.sample_rate),
            *about_targets(scenario.tracker, tracker),
            *about_levels(CleanRecording(recording).recording, array),
        ),
        remarks=remarks,
        misfits=lambda: loud.misfits(recording.channel_names),
        check=check,
        within=math.degrees(lobe_width(array, float(beamformer.grid.frequency[-1]))),
    )


def _louder(labels: set[int], loudest_db: float) -> tuple[str, ...]:
    """Of which targets the SNR is not told."""
    if not labels:
        return ()
    whose = (
        f"target {next(iter(labels))} is" if len(labels) == 1 else f"targets {', '.join(map(str, sorted(labels)))} are"
    )
    return (f"The SNR of {whose} at the upper end of target.snr_db, {loudest_db:g} dB, or beyond it.",)


def _rest(recording: Recording, used: int) -> tuple[str, ...]:
    """What is left out at the end of a recording."""
    rest = (recording.length - used) / recording.sample_rate
    if not rest or recording.live:
        return ()
    return (f"The last {rest:.4g} s of {recording.duration:.6g} s, shorter than a frame, were left out.",)


def array_of(recording: Recording, scenario: RecordingScenario) -> tuple[SensorArray, tuple[str, ...]]:
    """Array of a scenario, its channels in the order of a recording's, and by which rule where that is not plain.

    Raises
    ------
    InputError : there is no array, or it has other channels.
    """
    if scenario.array is None:
        raise InputError(
            f"{recording.source} holds {recording.channels} channels at {recording.sample_rate:g} Hz and no array was "
            "given; expected array, a file (--array FILE) or a section of the scenario with the channels' positions."
        )
    return matched(build(scenario.array), recording)


def measure_noise(
    recording: Recording, beamformer: Beamformer, length: int, seconds: float
) -> Float[np.ndarray, " frequency"]:
    """Mean power of a channel in every bin over the first seconds of a recording.

    Parameters
    ----------
    recording, beamformer : samples, and how they become scans.
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
        scan = beamformer.scan(jnp.asarray(block.time), jnp.asarray(block.samples), jnp.asarray(block.usable))
        if scan.channels[0] > 0:
            powers.append(np.asarray(scan.total_power[0] / (scan.channels[0] * beamformer.grid.snapshots)))
    if not powers:
        raise InputError(
            f"{recording.source}: no whole frame in the first {seconds:g} s, from which to measure the noise."
        )
    return np.mean(powers, axis=0)


def _tones(recording: Recording, array: SensorArray, scenario: RecordingScenario) -> ToneAnalysis | None:
    """How frames become scans in which tones are looked for; None where that is not asked for."""
    if scenario.likelihood.kind != "tone":
        return None
    analysis = scenario.analysis
    return tone_analysis(array, recording.sample_rate, analysis.frame, analysis.band, analysis.beams)


def _levels(
    scenario: RecordingScenario, array: SensorArray, beamformer: Beamformer, tones: ToneAnalysis | None
) -> tuple[float, float]:
    """Lowest and highest SNR of targets, as the scenario says or by default; dB."""
    by_default = default_snr_db(array, beamformer.grid) if tones is None else default_tone_db(array, tones.grid)
    return scenario.target.snr_db or by_default


def _chosen(
    scenario: RecordingScenario,
    array: SensorArray,
    beamformer: Beamformer,
    tones: ToneAnalysis | None,
    sample_rate: float,
) -> RecordingScenario:
    """Scenario with what was chosen for a recording filled in."""
    chosen: dict[str, Any] = {"beams": beamformer.grid.beams, "snapshot": beamformer.snapshot / sample_rate}
    if tones is not None:
        chosen = {"beams": tones.grid.beams}
    analysis = scenario.analysis.model_copy(update=chosen)
    snr_db = _levels(scenario, array, beamformer, tones)
    target = scenario.target.model_copy(update={"snr_db": tuple(map(float, snr_db))})
    return scenario.model_copy(update={"array": describe(array), "analysis": analysis, "target": target})


def _require_heard(recording: Recording, array: SensorArray, heard: Bool[np.ndarray, " channel"]) -> None:
    """Refuse a recording of which fewer than two channels were heard; those that were not are told by the gate."""
    if (heard & array.alive).sum() < 2:
        silent = [name for name, ok in zip(recording.channel_names, heard, strict=True) if not ok]
        raise InputError(
            f"{recording.source}: channels {', '.join(silent[:8])} have no frame without missing samples; expected two "
            "channels at least."
        )


def _dataset(
    time: np.ndarray,
    usable: np.ndarray,
    estimates: Any,
    record: np.ndarray,
    array: SensorArray,
    recording: Recording,
    frame: float,
    heading: np.ndarray | None = None,
) -> xr.Dataset:
    """Estimates of consecutive frames in the schema, with the bearing-time record."""
    reference = NORTH if array.circular else AXIS
    masked = (~usable & array.alive).sum(axis=1).astype(np.int32)
    components = bearing(reference)
    if heading is not None:
        estimates = with_true_bearing(estimates, heading)
        components = (*components, TRUE_BEARING, *(() if array.circular else (STARBOARD,)))
    if hasattr(estimates.mean, "frequency"):
        components = (*components, Component("frequency", "Hz"))
    if hasattr(estimates.mean, "elevation"):
        estimates, components = with_trace_velocity(estimates, array.sound_speed), (*components, *COMPONENTS)
    data = estimated(time, estimates, components)
    if heading is not None:
        degrees = np.degrees(heading) % 360
        data["heading"] = of_scans(degrees, "degree", "heading of the array, of a line that of its axis")
    data["masked_channels"] = of_scans(masked, "1", "channels left out, samples missing", counted="masked_scans")
    shown = "beam power over the sum of the channels' powers"
    if hasattr(estimates.mean, "frequency"):
        shown = "loudest tone of a beam over the noise around it"
    data["record"] = (
        ("time", "beam"),
        record,
        {"units": "dB", "long_name": shown},
    )
    degrees = {"units": "degree", "long_name": "bearing", "reference": reference}
    data = data.assign_coords(beam=("beam", np.degrees(bearings(record.shape[1], array.circular)), degrees))
    data.time.attrs["long_name"] = "time from the start of the recording"
    start = "" if recording.start_time is None else f"{recording.start_time}Z"
    return data.assign_attrs(
        kind="recording", source=recording.source, start_time=start, first_scan_time=0.0, scan_interval=frame
    )
