r"""Five targets that meet at the middle of a region, watched by 144 sensors that each report one sum.

The scene is that of the track-before-detect filters of E. S. Davies and A. F. Garcia-Fernandez (*Information exchange
track-before-detect multi-Bernoulli filter for superpositional sensors*, IEEE Transactions on Signal Processing, 2024):

- a region of 120 x 120 m, sensors on a grid of 12 x 12, 10 m apart; a target at the distance d from a sensor adds
  :math:`500 / (d^2 + 25)` to what it reports, noise has the variance 1;
- 81 scans a second apart; nearly constant velocity, acceleration of density 0.5^2 along each axis; a target stays with
  0.99 from scan to scan, and appears with 1e-4 a scan and component of the birth density;
- **births (1)**: one component about the middle, with standard deviations of 32 m and 3.2 m/s. **Births (2)**: five,
  at the true starts rounded to 10 m, with 3.2 m and 3.2 m/s.

`truth.csv` is a draw of such targets. They come between scans 5 and 18, are within a metre of each other at scan 40,
and leave from scan 60 on. Every run has new noise on it."""

import functools
import math
from dataclasses import dataclass
from importlib import resources

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.beliefs.axis import Axis
from faintrack.beliefs.grids import Grid
from faintrack.likelihoods.superposed import SuperposedLikelihood
from faintrack.numerics.draws import normal
from faintrack.sensors.superposed import SensorNetwork, SuperposedScan, inverse_square, picture
from faintrack.targets.births import PlanarBirth
from faintrack.targets.motion import PlanarMotion
from faintrack.targets.states import PlanarState
from faintrack.targets.target import Target, rates
from faintrack.trackers.multi_bernoulli import MultiBernoulliTracker

SIDE, SPACING = 120.0, 10.0
"""Of the region, and between sensors; metres."""

LEVEL, CORE = 500.0, 5.0
"""Of the gain; m^2, m."""

SCANS, BIRTH, SURVIVAL, VELOCITY_NOISE = 81, 1e-4, 0.99, 0.5
"""A second apart; probabilities from scan to scan, of a component of the birth density and of a target; m/s."""

WIDE, NARROW = math.sqrt(1000.0), math.sqrt(10.0)
"""Standard deviations of where a target appears, births (1) and (2), m; NARROW is that of its velocity as well, m/s."""

CELL = 2.5
"""Of the grid on which newborn targets are proposed; metres."""

SLOTS, PARTICLES, SWEEPS, KERNEL = 7, 500, 2, 0.2
"""Of the tracker; sweeps and kernel were chosen on other truths of the same model, the others by their time."""


@dataclass(frozen=True, eq=False)
class Truth:
    """Where the targets are.

    Attributes
    ----------
    x, y : metres; NaN while a target is not there.
    """

    x: Float[np.ndarray, "scan target"]
    y: Float[np.ndarray, "scan target"]


@functools.cache
def truth() -> Truth:
    """The draw that is tracked."""
    with resources.files("faintrack.studies.superposed").joinpath("truth.csv").open() as file:
        table = np.genfromtxt(file, delimiter=",", skip_header=1)
    return Truth(table[:, 1::2], table[:, 2::2])


def network() -> SensorNetwork:
    """The sensors."""
    along = np.arange(SPACING / 2, SIDE, SPACING)
    x, y = (each.ravel() for each in np.meshgrid(along, along))
    return SensorNetwork(jnp.asarray(x, jnp.float32), jnp.asarray(y, jnp.float32), inverse_square(LEVEL, CORE))


def birth(sites: int) -> PlanarBirth:
    """Births (1) or (2), by the number of components: 1 or 5."""
    if sites == 1:
        x, y, wide = np.array([SIDE / 2]), np.array([SIDE / 2]), WIDE
    else:
        whole = truth()
        first = np.isfinite(whole.x).argmax(axis=0)
        targets = np.arange(whole.x.shape[1])
        x, y = np.round(whole.x[first, targets], -1), np.round(whole.y[first, targets], -1)
        wide = NARROW
    still = np.zeros(sites)

    def state(*components: np.ndarray) -> PlanarState:
        return PlanarState(*(jnp.asarray(each, jnp.float32) for each in components))

    return PlanarBirth(state(x, y, still, still), state(still + wide, still + wide, still + NARROW, still + NARROW))


def tracker(sites: int) -> MultiBernoulliTracker:
    """Tracker that knows the scene and the birth density of so many components."""
    target = Target(birth(sites), PlanarMotion(VELOCITY_NOISE), *rates(sites * BIRTH, SURVIVAL, 1.0))
    along = Axis(CELL / 2, CELL, round(SIDE / CELL))
    likelihood = SuperposedLikelihood(network(), Grid(PlanarState, (("x", along), ("y", along))))
    return MultiBernoulliTracker(target, likelihood, SLOTS, PARTICLES, SWEEPS, KERNEL)


def look(key: PRNGKeyArray) -> SuperposedScan:
    """Scans of a run: the sum of what the targets add, and noise; stacked."""
    whole, sensors = truth(), network()
    place = PlanarState(*(jnp.asarray(each, jnp.float32) for each in (whole.x, whole.y, whole.x, whole.y)))
    levels: Float[Array, "scan sensor"] = jnp.nansum(sensors.levels(place), axis=1)
    values = levels + normal(key, levels.shape)
    return jax.vmap(picture)(jnp.arange(1.0, SCANS + 1), values)
