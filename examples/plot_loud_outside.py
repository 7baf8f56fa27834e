r"""
A loud ship outside the region
==============================

Two arrays watch a square of 800 m. A target is in it, and a ship goes by 2 km to the east. Both arrays hear both. The
beam of the target in one array crosses that of the ship in the other within the square: a ghost that is as loud as the
target, and moves as steadily. Where the surroundings are watched, the ship is found too, and explains its beams.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

import faintrack as ft
from faintrack.kinds.records.pictures import draw_map

LEVEL, RUNS = 4.0, 10
SCENARIO = {
    "stations": [
        {"name": "south", "x": 0.0, "y": -500.0, "heading_deg": 90.0},
        {"name": "west", "x": -500.0, "y": 0.0, "heading_deg": 0.0},
    ],
    "region": {
        "x": [-400, 400],
        "y": [-400, 400],
        "cell": 50.0,
        "detectors": [2, 1],
        "speed": 6.0,
        "speeds": 5,
    },
    "energies": {"absent": [0.0, 1.0], "present": [LEVEL, 1.0]},
    "target": {"arrival_rate": 0.001, "departure_rate": 0.001, "velocity_noise": 0.2},
    "several": {"slots": 4},
    "simulation": {
        "scans": 40,
        "beam_deg": 5.0,
        "targets": [{"x": -200.0, "y": 100.0, "vx": 1.0, "vy": 1.0}, {"x": 2000.0, "y": 0.0, "vx": -2.0, "vy": 1.0}],
    },
}
time = np.arange(40.0)[:, None]
x, y = np.array([-200.0, 2000.0]) + time * np.array([1.0, -2.0]), np.array([100.0, 0.0]) + time


def track(run: int, surroundings: float) -> ft.Result:
    """Result of one draw of the noise."""
    heard = ft.simulate(SCENARIO, simulation={"seed": run})
    return ft.track(heard, SCENARIO, region={"surroundings": surroundings}, filter={"seed": run})


# %%
# In ten draws of the noise
# -------------------------
# How many tracks end more than 80 m from the target, without and with the surroundings, 2 km around the square.


def off(result: ft.Result) -> list[float]:
    """How far each track ends from the target."""
    return [math.hypot(one.mean["x"][-1] - x[-1, 0], one.mean["y"][-1] - y[-1, 0]) for one in result.tracks]


results = {width: [track(run, width) for run in range(RUNS)] for width in (0.0, 2000.0)}
for width, found in results.items():
    ends = [each for result in found for each in off(result)]
    print(
        f"{width:4.0f} m watched: {len(ends)} tracks in {RUNS} draws, {sum(each > 80 for each in ends)} of them ghosts"
    )

# %%
# One of them
# -----------
# The target's way is dotted; thin lines are the beams of target and ship, and the ghost lies where they cross.

worst = max(range(RUNS), key=lambda run: max(off(results[0.0][run]), default=0.0))
figure, axes = plt.subplots(1, 2, figsize=(11, 5.5), sharex=True, sharey=True, layout="constrained")
for axis, (width, found) in zip(axes, results.items(), strict=True):
    draw_map(axis, found[worst].data)
    axis.plot(x[:, 0] / 1000, y[:, 0] / 1000, color="black", ls=":", lw=1.5)
    for east, north in ((0.0, -500.0), (-500.0, 0.0)):
        for goal in range(2):
            axis.axline((east / 1000, north / 1000), (x[-1, goal] / 1000, y[-1, goal] / 1000), color="#999999", lw=0.6)
    axis.set(xlim=(-0.6, 0.6), ylim=(-0.6, 0.6))
    axis.set_title("surroundings not watched" if width == 0 else f"surroundings watched, {width / 1000:g} km")
