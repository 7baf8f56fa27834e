"""What every filter and tracker obeys, whatever the scene."""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.beliefs.belief import Belief, covariance, mean
from faintrack.filters.run import run
from faintrack.targets.motion import (
    BearingMotion,
    Noise,
    PlanarMotion,
    WalkingMotion,
    piecewise_acceleration,
    white_acceleration,
)
from faintrack.targets.states import BearingState, PlanarState, WaveState
from faintrack.trackers.single import SingleTargetTracker
from tests.scenes import Scene, batch, followed, part, predict, start, step, update
from tests.tolerances import assert_equal, assert_same_mean, rounding

KEY = jax.random.key(11)
SCANS, KEYS = 6, 100
PARTICLES, BIRTHS = 200, 50
POINTS = PARTICLES + BIRTHS


def belief_of(scene: Scene, existence: float = 0.5) -> Belief:
    """A belief after one scan, so that its weights differ."""
    filter = scene.filter()
    belief = predict(filter, start(filter, KEY, existence), 1.0, KEY)
    pull = 3 * jnp.cos(belief.states.bearing).astype(scene.dtype)
    return update(belief, pull)[0]


def assert_same_bits(first: Any, second: Any) -> None:
    for one, other in zip(jax.tree.leaves(first), jax.tree.leaves(second), strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_scan_that_says_nothing_changes_nothing(dtype: type) -> None:
    belief = belief_of(Scene(dtype))
    updated, log_evidence = update(belief, jnp.zeros(POINTS, dtype))
    assert abs(log_evidence) < rounding(dtype, POINTS)
    assert_equal(updated.log_weights, belief.log_weights, dtype, POINTS, scale=1.0)
    assert_equal(updated.existence, belief.existence, dtype, POINTS)
    assert_same_bits(updated.states, belief.states)


@pytest.mark.parametrize("existence", [0.0, 1e-6, 0.5, 0.999])
def test_probability_stays_probability(dtype: type, existence: float) -> None:
    scene = Scene(dtype)
    filter = scene.filter()
    belief = start(filter, KEY, existence)
    for log_ratio in (-80.0, 0.0, 80.0):
        predicted = predict(filter, belief, belief.time + 1, KEY)
        updated, log_evidence = update(predicted, log_ratio * jnp.sin(predicted.states.bearing))
        for each in (predicted, updated):
            assert_equal(np.exp(each.log_weights).sum(), 1.0, dtype, POINTS)
            assert np.isfinite(each.log_odds)
        assert np.isfinite(log_evidence)
        belief = updated


def test_a_scan_at_the_start_finds_the_newborn(dtype: type) -> None:
    """No time has passed in which a target could appear: it is absent for certain, and nothing is undefined."""
    filter = Scene(dtype).filter()
    belief, log_evidence = update(predict(filter, filter.init(KEY), 0.0, KEY), jnp.ones(POINTS, dtype))
    assert belief.existence == 0
    assert_equal(log_evidence, 1.0, dtype, POINTS)
    assert_equal(np.exp(belief.log_weights).sum(), 1.0, dtype, POINTS)


def test_a_scan_that_rules_a_target_out_everywhere_leaves_the_weights(dtype: type) -> None:
    belief = belief_of(Scene(dtype))
    updated, log_evidence = update(belief, jnp.full(POINTS, -jnp.inf, dtype))
    assert log_evidence == -jnp.inf
    assert updated.existence == 0
    assert_same_bits(updated.log_weights, belief.log_weights)


@pytest.mark.parametrize("existence", [0.01, 0.5, 0.99])
def test_existence_in_two_steps_equals_one(dtype: type, existence: float) -> None:
    filter = Scene(dtype).filter()
    belief = start(filter, KEY, existence)
    once = predict(filter, belief, 2.5, KEY)
    twice = predict(filter, predict(filter, belief, 0.7, KEY), 2.5, KEY)
    assert_equal(once.existence, twice.existence, dtype, operations=50)


def test_rates_give_back_their_probabilities(dtype: type) -> None:
    scene = Scene(dtype)
    appears, stays = scene.target.transition(jnp.asarray(1.0, dtype))
    assert_equal(np.array([appears, stays]), np.array([0.05, 0.95]), dtype, operations=20)


def test_the_same_target_in_two_steps_equals_one(dtype: type) -> None:
    """Staying without being replaced has the probability exp(-departure rate times interval)."""
    target = Scene(dtype).target

    def same(interval: float) -> np.ndarray:
        interval = jnp.asarray(interval, dtype)
        return np.asarray(target.transition(interval)[1] - target.replacement(interval))

    assert_equal(same(0.7) * same(1.8), same(2.5), dtype, operations=20)
    assert_equal(same(2.5), np.exp(-2.5 * target.departure_rate), dtype, operations=20)


@pytest.mark.parametrize("existence", [0.0, 0.3, 1.0])
def test_what_may_happen_has_the_probability_1(dtype: type, existence: float) -> None:
    """Five things, which also add up to the birth and survival probabilities."""
    target, interval = Scene(dtype).target, jnp.asarray(1.0, dtype)
    with np.errstate(divide="ignore"):
        log_odds = jnp.asarray(np.log(existence) - np.log1p(-existence), dtype)
    forecast = target.forecast(log_odds, interval)
    assert_equal(np.exp(np.array(forecast)).sum(), 1.0, dtype, operations=20)
    expected = 0.05 * (1 - existence) + 0.95 * existence
    assert_equal(np.exp(forecast.existence), expected, dtype, operations=50)
    assert_equal(jax.nn.sigmoid(forecast.log_odds), expected, dtype, operations=50)
    if existence > 0:
        assert_equal(np.exp(forecast.replaced), existence * target.replacement(interval), dtype, operations=50)


@pytest.mark.parametrize("first", [0.1, 1.0, 30.0])
def test_white_acceleration_in_two_steps_equals_one(dtype: type, first: float) -> None:
    """F Q(s) F' + Q(t) = Q(s + t), with F the motion over t."""
    second = 2.0
    forward = np.array([[1.0, second], [0.0, 1.0]])
    composed = forward @ noise_covariance(white_acceleration, first, dtype) @ forward.T
    composed += noise_covariance(white_acceleration, second, dtype)
    once = noise_covariance(white_acceleration, first + second, dtype)
    assert_equal(composed, once, dtype, operations=20)


def test_piecewise_acceleration_is_that_of_one_scan(dtype: type) -> None:
    """At one second it differs from white acceleration in the position variance alone: 1/4 against 1/3."""
    white, piecewise = (noise_covariance(noise, 1.0, dtype) for noise in (white_acceleration, piecewise_acceleration))
    assert_equal(white, np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]]), dtype, operations=10)
    assert_equal(piecewise, np.array([[1 / 4, 1 / 2], [1 / 2, 1.0]]), dtype, operations=10)


