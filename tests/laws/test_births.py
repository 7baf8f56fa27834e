"""Birth densities in the plane, and newborn particles along bearings that stand for theirs."""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.errors import InputError
from faintrack.likelihoods.bearing_sets import BearingSetLikelihood
from faintrack.likelihoods.several_sets import SeveralSetsLikelihood
from faintrack.sensors.bearing_sets import BearingSensor, BearingSet, bearing_set
from faintrack.sensors.several_sets import SeveralSets
from faintrack.targets.births import NormalBirth, RangeBirth
from faintrack.targets.states import PlanarState
from tests.tolerances import assert_mean, assert_same_mean

COUNT = 40_000
SENSOR = BearingSensor(0.03, 0.9, 3.0, -0.5, 2.5)


def state(*components: float) -> PlanarState:
    return PlanarState(*(jnp.asarray(value, float) for value in components))


HERE = state(50.0, -20.0, 0.0, 0.0)
BIRTH = RangeBirth(HERE, 100.0, 500.0, 4.0, SENSOR.start, SENSOR.width)


@eqx.filter_jit
def along(scan: BearingSet, key: jax.Array) -> tuple[PlanarState, jax.Array]:
    return BearingSetLikelihood(SENSOR).propose(scan, BIRTH, key, COUNT)


def test_normal_birth_has_its_moments() -> None:
    mean, std = np.array([380.0, 200.0, 12.0, -12.0]), np.array([50.0, 40.0, 3.0, 2.0])
    drawn = NormalBirth(state(*mean), state(*std)).sample(jax.random.key(0), COUNT)
    off = (np.stack(jax.tree.leaves(drawn), axis=1) - mean) / std
    assert_mean(off, 0.0)
    assert_mean(off[:, :, None] * off[:, None, :], np.eye(4))


@pytest.mark.parametrize("bearings", [[], [0.4], [0.4, 1.9, 1.95]])
def test_draws_along_bearings_stand_for_the_birth_density(bearings: list[float]) -> None:
    """Weighted means of features are those of the density itself: bearing by bearing, near and far, slow and fast."""
    scan = bearing_set(SENSOR, 0.0, np.array(bearings), HERE, capacity=4)

    def features(states: PlanarState) -> np.ndarray:
        bearing = np.arctan2(states.y - HERE.y, states.x - HERE.x)
        distance = np.hypot(states.x - HERE.x, states.y - HERE.y)
        edges = np.array([-0.5, 0.3, 0.5, 1.2, 1.85, 2.0])
        within = (bearing[:, None] >= edges[:-1]) & (bearing[:, None] < edges[1:])
        return np.column_stack([within, distance / 100, np.asarray(states.vx), np.asarray(states.vy)])

    states, log_weights = along(scan, jax.random.key(1))
    weights = np.exp(np.asarray(log_weights, float))
    assert_mean(weights, 1.0)
    assert_same_mean(features(states) * weights[:, None], features(BIRTH.sample(jax.random.key(2), COUNT)))
    if bearings:
        near = np.abs(np.arctan2(states.y - HERE.y, states.x - HERE.x)[:, None] - np.array(bearings)) < 0.1
        assert near.any(axis=1).mean() > 0.5


def test_draws_where_observers_agree_stand_for_the_birth_density() -> None:
    """As above, with a second observer that hears a target to its left, and a third that did not report."""
    seconds = (HERE, state(400.0, -20.0, 0.0, 0.0), state(0.0, 0.0, 0.0, 0.0))
    heard = [
        bearing_set(SENSOR, 0.0, np.array(z), at, 4) for z, at in zip([[0.6, 1.8], [1.5], []], seconds, strict=True)
    ]
    sets = jax.tree.map(lambda *parts: jnp.stack(parts), *heard)
    scan = SeveralSets(jnp.array(0.0), sets, jnp.array([True, True, False]))
    likelihood = SeveralSetsLikelihood(BearingSetLikelihood(SENSOR))
    draw = eqx.filter_jit(lambda key: likelihood.propose(scan, BIRTH, key, 400))
    told, ratios = [], []
    for key in jax.random.split(jax.random.key(4), 60):
        states, log_weights = draw(key)
        weights = np.exp(np.asarray(log_weights, float))
        features = np.column_stack([np.ones(400), states.x / 100, states.y / 100, states.vx, states.vx**2])
        told.append((features * weights[:, None]).mean(axis=0))
        ratios.append((weights * np.exp(likelihood.log_ratio(scan, states))).mean())
    free = BIRTH.sample(jax.random.key(2), COUNT)
    features = np.column_stack([np.ones(COUNT), free.x / 100, free.y / 100, free.vx, free.vx**2])
    assert_same_mean(np.array(told), features)
    assert_same_mean(np.array(ratios), np.exp(likelihood.log_ratio(scan, free)))


def test_births_follow_the_observer() -> None:
    there = state(5000.0, 0.0, 0.0, 0.0)
    scan = bearing_set(SENSOR, 0.0, np.array([0.4]), there, capacity=4)
    states, _ = along(scan, jax.random.key(1))
    distance = np.hypot(states.x - 5000.0, states.y)
    assert distance.min() > 99
    assert distance.max() < 501


def test_a_range_birth_that_cannot_be() -> None:
    with pytest.raises(InputError, match="nearest 500 m, farthest 100 m, speed 4 m/s; expected the nearest first"):
        RangeBirth(HERE, 500.0, 100.0, 4.0)
    with pytest.raises(InputError, match="farthest inf m"):
        RangeBirth(HERE, 0.0, math.inf, 4.0)
