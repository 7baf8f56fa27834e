"""What likelihoods of cells obey, beside the laws of all (`tests/laws/test_every_likelihood.py`)."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.beliefs.axis import Axis
from faintrack.likelihoods.cells import CellLikelihood, gaussian, gaussian_spread, rayleigh, swerling0, swerling1
from faintrack.sensors.cells import Cells, CellScan
from faintrack.simulation.cells import draw_scans
from faintrack.targets.states import PlanarState
from tests.tolerances import RATIO_OPERATIONS, assert_equal, assert_mean

DRAWS = 6_000
IMAGE = Cells((("y", Axis(0.0, 1.0, 5)), ("x", Axis(0.0, 1.0, 6))))
LEVELS = {gaussian: 0.8, swerling1: 0.3, swerling0: 0.5, rayleigh: 0.3}
"""Levels at which the ratio has a variance: that of `swerling1` has none from 1 on."""
every = pytest.mark.parametrize("amplitude", LEVELS, ids=lambda amplitude: amplitude.__name__)


def likelihood_of(amplitude: object) -> CellLikelihood:
    return CellLikelihood(IMAGE, amplitude, LEVELS[amplitude], gaussian_spread(0.6), reach=1, oversample=3)


def planar(x: object, y: object) -> PlanarState:
    x, y = jnp.asarray(x, jnp.float32), jnp.asarray(y, jnp.float32)
    return PlanarState(x, y, jnp.zeros((1,) * x.ndim), jnp.zeros((1,) * x.ndim))


def points() -> PlanarState:
    """In the middle, between pixels, at the edge, beyond it, and where nothing is heard."""
    return planar([2.0, 3.4, 5.0, -1.0, 20.0], [2.0, 1.6, 0.1, 3.0, 2.0])


def draw(amplitude: object, present: bool, place: int = 0) -> tuple[CellLikelihood, CellScan]:
    likelihood = likelihood_of(amplitude)
    states = planar(jnp.full(DRAWS, points().x[place]), jnp.full(DRAWS, points().y[place]))
    present_at = jnp.full(DRAWS, present)
    return likelihood, eqx.filter_jit(draw_scans)(jax.random.key(1), likelihood, jnp.zeros(DRAWS), states, present_at)


@eqx.filter_jit
def ratio(likelihood: CellLikelihood, scan: CellScan, states: PlanarState) -> jax.Array:
    return likelihood.log_ratio(scan, states)


def log_ratios(likelihood: CellLikelihood, scans: CellScan) -> np.ndarray:
    return np.asarray(jax.jit(jax.vmap(lambda scan: likelihood.log_ratio(scan, points())))(scans), np.float64)


def test_gaussian_log_ratio_has_the_moments_of_stone() -> None:
    """stone2002, section 3.3: +r^2/2 under target, -r^2/2 under noise, variance r^2, with r^2 summed over the cells."""
    likelihood = likelihood_of(gaussian)
    square = float(jnp.sum(likelihood.levels(jax.tree.map(lambda x: x[1] if x.size > 1 else x[0], points())) ** 2))
    for present, mean in ((True, square / 2), (False, -square / 2)):
        drawn = log_ratios(*draw(gaussian, present, 1))[:, 1]
        assert_mean(drawn, mean)
        assert_mean((drawn - mean) ** 2, square)


@every
def test_no_level_says_nothing(amplitude: object) -> None:
    likelihood = CellLikelihood(IMAGE, amplitude, 0.0, gaussian_spread(0.6), reach=1)
    scan = CellScan(jnp.array(0.0), jnp.linspace(0.1, 4.0, 30).reshape(5, 6))
    assert_equal(ratio(likelihood, scan, points()), np.zeros(5), np.float32, RATIO_OPERATIONS, scale=1.0)


@every
def test_a_mesh_of_points_is_a_row_of_points(amplitude: object) -> None:
    scan = CellScan(jnp.array(0.0), jnp.linspace(0.1, 4.0, 30).reshape(5, 6))
    x, y = np.linspace(-2.0, 7.0, 9), np.linspace(-2.0, 6.0, 7)
    likelihood = likelihood_of(amplitude)
    mesh = ratio(likelihood, scan, planar(x[:, None, None, None], y[None, None, :, None]))
    row = ratio(likelihood, scan, planar(np.repeat(x, 7), np.tile(y, 9)))
    assert mesh.shape == (9, 1, 7, 1)
    np.testing.assert_array_equal(mesh.ravel(), row)


@every
def test_a_shifted_scene_is_the_same_scene(amplitude: object) -> None:
    """What a target tells does not depend on where in the image it is, away from the edges."""
    small, large = np.linspace(0.1, 4.0, 30).reshape(5, 6), np.full((12, 14), 0.5)
    large[4:9, 3:9] = small
    wide = Cells((("y", Axis(10.0, 1.0, 12)), ("x", Axis(-5.0, 1.0, 14))))
    near = likelihood_of(amplitude)
    far = CellLikelihood(wide, amplitude, near.level, near.spread, near.reach, near.oversample)
    x, y = np.array([1.3, 2.0, 4.0]), np.array([1.0, 2.4, 3.0])
    first = ratio(near, CellScan(jnp.array(0.0), jnp.asarray(small, jnp.float32)), planar(x, y))
    second = ratio(far, CellScan(jnp.array(0.0), jnp.asarray(large, jnp.float32)), planar(x + 3 - 5, y + 4 + 10))
    assert_equal(first, second, np.float32, RATIO_OPERATIONS, scale=1.0)
