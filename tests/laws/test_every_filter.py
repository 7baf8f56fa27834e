"""Laws of filters, on every one of them (`tests/cases.py`)."""

import dataclasses
import functools
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.beliefs.belief import Belief, update
from faintrack.filters.run import run
from faintrack.sensors.cells import CellScan
from tests.cases import FILTERS, PLACE, believed, for_filter
from tests.tolerances import assert_equal

SCANS, EXISTENCE = 4, 0.7
POINTS = 2000
"""At least as many as any of the filters has; roundings in a sum over them."""
RANDOM = ("particles with a bit", "grid, cell particles")
"""Existence itself is estimated by draws."""

every = pytest.mark.parametrize("name", FILTERS)
exact = pytest.mark.parametrize("name", [name for name in FILTERS if name not in RANDOM])


class Told(NamedTuple):
    """What one compiled program says of a filter.

    Attributes
    ----------
    started : belief after a prediction to the time of the start.
    once, twice : beliefs after a prediction over three seconds, and over one and two, where no target appears.
    same : belief `once` after a scan that says nothing.
    existence, total : after every scan of a loud target: probability, and sum of all weights.
    log_odds : after every scan.
    """

    started: Belief
    once: Belief
    twice: Belief
    same: Belief
    existence: jax.Array
    total: jax.Array
    log_odds: jax.Array


@eqx.filter_jit
def told_of(filter: Any, likelihood: Any, scans: CellScan, key: jax.Array) -> Told:
    closed = dataclasses.replace(filter, target=dataclasses.replace(filter.target, arrival_rate=0.0))
    start = closed.init(key, existence=EXISTENCE)
    once = closed.predict(start, 3.0, key)
    twice = closed.predict(closed.predict(start, 1.0, key), 3.0, key)

    def keep(belief: Belief) -> tuple[jax.Array, ...]:
        belief = believed(belief)
        return belief.existence, jnp.exp(belief.log_weights).sum(), belief.log_odds

    _, kept, _ = run(filter, likelihood, scans, key, keep)
    started = filter.predict(filter.init(key), 0.0, key)
    same = update(once, jnp.zeros_like(once.log_weights))[0]
    return Told(*(believed(belief) for belief in (started, once, twice, same)), *kept)


def loud(dtype: type = np.float32) -> CellScan:
    """A target that stands in the fifth cell, and at last a scan that speaks against any."""
    values = np.random.default_rng(0).normal(size=(SCANS, PLACE.count))
    values[:-1, 4] += 8.0
    values[-1] -= 6.0
    return CellScan(jnp.arange(1.0, SCANS + 1, dtype=dtype), jnp.asarray(values, dtype))


@functools.cache
def told(name: str) -> Told:
    filter = FILTERS[name]()
    return jax.tree.map(np.asarray, told_of(filter, for_filter(filter), loud(), jax.random.key(3)))


@every
def test_a_scan_at_the_start_finds_the_newborn(name: str) -> None:
    """No time has passed in which a target could appear: it is absent for certain, and nothing is undefined."""
    started = told(name).started
    assert started.log_odds == -np.inf
    assert_equal(np.exp(started.log_weights).sum(), 1.0, np.float32, POINTS)


@every
def test_probability_stays_probability(name: str) -> None:
    of = told(name)
    assert np.all((of.existence >= 0) & (of.existence <= 1))
    assert_equal(of.total, np.ones(SCANS), np.float32, POINTS)
    assert of.existence[-2] > 0.99
    assert of.existence[-1] < of.existence[-2]


@every
def test_a_scan_that_says_nothing_changes_nothing(name: str) -> None:
    once, same = told(name).once, told(name).same
    assert_equal(same.log_weights, once.log_weights, np.float32, POINTS, scale=1.0)
    assert_equal(same.log_odds, once.log_odds, np.float32, POINTS, scale=1.0)


@exact
def test_existence_in_two_steps_equals_one(name: str) -> None:
    """Where no target appears between, which would move in two steps and not in one; off a grid it has left."""
    of = told(name)
    assert_equal(of.twice.log_odds, of.once.log_odds, np.float32, POINTS, scale=1.0)


@pytest.mark.parametrize("name", ["grid, shifts", "grid, separable", "grid, alternating directions"])
def test_weights_of_a_grid_in_two_steps_equal_one(name: str) -> None:
    """Where none comes back, either."""
    of = told(name)
    assert_equal(np.exp(of.twice.log_weights), np.exp(of.once.log_weights), np.float32, POINTS, scale=1.0)


@every
def test_same_key_same_bits(name: str) -> None:
    filter = FILTERS[name]()
    again = told_of(filter, for_filter(filter), loud(), jax.random.key(3))
    for one, other in zip(jax.tree.leaves(told(name)), jax.tree.leaves(again), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("name", [name for name in FILTERS if name.startswith("grid") and name not in RANDOM])
def test_single_and_double_precision_agree(name: str) -> None:
    """Of what draws nothing. A loud scan is a log ratio of 14, and grids hold weights down to e^-87."""
    with jax.enable_x64(True):
        filter = FILTERS[name]()
        birth = jnp.full((), -np.log(filter.grid.size), np.float64)
        wide = dataclasses.replace(filter, log_birth=birth)
        found = np.asarray(told_of(wide, for_filter(filter), loud(np.float64), jax.random.key(3)).log_odds)
    np.testing.assert_allclose(found, told(name).log_odds, rtol=1e-4, atol=1e-4)
