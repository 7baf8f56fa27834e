r"""
A target among false bearings
=============================

A detector reports three false bearings in every scan and, nine times in ten, that of a target, if there is one. Nobody
knows which is which. One observer goes east at 10 m/s, another stands still; the target appears after 15 s.
"""

import matplotlib.pyplot as plt
import numpy as np

from faintrack.data.bearings import from_columns
from faintrack.kinds.session_bearings import track_bearings
from faintrack.plots.bearings import draw_heard, draw_place
from faintrack.scenario import Scenario

rng, seconds, appears = np.random.default_rng(3), 60, 15


def target(time: float) -> tuple[float, float]:
    """Where it is; m."""
    return 900 - 8.0 * time, 700 + 4.0 * time


rows = []
for time in range(seconds):
    for number, (x, y) in enumerate([(10.0 * time, 0.0), (1500.0, -200.0)]):
        east, north = target(time)[0] - x, target(time)[1] - y
        heard = [np.degrees(np.arctan2(east, north)) + rng.normal()] if time >= appears and rng.random() < 0.9 else []
        for bearing in [*heard, *rng.uniform(0, 360, rng.poisson(3))] or [np.nan]:
            rows.append((time, bearing % 360, x, y, number))
names = ("time_s", "bearing_deg", "observer_x_m", "observer_y_m", "observer")
columns = dict(zip(names, np.array(rows).T, strict=True))
scenario = Scenario.model_validate(
    {
        "bearings": {
            "error_deg": 1.0,
            "detection_probability": 0.9,
            "false_per_scan": 3.0,
            "range": [200.0, 3000.0],
            "speed": 15.0,
        },
        "target": {"arrival_rate": 0.01, "departure_rate": 0.01, "velocity_noise": 0.2},
        "filter": {"particles": 4000, "births": 2000},
    }
)

# %%
# Both observers
# --------------
# Their log ratios add. Dark bearings belong to the target with high probability: nothing had to decide which they are.

both = track_bearings(from_columns(columns), scenario)
figure, (above, below) = plt.subplots(2, 1, figsize=(8, 6), height_ratios=[2.2, 1], sharex=True, layout="constrained")
figure.colorbar(draw_heard(above, both.data), ax=above, label="probability that the\nbearing is the target's")
below.plot(both.data.time, both.existence, color="#0072B2")
below.axvline(appears, color="0.6", lw=0.8, ls="--")
below.set(xlabel="time (s); dashed: the target appears", ylabel="existence", ylim=(-0.02, 1.05))

# %%
# One observer, or two
# --------------------
# One that moves knows the direction at once and the range slowly; two know where it is within a few scans.

first = columns["observer"] == 0
one = track_bearings(from_columns({name: columns[name][first] for name in names[:4]}), scenario)
figure, axes = plt.subplots(1, 2, figsize=(11, 4.6), layout="constrained")
path = np.array([target(time) for time in range(appears, seconds)])
for axis, result, title in zip(axes, (one, both), ("one observer", "two observers"), strict=True):
    draw_place(axis, result.data)
    axis.plot(*path.T, color="#000000", lw=1, ls=":", label="truth")
    axis.set_title(title)
    axis.legend(fontsize=8)
    held = result.data.label.values[appears:] > 0
    error = np.hypot(result.data.x_mean[appears:] - path[:, 0], result.data.y_mean[appears:] - path[:, 1]).values[held]
    print(f"{title}: declared after {int(held.argmax())} s, mean error of the position {error.mean():.0f} m")
