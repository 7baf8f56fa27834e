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
from faintrack.sensors.array import line_array

SAMPLE_RATE = 4000.0
"""Hz."""


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
