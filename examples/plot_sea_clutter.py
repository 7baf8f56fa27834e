r"""
False alarms in sea clutter
===========================

A radar looks at one patch of the sea. Breaking waves are spikes in frequency and time that a model with exponential
powers takes for targets; with the level of every cell known in part only, from the cells beside it, they no longer are.
A floating sphere still is found.

The numbers are those of ``examples/sea_clutter.py``, which needs the recordings and some minutes.
"""

import json
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from faintrack.beliefs.axis import Axis
from faintrack.metrics.intervals import binomial_interval
from faintrack.signal.clutter import ClutterTracker
from sea_clutter import FIRST, FREQUENCY, INTERVAL, MIDDLE, followed, joined, models, read

root = Path() if Path("docs/validation_data").exists() else Path("..")
result = json.loads((root / "docs/validation_data/sea_clutter.json").read_text())
labels = {
    "past": "exponential, level from the past",
    "neighbours": "exponential, level from neighbours",
    "compound": "level from neighbours, integrated out",
}

# %%
# Share of clutter segments with a declaration
# --------------------------------------------
# Five recordings without a target, segments of 4 s. Each model has the threshold that its own noise passes in one
# segment of twenty, the dashed line. Bars: 95 % intervals.

figure, axis = plt.subplots(figsize=(7, 2.4), layout="constrained")
for place, (model, label) in enumerate(labels.items()):
    declared, segments = (result["clutter"][model][name] for name in ("declared", "segments"))
    low, high = binomial_interval(declared, segments)
    axis.plot([low, high], [place, place], color="#0072B2", lw=2)
    axis.plot(declared / segments, place, "o", color="#0072B2")
    print(f"{label}: {declared} of {segments}, {low:.3f} to {high:.3f}")
axis.axvline(result["false_share"], color="0.4", ls="--")
axis.set(yticks=range(len(labels)), yticklabels=labels.values(), xlim=(0, 1.02), xlabel="share of segments declared")
axis.invert_yaxis()

# %%
# Where they are
# --------------
# Declared segments of each recording; the last has the sphere.

for model, label in labels.items():
    counts = [f"{row['recording']} {row['declared']}" for row in result["rows"] if row["model"] == model]
    print(label + ":", ", ".join(counts), f"of {result['rows'][0]['segments']} each")

# %%
# The sphere
# ----------
# Power over time and frequency, and the likeliest frequency wherever the log odds are above the threshold. The second
# half of the recording, as one. Drawn where the recordings are at hand.

file = root / "../shared/data/ipix_dartmouth/ipix30_target_IQ_uint8.npz"
if file.exists():
    power = read(file)
    fitted = result["tracker"]
    tracker = ClutterTracker(**fitted | {name: int(fitted[name]) for name in ("guard", "train")})
    (odds,), (frequency,) = followed(joined(models(tracker, power)["compound"]))
    reported = odds > result["thresholds"]["compound"]["value"]
    time = Axis(FIRST * INTERVAL, INTERVAL, len(odds))

    figure, axes = plt.subplots(1, 2, figsize=(9, 5), sharex=True, sharey=True, layout="constrained")
    extent = (FREQUENCY.edges[0], FREQUENCY.edges[-1], time.edges[-1], time.edges[0])
    decibels = 10 * np.log10(np.asarray(power)[FIRST:, MIDDLE] / np.median(power))
    picture = axes[0].imshow(decibels, extent=extent, aspect="auto", vmin=0, vmax=45)
    figure.colorbar(picture, label="power over the receiver's noise (dB)")
    axes[1].plot(frequency[reported], time.values[reported], ".", color="#D55E00", ms=4)
    for axis in axes:
        axis.set(xlim=(-125, 125), xlabel="frequency (Hz)")
    axes[0].set_ylabel("time (s)")
else:
    print(f"{file} is absent: no picture.")
