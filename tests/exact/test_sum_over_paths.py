"""On a few cells every path can be summed: the filter finds the same existence and the same cells."""

import itertools
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.filters.bernoulli_particle import BernoulliParticleFilter
from faintrack.filters.run import run
from faintrack.targets.target import Target, UniformBirth, rates
from tests.tolerances import assert_mean

APPEARS, STAYS = 0.15, 0.85
DEPARTURE = -np.log(STAYS - APPEARS) * (1 - STAYS) / (1 - STAYS + APPEARS)
SAME = np.exp(-DEPARTURE)
"""Probability that the target is still the same one; otherwise it left, and with STAYS - SAME another has come."""
JUMPS = np.array([[0.7, 0.2, 0.1], [0.3, 0.4, 0.3], [0.05, 0.15, 0.8]])
"""Probability of the next cell (column) from each cell (row)."""
RATIO = np.array([[0.4, 2.0, 1.5], [0.2, 3.0, 0.9], [0.8, 0.5, 4.0], [0.3, 0.6, 0.7], [1.2, 0.1, 5.0]])
"""Likelihood ratio of each scan (row) with a target in each cell (column)."""
SCANS, CELLS = RATIO.shape
RUNS, PARTICLES, BIRTHS = 200, 2000, 1000


class CellState(eqx.Module):
    """A place on the line from 0 to the number of cells; the cell is its whole part."""

    place: Float[Array, "..."]
    angles: ClassVar[tuple[str, ...]] = ()

    @property
    def cell(self) -> Array:
        return jnp.clip(self.place.astype(int), 0, CELLS - 1)


class Jump(eqx.Module):
    """Moves once, whatever the interval."""

    def move(self, states: CellState, interval: Any, key: PRNGKeyArray) -> CellState:
        jump = jax.random.categorical(key, jnp.log(JUMPS.astype(states.place.dtype))[states.cell])
        return CellState(jump.astype(states.place.dtype) + 0.5)


class CellScan(eqx.Module):
    """The likelihood ratio itself."""

    time: Float[Array, "*scan"]
    ratio: Float[Array, "*scan cell"]


class Table(eqx.Module):
    """Reads the ratio at the cell of each point."""

    def log_ratio(self, scan: CellScan, states: CellState) -> Array:
        return jnp.log(scan.ratio)[states.cell]


def every_path(scans: int) -> tuple[float, np.ndarray, float]:
    """Existence and cells after so many scans, and the mean ratio of all of them, from the sum over every path.

    A path is a cell, or `CELLS` for no target, before the first scan and at each scan; there is no target before.
    """
    ends = np.zeros(CELLS + 1)
    step = np.zeros((CELLS + 1, CELLS + 1))
    step[:CELLS, :CELLS], step[:CELLS, CELLS] = SAME * JUMPS + (STAYS - SAME) / CELLS, 1 - STAYS
    step[CELLS, :CELLS], step[CELLS, CELLS] = APPEARS / CELLS, 1 - APPEARS
    for path in itertools.product(range(CELLS + 1), repeat=scans):
        probability, before = 1.0, CELLS
        for scan, place in enumerate(path):
            probability *= step[before, place] * (1.0 if place == CELLS else RATIO[scan, place])
            before = place
        ends[before] += probability
    total = ends.sum()
    return 1 - ends[CELLS] / total, ends[:CELLS] / ends[:CELLS].sum(), total


@pytest.fixture(scope="module")
def runs() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Existence (run, scan), probability of the cells (run, scan, cell) and log evidence with existence (run, scan)."""
    birth = UniformBirth(CellState(jnp.array(0.0)), CellState(jnp.array(float(CELLS))))
    filter = BernoulliParticleFilter(Target(birth, Jump(), *rates(APPEARS, STAYS, 1.0)), PARTICLES, BIRTHS)
    scans = CellScan(jnp.arange(1.0, SCANS + 1), jnp.asarray(RATIO, jnp.float32))

    def kept(belief: Any) -> tuple[Array, Array]:
        in_cell = belief.states.cell[:, None] == jnp.arange(CELLS)
        return belief.existence, jnp.exp(belief.log_weights) @ in_cell

    keys = jax.random.split(jax.random.key(1), RUNS)
    _, (existence, cells), log_evidence = jax.vmap(lambda key: run(filter, Table(), scans, key, kept))(keys)
    return tuple(np.asarray(each, np.float64) for each in (existence, cells, log_evidence))


@pytest.mark.parametrize("scan", range(SCANS))
def test_existence(runs: tuple[np.ndarray, ...], scan: int) -> None:
    """200 runs, 5 standard errors of about 3e-4."""
    assert_mean(runs[0][:, scan], every_path(scan + 1)[0])


@pytest.mark.parametrize("scan", range(SCANS))
def test_cells(runs: tuple[np.ndarray, ...], scan: int) -> None:
    """200 runs, 5 standard errors of about 1e-3."""
    assert_mean(runs[1][:, scan], every_path(scan + 1)[1])


def test_evidence(runs: tuple[np.ndarray, ...]) -> None:
    """The product over scans of 1 - q + q I, q predicted, is the mean ratio of the scans over every path."""
    existence, _, log_evidence = runs
    odds = existence / (1 - existence) / np.exp(log_evidence)
    predicted = odds / (1 + odds)
    product = np.prod(1 - predicted + predicted * np.exp(log_evidence), axis=1)
    assert_mean(product, every_path(SCANS)[2])
