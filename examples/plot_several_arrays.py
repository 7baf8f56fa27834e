r"""
Two arrays, two targets
=======================

Two lines of hydrophones lie 600 m apart. Each reports the energy of its beams once a second; a target raises that of
its beam by three standard deviations of the noise, and every scan has peaks of noise as high. Two targets pass each
other, and for a while both arrays hear them in one beam. No bearing is ever called a detection.
"""

import matplotlib.pyplot as plt
import numpy as np

import faintrack as ft
from faintrack.kinds.records.pictures import draw_detection, draw_heard, draw_map, draw_number

LEVEL = 3.0
targets = [{"x": -400.0, "y": 480.0, "vx": 5.0, "vy": 2.5}, {"x": 380.0, "y": 640.0, "vx": -5.0}]
scenario = {
    "stations": [
        {"name": "west", "x": -300.0, "y": 0.0, "heading_deg": 90.0},
        {"name": "east", "x": 300.0, "y": 0.0, "heading_deg": 90.0},
    ],
    "region": {"x": [-600, 600], "y": [200, 1000], "cell": 40.0, "detectors": [2, 1], "speed": 6.0, "speeds": 7},
    "energies": {"present": [LEVEL, 1.0]},
    "target": {"arrival_rate": 0.001, "departure_rate": 0.001, "velocity_noise": 0.05},
    "several": {"slots": 4},
    "simulation": {"scans": 150, "beam_deg": 3.0, "targets": targets},
}
records = ft.simulate(scenario)
result = ft.track(records, scenario)
time = result.data.time.values[:, None]
x, y = (np.array([t[of] for t in targets]) + time * np.array([t.get(f"v{of}", 0.0) for t in targets]) for of in "xy")

# %%
# What the arrays hear
# --------------------
# Energy of every beam, and over it the bearings of the tracks that both arrays together were found to hear.

figure, axes = plt.subplots(2, 1, figsize=(9, 6), sharex=True, sharey=True, layout="constrained")
for number, axis in enumerate(axes):
    draw_heard(axis, result.data, number)
axes[-1].set_xlabel("time from the first scan (s)")
figure.colorbar(axes[0].images[0], ax=axes, label="energy (standard deviations above the median)")

# %%
# Where the targets are
# ---------------------
# Tracks with ellipses of three standard deviations; the truth is dotted. Beams of one target cross those of the other
# in two more places, and nothing is tracked there.

figure, axis = plt.subplots(figsize=(8, 6.5), layout="constrained")
draw_map(axis, result.data)
axis.plot(x / 1000, y / 1000, color="black", ls=":", lw=1)

# %%
# How they are found
# ------------------
# Two detectors watch the region. When the probability of one crosses the threshold its target is handed over to
# particles; it is declared when it has been in hand for ten scans.

figure, (above, below) = plt.subplots(2, 1, figsize=(9, 4.5), sharex=True, layout="constrained")
draw_detection(above, result)
draw_number(below, result)
below.set_xlabel("time from the first scan (s)")
for track in result.tracks:
    off = np.hypot(track.mean["x"][-1] - x[-1], track.mean["y"][-1] - y[-1]).min()
    print(f"track {track.label}: declared after {track.start_s:.0f} s; at the end {off:.0f} m off")
