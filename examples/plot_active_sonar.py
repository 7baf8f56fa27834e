r"""
A target below the threshold of an active sonar
===============================================

The example of Aughenbaugh and La Cour (2010): a source and a receiver 5 km apart, a ping every three minutes, a target
whose mean echo is weaker than the threshold above which returns are reported. It comes into view at 25 km, crosses the
zone around the sonar where echoes are blanked, and leaves on the other side.
"""

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

from faintrack.beliefs.belief import mode
from faintrack.filters.run import run
from faintrack.studies.aughenbaugh2010 import runs, scene
from faintrack.targets.states import PlanarState

pings, _ = jax.jit(scene.pings, static_argnums=1)(jax.random.key(5), "fm")
sonar, truth = scene.likelihood("fm").sonar, scene.truth()
pair = sonar.pair
print(f"{int(pings.there.sum(axis=1).mean())} returns a ping out of {sonar.size:,} bins")

# %%
# What the sonar reports
# ----------------------
# All returns of all pings, where their delay and bearing put them. The target is among them.

delay = sonar.delay.first + sonar.delay.step * pings.bins[..., 0]
east, north = pair.position(delay, pings.bins[..., 1] * sonar.beam_step)
there = np.asarray(pings.there)


def draw_map(axis: plt.Axes) -> None:
    """Sonar, and the ends of what it hears."""
    place = jnp.linspace(-scene.POSITION, scene.POSITION, 300)
    states = PlanarState(place[None, :], place[:, None], jnp.zeros(()), jnp.zeros(()))
    levels = [scene.BLANKED, scene.LAST]
    axis.contour(place / 1e3, place / 1e3, pair.echo(states)[0], levels, colors="0.5", linewidths=1)
    axis.plot(pair.source.x / 1e3, pair.source.y / 1e3, "k^", ms=6, label="source")
    axis.plot(pair.receiver.x / 1e3, pair.receiver.y / 1e3, "kv", ms=6, label="receiver")
    axis.set(xlabel="east (km)", ylabel="north (km)", xlim=(-33, 33), ylim=(-33, 33), aspect="equal")


figure, axis = plt.subplots(figsize=(5.4, 5), layout="constrained")
axis.plot(np.asarray(east)[there] / 1e3, np.asarray(north)[there] / 1e3, ".", ms=1.5, color="#0072B2", label="returns")
axis.plot(truth.x / 1e3, truth.y / 1e3, color="#D55E00", lw=1.2, label="target")
draw_map(axis)
axis.legend(fontsize=8, loc="lower left")

# %%
# Track before detect
# -------------------
# A grid of 51 x 51 positions and 7 x 7 velocities. Every ping is taken in through the mean likelihood ratio of each
# cell, sampled near the returns only.

filter, likelihood = scene.filter_on(scene.BASE), runs.guided("fm", scene.BASE)
start = filter.init(jax.random.key(0), existence=0.5)
_, (existence, best), _ = run(
    filter, likelihood, pings, jax.random.key(0), lambda belief: (belief.existence, mode(belief)), start
)
samples = jax.vmap(likelihood.samples)(pings)
print(f"{int(samples.mean()):,} points a ping, for {filter.grid.size:,} cells")

figure, (above, below) = plt.subplots(2, 1, figsize=(7, 7.6), height_ratios=[1, 3.2], layout="constrained")
scan = np.arange(1, scene.SCANS + 1)
for number in scan[~scene.in_view("fm")]:
    above.axvspan(number - 0.5, number + 0.5, color="0.88", lw=0)
above.plot(scan, existence, color="#0072B2")
above.set(xlabel="ping (grey: the target cannot be heard)", ylabel="target probability", xlim=(1, scene.SCANS))
held = np.asarray(existence) > 0.9
below.plot(truth.x / 1e3, truth.y / 1e3, color="#D55E00", lw=1.2, label="target")
below.plot(best.x[held] / 1e3, best.y[held] / 1e3, "o", ms=5, mfc="none", color="#0072B2", label="likeliest cell")
draw_map(below)
below.legend(fontsize=8, loc="lower left")

# %%
# How well it does
# ----------------

seen = scene.in_view("fm")
error = np.hypot(best.x - truth.x, best.y - truth.y) / 1e3
print(f"first in view at ping {scan[seen][0]}, declared at ping {scan[np.asarray(existence) > 0.9][0]}")
print(f"mean error at pings 14 to 29: {error[13:29].mean():.2f} km; a cell is 1.29 km wide")
print(f"lowest target probability while blanked: {np.asarray(existence)[scene.blanked('fm')].min():.2f}")
