r"""
Lines of a ship: LOFAR and DEMON
================================

Two minutes of one hydrophone: sea noise that falls with frequency, three tones of an engine, and cavitation that a
propeller of four blades modulates. The tones stand in the spectrum (LOFAR); shaft and blades stand only in the spectrum
of the envelope (DEMON).
"""

import matplotlib.pyplot as plt
import numpy as np

import faintrack as ft
from faintrack.results.lofargrams import draw_lofargram, line_rows
from faintrack.signal.demon import demon
from faintrack.signal.lofar import lofar

rate, seconds, engine, shaft = 4000.0, 120.0, 24.0, 2.5
time = np.arange(int(rate * seconds)) / rate
rng = np.random.default_rng(0)

spectrum = np.fft.rfft(rng.normal(size=len(time)))
frequency = np.fft.rfftfreq(len(time), 1 / rate)
sea = np.fft.irfft(spectrum * np.sqrt(100.0 / (100.0 + frequency)), len(time))
tones = sum(0.06 * np.sin(2 * np.pi * engine * number * time + number) for number in (2, 3, 4))
blades = 0.1 * np.cos(2 * np.pi * shaft * time) + 0.3 * np.cos(2 * np.pi * 4 * shaft * time)
cavitation = 0.4 * rng.normal(size=len(time)) * (1 + blades)
recording = ft.from_samples((sea + tones + cavitation)[:, None], rate)

# %%
# The spectrum
# ------------
# Levels over a background that follows the slope of the sea; the engine's harmonics are one series.

record = lofar(recording, band=(10.0, 200.0), resolution=0.25, interval=2.0)
for row in line_rows(record.lines):
    print("{:>9} Hz {:>6} dB   of {:>7} Hz, number {}".format(*row))
figure = draw_lofargram(record, "LOFAR", plt.figure(figsize=(9, 7), layout="constrained"))

# %%
# The envelope
# ------------
# Of the noise from 500 to 1800 Hz: the blades' rate is the fourth harmonic of the shaft's.

record = demon(recording, band=(500.0, 1800.0), highest=30.0, resolution=0.1, interval=10.0)
for row in line_rows(record.lines):
    print("{:>9} Hz {:>6} dB   of {:>7} Hz, number {}".format(*row))
figure = draw_lofargram(record, "DEMON", plt.figure(figsize=(9, 7), layout="constrained"))
