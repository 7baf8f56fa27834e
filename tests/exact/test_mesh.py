"""The mesh of measurements: areas against counting its points one by one, velocities against draws."""

import math
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.errors import InputError
from faintrack.likelihoods.mesh import Mesh, below
from faintrack.sensors.bistatic import Bistatic, fixed
from faintrack.targets.states import PlanarState
from tests.sonar import AXES, count_points, grid, pair, sweep, tone
from tests.tolerances import STANDARD_ERRORS, assert_equal

PAIRS = {
    "apart": ((300.0, -400.0), (-200.0, 500.0)),
    "in one place": ((-170.0, 390.0), (-170.0, 390.0)),
    "receiver on an edge": ((300.0, -400.0), (-1000.0, 500.0)),
    "receiver on a corner": ((300.0, -400.0), (0.0, -4000.0 + 9000.0 * 3 / 7)),
    "source outside": ((9000.0, 1000.0), (-200.0, 500.0)),
    "receiver outside": ((300.0, -400.0), (1500.0, 9000.0)),
    "both outside": ((-9000.0, -400.0), (-8000.0, 700.0)),
}
"""Of source and receiver; metres. The grid reaches from -5 to 4 km east and from -4 to 5 km north."""
DRAWS = 4_000


def apart(name: str) -> Bistatic:
    source, receiver = PAIRS[name]
    return Bistatic(fixed(*source), fixed(*receiver))


@eqx.filter_jit
def areas(mesh: Mesh, pair: Bistatic) -> Any:
    return mesh.areas(pair)


@eqx.filter_jit
def shares(mesh: Mesh, pair: Bistatic, x: Any, y: Any, edges: Any) -> Any:
    return mesh.shares(mesh.spread(pair, x, y), edges)


@pytest.mark.parametrize("name", PAIRS)
def test_areas_are_those_of_points_counted_one_by_one(name: str, float64: type) -> None:
    """All points, and those that are heard; every point in the cell that it lies in, with its stretch of the ray."""
    mesh = Mesh(sweep(), grid("x", "y"), (2, 3, 1))
    for found, expected in zip(areas(mesh, apart(name)), count_points(mesh, *PAIRS[name]), strict=True):
        assert_equal(found, expected, np.float64, 1000, scale=1e6)


def test_areas_in_single_precision() -> None:
    """A point on the edge of a cell may lie on either side: less than one in a hundred does."""
    mesh = Mesh(sweep(), grid("x", "y"), (2, 3, 1))
    for found, expected in zip(areas(mesh, apart("apart")), count_points(mesh, *PAIRS["apart"]), strict=True):
        assert np.abs(found - expected).sum() < 0.01 * expected.sum()


@pytest.mark.parametrize("name", ["apart", "in one place", "receiver outside"])
def test_a_fine_mesh_measures_the_cells(name: str, float64: type) -> None:
    """Far from the receiver two or three rays cross a cell of 1000 by 1286 m: 30 %; all together, less than 1 %."""
    mesh = Mesh(sweep(), grid("x", "y"), (2, 24, 1))
    cell = AXES["x"].step * AXES["y"].step
    found = np.asarray(areas(mesh, apart(name))[0])
    x, y = np.meshgrid(AXES["x"].values, AXES["y"].values, indexing="ij")
    between = np.hypot(x - PAIRS[name][0][0], y - PAIRS[name][0][1])
    between += np.hypot(x - PAIRS[name][1][0], y - PAIRS[name][1][1])
    clear = between > np.hypot(*np.subtract(*PAIRS[name])) + 3000
    assert np.abs(found[clear] / cell - 1).max() < 0.3
    assert abs(found[clear].mean() / cell - 1) < 0.01


