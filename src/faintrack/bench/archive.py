"""A segment of an archive from its file to its folder."""

import tempfile
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from faintrack.archive.cut import Cut
from faintrack.archive.plan import planned
from faintrack.archive.segment import compute
from faintrack.archive.store import writing
from faintrack.bench.machine import Machine, beam_operations
from faintrack.bench.rows import Row, row, timed
from faintrack.bench.sizes import Sizes
from faintrack.kinds.beamforming import build_beamformer
from faintrack.scenario.array import build

CHANNELS, RATE, WIDTH = 8, 48000, 2
"""Of a hydrophone station: channels, Hz, bytes of a sample."""

TARGET = 15e6
"""Bytes a second on two cores."""

SCENARIO = {
    "kind": "recording",
    "array": {"line": {"count": CHANNELS, "spacing": 0.5}},
    "analysis": {"band": (100.0, 1500.0)},
}


def archive_segment(machine: Machine, sizes: Sizes) -> Row:
    """Noise of a hydrophone station in a WAV file through reading, tracking and writing; no peer."""
    import soundfile

    seconds = sizes.archive_seconds
    with tempfile.TemporaryDirectory(prefix="faintrack-") as folder:
        file = Path(folder) / "recordings" / "20260101_000000.wav"
        file.parent.mkdir()
        noise = 1000 * np.random.default_rng(0).standard_normal((seconds * RATE, CHANNELS), dtype=np.float32)
        soundfile.write(file, noise.astype(np.int16), RATE, subtype="PCM_16")
        cut = Cut(float(seconds), 86400.0 // seconds * seconds, 0.0)
        plan = planned([file.parent], SCENARIO, cut, "%Y%m%d_%H%M%S")
        ((segment,),) = plan.chains
        with writing(Path(folder) / "store", cut) as store:
            store.keep_scenario(segment.station, plan.scenarios[segment.station])
        timing = timed(lambda: compute(str(Path(folder) / "store"), segment).seconds, sizes.repeat_seconds)
    scenario = plan.scenarios[segment.station]
    grid = build_beamformer(scenario.analysis, build(scenario.array), RATE, scenario.analysis.taper).grid
    transform = jax.jit(lambda frame: jnp.fft.rfft(frame, axis=0))
    frame = jnp.asarray(noise[:RATE])
    fourier = timed(lambda: transform(frame), 0.1).least
    beams = machine.seconds(beam_operations(grid.frequency.size, grid.beams, CHANNELS, grid.snapshots))
    size, least = noise.size * WIDTH, seconds * (fourier + beams)
    note = (
        f"{seconds} s of {CHANNELS} channels at {RATE} Hz, 16 bit, {size / 1e6:.0f} MB with tracker, report and "
        f"tables: {size / 1e6 / timing.least:.1f} MB/s; target: {TARGET / 1e6:g} MB/s; limit: Fourier transforms and "
        f"beam sums at the rate of a large matrix product, nothing else: {size / 1e6 / least:.0f} MB/s"
    )
    return row("archive_segment", "s", timing, note, size / TARGET, limit=least)
