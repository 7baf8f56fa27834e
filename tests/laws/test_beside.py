"""Laws of targets that are part of the background: none is nothing, order is nothing, and the mean ratio is 1."""

import dataclasses
import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.beliefs.axis import Axis
from faintrack.likelihoods.bearing_sets import BearingSetLikelihood
from faintrack.likelihoods.cells import CellLikelihood, gaussian, gaussian_spread, rayleigh, swerling1
from faintrack.likelihoods.clutter import ClutterLikelihood
from faintrack.likelihoods.heavy_tails import student
from faintrack.likelihoods.protocols import Beside, with_others
from faintrack.likelihoods.unknown_level import UnknownLevel
from faintrack.sensors.bearing_sets import BearingSensor, BearingSet, bearing_set
from faintrack.sensors.cells import Cells, CellScan
from faintrack.signal.clutter import ClutterScan, Level
from faintrack.targets.states import PlanarState
from tests.tolerances import STANDARD_ERRORS, errors_apart

IMAGE = Cells((("y", Axis(0.0, 1.0, 6)), ("x", Axis(0.0, 1.0, 7))))
DRAWS = 20_000
SPREAD = gaussian_spread(0.6)
LEVELS = {gaussian: 0.8, student(6.0): 0.8, swerling1: 0.3, rayleigh: 0.3}


def planar(*places: tuple[float, float]) -> PlanarState:
    x, y = (jnp.asarray(values, jnp.float32) for values in zip(*places, strict=True))
    return PlanarState(x, y, jnp.zeros_like(x), jnp.zeros_like(x))


def certain(*places: tuple[float, float]) -> tuple[PlanarState, Any, Any]:
    """Targets that are there, each at one place: states, log weights and existence."""
    states = jax.tree.map(lambda values: values[:, None], planar(*places))
    return states, jnp.zeros((len(places), 1)), jnp.ones(len(places))


def image(amplitude: Any, oversample: int = 1) -> CellLikelihood:
    return CellLikelihood(IMAGE, amplitude, LEVELS[amplitude], SPREAD, reach=1, oversample=oversample)


def noise(seed: int = 0) -> CellScan:
    return CellScan(jnp.zeros(()), jnp.abs(jax.random.normal(jax.random.key(seed), IMAGE.shape)))


SENSOR = BearingSensor(math.radians(2), 0.9, 4.0)
HERE = jax.tree.map(lambda values: values[0], planar((0.0, 0.0)))


def bearings() -> BearingSet:
    return bearing_set(SENSOR, 0.0, np.array([0.1, 0.12, 1.0, -2.0]), HERE, capacity=6)


CLUTTER = ClutterScan(
    jnp.zeros(()), jnp.abs(noise(3).values) + 0.1, Level(jnp.full(IMAGE.shape, 6.0), jnp.full(IMAGE.shape, 9.0))
)
CASES: dict[str, tuple[Any, Any]] = {
    **{
        name: (image(amplitude), noise())
        for name, amplitude in zip(("gaussian", "student", "swerling1", "rayleigh"), LEVELS, strict=True)
    },
    "within a cell": (image(gaussian, oversample=3), noise()),
    "unknown level": (UnknownLevel((image(gaussian), dataclasses.replace(image(gaussian), level=2.0))), noise()),
    "clutter": (ClutterLikelihood(IMAGE, 2.0), CLUTTER),
    "bearings": (BearingSetLikelihood(SENSOR), bearings()),
}
POINTS = planar((2.2, 3.1), (2.0, 3.0), (5.0, 0.0), (0.4, 0.4))


@pytest.mark.parametrize("name", CASES)
def test_it_says_that_it_can(name: str) -> None:
    assert isinstance(CASES[name][0], Beside)


@pytest.mark.parametrize("name", CASES)
def test_a_target_that_does_not_exist_is_nothing(name: str) -> None:
    likelihood, scan = CASES[name]
    states, log_weights, existence = certain((2.0, 3.0), (4.0, 1.0))
    empty = with_others(likelihood, scan, states, log_weights, 0 * existence)
    np.testing.assert_allclose(
        likelihood.log_ratio(empty, POINTS), likelihood.log_ratio(scan, POINTS), rtol=1e-5, atol=1e-5
    )


