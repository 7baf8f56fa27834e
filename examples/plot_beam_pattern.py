"""
What an array can tell apart
============================

The beam pattern is the power that a beam steered to one bearing gathers from a plane wave of another. Its main lobe is
how sharply an array points; its other lobes are the directions it mistakes for that one.
"""

# %%
# A line
# ------
# 32 hydrophones, 0.375 m apart: half a wavelength at 2000 Hz. The main lobe narrows with frequency, and its edge is
# where `lobe_width` puts it. Where the spacing exceeds a wavelength, above 4000 Hz, other directions look the same as
# broadside: grating lobes. For waves along the line they begin at 2000 Hz.

import matplotlib.pyplot as plt
import numpy as np

from faintrack.sensors.array import line_array, sensor_array
from faintrack.sensors.beams import lobe_width, steering


def pattern_db(array, frequency, from_deg, to_deg):
    """Power of the beam at `to_deg` for a wave from `from_deg`, over that of the beam pointed right; dB."""
    wave = steering(array, frequency, np.radians(np.atleast_1d(from_deg)))
    beams = steering(array, frequency, np.radians(to_deg))
    power = np.abs(np.sum(beams.conj() * wave, axis=-1)) ** 2 / len(array.gains) ** 2
    return 10 * np.log10(np.maximum(power, 1e-6))


line = line_array(count=32, spacing=0.375)
bearing_deg = np.linspace(0, 180, 1441)
frequency = np.array([500.0, 2000.0, 4500.0])
power_db = pattern_db(line, frequency, 90.0, bearing_deg)

figure, axes = plt.subplots(figsize=(8, 4), layout="constrained")
looks = (("#0072B2", "-"), ("#D55E00", "--"), ("#009E73", ":"))
for row, hertz, (color, style) in zip(power_db, frequency, looks, strict=True):
    width = np.degrees(lobe_width(line, hertz))
    axes.plot(bearing_deg, row, color=color, linestyle=style, label=f"{hertz:.0f} Hz, lobe {width:.1f} degrees")
axes.set(
    xlabel="bearing of the beam, from the array axis (degree)",
    ylabel="power (dB)",
    ylim=(-40, 1),
    title="Line of 32 hydrophones, plane wave from 90 degrees",
)
figure.legend(loc="outside lower center", ncols=3)

# %%
# Steered to its end
# ------------------
# The lobe widens towards the axis, where a small change of bearing hardly changes a delay. What a line hears from one
# side it hears from the other: its bearings end at 0 and 180 degrees.

from_deg = np.linspace(0, 180, 361)
ambiguity = np.array([pattern_db(line, np.array([1500.0]), each, bearing_deg[::4])[0] for each in from_deg])

figure, axes = plt.subplots(figsize=(6.5, 5), layout="constrained")
mesh = axes.pcolormesh(from_deg, bearing_deg[::4], ambiguity.T, cmap="cividis", vmin=-30, vmax=0, rasterized=True)
axes.set(
    xlabel="bearing of the wave (degree)",
    ylabel="bearing of the beam (degree)",
    title="Line of 32 hydrophones, 1500 Hz",
)
figure.colorbar(mesh, label="power (dB)", extend="min")

# %%
# Four microphones in a plane
# ---------------------------
# Any geometry but a line hears the full circle. Four microphones 100 m apart have a broad beam at 1 Hz (345 m long
# waves), and several directions that look alike above 3 Hz.

positions = np.array([[-66.5, -44.5], [-32.5, 77.8], [88.2, -22.1], [10.8, -11.1]])
plane = sensor_array(positions, sound_speed=345.0)
around_deg, frequency = np.linspace(-180, 180, 721), np.linspace(0.5, 5.0, 181)
power_db = pattern_db(plane, frequency, -39.0, around_deg)

figure, axes = plt.subplots(figsize=(8, 4.2), layout="constrained")
mesh = axes.pcolormesh(around_deg, frequency, power_db, cmap="cividis", vmin=-20, vmax=0, rasterized=True)
axes.axvline(-39.0, color="white", linestyle="--", linewidth=1.0)
axes.set(
    xlabel="bearing of the beam (degree, clockwise from north)",
    ylabel="frequency (Hz)",
    title="Four microphones, plane wave from -39 degrees",
)
axes.set_xticks(range(-180, 181, 60))
figure.colorbar(mesh, label="power (dB)", extend="min")

plt.show()