@pytest.mark.parametrize("finer", [1, 2])
def test_shares_are_those_of_velocities_drawn_in_the_cells(finer: int, dtype: type) -> None:
    """4,000 draws a cell with the whole Doppler equation, 5 standard errors, and 0.03 for what the first order leaves
    out: a gradient that changes by 2 v/c = 2 % moves the ends of a cell by that share of it. They sum to 1."""
    sonar = tone()
    mesh = Mesh(sonar, grid(), (1, 4, finer))
    x, y = jnp.asarray([-4000.0, 2500.0, 900.0], dtype), jnp.asarray([2000.0, 4800.0, -3000.0], dtype)
    edges = np.arange(mesh.first(2) - 0.5, mesh.first(2) + mesh.count(2))
    found = np.asarray(shares(mesh, pair(), x, y, jnp.asarray(edges, dtype)))
    assert found.dtype == dtype
    rng = np.random.default_rng(2)
    vx, vy = (np.asarray(each)[:, None] for each in mesh.velocities)
    vx = vx + AXES["vx"].step * rng.uniform(-0.5, 0.5, size=(len(vx), DRAWS))
    vy = vy + AXES["vy"].step * rng.uniform(-0.5, 0.5, size=(len(vy), DRAWS))
    states = PlanarState(x[:, None, None], y[:, None, None], jnp.asarray(vx, dtype), jnp.asarray(vy, dtype))
    drawn = np.asarray(sonar.doppler.place(pair().doppler(states, sonar.pulse.frequency))) * finer
    for strip in range(found.shape[1]):
        within = np.mean((drawn >= edges[strip]) & (drawn < edges[strip + 1]), axis=-1)
        error = np.sqrt(found[:, strip] * (1 - found[:, strip]) / DRAWS)
        assert np.all(np.abs(within - found[:, strip]) < STANDARD_ERRORS * error + 0.03)
    every = shares(mesh, pair(), x, y, jnp.asarray([-500.0, -3.5, 2.0, 500.0], dtype))
    assert_equal(every.sum(axis=1), np.ones((3, 12)), dtype, 4)


def test_without_doppler_a_velocity_is_no_matter() -> None:
    mesh = Mesh(sweep(), grid("x", "y"), (1, 4, 9))
    assert mesh.finer == (1, 4, 1)
    found = shares(mesh, pair(), jnp.zeros(2), jnp.zeros(2), jnp.array([-0.5, 0.5]))
    assert found.tolist() == [[[1.0]], [[1.0]]]


@pytest.mark.parametrize(("a", "b"), [(1.0, 1.0), (1.0, 0.25), (0.3, 2.0), (1e-3, 1.0), (1e-3, 1e-3)])
def test_below_is_the_convolution_of_two_boxes(a: float, b: float, dtype: type) -> None:
    """Summed over 20,000 places in the first box; exactly 0 and 1 outside."""
    x = np.linspace(-1.05, 1.05, 43) * (a + b)
    first = a * (2 * (np.arange(20_000) + 0.5) / 20_000 - 1)
    expected = np.clip((x[:, None] - first + b) / (2 * b), 0, 1).mean(axis=1)
    found = np.asarray(below(jnp.asarray(x, dtype), jnp.asarray(a, dtype), jnp.asarray(b, dtype)))
    assert_equal(found, expected, dtype, 20, scale=1.0 if dtype is np.float32 else 1e6)
    assert np.all(found[x < -1.001 * (a + b)] == 0)
    assert np.all(found[x > 1.001 * (a + b)] == 1)
    assert math.isclose(float(below(jnp.zeros((), dtype), a, b)), 0.5, rel_tol=1e-5)


def test_what_cannot_be_used_is_said() -> None:
    with pytest.raises(InputError, match="mesh: the grid has no axis vy; expected x, y, vx, vy"):
        Mesh(tone(), grid("x", "y", "vx"), (1, 4, 1))
    with pytest.raises(InputError, match="mesh: the grid has no axis y; expected x, y"):
        Mesh(sweep(), grid("x"), (1, 4, 1))
    with pytest.raises(InputError, match=r"mesh: \(1, 0, 1\) points a bin; expected at least 1"):
        Mesh(tone(), grid(), (1, 0, 1))
