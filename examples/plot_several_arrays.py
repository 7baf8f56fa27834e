r"""
Two arrays, two targets
=======================

Two lines of hydrophones lie 600 m apart. Each reports the energy of its beams once a second; a target raises that of
its beam by three standard deviations of the noise, and every scan has peaks of noise as high. Two targets pass each
other, and for a while both arrays hear them in one beam. No bearing is ever called a detection.
"""

import math

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

from faintrack.beliefs.axis import Axis
from faintrack.data.sequence import from_frames
from faintrack.kinds.session_stations import track_records
from faintrack.likelihoods.beam_energies import BeamEnergies
from faintrack.plots.stations import draw_detection, draw_heard, draw_map, draw_number
from faintrack.scenario import Scenario
from faintrack.sensors.stations import Fans, Stations
from faintrack.simulation.energies import draw_energies
from faintrack.targets.states import PlanarState

STEP_DEG, LEVEL = 3.0, 3.0
time = jnp.arange(150.0)
fans = Fans(first=(0.0, 0.0), step=(math.radians(STEP_DEG),) * 2, count=(61, 61), line=(True, True))
lines = Stations(x=jnp.array([-300.0, 300.0]), y=jnp.zeros(2), heading=jnp.full(2, math.pi / 2))
start, speed = jnp.array([[-400.0, 480.0], [380.0, 640.0]]), jnp.array([[5.0, -5.0], [2.5, 0.0]])
x, y = start[:, None] + time[:, None] * speed[:, None]
truth = PlanarState(x, y, *jnp.broadcast_to(speed[:, None], (2, *x.shape)))
drawn = draw_energies(
    jax.random.key(0), BeamEnergies(fans, present_mean=LEVEL), time, lines, truth, jnp.ones(x.shape, bool)
)
beams = (("bearing", Axis(0.0, STEP_DEG, 61)),)
records = tuple(from_frames(np.asarray(drawn.energy[:, number]), axes=beams) for number in range(2))
scenario = Scenario.model_validate(
    {
        "stations": [
            {"name": "west", "x": -300.0, "y": 0.0, "heading_deg": 90.0},
            {"name": "east", "x": 300.0, "y": 0.0, "heading_deg": 90.0},
        ],
        "region": {"x": [-600, 600], "y": [200, 1000], "cell": 40.0, "detectors": [2, 1], "speed": 6.0, "speeds": 7},
        "energies": {"present": [LEVEL, 1.0]},
        "target": {"arrival_rate": 0.001, "departure_rate": 0.001, "velocity_noise": 0.05},
        "several": {"slots": 4},
    }
)
result = track_records(records, scenario)

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
axis.plot(np.asarray(x) / 1000, np.asarray(y) / 1000, color="black", ls=":", lw=1)

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
    end = [float(abs(track.end[name] - np.asarray(value)[-1]).min()) for name, value in (("x", x), ("y", y))]
    print(f"track {track.label}: declared after {track.start_s:.0f} s; at the end {math.hypot(*end):.0f} m off")
