"""Dynamic programming: on a few cells the best of all paths can be looked up."""

import itertools
import math
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array, Float

from faintrack.baselines.viterbi import Viterbi, follow
from faintrack.beliefs.axis import Axis
from faintrack.beliefs.grids import Grid
from faintrack.filters.shifts import Shifts
from faintrack.targets.states import RangeState
from tests.tolerances import rounding

PLACES, VELOCITIES, SCANS = 4, 3, 4
BIRTH, SURVIVAL, PLANT = 0.2, 0.7, (0.1, 0.7, 0.2)
ABSENT = PLACES * VELOCITIES


class Told(eqx.Module):
    """The log ratio of every cell itself."""

    time: Float[Array, "*scan"]
    log_ratio: Float[Array, "*scan place velocity"]


class Reading(eqx.Module):
    def log_ratio(self, scan: Told, states: Any) -> Array:
        return scan.log_ratio


def best_of_all_paths(log_ratio: np.ndarray) -> tuple[float, int]:
    """Log of the best path that ends with a target over the best that ends without, and the cell in which it ends."""
    step = np.full((ABSENT + 1, ABSENT + 1), -np.inf)
    step[ABSENT, :ABSENT], step[ABSENT, ABSENT] = math.log(BIRTH / ABSENT), math.log(1 - BIRTH)
    step[:ABSENT, ABSENT] = math.log(1 - SURVIVAL)
    for place, velocity, noise in itertools.product(range(PLACES), range(VELOCITIES), range(3)):
        there = place + velocity - 1 + noise - 1
        if 0 <= there < PLACES:
            cells = (each * VELOCITIES + velocity for each in (place, there))
            step[*cells] = math.log(SURVIVAL * PLANT[noise])
    told = np.concatenate([log_ratio.reshape(len(log_ratio), -1), np.zeros((len(log_ratio), 1))], axis=1)
    best = np.full(ABSENT + 1, -np.inf)
    for path in itertools.product(range(ABSENT + 1), repeat=len(log_ratio)):
        total, before = 0.0, ABSENT
        for scan, here in enumerate(path):
            total += step[before, here] + told[scan, here]
            before = here
        best[before] = max(best[before], total)
    return best[:ABSENT].max() - best[ABSENT], int(best[:ABSENT].argmax())


def test_it_finds_the_best_of_all_paths() -> None:
    log_ratio = np.random.default_rng(4).normal(scale=3.0, size=(SCANS, PLACES, VELOCITIES)).astype(np.float32)
    grid = Grid(RangeState, (("range", Axis(0.0, 1.0, PLACES)), ("range_rate", Axis(-1.0, 1.0, VELOCITIES))))
    viterbi = Viterbi(grid, Shifts(grid, 1.0, PLANT, jnp.max), BIRTH, SURVIVAL)
    score, state = follow(viterbi, Reading(), Told(jnp.arange(float(SCANS)), jnp.asarray(log_ratio)))
    for scan in range(SCANS):
        expected, cell = best_of_all_paths(log_ratio[: scan + 1])
        assert score[scan] == pytest.approx(expected, rel=10 * rounding(np.float32), abs=1e-5)
        assert (state.range[scan], state.range_rate[scan]) == (cell // VELOCITIES, cell % VELOCITIES - 1)
