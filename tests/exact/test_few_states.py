"""Few states read the cells around them: the same as from a table of all places, and as sums over all cells."""

import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.beliefs.axis import Axis
from faintrack.likelihoods import cell_field
from faintrack.likelihoods.cells import CellLikelihood, gaussian_spread
from faintrack.likelihoods.heavy_tails import student
from faintrack.likelihoods.unknown_level import UnknownLevel
from faintrack.sensors.cells import Cells, CellScan
from faintrack.targets.states import PlanarState

AXES = (("y", Axis(0.0, 1.0, 30)), ("x", Axis(5.0, 0.5, 40)))
STATES = 60


def likelihood(level: float, oversample: int) -> CellLikelihood:
    return CellLikelihood(Cells(AXES), student(10.0, slack=0.7), level, gaussian_spread(0.55), 1, oversample)


def scan() -> CellScan:
    rng = np.random.default_rng(0)
    values, gain, independent = rng.normal(size=(30, 40)), rng.random((30, 40)), rng.random((30, 40))
    values[3, 4] = np.nan
    parts = (jnp.asarray(part, jnp.float32) for part in (values, gain, independent))
    return CellScan(jnp.array(0.0), *parts)


def states() -> PlanarState:
    """Some of them outside."""
    y, x = np.random.default_rng(1).uniform([[-3.0], [3.0]], [[33.0], [27.0]], (2, STATES))
    return PlanarState(jnp.asarray(x, jnp.float32), jnp.asarray(y, jnp.float32), jnp.zeros(STATES), jnp.zeros(STATES))


@pytest.mark.parametrize("oversample", [1, 3])
def test_ratios_are_those_of_the_table(oversample: int) -> None:
    one, several = likelihood(3.0, oversample), UnknownLevel((likelihood(2.0, oversample), likelihood(5.0, oversample)))
    assert one.few(states())
    place, inside = one.places.nearest(states())
    for each in (one, several):
        expected = jnp.where(inside, each.table(scan())[place], 0)
        np.testing.assert_allclose(each.log_ratio(scan(), states()), expected, atol=2e-6)
    assert np.ptp(np.asarray(several.log_ratio(scan(), states()))) > 1


@pytest.mark.parametrize("oversample", [1, 3])
def test_what_few_points_put_there_is_what_all_places_would(oversample: int) -> None:
    one = likelihood(3.0, oversample)
    weights = jnp.full(STATES, -np.log(STATES))
    given = (one.places, one.shares, one.reach, oversample, states(), weights)
    by_points, by_places = (cell_field.shared(*given, few) for few in (True, False))
    for found, expected in zip(by_points, by_places, strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-5)
        assert float(expected.max()) > 1e-2
