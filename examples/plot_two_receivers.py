r"""
Two receivers of one sonar
==========================

A source and two receivers hear one target. Each receiver alone puts it somewhere along a piece of an ellipse; where
the pieces cross it is. What a cell of the grid needs is the mean of the *product* of both ratios over the cell. Adding
the logs of both means finds a target wherever two returns pass through one cell, whether they cross in it or not.
"""

import math

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

from faintrack.beliefs.axis import Axis, between
from faintrack.beliefs.grids import Grid
from faintrack.likelihoods.exceedances import ExceedanceLikelihood
from faintrack.likelihoods.guided import Guided
from faintrack.likelihoods.multistatic import Multistatic
from faintrack.sensors.active import ActiveSonar, Pulse
from faintrack.sensors.bistatic import Bistatic, fixed
from faintrack.sensors.multistatic import Pings
from faintrack.simulation.active import capacity_for, draw_ping
from faintrack.targets.states import PlanarState

source, target = fixed(0.0, 0.0), fixed(-8000.0, 12_000.0)
receivers = fixed(0.0, 5000.0), fixed(6000.0, -2000.0)
place = between(-24e3, 24e3, 37)
grid = Grid(PlanarState, (("x", place), ("y", place)))
pulse = Pulse(frequency=2350.0, duration=1.0, bandwidth=400.0, factor=1.0)
delay = Axis(4.334, 29.717 / 18000, 18000)

guided, pings = [], []
for number, receiver in enumerate(receivers):
    sonar = ActiveSonar(pulse, delay, 72, math.radians(5), None, Bistatic(source, receiver))
    likelihood = ExceedanceLikelihood(sonar, snr=10**0.95, threshold=10.0)
    ping, _ = draw_ping(jax.random.key(number), likelihood, capacity_for(likelihood), jnp.array(0.0), target, True)
    guided.append(Guided(likelihood, grid))
    pings.append(ping)
    print(f"receiver {number + 1}: {int(ping.there.sum())} returns")

# %%
# One ping
# --------
# Log of the mean ratio of every cell, below that of the highest: each receiver alone, both together, and the sum of the
# logs of both.

alone = [np.asarray(each.log_mean_ratio(ping)) for each, ping in zip(guided, pings, strict=True)]
both = np.asarray(Multistatic(guided).log_mean_ratio(Pings(jnp.array(0.0), tuple(pings), jnp.array([True, True]))))

figure, axes = plt.subplots(2, 2, figsize=(8, 7.4), sharex=True, sharey=True, layout="constrained")
titles = "receiver 1", "receiver 2", "mean of the product", "sum of the log means"
for axis, values, title in zip(axes.flat, (*alone, both, sum(alone)), titles, strict=True):
    image = axis.imshow(
        (values - values.max()).T, origin="lower", extent=(-24, 24, -24, 24), cmap="cividis", vmin=-80, vmax=0
    )
    axis.plot(target.x / 1e3, target.y / 1e3, "o", ms=14, mfc="none", color="#D55E00")
    for receiver in receivers:
        axis.plot(receiver.x / 1e3, receiver.y / 1e3, "wv", ms=5)
    axis.plot(source.x / 1e3, source.y / 1e3, "w^", ms=5)
    axis.set_title(title, fontsize=10)
    axis.set(xlim=(-20, 8), ylim=(-4, 22))
figure.supxlabel("east (km)")
figure.supylabel("north (km)")
figure.colorbar(image, ax=axes, label="log of the mean ratio below the highest (nats)", shrink=0.7)

# %%
# Where the target is said to be
# ------------------------------
# Cells within 20 nats of the highest: those that a tracker would have to tell apart by later pings.

for name, values in zip(titles, (*alone, both, sum(alone)), strict=True):
    print(f"{name}: {int((values > values.max() - 20).sum())} cells within 20 nats of the highest")
print(f"the sum is above the mean of the product by up to {float((sum(alone) - both).max()):.0f} nats")
