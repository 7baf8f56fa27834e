r"""
A wave from above
=================

Eight microphones within 150 m, infrasound from 1 to 8 Hz, and a source that climbs from the horizon. Its wave crosses
the array faster the higher it stands, from 60 degrees at twice the speed of sound. Taken for level, its track drifts
off on the way up, and another begins where nothing is. With the elevation in the state it stays at its bearing, and the
trace velocity is part of the result.
"""

import matplotlib.pyplot as plt
import numpy as np

import faintrack as ft

PLACES = [(0, 0), (5, 71), (55, 38), (62, -22), (18, -66), (-38, -60), (-70, 4), (-45, 51)]
SOUND, BEARING, STEP = 340.0, 123.0, 60.0
CLIMB = [0.0, 15.0, 30.0, 45.0, 60.0, 70.0]
SCENARIO = {
    "array": ft.sensor_array(np.array(PLACES, float), SOUND),
    "analysis": {"band": [1.0, 8.0], "frame": 10.0},
    "target": {"elevation_noise_deg": 0.5},
    "simulation": {
        "duration": STEP * len(CLIMB),
        "sample_rate": 50.0,
        "sources": [
            {
                "snr_db": 8.0,
                "bearing_deg": BEARING,
                "elevation_deg": above,
                "start": STEP * number,
                "end": STEP * number + STEP,
            }
            for number, above in enumerate(CLIMB)
        ],
    },
}
recording = ft.simulate(SCENARIO)
level = ft.track(recording, SCENARIO)
raised = ft.track(recording, SCENARIO, target={"elevation_deg": [0.0, 80.0]})

# %%
# What the report says where the wave is taken for level
# ------------------------------------------------------

for remark in level.misfits:
    print(remark)

# %%
# Both ways
# ---------

figure, (bearing, elevation, speed) = plt.subplots(3, 1, figsize=(9, 8), sharex=True, layout="constrained")
for result, colour, name in ((level, "#D55E00", "taken for level"), (raised, "#0072B2", "elevation in the state")):
    for number, track in enumerate(result.tracks):
        error = track.std["bearing"]
        off = (track.mean["bearing"] - BEARING + 180) % 360 - 180
        label = name if number == 0 else None
        bearing.errorbar(track.time, off, 3 * error, fmt="o", ms=4, lw=1, color=colour, label=label)
bearing.axhline(0, color="0.4", lw=0.8)
bearing.set(ylabel="bearing less the true one\n(degrees, 3 deviations)", ylim=(-180, 180), yticks=range(-180, 181, 90))
bearing.legend(fontsize=8, loc="lower left")
time = STEP * np.arange(len(CLIMB) + 1)
for axis, name, truth in (
    (elevation, "elevation", np.array(CLIMB)),
    (speed, "trace_velocity", SOUND / np.cos(np.radians(CLIMB))),
):
    axis.stairs(truth, time, color="0.4", baseline=None, label="true")
    for track in raised.tracks:
        axis.errorbar(track.time, track.mean[name], 3 * track.std[name], fmt="o", ms=4, lw=1, color="#0072B2")
elevation.set(ylabel="elevation (degrees)", ylim=(0, 90))
speed.set(ylabel="trace velocity (m/s)", xlabel="time from the start of the recording (s)")
for axis in (bearing, elevation, speed):
    axis.grid(alpha=0.3)
for name, result in (("taken for level", level), ("elevation in the state", raised)):
    off = [(track.mean["bearing"] - BEARING + 180) % 360 - 180 for track in result.tracks]
    inside = np.concatenate([np.abs(o) < 3 * track.std["bearing"] for o, track in zip(off, result.tracks, strict=True)])
    print(f"{name}: {len(off)} tracks, {inside.sum()} of {len(inside)} frames within 3 deviations of the bearing")
