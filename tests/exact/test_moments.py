"""Mean and covariance of a belief against NumPy, on particles and grids; states that have nothing but their fields."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.beliefs.axis import Axis
from faintrack.beliefs.belief import Belief, covariance, deviations, mean, mode, moments, standard_deviation, update
from faintrack.beliefs.components import components
from faintrack.beliefs.grids import Grid
from faintrack.filters.bernoulli_particle import BernoulliParticleFilter
from faintrack.filters.cell_particles import CellParticles
from faintrack.filters.grid import GridFilter
from faintrack.targets.states import BearingState, PlanarState
from faintrack.targets.target import Target, UniformBirth
from tests.tolerances import assert_equal

GRIDS = {
    "four axes": (PlanarState, (("x", 5), ("vx", 3), ("y", 4), ("vy", 2))),
    "rates first": (PlanarState, (("vx", 3), ("vy", 2), ("x", 5), ("y", 4))),
    "two axes, others still": (PlanarState, (("y", 5), ("vy", 4))),
    "an angle": (BearingState, (("bearing_rate", 3), ("bearing", 7))),
}


class Depth(eqx.Module):
    """A user's state: nothing but its fields."""

    depth: Any
    temperature: Any


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class Plain:
    """The same without equinox."""

    depth: Any
    temperature: Any


class Still(eqx.Module):
    """Motion of any state: every component walks at random."""

    def move(self, states: Any, interval: Any, key: jax.Array) -> Any:
        return jax.tree.map(lambda values: values + 0.1 * jax.random.normal(key, values.shape), states)


def by_numpy(states: Any, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance from all points, one row a component."""
    rows = np.stack([np.broadcast_to(values, weights.shape).ravel() for values in components(states).values()])
    weights = weights.ravel()
    middle = rows @ weights
    for row, name in enumerate(components(states)):
        if name in getattr(states, "angles", ()):
            middle[row] = np.angle(np.exp(1j * rows[row]) @ weights)
    off = rows - middle[:, None]
    for row, name in enumerate(components(states)):
        if name in getattr(states, "angles", ()):
            off[row] = np.angle(np.exp(1j * off[row]))
    return middle, (off * weights) @ off.T


@pytest.mark.parametrize("name", GRIDS)
def test_moments_of_a_grid_are_those_of_its_cells(name: str, float64: type) -> None:
    kind, counts = GRIDS[name]
    grid = Grid(kind, tuple((axis, Axis(0.3, 0.7, count)) for axis, count in counts))
    log_weights = jax.nn.log_softmax(jax.random.normal(jax.random.key(1), (grid.size,))).reshape(grid.shape)
    belief = Belief(grid.states(float64), log_weights, jnp.array(0.0), jnp.array(0.0))
    middle, matrix = by_numpy(belief.states, np.exp(log_weights))
    actual, squares = moments(belief)
    assert_equal(np.array(list(components(actual).values())), middle, float64, grid.size, 1.0)
    assert_equal(squares, matrix, float64, grid.size, 1.0)
    assert_equal(np.array(list(components(mean(belief)).values())), middle, float64, grid.size, 1.0)


@pytest.mark.parametrize("kind", [Depth, Plain])
def test_a_state_needs_nothing_but_its_fields(kind: Any) -> None:
    rng = np.random.default_rng(0)
    states, weights = kind(*jnp.asarray(rng.normal(size=(2, 50)), np.float32)), np.full(50, 0.02, np.float32)
    belief = Belief(states, jnp.log(weights), jnp.array(0.0), jnp.array(0.0))
    middle, matrix = by_numpy(states, weights)
    assert_equal(mean(belief).depth, middle[0], np.float32, 50, 1.0)
    assert_equal(covariance(belief), matrix, np.float32, 50, 1.0)
    assert_equal(standard_deviation(belief).temperature, matrix[1, 1] ** 0.5, np.float32, 50)
    assert_equal(deviations(states, covariance(belief)).depth, matrix[0, 0] ** 0.5, np.float32, 50)
    assert float(mode(update(belief, -jnp.abs(states.depth - 10))[0]).depth) == states.depth.max()


@pytest.mark.parametrize("kind", [Depth, Plain])
def test_filters_carry_any_state(kind: Any) -> None:
    birth = UniformBirth(*(kind(jnp.array(low), jnp.array(low)) for low in (0.0, 3.0)))
    target, key = Target(birth, Still(), 0.1, 0.1), jax.random.key(0)
    grid = Grid(kind, (("depth", Axis(0.0, 1.0, 4)), ("temperature", Axis(0.0, 1.0, 4))))
    on_grid = GridFilter(grid, target, CellParticles(grid, Still(), 1.0, 2))
    for carrier in (BernoulliParticleFilter(target, 40, 10), on_grid):
        belief = carrier.predict(carrier.init(key, existence=0.5), 1.0, key)
        belief, _ = update(belief, -((belief.states.depth - 2.0) ** 2))
        assert 1.0 < float(mean(belief).depth) < 3.0
        assert np.all(np.linalg.eigvalsh(covariance(belief)) > -1e-6)
