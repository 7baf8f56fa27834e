r"""The simple simulation (stone2002, section 4.1): one target in 100 cells, nine velocities, 16 scans.

The grid goes so far beyond the sensor that no target leaves it, as in the paper, where positions have no end. The
likelihood ratio of all scans up to one is then the sum of the surface over the grid divided by the prior odds, exactly,
and false-alarm probabilities follow from draws with a target (`faintrack.metrics.change_of_measure`).

Three kinds of target: `straight`, the paper's, from cell 30 at one cell a scan without plant noise; `modelled`, drawn
from the prior and the motion model; `ending`, drawn from the model given where it is at last.

A target in a cell beside the sensor spills over into it; the paper leaves open whether it does.
"""

import functools
import math
from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.beliefs.axis import Axis
from faintrack.beliefs.belief import Belief
from faintrack.beliefs.grids import Grid, surface
from faintrack.filters.grid import GridFilter
from faintrack.filters.run import step
from faintrack.filters.shifts import Shifts
from faintrack.likelihoods.cells import CellLikelihood, gaussian, spill_over
from faintrack.sensors.cells import Cells, CellScan
from faintrack.simulation.cells import draw_scans
from faintrack.targets.states import RangeState
from faintrack.targets.target import Target

SCANS, CELLS, LEVEL = 16, 100, 2.0
"""Scans at times 0 to 15, cells of the sensor from 1 on, and u."""

PLANT = (0.1, 0.8, 0.1)
"""Eq. 31."""

VELOCITIES = Axis(-3.0, 1.0, 9)

PRIOR = 0.25
"""Probability that there is a target, spread over the cells of the sensor and the velocities."""

START, VELOCITY = 30.0, 1.0
"""Of the paper's target."""

END = 45.0
"""Cell at the last scan of the target whose end is given; the paper's target ends there."""

APART = 10.0
"""Cells from the target beyond which a local peak is one of noise."""

POSITIONS = Axis(-70.0, 1.0, 271)
SENSOR = slice(71, 71 + CELLS)
"""Cells of the sensor on the grid."""


@dataclass(frozen=True)
class Scene:
    """Filter and likelihood, made once a process."""

    filter: GridFilter
    likelihood: CellLikelihood


@functools.cache
def scene() -> Scene:
    """The paper's model on a grid of position and velocity."""
    # Runs are traced, and what they share is not part of them.
    with jax.ensure_compile_time_eval():
        grid = Grid(RangeState, (("range", POSITIONS), ("range_rate", VELOCITIES)))
        seen = jnp.full((POSITIONS.count, 1), -jnp.inf).at[SENSOR].set(-math.log(CELLS * VELOCITIES.count))
        filter = GridFilter(grid, Target(None, None, 0.0, 0.0), Shifts(grid, 1.0, PLANT), seen)
        cells = Cells((("range", Axis(1.0, 1.0, CELLS)),))
        return Scene(filter, CellLikelihood(cells, gaussian, LEVEL, spill_over(0.5), reach=1))


def prior_log_ratio() -> float:
    """Log target likelihood ratio of every state of the sensor before the first scan, read off the filter."""
    start = surface(scene().filter.init(jax.random.key(0), existence=PRIOR))
    return float(start[SENSOR].max())


def surfaces(scans: CellScan) -> Float[Array, "scan position velocity"]:
    """Log target likelihood ratio surface after every scan (eq. 25-28)."""
    at = scene()
    # Nothing is drawn: the key is never read.
    unused = jax.random.key(0)

    def take_in(belief: Belief, scan: CellScan) -> tuple[Belief, Array]:
        belief, _ = step(at.filter, at.likelihood, belief, scan, unused)
        return belief, surface(belief)

    return jax.lax.scan(take_in, at.filter.init(unused, existence=PRIOR), scans)[1]


def look(
    key: PRNGKeyArray, path: Float[Array, " scan"], present: bool = True
) -> Float[Array, "scan position velocity"]:
    """Surfaces of scans that are drawn with a target on a path, or without."""
    time = jnp.arange(float(SCANS))
    states = RangeState(path, jnp.zeros(SCANS))
    return surfaces(draw_scans(key, scene().likelihood, time, states, jnp.full(SCANS, present)))