def noise_covariance(noise: Noise, interval: float, dtype: type) -> np.ndarray:
    a, b, c = noise(jnp.asarray(interval, dtype))
    root = np.array([[a, b], [c, 0.0]], np.float64)
    return root @ root.T


MOTIONS = {
    "line, reflected at its end": (BearingMotion(0.1, 0.5), BearingState(*jnp.array([[0.1], [-0.3], [-10.0]]))),
    "circle, wrapped": (BearingMotion(0.1, 0.5, circular=True), BearingState(*jnp.array([[-3.1], [-0.3], [-10.0]]))),
    "above the horizon": (
        WalkingMotion(BearingMotion(0.1, 0.5, circular=True), "elevation", 0.1, 0.0, 1.2),
        WaveState(*jnp.array([[-3.1], [-0.3], [-10.0], [0.1]])),
    ),
    "plane": (PlanarMotion(0.4), PlanarState(*jnp.array([[1.0], [2.0], [-1.0], [0.5]]))),
}


@pytest.mark.parametrize("case", MOTIONS)
def test_motion_in_two_steps_equals_one(case: str) -> None:
    """100,000 draws, 5 standard errors: means, squares and products of the components."""
    motion, start = MOTIONS[case]
    cloud = jax.tree.map(lambda component: jnp.broadcast_to(component, 100_000), start)
    once = motion.move(cloud, 2.0, jax.random.key(1))
    twice = motion.move(motion.move(cloud, 0.5, jax.random.key(2)), 1.5, jax.random.key(3))
    assert_same_mean(moments(once), moments(twice))


def moments(states: Any) -> np.ndarray:
    """Shape (point, moment); an angle enters through its sine and cosine."""
    columns = []
    for field in dataclasses.fields(states):
        values = np.asarray(getattr(states, field.name), np.float64)
        columns += [np.sin(values), np.cos(values)] if field.name in states.angles else [values]
    products = [one * other for number, one in enumerate(columns) for other in columns[number:]]
    return np.stack(columns + products, axis=1)


def test_order_of_points_is_irrelevant_to_an_update(dtype: type) -> None:
    belief = belief_of(Scene(dtype))
    order = np.random.default_rng(1).permutation(POINTS)
    log_ratio = jnp.sin(3 * belief.states.bearing)
    shuffled = dataclasses.replace(
        belief,
        states=jax.tree.map(lambda component: component[order], belief.states),
        log_weights=belief.log_weights[order],
    )
    (expected, expected_evidence), (actual, evidence) = (
        update(belief, log_ratio),
        update(shuffled, log_ratio[order]),
    )
    assert_equal(evidence, expected_evidence, dtype, POINTS, scale=1.0)
    assert_equal(actual.log_weights, expected.log_weights[order], dtype, POINTS, scale=1.0)
    assert_equal(covariance(actual), covariance(expected), dtype, POINTS, scale=10.0)
    for one, other in zip(jax.tree.leaves(mean(actual)), jax.tree.leaves(mean(expected)), strict=True):
        assert_equal(one, other, dtype, POINTS, scale=10.0)


