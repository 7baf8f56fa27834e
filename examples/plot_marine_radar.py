r"""
Ships that hardly move
======================

A navigation radar turns eighteen times, 3 s a turn. Ships at 32 km show as blobs 10 samples long, and move by 4 to 8
samples in all that time, among hundreds of echoes that stay. What tells them apart is a second hypothesis: the echo
stands still.

The numbers are those of ``examples/marine_radar.py``, which needs the recording and some minutes.
"""

import json
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

root = Path() if Path("docs/validation_data").exists() else Path("..")
result = json.loads((root / "docs/validation_data/marine_radar.json").read_text())
print(f"{result['windows']} windows with an echo; the scans shuffled reach log odds of {max(result['shuffled']):.1f}")
sample, turn = 37.3, 2.99  # metres; seconds

# %%
# What moves, in the whole picture
# --------------------------------

for echo in result["found"]:
    place = f"spoke {echo['spoke']:.0f}, sample {echo['sample']:.1f}"
    print(f"{place}: log odds {echo['log_odds']:.1f}, {-echo['samples_a_scan'] * sample / turn:.1f} m/s inbound")

# %%
# Where, and how it looks beside an echo that stands
# --------------------------------------------------
# Left: mean of all scans, spoke over sample, and what is declared. The others: the range profile of each, averaged over
# its spokes, scan by scan, with the declared track; at last an echo that stands. Drawn where the recording is at hand.

file = root / "../shared/data/marine_radar/navico_halo_lauwersoog_38km.npz"
if file.exists():
    intensity = np.load(file)["intensity"]
    scans = np.arange(len(intensity))
    fixed = {"spoke": 1546.0, "sample": 571.0, "samples_a_scan": None}
    tracks = [*result["found"], fixed]
    figure, axes = plt.subplots(
        1, 1 + len(tracks), figsize=(12, 4.5), width_ratios=[2.2, *[1] * len(tracks)], layout="constrained"
    )
    axes[0].imshow(intensity.mean(axis=0), aspect="auto", vmax=8, cmap="gray_r", interpolation="nearest")
    axes[0].set(xlabel="sample", ylabel="spoke")
    for number, (axis, echo) in enumerate(zip(axes[1:], tracks, strict=True)):
        spoke, middle = round(echo["spoke"]), round(echo["sample"])
        first, last = middle - 16, min(middle + 16, intensity.shape[2])
        profile = intensity[:, spoke - 8 : spoke + 9, first:last].mean(axis=1)
        extent = (first - 0.5, last - 0.5, len(scans) - 0.5, -0.5)
        axis.imshow(profile, extent=extent, aspect="auto", cmap="gray_r", vmin=0, vmax=15)
        axis.set(xlabel="sample", title="stands" if echo is fixed else f"track {number + 1}")
        if echo is not fixed:
            line = echo["sample"] + echo["samples_a_scan"] * (scans - scans.mean())
            axis.plot(line, scans, color="#D55E00", lw=1.5)
            axes[0].plot(echo["sample"], echo["spoke"], "o", ms=10, mfc="none", mec="#D55E00")
            axes[0].annotate(str(number + 1), (echo["sample"] - 20, echo["spoke"]), color="#D55E00", ha="right")
    axes[1].set_ylabel("scan")
else:
    print(f"{file} is absent: no picture.")
