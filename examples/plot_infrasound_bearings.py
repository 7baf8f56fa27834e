r"""
Detected bearings, or everything
================================

Twenty minutes of an infrasound array, four microphones, sources that come and go. Once a detector comes first: of every
frame and each of four bands the strongest beam is kept where it stands above a low threshold, and sequential initiation
looks for a target among these bearings. Once nothing is thrown away: track before detect on the same recording.

The numbers are those of ``examples/infrasound_bearings.py``, which needs the recording and a minute.
"""

import json
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

folder = Path("docs") if Path("docs/validation_data").exists() else Path("../docs")
result = json.loads((folder / "validation_data" / "infrasound_bearings.json").read_text())
methods = {"bearings": "initiation from bearings", "track_before_detect": "track before detect"}
colours = {"bearings": "#0072B2", "track_before_detect": "#D55E00"}

# %%
# What the detector reports, and what is made of it
# -------------------------------------------------
# Dots are detections of any band, dark where they belong to a target with high probability; lines are the tracks.

heard = result["heard"]
bearing, chance = (np.array(heard[name], float) for name in ("bearing_deg", "association"))
bearing = (bearing + 180) % 360 - 180
time = np.broadcast_to(np.array(heard["time"])[:, None], bearing.shape)
figure, (above, below) = plt.subplots(2, 1, figsize=(9, 6.5), height_ratios=[2.2, 1], sharex=True, layout="constrained")
dots = above.scatter(time, bearing, c=chance, s=12, cmap="cividis_r", vmin=0, vmax=1, lw=0)
figure.colorbar(dots, ax=above, label="probability that the\nbearing is the target's")
for name, label in methods.items():
    told = result[name]
    track = np.array(told["bearing_deg"], float)
    above.plot(told["time"], track, color=colours[name], lw=1.6, label=label)
    below.plot(told["time"], told["existence"], color=colours[name], lw=1.2, label=label)
above.set(ylabel="bearing (degrees clockwise from north)", ylim=(-180, 180), yticks=range(-180, 181, 90))
above.legend(fontsize=8, loc="lower left")
below.set(ylabel="existence", xlabel="time from the start of the recording (s)", ylim=(-0.02, 1.05))
for axis in (above, below):
    axis.grid(alpha=0.3)

# %%
# Which sources are found
# -----------------------

for name, label in methods.items():
    told = result[name]
    print(f"{label}:")
    for source, each in told["sources"].items():
        after = "never" if each["declared_after_s"] is None else f"after {each['declared_after_s']:.0f} s"
        print(f"  {source}: declared {after}, followed in {each['followed']} of {each['frames']} frames")
    print(f"  quiet parts: a track in {told['quiet_frames_with_a_track']} of {told['quiet_frames']} frames")
    print(f"  elsewhere: a track in {told['frames_with_a_track_elsewhere']} frames")
