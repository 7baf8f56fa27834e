"""Particles with a bit of existence: the chain alone, resampling, and the same existence as the Bernoulli filter."""

import dataclasses
import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.beliefs.belief import Belief, update
from faintrack.filters.bernoulli_particle import BernoulliParticleFilter
from faintrack.filters.existence_particle import ExistenceParticleFilter, OfPossible, PossibleState, of_target
from faintrack.filters.run import run
from faintrack.likelihoods.bearing_sets import BearingSetLikelihood
from faintrack.sensors.bearing_draws import draw_bearing_set
from faintrack.sensors.bearing_sets import BearingSensor
from faintrack.targets.births import NormalBirth
from faintrack.targets.motion import PlanarMotion
from faintrack.targets.states import PlanarState
from faintrack.targets.target import Target, rates
from tests.tolerances import STANDARD_ERRORS, assert_same_mean, rounding

PARTICLES, SCANS, KEYS = 500, 8, 120
SENSOR = BearingSensor(math.radians(2), 0.9, 4.0)


def state(*components: float) -> PlanarState:
    return PlanarState(*(jnp.asarray(value, float) for value in components))


BIRTH = NormalBirth(state(300.0, 200.0, 5.0, -5.0), state(40.0, 40.0, 2.0, 2.0))
TARGET = Target(BIRTH, PlanarMotion(0.3), *rates(0.05, 0.9, 1.0))
FILTER = ExistenceParticleFilter(TARGET, PARTICLES)


@eqx.filter_jit
def start(filter: ExistenceParticleFilter, key: jax.Array) -> Belief:
    return filter.init(key, existence=0.4)


@eqx.filter_jit
def predict(filter: ExistenceParticleFilter, belief: Belief, time: jax.Array, key: jax.Array) -> Belief:
    return filter.predict(belief, time, key)


def test_without_scans_existence_is_the_chain() -> None:
    """Shares of independent particles, scan by scan."""
    filter = ExistenceParticleFilter(TARGET, 20_000)
    belief, q = start(filter, jax.random.key(0)), 0.4
    assert float(of_target(belief).existence) == pytest.approx(q, abs=STANDARD_ERRORS * math.sqrt(q * (1 - q) / 20_000))
    for scan in range(1, 4):
        belief = predict(filter, belief, jnp.asarray(float(scan)), jax.random.key(scan))
        q = 0.05 * (1 - q) + 0.9 * q
        error = math.sqrt(q * (1 - q) / 20_000)
        assert float(of_target(belief).existence) == pytest.approx(q, abs=STANDARD_ERRORS * error)


def belief_with(log_weights: np.ndarray, present: np.ndarray) -> Belief:
    """Particles whose x is their number."""
    count = len(log_weights)
    zero = jnp.zeros(count)
    states = PossibleState(PlanarState(jnp.arange(float(count)), zero, zero, zero), jnp.asarray(present))
    return Belief(states, jnp.asarray(log_weights, float), jnp.asarray(jnp.inf), jnp.asarray(0.0), zero)


@pytest.mark.parametrize("effective", [0.4, 0.6])
def test_particles_are_drawn_anew_where_few_are_effective(effective: float) -> None:
    """Equal weights on a share of the particles make that share the effective number."""
    count = 200
    held = np.arange(count) < effective * count
    with np.errstate(divide="ignore"):
        before = belief_with(np.log(held / held.sum()), np.ones(count, bool))
    still = dataclasses.replace(TARGET, motion=PlanarMotion(0.0), departure_rate=0.0)
    after = predict(ExistenceParticleFilter(still, count), before, jnp.asarray(1.0), jax.random.key(3))
    x = np.asarray(after.states.state.x)
    if effective < 0.5:
        assert x.max() < effective * count
        np.testing.assert_allclose(after.log_weights, -math.log(count), rtol=1e-6)
    else:
        np.testing.assert_array_equal(x, np.arange(count))
        np.testing.assert_array_equal(after.log_weights, before.log_weights)


def test_update_is_bayes_rule_over_truths() -> None:
    """Weights, gain and existence by hand."""
    weights, present, ratio = np.array([0.1, 0.2, 0.3, 0.4]), np.array([1, 0, 1, 0], bool), np.array([2.0, 9, 5, 9])
    before = belief_with(np.log(weights), present)
    after, log_gain = update(before, jnp.where(before.states.present, jnp.log(ratio), 0))
    joint = weights * np.where(present, ratio, 1)
    told = of_target(after)
    assert math.exp(float(log_gain)) == pytest.approx(joint.sum(), rel=rounding(np.float32, 10))
    assert float(told.existence) == pytest.approx(joint[present].sum() / joint.sum(), rel=rounding(np.float32, 10))
    expected = np.where(present, joint / joint[present].sum(), 0)
    np.testing.assert_allclose(np.exp(told.log_weights), expected, rtol=rounding(np.float32, 10))


def test_without_any_target_there_is_none() -> None:
    told = of_target(belief_with(np.log(np.full(4, 0.25)), np.zeros(4, bool)))
    assert float(told.existence) == 0
    assert np.isfinite(told.log_weights).all()


@eqx.filter_jit
def existences(keys: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Of both filters on the same scans, each with its own draws: shape (filter, key, scan); log of all gains."""
    time, path = jnp.arange(1.0, SCANS + 1), state(300.0, 200.0, 5.0, -5.0)
    draw = jax.vmap(lambda key, time: draw_bearing_set(key, SENSOR, 16, time, state(0, 0, 0, 0), path, time > 2)[0])
    scans = draw(jax.random.split(jax.random.key(5), SCANS), time)
    likelihood = BearingSetLikelihood(SENSOR)

    def with_bit(key: jax.Array) -> tuple[jax.Array, jax.Array]:
        _, told, gains = run(FILTER, OfPossible(likelihood), scans, key, lambda belief: of_target(belief).existence)
        return told, gains.sum()

    def core(key: jax.Array) -> tuple[jax.Array, jax.Array]:
        filter = BernoulliParticleFilter(TARGET, PARTICLES * 4 // 5, PARTICLES // 5)
        _, (odds, told), evidence = run(filter, likelihood, scans, key, lambda each: (each.log_odds, each.existence))
        before = odds - evidence
        gains = jnp.logaddexp(jax.nn.log_sigmoid(-before), jax.nn.log_sigmoid(before) + evidence)
        return told, gains.sum()

    both = [jax.vmap(each)(keys) for each in (with_bit, core)]
    return jnp.stack([told for told, _ in both]), jnp.stack([gains for _, gains in both])


def test_both_filters_estimate_the_same_existence_and_the_core_with_less_variance() -> None:
    told, gains = (np.asarray(each, float) for each in existences(jax.random.split(jax.random.key(7), KEYS)))
    # The product of the gains is unbiased, however few the particles.
    assert_same_mean(*np.exp(gains - gains.max()))
    # Existence is a ratio: its bias is of the order of one over the particles, below a standard error here.
    assert_same_mean(told[0], told[1])
    bit, core = told.var(axis=1).mean(axis=1)
    # Variances of normal estimates have a relative standard error of sqrt(2 / keys) each.
    assert core < bit * (1 - STANDARD_ERRORS * math.sqrt(2 * 2 / (KEYS * SCANS)))
