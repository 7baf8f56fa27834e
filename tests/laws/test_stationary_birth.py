"""Births that keep a prior: nothing negative, nothing inside, and prediction leaves the prior as it is."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.beliefs.axis import between
from faintrack.beliefs.grids import Grid, marginal
from faintrack.errors import InputError
from faintrack.filters.birth import Stationary, stationary
from faintrack.filters.grid import GridFilter
from faintrack.filters.separable import Separable, separable
from faintrack.targets.motion import OrnsteinUhlenbeck
from faintrack.targets.states import PlanarState
from faintrack.targets.target import Target
from tests.tolerances import rounding

EXISTENCE, INTERVAL = 0.3, 1.0
MOTION = OrnsteinUhlenbeck(0.6, 10.0)


@pytest.fixture(scope="module")
def transport() -> Separable:
    place, rate = between(-9.0, 9.0, 12), between(-3.0, 3.0, 5)
    # Axes in an order of their own, so that none is taken for another.
    grid = Grid(PlanarState, (("vy", rate), ("x", place), ("y", place), ("vx", rate)))
    return separable(grid, MOTION, INTERVAL)


@pytest.fixture(scope="module")
def born(transport: Separable) -> Stationary:
    return stationary(transport, EXISTENCE)


def test_prediction_leaves_the_prior_as_it_is(transport: Separable, born: Stationary) -> None:
    filter = GridFilter(transport.grid, Target(None, MOTION, born.arrival_rate, 0.0), transport, born.log_birth)
    belief = filter.init(jax.random.key(0), existence=EXISTENCE)
    belief = type(belief)(belief.states, born.log_prior, belief.log_odds, belief.time)
    for number in range(3):
        belief = filter.predict(belief, INTERVAL * (number + 1), jax.random.key(0))
    # Three predictions, each a few sums over hundreds of cells.
    near = rounding(np.float32, 1000)
    assert float(belief.existence) == pytest.approx(EXISTENCE, rel=near)
    np.testing.assert_allclose(jnp.exp(belief.log_weights), jnp.exp(born.log_prior), rtol=near, atol=near / 3600)


def test_births_are_at_the_edges_and_point_inward(transport: Separable, born: Stationary) -> None:
    birth = np.exp(np.asarray(born.log_birth, float))
    assert birth.sum() == pytest.approx(1, rel=1e-4)
    middle = birth[:, 5:7, 5:7, :].sum()
    assert middle < 1e-3
    # At the western edge, away from the corners, newborn targets head east.
    west = birth[:, 0, 4:8, :].sum(axis=(0, 1))
    assert west[3:].sum() > 10 * west[:2].sum()


def test_velocities_of_the_prior_are_those_of_the_long_run(transport: Separable, born: Stationary) -> None:
    belief = GridFilter(transport.grid, Target(None, MOTION, 0.0, 0.0), transport, born.log_prior).init(
        jax.random.key(0), existence=0.5
    )
    share = np.exp(marginal(belief, transport.grid, "vx"))
    values = np.asarray(dict(transport.grid.axes)["vx"].values)
    spread = 0.6 * np.sqrt(10.0 / 2)
    # A cell adds a twelfth of its square to the variance in every step; the ends of the axis cut some off.
    assert np.sqrt((share * values**2).sum()) == pytest.approx(spread, rel=0.25)
    assert (share * values).sum() == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("existence", [0.0, 1.0, float("nan")])
def test_existence_is_a_probability(transport: Separable, existence: float) -> None:
    with pytest.raises(InputError, match=r"existence is .*; expected a probability between 0 and 1"):
        stationary(transport, existence)


def test_more_targets_leave_than_can_appear(transport: Separable) -> None:
    with pytest.raises(InputError, match=r"a target would have to appear with probability .* expected above 0"):
        stationary(transport, 0.999)
