r"""
Tones beside a loud ship
========================

A line of 16 hydrophones. A ship is heard at all frequencies, and two generators hum below it: one of them alone in its
direction, the other in a third. Nobody says at which frequencies. Each is found and followed in bearing and frequency;
the ship itself has no tone and gives no track.
"""

import numpy as np

import faintrack as ft

scenario = {
    "array": {"sound_speed": 1500.0, "line": {"count": 16, "spacing": 0.75}},
    "analysis": {"band": [100.0, 900.0]},
    "likelihood": {"kind": "tone"},
    "simulation": {
        "duration": 60.0,
        "sample_rate": 2000.0,
        "sources": [
            {"snr_db": 0.0, "bearing_deg": 40.0, "bearing_rate_deg": 0.1},
            {"tone": 317.6, "snr_db": -24.0, "bearing_deg": 70.0, "bearing_rate_deg": 0.3, "start": 5.0},
            {"tone": 318.9, "snr_db": -5.0, "bearing_deg": 130.0, "bearing_rate_deg": -0.2, "start": 15.0},
        ],
    },
}
result = ft.track(ft.simulate(scenario), scenario)
for track in result.tracks:
    frequency, bearing = (float(track.mean[name][-1]) for name in ("frequency", "bearing"))
    print(f"track {track.label} from {track.start_s:g} s: {frequency:.2f} Hz at {bearing:.1f} degrees at the end")

# %%
# The record shows the loudest tone of every beam over the noise around it; frequencies are told to a tenth of a bin.

figure = result.plot()
off = {track.label: np.min(np.abs(track.mean["frequency"][-1] - np.array([317.6, 318.9]))) for track in result.tracks}
print("error at the end, Hz:", {label: round(float(value), 3) for label, value in off.items()})
