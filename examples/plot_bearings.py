r"""
A target among false bearings
=============================

A detector reports three false bearings in every scan and, nine times in ten, that of a target, if there is one. Nobody
knows which is which. One observer goes east at 10 m/s, another stands still; the target appears after 15 s.
"""

import matplotlib.pyplot as plt
import numpy as np

import faintrack as ft
from faintrack.kinds.bearings.pictures import draw_place, draw_reported

seconds, appears = 60, 15
detector = {"error_deg": 1.0, "detection_probability": 0.9, "false_per_scan": 3.0}
tracking = {
    "bearings": {**detector, "range": [200.0, 3000.0], "speed": 15.0},
    "target": {"arrival_rate": 0.01, "departure_rate": 0.01, "velocity_noise": 0.2},
    "filter": {"particles": 4000, "births": 2000},
}
simulation = {
    "scans": seconds,
    "observers": [{"path": [[0, 0, 0], [seconds, 10 * seconds, 0]]}, {"path": [[0, 1500, -200]]}],
    "targets": [{"x": 780.0, "y": 760.0, "vx": -8.0, "vy": 4.0, "start": appears}],
    "seed": 3,
}

# %%
# Both observers
# --------------
# Their log ratios add. Dark bearings belong to the target with high probability: nothing had to decide which they are.

both = ft.track(ft.simulate(tracking, simulation=simulation), tracking)
figure, (above, below) = plt.subplots(2, 1, figsize=(8, 6), height_ratios=[2.2, 1], sharex=True, layout="constrained")
figure.colorbar(draw_reported(above, both.data), ax=above, label="probability that the\nbearing is the target's")
below.plot(both.data.time, both.data.existence, color="#0072B2")
below.axvline(appears, color="0.6", lw=0.8, ls="--")
below.set(xlabel="time (s); dashed: the target appears", ylabel="existence", ylim=(-0.02, 1.05))

# %%
# One observer, or two
# --------------------
# One that moves knows the direction at once and the range slowly; two know where it is within a few scans. The first
# reports the very same bearings when it is alone.

first = {**simulation, "observers": simulation["observers"][:1]}
one = ft.track(ft.simulate(tracking, simulation=first), tracking)
figure, axes = plt.subplots(1, 2, figsize=(11, 4.6), layout="constrained")
since = np.arange(seconds - appears)
path = np.stack([780 - 8.0 * since, 760 + 4.0 * since], axis=-1)
for axis, result, title in zip(axes, (one, both), ("one observer", "two observers"), strict=True):
    draw_place(axis, result.data)
    axis.plot(*path.T, color="#000000", lw=1, ls=":", label="truth")
    axis.set_title(title)
    axis.legend(fontsize=8)
    held = result.data.label.values[appears:, 0] > 0
    error = np.hypot(result.data.x[appears:, 0] - path[:, 0], result.data.y[appears:, 0] - path[:, 1]).values[held]
    print(f"{title}: declared after {int(held.argmax())} s, mean error of the position {error.mean():.0f} m")
