r"""
Contacts of two targets that cross
==================================

A sonar reports contacts, one for each echo: a range, a bearing, and nothing of which of them are false. Two targets
cross while five false contacts come in every ping. Each is found, keeps its label through the crossing, and every
contact is given the probability that it is a target's.
"""

import matplotlib.pyplot as plt
import numpy as np

import faintrack as ft

scenario = {
    "contacts": {
        "range": (200.0, 10e3),
        "range_std": 20.0,
        "bearing_std_deg": 1.5,
        "detection_probability": 0.8,
        "false_per_ping": 5.0,
        "source": (0.0, 0.0),
        "receiver": (0.0, 0.0),
        "x": (-10e3, 10e3),
        "y": (-10e3, 10e3),
        "speed": 10.0,
    },
    "simulation": {
        "pings": 40,
        "interval": 20.0,
        "seed": 4,
        "targets": [
            {"x": -4000.0, "y": 3000.0, "vx": 6.0, "vy": -3.0},
            {"x": -4000.0, "y": 600.0, "vx": 6.0, "vy": 3.0},
        ],
    },
}
contacts = ft.simulate(scenario)
print(f"{len(contacts.ping)} contacts in {contacts.length} pings")

# %%
# Tracks
# ------
# The sum over all that the contacts may mean, and particles that are drawn about them.

result = ft.track(contacts, scenario)
for track in result.tracks:
    speed = np.hypot(track.mean["vx"][-1], track.mean["vy"][-1])
    print(f"track {track.label}: from {track.start_s:.0f} to {track.end_s:.0f} s, {speed:.1f} m/s at the end")

# %%
# What was told and what is believed
# ----------------------------------
# Left all contacts as they came, the later the darker; right the same with the probability that each is a target's, and
# the tracks.

data = result.data
x, y = (1e-3 * data[f"contact_{name}"].values for name in "xy")
time = np.broadcast_to(data.time.values[:, None, None], x.shape)
figure, (told, believed) = plt.subplots(1, 2, figsize=(10, 5.4), sharex=True, sharey=True, layout="constrained")
points = told.scatter(x, y, c=time, s=8, cmap="cividis_r")
figure.colorbar(points, ax=told, location="bottom", label="time (s)", shrink=0.8)
points = believed.scatter(x, y, c=data.association.values, s=8, cmap="cividis_r", vmin=0, vmax=1)
figure.colorbar(points, ax=believed, location="bottom", label="probability that the contact is a target's", shrink=0.8)
for track in result.tracks:
    east, north = 1e-3 * track.mean["x"], 1e-3 * track.mean["y"]
    believed.plot(east, north, color="#D55E00")
    believed.annotate(str(track.label), (east[-1], north[-1]), xytext=(6, 4), textcoords="offset points")
for axes in (told, believed):
    axes.plot(0, 0, "k^", markersize=6)
    axes.set(xlim=(-6, 6), ylim=(-5, 7), xlabel="east (km)", aspect="equal")
told.set_ylabel("north (km)")
