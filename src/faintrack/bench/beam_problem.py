"""The array and the samples of which every beamformer of the benchmark makes beam power."""

import numpy as np

from faintrack.bench.sizes import Sizes
from faintrack.sensors.array import SensorArray, line_array
from faintrack.signal.beamformer import Beamformer, beamformer

SAMPLE_RATE = 4000.0
"""Hz."""
SNAPSHOT = 1024
"""Samples in a transform; Acoular takes powers of two."""
SNAPSHOTS = 4
"""Transforms a frame."""
FRAMES = 16
"""Frames that ours takes in one call; a recording goes through in blocks."""


def plan_of(sizes: Sizes) -> tuple[SensorArray, Beamformer]:
    """Array and beamformer of both rows."""
    array = line_array(sizes.channels, 0.375)
    frame = SNAPSHOT * SNAPSHOTS / SAMPLE_RATE
    return array, beamformer(array, SAMPLE_RATE, frame, beams=sizes.beams, snapshot=SNAPSHOT / SAMPLE_RATE)


def draw_frames(sizes: Sizes) -> np.ndarray:
    """Noise of shape (frame, sample, channel), float32."""
    shape = (FRAMES, SNAPSHOT * SNAPSHOTS, sizes.channels)
    return np.random.default_rng(0).standard_normal(shape, dtype=np.float32)
