"""
A target of one pixel
=====================

The TENET example (stone2002, section 4.3): 61 x 61 Rayleigh pixels, a target that raises one of them, and 100,000
points that wait to be told where it is. A single frame says next to nothing: with 3721 pixels of noise the brightest is
seldom the target. Eleven frames leave no doubt.
"""

# %%
# The sensor and the target
# -------------------------
# There are ten pixels to the unit length. The target starts at the origin with a velocity of 0.2 units a scan and
# hardly turns; the tracker knows neither.

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

from faintrack.beliefs.axis import Axis
from faintrack.filters.bernoulli_particle import BernoulliParticleFilter
from faintrack.filters.run import run
from faintrack.likelihoods.cells import CellLikelihood, rayleigh
from faintrack.sensors.cells import Cells, cell_surface
from faintrack.simulation.cells import draw_scans
from faintrack.targets.motion import PlanarMotion
from faintrack.targets.states import PlanarState
from faintrack.targets.target import Target, UniformBirth

SNR, SCANS, POINTS = 10.9, 11, 100_000
pixels = Cells((("y", Axis(-3.0, 0.1, 61)), ("x", Axis(-1.5, 0.1, 61))))
likelihood = CellLikelihood(pixels, rayleigh, SNR)
motion = PlanarMotion(velocity_noise=np.sqrt(5e-4))


def advance(state, key):
    return motion.move(state, 1.0, key), state


origin = PlanarState(*(jnp.array(value) for value in (0.0, 0.0, 0.2, 0.0)))
_, truth = jax.lax.scan(advance, origin, jax.random.split(jax.random.key(7), SCANS))
scans = draw_scans(jax.random.key(107), likelihood, jnp.arange(float(SCANS)), truth, jnp.ones(SCANS, bool))

# %%
# Points, and what each scan tells them
# -------------------------------------
# A target is there with probability 0.1, so that every point begins with a likelihood ratio of 1.11e-6.


def corner(*values):
    return PlanarState(*(jnp.array(value) for value in values))


birth = UniformBirth(corner(-1.5, -3.0, -0.5, -0.6), corner(4.5, 3.0, 0.7, 0.6))
target = Target(birth, motion, arrival_rate=0.0, departure_rate=0.0)


velocity_cells = Cells((("vy", Axis(-0.6, 0.03, 41)), ("vx", Axis(-0.5, 0.03, 41))))


def kept(belief):
    """Log likelihood ratio of the pixels and of cells of velocity, and the log odds."""
    return cell_surface(belief, pixels), cell_surface(belief, velocity_cells), belief.log_odds


filter = BernoulliParticleFilter(target, POINTS, births=1)
start = jax.jit(lambda key: filter.init(key, existence=0.1))(jax.random.key(1))
_, found, _ = run(filter, likelihood, scans, jax.random.key(10), kept, start)
truth, (places, velocities, log_odds) = jax.tree.map(np.asarray, (truth, found))
for scan, odds in enumerate(log_odds):
    print(f"scan {scan:2d}: probability of a target {1 / (1 + np.exp(-odds)):.4f}")

# %%
# Place and velocity peak together
# --------------------------------
# The log likelihood ratio of each pixel and of each cell of velocity, summed over the other. The star is where the
# target truly is. What stone2002 shows as figures 11 to 20.
#
# It is one draw, as there. With 27 points to a pixel, each with a velocity of its own, one loud scan leaves the
# offspring of a few; where none of them moves as the target does, the evidence stays and the target is lost. That
# happens in more than half of all draws. A grid has a weight for every velocity and cannot lose any: see the study
# `stone2002`.

LOWEST = -14.0
shown = (0, 2, 4, 8)
figure, axes = plt.subplots(2, len(shown), figsize=(11, 5.6), layout="constrained")
for column, scan in enumerate(shown):
    for row, (surfaces, cells, at, unit) in enumerate(
        (
            (places, pixels, (truth.x, truth.y), "position"),
            (velocities, velocity_cells, (truth.vx, truth.vy), "velocity"),
        )
    ):
        panel, (down, across) = axes[row, column], (axis for _, axis in cells.axes)
        extent = (across.edges[0], across.edges[-1], down.edges[0], down.edges[-1])
        image = panel.imshow(
            np.maximum(surfaces[scan], LOWEST),
            origin="lower",
            extent=extent,
            cmap="cividis",
            vmin=LOWEST,
            vmax=30,
            aspect="equal",
        )
        panel.plot(at[0][scan], at[1][scan], marker="*", color="white", markeredgecolor="black", markersize=12)
        panel.set(xlabel=f"x {unit}", title=f"scan {scan}" if row == 0 else None)
    axes[0, 0].set_ylabel("y position")
    axes[1, 0].set_ylabel("y velocity")
figure.colorbar(image, ax=axes, label="log likelihood ratio, target in the cell to no target")
plt.show()
