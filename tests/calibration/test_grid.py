"""Of targets that a grid believes in at 0.8, 80 % exist: targets drawn from the very chain that the grid holds."""

import jax
import jax.numpy as jnp
import numpy as np

from faintrack.beliefs.axis import Axis
from faintrack.beliefs.grids import Grid
from faintrack.filters.grid import GridFilter
from faintrack.filters.run import run
from faintrack.filters.shifts import Shifts
from faintrack.likelihoods.cells import CellLikelihood, gaussian
from faintrack.sensors.cells import Cells, CellScan
from faintrack.targets.states import RangeState
from faintrack.targets.target import Target, rates
from tests.tolerances import assert_calibrated

RUNS, SCANS, LEVEL = 2500, 8, 1.6
PLACE, SPEED = Axis(0.0, 1.0, 10), Axis(-1.0, 1.0, 3)
TARGET = Target(None, None, *rates(0.12, 0.9, 1.0))


def lives(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Whether a target exists, and in which cell it is; shape (scan, run). What leaves the grid is gone."""
    chances = jax.tree.map(np.exp, TARGET.forecast(jnp.array([-jnp.inf, jnp.inf]), 1.0))
    exists, cell, speed = np.zeros(RUNS, bool), np.zeros(RUNS, int), np.zeros(RUNS, int)
    presence, places = [], []
    for _ in range(SCANS):
        change, before = rng.random(RUNS), exists.astype(int)
        new = change < (chances.appeared + chances.replaced)[before]
        same = ~new & (change < (chances.appeared + chances.replaced + chances.same)[before])
        cell = np.where(new, rng.integers(0, PLACE.count, RUNS), cell + speed)
        speed = np.where(new, rng.integers(-1, 2, RUNS), speed)
        exists = new | (same & (cell >= 0) & (cell < PLACE.count))
        presence.append(exists)
        places.append(cell)
    return np.stack(presence), np.stack(places)


def test_of_targets_believed_in_as_many_exist() -> None:
    """2,500 runs of 8 scans, one number from the end of each; five bins of probability, 5 standard errors in each."""
    rng = np.random.default_rng(5)
    exists, cell = lives(rng)
    hit = exists[..., None] & (np.arange(PLACE.count) == cell[..., None])
    values = np.moveaxis(rng.normal(size=hit.shape) + LEVEL * hit, 0, 1)
    grid = Grid(RangeState, (("range", PLACE), ("range_rate", SPEED)))
    filter = GridFilter(grid, TARGET, Shifts(grid, 1.0))
    likelihood = CellLikelihood(Cells((("range", PLACE),)), gaussian, LEVEL)

    @jax.jit
    @jax.vmap
    def existence(values: jax.Array) -> jax.Array:
        scans = CellScan(jnp.arange(1.0, SCANS + 1), values)
        return run(filter, likelihood, scans, jax.random.key(0), lambda belief: None)[0].existence

    assert_calibrated(existence(jnp.asarray(values, jnp.float32)), exists[-1])
