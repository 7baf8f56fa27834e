"""
Noise power: held fixed, or integrated out
==========================================

The white signal likelihood needs the power of the noise. In a simulation it is known. In the open it rises and falls
with wind and traffic, and a level measured a few minutes ago is wrong by more than a faint source adds. This page runs
one recording twice: with the noise power measured over the first minute and then held, and with the noise power of
every frequency and frame integrated out.
"""

# %%
# The recording
# -------------
# Four infrasound microphones, twenty minutes, two sources that come and go: near -110 degrees (570 to 800 s) and near
# -39 degrees (415 to 435 s and 805 to 900 s). It belongs to others, so it is not part of this project. Where it is
# absent, four microphones in simulated coloured noise take its place, with a level that rises by 16 dB and falls again.

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import faintrack as ft
from faintrack.simulation.samples import Source, draw_samples

positions = np.array([[-66.5, -44.5], [-32.5, 77.8], [88.2, -22.1], [10.8, -11.1]])
array = ft.sensor_array(positions, sound_speed=345.0, channel_names=("BRP1", "BRP2", "BRP3", "BRP4"))

folders = (folder / "shared/data/infrasound_array" for folder in Path.cwd().parents)
folder = next((folder for folder in folders if folder.exists()), None)
if folder is not None:
    recording = ft.read(*(folder / f"YJ.{name}..EDF.SAC" for name in array.channel_names))
    sources_deg, source_times = (-110.0, -39.0), ((415, 435), (570, 800), (805, 900))
else:
    print("The infrasound recording is not here: drawing simulated noise that drifts instead.")
    source = Source(snr_db=0.0, bearing=np.radians(-110.0), start=570.0, end=800.0)
    drawn = draw_samples(array, [source], duration=1200.0, sample_rate=100.0, noise_slope_db=-6.0)
    samples = np.concatenate(list(drawn))
    level_db = 8.0 * np.sin(2 * np.pi * np.arange(len(samples)) / len(samples) - np.pi / 2)
    recording = ft.from_samples(samples * 10 ** (level_db[:, None] / 20), 100.0)
    sources_deg, source_times = (-110.0,), ((570, 800),)

# %%
# Two runs that differ in one section
# -----------------------------------

scenario = ft.Scenario(array=array, analysis={"band": [0.5, 2.5], "frame": 5.0})
fixed = {"kind": "known_noise", "noise_seconds": 60.0}
results = {
    "noise power held from the first minute": ft.track(recording, scenario, likelihood=fixed),
    "noise power integrated out": ft.track(recording, scenario),
}

# %%
# What do they say of the time without a strong source?

time = results["noise power integrated out"].data.time.values
quiet = ~np.any([(time > start - 25) & (time < end + 60) for start, end in source_times], axis=0)
for name, result in results.items():
    evidence = result.data.log_evidence.values[quiet]
    print(
        f"{name}: tracks: {len(result.tracks)}; log evidence of the {quiet.sum()} frames without a strong "
        f"source: mean {evidence.mean():.1f}, largest {evidence.max():.1f}"
    )

# %%
# Why
# ---
# Above, the power of a channel in the band: it changes by far more than a faint source would. In the middle, what each
# frame says for a target. Where the level rises above that of the first minute, the fixed likelihood takes noise for a
# source, in a direction that the next frame does not confirm. Below, the tracks; grey lines mark the bearings of the
# strong sources. Early tracks of the integrated likelihood in the infrasound come from a weak arrival near the second
# line, late ones from one near north.

figure, (power_axes, evidence_axes, bearing_axes) = plt.subplots(
    3, 1, figsize=(8, 8), sharex=True, height_ratios=[1, 1.3, 1.6], layout="constrained"
)
frame = round(5.0 * recording.sample_rate)
frequency = np.fft.rfftfreq(frame, 1 / recording.sample_rate)
band = (frequency >= 0.5) & (frequency <= 2.5)
spectra = [np.fft.rfft(block, axis=0)[band] for block in recording.blocks(frame) if len(block) == frame]
power_db = 10 * np.log10([np.mean(np.abs(spectrum) ** 2) for spectrum in spectra])
power_axes.plot(time, power_db - power_db[time < 60].mean(), color="black", linewidth=0.8)
power_axes.axhline(0.0, color="#999999", linewidth=0.8)
power_axes.set(ylabel="power in band over\nits first minute (dB)")

style = {
    "noise power held from the first minute": {"color": "#D55E00", "marker": "x", "markersize": 4},
    "noise power integrated out": {"color": "#0072B2", "marker": "o", "markersize": 2.5},
}
for name, result in results.items():
    evidence_axes.plot(time, result.data.log_evidence, linewidth=0.9, color=style[name]["color"])
    data = result.data.isel(slot=0)
    bearing_axes.plot(time, data.bearing.where(data.label > 0), linestyle="none", label=name, **style[name])
evidence_axes.set_yscale("symlog", linthresh=1.0)
evidence_axes.set(ylabel="log evidence of\neach frame (nat)")
for known in sources_deg:
    bearing_axes.axhline(known, color="#999999", linewidth=0.8, zorder=0)
bearing_axes.set(
    xlabel="time (s)", ylabel="bearing of the track in hand\n(degree, clockwise from north)", ylim=(-180, 180)
)
bearing_axes.set_yticks(range(-180, 181, 60))
figure.legend(*bearing_axes.get_legend_handles_labels(), loc="outside upper center", ncols=2)

plt.show()
