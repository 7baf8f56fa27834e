"""Several Bernoulli beliefs beside each other: what scans that say nothing leave, who is found and who has left."""

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.beliefs.axis import between
from faintrack.beliefs.grids import Grid
from faintrack.likelihoods.superposed import SuperposedLikelihood
from faintrack.sensors.superposed import SensorNetwork, SuperposedScan, inverse_square
from faintrack.targets.births import PlanarBirth
from faintrack.targets.motion import PlanarMotion
from faintrack.targets.states import PlanarState
from faintrack.targets.target import Target, rates
from faintrack.trackers.beliefs import Beliefs
from faintrack.trackers.multi_bernoulli import BernoulliEstimate, MultiBernoulliTracker
from tests.tolerances import STANDARD_ERRORS, assert_equal

SURVIVAL, SLOTS, PARTICLES, SCANS = 0.95, 3, 200, 14
NEAR = 3.0
"""Metres; a reading tells a place to a metre or less, half way between two targets is 5."""

COMES, MEETS, LEAVES = 2, 6, 10
"""Scans at which the second target appears, it is nearest to the first, and it is there no more."""


@functools.cache
def tracker() -> MultiBernoulliTracker:
    x, y = (jnp.asarray(each.ravel(), jnp.float32) for each in np.meshgrid(*[np.arange(0.0, 41.0, 10.0)] * 2))
    place = between(0.0, 40.0, 16)
    likelihood = SuperposedLikelihood(
        SensorNetwork(x, y, inverse_square(500.0, 5.0)), Grid(PlanarState, (("x", place), ("y", place)))
    )
    middle = PlanarState(*(jnp.full(1, each) for each in (20.0, 20.0, 0.0, 0.0)))
    birth = PlanarBirth(middle, PlanarState(*(jnp.full(1, each) for each in (15.0, 15.0, 1.0, 1.0))))
    return MultiBernoulliTracker(
        Target(birth, PlanarMotion(0.2), *rates(1e-3, SURVIVAL, 1.0)), likelihood, SLOTS, PARTICLES
    )


def places() -> tuple[np.ndarray, np.ndarray]:
    """Of two targets that pass as far apart as sensors are; NaN where one is not there. Shape (scan, target)."""
    time = np.arange(SCANS)
    x = np.column_stack([20.0 + (time - MEETS), 20.0 - (time - MEETS)])
    y = np.column_stack([np.full(SCANS, 15.0), np.full(SCANS, 25.0)])
    there = np.column_stack([np.ones(SCANS, bool), (time >= COMES) & (time < LEAVES)])
    return np.where(there, x, np.nan), np.where(there, y, np.nan)


class Followed(NamedTuple):
    """Estimates of two targets; beliefs before and after a scan without a reading, and its estimate."""

    estimates: BernoulliEstimate
    before: Beliefs
    after: Beliefs
    said: BernoulliEstimate


@functools.cache
def followed() -> Followed:
    """One compiled step for all."""
    track, key = tracker(), jax.random.key(0)
    x, y = (jnp.asarray(each, jnp.float32) for each in places())
    levels = jnp.nansum(track.likelihood.network.levels(PlanarState(x, y, x, y)), axis=1)
    values = levels + jax.random.normal(jax.random.key(1), levels.shape)
    # The last scans hold no reading.
    values = jnp.concatenate([values, jnp.full((1, values.shape[1]), jnp.nan)])
    beliefs = track.init(key)
    made: list[tuple[Beliefs, Any]] = []
    for number, value in enumerate(values):
        scan = SuperposedScan(jnp.asarray(number + 1.0), value, jnp.zeros((value.size, 0)))
        beliefs, estimate = track.step(beliefs, scan, jax.random.fold_in(key, number))
        made.append((beliefs, estimate))
    estimates = jax.tree.map(lambda *each: jnp.stack(each), *(estimate for _, estimate in made[:SCANS]))
    return Followed(estimates, made[-2][0], *made[-1])


@pytest.mark.slow
def test_two_that_pass_are_followed_and_one_that_leaves_is_gone() -> None:
    estimates = followed().estimates
    x, y = places()
    for scan in range(SCANS):
        found = np.asarray(estimates.existence[scan]) > 0.5
        there = np.isfinite(x[scan])
        if scan in (0, COMES):
            # Whether it is found at once is chance.
            continue
        assert found.sum() == there.sum()
        at = np.column_stack([np.asarray(estimates.mean.x[scan])[found], np.asarray(estimates.mean.y[scan])[found]])
        true = np.column_stack([x[scan], y[scan]])[there]
        assert np.all(np.hypot(*(at[:, None] - true).transpose(2, 0, 1)).min(axis=1) < NEAR)


@pytest.mark.slow
def test_a_scan_without_a_reading_leaves_what_was_forecast() -> None:
    """Existence exactly, places to within what resampling does."""
    before, after = followed().before, followed().after
    held = np.asarray(before.existence) > 0.5
    assert held.sum() == 1
    # The same target has stayed; one that took its place is newborn.
    stays = np.exp(-tracker().target.departure_rate)
    assert_equal(np.asarray(after.existence)[:1], stays * np.asarray(before.existence)[held], np.float32, 100)
    weights = np.exp(np.asarray(before.log_weights, float))[held][0]
    x, vx = (np.asarray(each, float)[held][0] for each in (before.states.x, before.states.vx))
    moved = x + vx
    middle = weights @ moved
    error = np.sqrt(weights @ (moved - middle) ** 2 / PARTICLES)
    assert abs(float(followed().said.mean.x[0]) - middle) < STANDARD_ERRORS * error


def test_slots_are_in_the_order_of_existence() -> None:
    existence = np.asarray(followed().estimates.existence)
    assert np.all(np.diff(existence, axis=1) <= 0)