def test_order_of_points_is_irrelevant_to_a_prediction(scene: Scene) -> None:
    """400 keys, 5 standard errors: resampling reads the points in their order, what it draws is the same on average."""
    belief = belief_of(scene)
    order = np.random.default_rng(1).permutation(POINTS)
    shuffled = dataclasses.replace(
        belief,
        states=jax.tree.map(lambda component: component[order], belief.states),
        log_weights=belief.log_weights[order],
    )
    filter = scene.filter()

    def averages(belief: Belief, seed: int) -> np.ndarray:
        rows = []
        for key in jax.random.split(jax.random.key(seed), 400):
            predicted = predict(filter, belief, 2.0, key)
            rows.append(np.exp(predicted.log_weights) @ moments(predicted.states))
        return np.stack(rows)

    assert_same_mean(averages(belief, 1), averages(shuffled, 2))


def test_same_key_same_bits(scene: Scene) -> None:
    filter, likelihood, scans = followed(scene.dtype)
    assert_same_bits(run(filter, likelihood, scans, KEY), run(filter, likelihood, scans, KEY))


def test_a_run_is_one_step_after_another(scene: Scene) -> None:
    """To rounding: a loop and a single step are compiled apart. Each step starts where the run was."""
    filter, likelihood, scans = followed(scene.dtype)
    _, kept, log_evidence = run(filter, likelihood, scans, KEY)
    belief = filter.init(jax.random.fold_in(KEY, SCANS))
    for number in range(SCANS):
        expected, scan = part(kept, number), part(scans, number)
        actual, evidence = step(filter, likelihood, belief, scan, jax.random.fold_in(KEY, number))
        assert_equal(evidence, log_evidence[number], scene.dtype, POINTS)
        assert_close(actual, expected)
        belief = expected


def test_a_batch_is_one_run_beside_another(scene: Scene) -> None:
    """To rounding, as above; at the first scan, since rounding may later turn the choice of a particle."""
    filter, likelihood, scans = followed(scene.dtype)
    keys = jax.random.split(KEY, KEYS)
    _, beside, _ = batch(filter, likelihood, scans, keys)
    for number in (0, 7, KEYS - 1):
        _, single, _ = run(filter, likelihood, scans, keys[number])
        assert_close(part(beside, (number, 0)), part(single, 0))


@pytest.mark.slow
def test_blocks_of_any_length_give_the_same_bits(scene: Scene) -> None:
    """Six scans at once, or three and three; a single scan is compiled apart and agrees to rounding."""
    filter, likelihood, scans = followed(scene.dtype)
    tracker = SingleTargetTracker(filter, likelihood, declare=0.6)
    start = tracker.init(KEY)
    last, estimates = tracker.steps(start, scans, KEY)
    middle, early = tracker.steps(start, part(scans, slice(0, 3)), KEY)
    end, late = tracker.steps(middle, part(scans, slice(3, 6)), KEY)
    assert_same_bits((end, jax.tree.map(lambda *parts: jnp.concatenate(parts), early, late)), (last, estimates))
    _, alone = eqx.filter_jit(tracker.step)(middle, part(scans, 3), KEY)
    assert_close(alone, part(late, 0))


def test_a_track_exists_at_most_as_surely_as_any_target(scene: Scene) -> None:
    filter, likelihood, scans = followed(scene.dtype)
    tracker = SingleTargetTracker(filter, likelihood, declare=0.6)
    _, estimates = tracker.steps(tracker.init(KEY), scans, KEY)
    assert estimates.label.max() == 1
    assert np.all(estimates.track_existence <= estimates.existence)
    assert np.all((estimates.existence >= 0) & (estimates.existence <= 1))


def test_capacity_holds_room_and_changes_nothing(scene: Scene) -> None:
    """All of it in use is a filter without; what lies beyond `particles` has no weight."""
    key, belief = jax.random.key(5), belief_of(scene)
    expected = predict(scene.filter(), belief, 2.0, key)
    full, roomy = (
        predict(scene.filter(jnp.array(particles), capacity=PARTICLES), belief, 2.0, key)
        for particles in (PARTICLES, PARTICLES - 30)
    )
    assert_close(full, expected)
    assert np.all(roomy.log_weights[PARTICLES - 30 : PARTICLES] == -np.inf)
    assert np.all(np.isfinite(roomy.log_weights[: PARTICLES - 30]))
    assert_equal(np.exp(roomy.log_weights).sum(), 1.0, scene.dtype, POINTS)
    assert_equal(roomy.existence, expected.existence, scene.dtype, POINTS)


def assert_close(actual: Any, expected: Any) -> None:
    for one, other in zip(jax.tree.leaves(actual), jax.tree.leaves(expected), strict=True):
        assert_equal(one, other, np.float32, POINTS)