def plant_noise(key: PRNGKeyArray) -> Float[Array, " scan"]:
    """Cells that plant noise has added up to every scan."""
    steps = jax.random.choice(key, jnp.array([-1.0, 0.0, 1.0]), (SCANS - 1,), p=jnp.array(PLANT))
    return jnp.concatenate([jnp.zeros(1), jnp.cumsum(steps)])


def straight(key: PRNGKeyArray) -> dict[str, Array]:
    """The paper's target: highest value of the surface over the sensor, within a cell of the truth; peaks of noise."""
    path = START + VELOCITY * jnp.arange(SCANS)
    whole = look(key, path)
    inside = whole[:, SENSOR]
    position, velocity = jnp.asarray(POSITIONS.values), jnp.asarray(VELOCITIES.values)
    beside = jnp.abs(position - path[:, None]) < 1.5
    near = beside[:, :, None] & (jnp.abs(velocity - VELOCITY) < 1.5)
    peaks = noise_peaks(inside[-1], jnp.abs(position[SENSOR] - path[-1]) > APART)
    return {
        "peak": inside.max(axis=(1, 2)),
        "near": jnp.where(near, whole, -jnp.inf).max(axis=(1, 2)),
        "noise_peak": jnp.nanmedian(peaks),
        "noise_peak_highest": jnp.nanmax(peaks),
    }


def modelled(key: PRNGKeyArray) -> dict[str, Array]:
    """A target drawn from the model: highest value over the sensor, and the ratio of all scans so far."""
    for_start, for_velocity, for_plant, for_scans = jax.random.split(key, 4)
    start = jax.random.randint(for_start, (), 1, CELLS + 1)
    velocity = jax.random.choice(for_velocity, jnp.asarray(VELOCITIES.values, jnp.float32))
    path = start + velocity * jnp.arange(SCANS) + plant_noise(for_plant)
    return _over_sensor(look(for_scans, path))


def noise(key: PRNGKeyArray) -> dict[str, Array]:
    """No target: the same, to compare with counting."""
    return _over_sensor(look(key, jnp.zeros(SCANS), present=False))


def ending(key: PRNGKeyArray) -> dict[str, Array]:
    """A target drawn from the model given that it ends at `END` with `VELOCITY`: the surface there at the last scan.

    Every start from which it can come is in the sensor, and its prior log ratio is the same as at the start.
    """
    for_plant, for_scans = jax.random.split(key)
    moved = VELOCITY * jnp.arange(SCANS) + plant_noise(for_plant)
    last = look(for_scans, END + moved - moved[-1])[-1]
    return {"at_state": last[int(END - POSITIONS.first), int(VELOCITY - VELOCITIES.first)]}


def picture(key: PRNGKeyArray) -> dict[str, Array]:
    """All surfaces of a run with the paper's target, over the sensor."""
    return {"surface": look(key, START + VELOCITY * jnp.arange(SCANS))[:, SENSOR]}


def noise_peaks(values: Float[Array, "position velocity"], away: Array) -> Float[Array, "position velocity"]:
    """Values at local peaks, no lower than all eight neighbours, that are away from the target; NaN elsewhere."""
    highest = jax.lax.reduce_window(values, -jnp.inf, jax.lax.max, (3, 3), (1, 1), "SAME")
    return jnp.where((values == highest) & (values > -jnp.inf) & away[:, None], values, jnp.nan)


def _over_sensor(surface: Float[Array, "scan position velocity"]) -> dict[str, Array]:
    """Highest value over the sensor after every scan, and the log ratio of the scans so far to noise."""
    log_prior_odds = math.log(PRIOR) - math.log1p(-PRIOR)
    total = jax.nn.logsumexp(surface, axis=(1, 2))
    return {"peak": surface[:, SENSOR].max(axis=(1, 2)), "log_ratio": total - log_prior_odds}
