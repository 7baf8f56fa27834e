"""
A faint source beside a loud one
================================

Three sources at once: one as loud as the noise, one 18 dB below it, one that appears after half a minute. One belief of
one target follows the loudest alone. With the loud ones as part of the background the faint ones are heard beside them.
"""

# %%
# Draw the recording
# ------------------
# Sixteen hydrophones in a line. Nothing but positions is told.

import matplotlib.pyplot as plt
import numpy as np

import faintrack as ft
from faintrack.simulation.samples import Source, draw_samples

array = ft.line_array(count=16, spacing=1.5)
sources = [
    Source(snr_db=0.0, bearing=np.radians(60.0), bearing_rate=np.radians(0.2)),
    Source(snr_db=-18.0, bearing=np.radians(110.0)),
    Source(snr_db=-12.0, bearing=np.radians(40.0), start=30.0),
]
samples = np.concatenate(list(draw_samples(array, sources, duration=60.0, sample_rate=1000.0, seed=4)))
recording = ft.from_samples(samples, sample_rate=1000.0)
band = {"band": [50.0, 450.0]}

# %%
# One target, and several
# -----------------------
# `tracker.targets = 1` is the Bernoulli filter of the papers.

one = ft.track(recording, array=array, analysis=band, tracker={"targets": 1})
several = ft.track(recording, array=array, analysis=band)
for name, result in (("one", one), ("several", several)):
    for track in result.tracks:
        print(
            f"{name}: track {track.label}, {track.start_s:.1f} to {track.end_s:.1f} s, {track.average('bearing'):.1f}°"
        )

# %%
# Tracks over the bearing-time record
# -----------------------------------
# Dashed are the true bearings. A band is two standard deviations to either side.

figure, axes = plt.subplots(1, 2, figsize=(9, 4.5), sharey=True, layout="constrained")
for ax, (title, result) in zip(axes, (("one target", one), ("several", several)), strict=True):
    time = result.data.time.values
    mesh = ax.pcolormesh(
        result.data.beam, time, result.data.record, cmap="cividis", shading="nearest", rasterized=True, vmax=6
    )
    for source in sources:
        heard = time >= source.start
        ax.plot(np.degrees(source.bearing_at(time[heard])), time[heard], color="white", linestyle="--", linewidth=1)
    for track in result.tracks:
        middle, spread = track.mean["bearing"], 2 * track.std["bearing"]
        (line,) = ax.plot(middle, track.time, linewidth=1.6, label=f"track {track.label}")
        ax.fill_betweenx(track.time, middle - spread, middle + spread, color=line.get_color(), alpha=0.3)
    ax.set(xlabel="bearing from the array axis (degree)", title=title)
    ax.legend(loc="lower right", facecolor="#444444", labelcolor="white")
axes[0].set_ylabel("time (s)")
axes[0].invert_yaxis()
figure.colorbar(mesh, ax=axes, label="beam power over\nsum of channel powers (dB)")

# %%
# A channel with its poles reversed
# ---------------------------------
# One such channel hides part of every source and turns its bearing. The run looks whether the array would hear a
# source much better with a channel changed, and says which.

wrong = samples.copy()
wrong[:, 5] *= -1
reversed_one = ft.track(ft.from_samples(wrong, sample_rate=1000.0), array=array, analysis=band)
print(*reversed_one.misfits, sep="\n")
