"""
One frame through three likelihoods
===================================

Each likelihood turns the beam power of a frame into one number for every bearing and SNR: how much likelier the frame
is with a source there than without any, as a natural logarithm.
"""

# %%
# One frame
# ---------
# 24 hydrophones, one second, a source at 60 degrees with -20 dB, drawn from the signal model in noise of power 1.

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

from faintrack.likelihoods.lobe_width import lobe_width_likelihood
from faintrack.likelihoods.unknown_noise import UnknownNoise
from faintrack.likelihoods.white_signal import WhiteSignal
from faintrack.sensors.array import line_array
from faintrack.sensors.beams import lobe_width
from faintrack.signal.beamformer import beamformer
from faintrack.simulation.spectra import draw_spectra
from faintrack.targets.states import BearingState

array = line_array(count=24, spacing=1.5)
plan = beamformer(array, sample_rate=1000.0, frame=1.0, band=(50.0, 500.0))
true_deg, true_db = 60.0, -20.0
spectra = draw_spectra(
    jax.random.key(6), array, plan.grid, bearing=jnp.radians(jnp.array([true_deg])), snr_db=jnp.array([true_db])
)
stacked = plan.scan_spectra(jnp.array([0.5]), spectra, usable=jnp.ones((1, 24), bool))
scan = jax.tree.map(lambda field: field[0], stacked)
print(f"{plan.grid.frequency.size} frequencies, {plan.grid.snapshots} snapshots, {plan.grid.beams} beams")

# %%
# States as an open mesh
# ----------------------
# The components of a state broadcast, so that a table over bearing and SNR needs no loop.

bearing_deg, snr_db = np.linspace(0, 180, 361), np.linspace(-35, -10, 101)
states = BearingState(
    bearing=jnp.radians(jnp.asarray(bearing_deg))[:, None],
    bearing_rate=jnp.zeros((1, 1)),
    snr_db=jnp.asarray(snr_db)[None, :],
)
likelihoods = {
    "white signal, noise power 1 known": WhiteSignal(plan.grid, jnp.array(1.0)),
    "white signal, noise power 10 % too low": WhiteSignal(plan.grid, jnp.array(0.9)),
    "noise power integrated out": UnknownNoise(plan.grid, (-35.0, -10.0)),
    "lobe width": lobe_width_likelihood(plan.grid, lobe_width(array, 500.0)),
}
tables = {
    name: np.broadcast_to(likelihood.log_ratio(scan, states), (361, 101)) for name, likelihood in likelihoods.items()
}

# %%
# The tables
# ----------
# Known and unknown noise agree on the place of the source; not to know the noise costs little with this many
# frequencies. A noise power taken too low makes every bearing a source, where the frame has none. The lobe-width ratio
# does not read the SNR.

figure, panels = plt.subplots(2, 2, figsize=(9, 6.5), sharex=True, sharey=True, layout="constrained")
for axes, (name, table) in zip(panels.flat, tables.items(), strict=True):
    mesh = axes.pcolormesh(bearing_deg, snr_db, table.T, cmap="viridis", vmin=-5, vmax=10, rasterized=True)
    axes.contour(bearing_deg, snr_db, table.T, levels=[0.0], colors="white", linewidths=0.8)
    axes.plot(true_deg, true_db, marker="+", color="#E69F00", markersize=12, markeredgewidth=2)
    axes.set_title(name, fontsize=10)
for axes in panels[-1]:
    axes.set_xlabel("bearing from the array axis (degree)")
for axes in panels[:, 0]:
    axes.set_ylabel("SNR at one channel (dB)")
figure.colorbar(mesh, ax=panels, label="log ratio of this frame (nat); white line: 0", extend="both")

# %%
# The best SNR of each bearing
# ----------------------------

figure, axes = plt.subplots(figsize=(8, 3.8), layout="constrained")
styles = (("#0072B2", "-"), ("#D55E00", "--"), ("#009E73", "-."), ("#CC79A7", ":"))
for (name, table), (color, line) in zip(tables.items(), styles, strict=True):
    axes.plot(bearing_deg, table.max(axis=1), color=color, linestyle=line, label=name)
axes.axvline(true_deg, color="black", linewidth=0.8)
axes.set(xlabel="bearing from the array axis (degree)", ylabel="largest log ratio over SNR (nat)")
axes.legend()

plt.show()
