r"""
One array, three sources
========================

A line of 32 hydrophones hears three sources, each 27 dB below the noise of a hydrophone: two that cross in bearing,
and one that falls silent. A scan of a second shows none of them for certain. A detector over bearing and its rate finds
one after the other; each is then followed by particles of its own, and where two share a beam they are updated
together.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

import faintrack as ft
from faintrack.kinds.records.data import from_records
from faintrack.kinds.records.pictures import draw_detection, draw_heard, draw_number
from faintrack.simulation.samples import Source, draw_samples

SECONDS, RATE, SNR_DB = 180.0, 4000.0, -27.0
sources = [
    Source(SNR_DB, math.radians(60), math.radians(0.25)),
    Source(SNR_DB, math.radians(100), math.radians(-0.15)),
    Source(SNR_DB, math.radians(140), start=40.0, end=120.0),
]
array = ft.line_array(32, 0.375)
recording = ft.from_samples(np.concatenate(list(draw_samples(array, sources, SECONDS, RATE, seed=0))), RATE)
result = ft.track(
    from_records(recording),
    stations=[{"name": "line", "array": array}],
    analysis={"frame": 1.0, "beams": 48},
    target={"bearing_rate_deg": 0.5, "bearing_rate_noise_deg": 0.02},
    several={"slots": 6, "particles": 1024},
)

# %%
# What the array hears
# --------------------
# Energy of every beam, and over it the tracks. They go through the crossing, and the third ends when its source does.

figure, axis = plt.subplots(figsize=(9, 4.5), layout="constrained")
draw_heard(axis, result.data, 0)
axis.set_xlabel("time from the first scan (s)")
figure.colorbar(axis.images[0], ax=axis, label="energy (standard deviations above the median)")

# %%
# How they are found
# ------------------
# The detector's probability rises until a target is handed over, and falls at once; a target is declared when it has
# been in hand for ten scans.

figure, (above, below) = plt.subplots(2, 1, figsize=(9, 4.5), sharex=True, layout="constrained")
draw_detection(above, result)
draw_number(below, result)
below.set_xlabel("time from the first scan (s)")
for track in result.tracks:
    print(
        f"track {track.label}: {track.start_s:.0f} to {track.end_s:.0f} s, from {track.mean['bearing'][0]:.1f} to "
        f"{track.mean['bearing'][-1]:.1f} degrees"
    )
