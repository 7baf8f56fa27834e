"""
A source too quiet to see
=========================

A line of 24 hydrophones listens for three minutes. After one minute a source appears, 27 dB below the noise at each
hydrophone, and turns slowly. No single second shows it; the sum of what all the seconds say does.
"""

# %%
# Draw the recording
# ------------------
# `draw_samples` delays the source's waveform to each hydrophone and adds noise. Everything later sees samples only.

import matplotlib.pyplot as plt
import numpy as np

import faintrack as ft
from faintrack.simulation.samples import Source, draw_samples

array = ft.line_array(count=24, spacing=1.5)
source = Source(snr_db=-27.0, bearing=np.radians(70.0), bearing_rate=np.radians(0.15), start=60.0)
samples = np.concatenate(list(draw_samples(array, [source], duration=180.0, sample_rate=1000.0, seed=2)))
recording = ft.from_samples(samples, sample_rate=1000.0)
print(f"{recording.duration:.0f} s, {recording.channels} channels at {recording.sample_rate:.0f} Hz")

# %%
# Track it
# --------
# Nothing is told about the noise, the source, or when it appears.

result = ft.track(recording, array=array, analysis={"band": [50.0, 500.0], "frame": 1.0})
for track in result.tracks:
    print(
        f"track {track.label}: {track.start_s:.1f} to {track.end_s:.1f} s, {track.average('bearing'):.1f} "
        f"± {track.std['bearing'].mean():.1f} degrees, SNR {track.average('snr_db'):.1f} dB"
    )

# %%
# The bearing-time record
# -----------------------
# Power of every beam in every second. The dashed line is where the source truly is.

time = result.data.time.values
true_bearing = np.where(time >= source.start, np.degrees(source.bearing_at(time)), np.nan)

figure, axes = plt.subplots(figsize=(8, 4.5), layout="constrained")
mesh = axes.pcolormesh(result.data.beam, time, result.data.record, cmap="cividis", shading="nearest", rasterized=True)
axes.plot(true_bearing, time, color="white", linestyle="--", linewidth=1.2, label="true bearing")
axes.set(xlabel="bearing from the array axis (degree)", ylabel="time (s)", title="Bearing-time record")
axes.invert_yaxis()
axes.legend(loc="upper right", facecolor="#444444", labelcolor="white")
figure.colorbar(mesh, label="beam power over\nsum of channel powers (dB)")

# %%
# One second of it
# ----------------
# The loudest beam of a single second is a guess, mostly a wrong one: a tracker fed with one detection a second would
# start from these.

loudest = result.data.beam.values[result.data.record.argmax("beam").values]
close = np.abs(loudest - true_bearing)[time >= source.start] < 3.0
print(f"the loudest beam lies within 3 degrees of the source in {close.mean():.0%} of its seconds")

# %%
# What the tracker believes
# -------------------------
# Existence stays low for the first minute and rises as evidence adds up. The band around the bearing is one standard
# deviation to either side.

figure, (above, below) = plt.subplots(2, 1, figsize=(8, 5.5), sharex=True, layout="constrained")
above.plot(time, result.data.existence.isel(slot=0), color="#0072B2")
above.axhline(result.scenario.tracker.declare, color="#D55E00", linestyle=":", label="threshold to declare")
above.axvline(source.start, color="black", linewidth=0.8, linestyle="--", label="source appears")
above.set(ylabel="existence (probability)", ylim=(-0.03, 1.05))
above.legend(loc="center left")

for track in result.tracks:
    bearing, deviation = track.mean["bearing"], track.std["bearing"]
    below.fill_between(track.time, bearing - deviation, bearing + deviation, color="#56B4E9", alpha=0.5, linewidth=0)
    below.plot(track.time, bearing, color="#0072B2", label=f"track {track.label}")
below.plot(time, true_bearing, color="black", linestyle="--", linewidth=1.0, label="truth")
below.set(xlabel="time (s)", ylabel="bearing from the axis (degree)")
below.legend(loc="upper left")

plt.show()
