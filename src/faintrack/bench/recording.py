"""A recording from samples to tracks, against the clock on the wall."""

from typing import Any

import numpy as np

from faintrack.bench.machine import Machine, beam_operations
from faintrack.bench.rows import Row, row, timed
from faintrack.bench.sizes import Sizes
from faintrack.data.recording import from_samples
from faintrack.kinds.beamforming import build_beamformer
from faintrack.kinds.door import track
from faintrack.kinds.scenario import Scenario
from faintrack.sensors.array import line_array, sensor_array
from faintrack.signal.tones import tone_analysis

SAMPLE_RATE = 4000.0
"""Hz."""

INFRASOUND_RATE, INFRASOUND_FRAME, RADIUS = 50.0, 10.0, 75.0
"""Of the recording of an array of microphones: Hz, seconds; of the circle on which they stand: metres."""

MICROPHONES = 8
"""On the circle."""


def track_55ch_realtime(machine: Machine, sizes: Sizes) -> Row:
    """Noise through beamformer, likelihood with unknown noise, filter and tracker; the peer is real time."""
    duration, channels = sizes.recording_seconds, sizes.channels
    array = line_array(channels, 0.375)
    samples = np.random.default_rng(0).standard_normal((round(duration * SAMPLE_RATE), channels), dtype=np.float32)
    recording = from_samples(samples, SAMPLE_RATE)
    scenario: Any = Scenario(
        array=array,
        analysis={"beams": sizes.beams},
        filter={"particles": sizes.particles, "births": sizes.births},
    )
    timing = timed(lambda: track(recording, scenario).tracks, sizes.repeat_seconds)
    grid = build_beamformer(scenario.analysis, array, SAMPLE_RATE, scenario.analysis.taper).grid
    operations = beam_operations(grid.frequency.size, grid.beams, channels, grid.snapshots)
    # Bearing and SNR take three normal numbers a particle.
    limit = duration * machine.seconds(operations, 3 * (sizes.particles + sizes.births))
    note = (
        f"{duration} s of {channels} channels at {SAMPLE_RATE:g} Hz in memory, 1 s frames, {sizes.beams} beams, "
        f"{sizes.particles} + {sizes.births} particles; peer: real time; limit: beam sums at the rate of a large "
        "matrix product and random numbers drawn at once, nothing else"
    )
    return row("track_55ch_realtime", "s", timing, note, duration / 50, float(duration), limit)


def track_above_horizon(machine: Machine, sizes: Sizes) -> Row:
    """A recording with the elevation of waves in the state; the peer is ours of level waves."""
    duration = sizes.recording_seconds * INFRASOUND_FRAME
    around = 2 * np.pi * np.arange(MICROPHONES) / MICROPHONES + 0.3 * np.sin(np.arange(MICROPHONES) ** 2)
    array = sensor_array(RADIUS * np.stack([np.sin(around), np.cos(around)], axis=-1), 340.0)
    shape = round(duration * INFRASOUND_RATE), MICROPHONES
    recording = from_samples(np.random.default_rng(0).standard_normal(shape, dtype=np.float32), INFRASOUND_RATE)
    scenario: Any = Scenario(
        array=array,
        analysis={"band": (1.0, 8.0), "frame": INFRASOUND_FRAME},
        filter={"particles": sizes.particles, "births": sizes.births},
    )
    level = timed(lambda: track(recording, scenario).tracks, sizes.repeat_seconds)
    above = {"elevation_deg": (0.0, 80.0)}
    timing = timed(lambda: track(recording, scenario, target=above).tracks, sizes.repeat_seconds)
    grid = build_beamformer(scenario.analysis, array, INFRASOUND_RATE, True, above["elevation_deg"]).grid
    note = (
        f"{duration:g} s of {MICROPHONES} channels at {INFRASOUND_RATE:g} Hz in memory, {INFRASOUND_FRAME:g} s frames, "
        f"{grid.rings} rings of {grid.beams} beams, {sizes.particles} + {sizes.births} particles; peer: ours with all "
        "waves level, one ring"
    )
    return row("track_above_horizon", "s", timing, note, None, level.least)


def track_tones(machine: Machine, sizes: Sizes) -> Row:
    """A tone whose frequency is not known; the peer is ours by power in the same band."""
    duration, channels = sizes.recording_seconds, sizes.channels
    array = line_array(channels, 0.375)
    time = np.arange(round(duration * SAMPLE_RATE)) / SAMPLE_RATE
    noise = np.random.default_rng(0).standard_normal((len(time), channels), dtype=np.float32)
    samples = noise + 0.05 * np.cos(2 * np.pi * 433.3 * time, dtype=np.float32)[:, None]
    recording = from_samples(samples.astype(np.float32), SAMPLE_RATE)
    scenario: Any = Scenario(
        array=array,
        analysis={"band": (100.0, 1000.0)},
        filter={"particles": 4 * sizes.particles, "births": 8 * sizes.births},
    )
    power = timed(lambda: track(recording, scenario).tracks, sizes.repeat_seconds)
    tones = {"kind": "tone"}
    timing = timed(lambda: track(recording, scenario, likelihood=tones).tracks, sizes.repeat_seconds)
    grid = tone_analysis(array, SAMPLE_RATE, 1.0, (100.0, 1000.0)).grid
    operations = 8 * grid.count * grid.beams * channels
    limit = duration * machine.seconds(operations, 3 * (4 * sizes.particles + 8 * sizes.births))
    note = (
        f"{duration} s of {channels} channels at {SAMPLE_RATE:g} Hz in memory, 1 s frames, {grid.count} frequencies, "
        f"{grid.beams} beams, {4 * sizes.particles} + {8 * sizes.births} particles, one tone; peer: ours by power in "
        "the band; limit: sums over all beams at the rate of a large matrix product and random numbers drawn at once"
    )
    return row("track_tones", "s", timing, note, None, power.least, limit)