@pytest.mark.parametrize("name", CASES)
def test_order_is_irrelevant(name: str) -> None:
    likelihood, scan = CASES[name]
    states, log_weights, _ = certain((2.0, 3.0), (3.0, 3.0), (5.0, 1.0))
    existence = jnp.asarray([0.9, 0.4, 1.0])
    turned = jax.tree.map(lambda values: values[::-1], (states, log_weights, existence))
    one, two = with_others(likelihood, scan, states, log_weights, existence), with_others(likelihood, scan, *turned)
    np.testing.assert_allclose(
        likelihood.log_ratio(one, POINTS), likelihood.log_ratio(two, POINTS), rtol=1e-4, atol=1e-4
    )


@pytest.mark.parametrize("name", CASES)
def test_what_is_explained_tells_less(name: str) -> None:
    """A loud echo where another is expected speaks less for one target more."""
    likelihood, scan = CASES[name]
    if isinstance(scan, BearingSet):
        point, other = planar((900.0, 90.0)), certain((1000.0, 100.0))
    else:
        scan = dataclasses.replace(scan, values=scan.values.at[3, 2].set(8.0))
        point, other = planar((2.0, 3.0)), certain((2.0, 3.0))
    assert float(likelihood.log_ratio(with_others(likelihood, scan, *other), point)[0]) < float(
        likelihood.log_ratio(scan, point)[0]
    )


@pytest.mark.parametrize("amplitude", [gaussian, swerling1, rayleigh], ids=["gaussian", "swerling1", "rayleigh"])
def test_mean_ratio_under_another_target(amplitude: Any) -> None:
    """Given one at a place that is known, the mean ratio for a second is 1, wherever that is."""
    likelihood = image(amplitude)
    other = jax.tree.map(lambda values: values[0], planar((2.0, 3.0)))
    beside = certain((2.0, 3.0))

    def one(key: Any) -> Any:
        drawn = likelihood.simulate(noise(), other, True, key)
        return jnp.exp(likelihood.log_ratio(with_others(likelihood, drawn, *beside), POINTS))

    ratios = jax.jit(jax.vmap(one))(jax.random.split(jax.random.key(1), DRAWS))
    assert errors_apart(np.asarray(ratios), 1.0) < STANDARD_ERRORS


def test_a_place_that_is_not_known_widens_the_cells() -> None:
    """Mean and variance of what another puts into each cell, against their sums over its two places."""
    likelihood = image(gaussian)
    places, weights, existence = ((2.0, 3.0), (3.0, 3.0)), np.array([0.7, 0.3]), 0.8
    maps = [np.asarray(likelihood.levels(jax.tree.map(lambda v: v[0], planar(place)))) for place in places]
    mean = existence * sum(weight * each for weight, each in zip(weights, maps, strict=True))
    square = existence * sum(weight * each**2 for weight, each in zip(weights, maps, strict=True))
    states = jax.tree.map(lambda values: values[None], planar(*places))
    scan = noise()
    found = with_others(likelihood, scan, states, jnp.log(jnp.asarray(weights))[None], jnp.asarray([existence]))
    factor = 1 / np.sqrt(1 + square - mean**2)
    np.testing.assert_allclose(found.gain, factor, rtol=1e-5)
    np.testing.assert_allclose(found.values, (np.asarray(scan.values) - mean) * factor, rtol=1e-4, atol=1e-5)


def test_bearings_of_another_add_to_the_false_ones() -> None:
    likelihood, scan = CASES["bearings"]
    found = with_others(likelihood, scan, *certain((1000.0, 100.0)))
    off = np.array([0.1, 0.12, 1.0, -2.0]) - math.atan2(100.0, 1000.0)
    density = np.exp(-0.5 * (off / SENSOR.error) ** 2) / (SENSOR.error * math.sqrt(2 * math.pi))
    expected = 1 + 0.9 * density / (4.0 / (2 * math.pi))
    np.testing.assert_allclose(np.asarray(found.crowding)[:4], expected, rtol=1e-4)
