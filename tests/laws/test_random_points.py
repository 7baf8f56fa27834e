"""Means over random states of each cell: unbiased, and the same for the same scan."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.beliefs.axis import Axis
from faintrack.beliefs.grids import Grid
from faintrack.errors import InputError
from faintrack.likelihoods.random_points import RandomPoints
from faintrack.targets.states import PlanarState
from tests.tolerances import assert_mean

GRID = Grid(PlanarState, (("x", Axis(1.0, 2.0, 4)), ("vy", Axis(0.5, 1.0, 3))))
RUNS = 4_000


class Scan(eqx.Module):
    time: Any


class Straight(eqx.Module):
    """A ratio that is linear in the state: its mean over a cell is its value in the middle."""

    def log_ratio(self, scan: Scan, states: PlanarState) -> Any:
        return jnp.log(1 + 2 * states.x + 3 * states.vy + states.y)


def points(count: int, seed: int = 0) -> RandomPoints:
    return RandomPoints(Straight(), GRID, count, jax.random.key(seed))


@pytest.mark.parametrize("count", [1, 5])
def test_the_mean_is_unbiased(count: int) -> None:
    """4,000 scans, 5 standard errors; the more states, the smaller the spread: by the root of their number to 10 %."""
    middles = GRID.states()
    found = jax.jit(jax.vmap(lambda time: points(count).log_mean_ratio(Scan(time))))(jnp.arange(float(RUNS)))
    ratios = np.exp(np.asarray(found, float))
    assert_mean(ratios, np.asarray(1 + 2 * middles.x + 3 * middles.vy))
    # A uniform number over a width w has the variance w^2 / 12.
    expected = np.sqrt(((2 * 2.0) ** 2 + (3 * 1.0) ** 2) / 12 / count)
    np.testing.assert_allclose(ratios.std(axis=0), expected, rtol=0.1)


def test_the_same_scan_has_the_same_states() -> None:
    """By its time and the key; others have others."""
    ratio = eqx.filter_jit(lambda points, time: points.log_mean_ratio(Scan(time)))
    first = ratio(points(3), jnp.array(60.0))
    assert np.array_equal(first, ratio(points(3), jnp.array(60.0)))
    for other in (ratio(points(3), jnp.array(60.5)), ratio(points(3, seed=1), jnp.array(60.0))):
        assert not np.any(first == other)


def test_no_state_is_refused() -> None:
    with pytest.raises(InputError, match="random points: 0 in every cell; expected at least 1"):
        points(0)
