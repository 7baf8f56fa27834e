"""Data association with existence against enumeration of all hypotheses, in double precision by hand."""

import itertools
import math
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import multivariate_normal

from faintrack.baselines.imm_pda import ImmPda, Models
from faintrack.baselines.ipda import Ipda, Presumed
from faintrack.baselines.pda import Association, Gaussian, extended, merged, turned, unscented
from faintrack.targets.target import Target, rates
from tests.tolerances import rounding

FALSE, STEP = 0.05, np.array([[1.0, 1.0], [0.0, 1.0]])
NOISE, ERROR = 0.2 * np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]]), 4.0
BIRTH_MEAN, BIRTH = np.array([10.0, 1.0]), np.diag([25.0, 1.0])
ROW = np.array([[1.0, 0.0]])


class Heard(NamedTuple):
    values: jax.Array
    there: jax.Array


def heard(values: list[float], capacity: int = 4) -> Heard:
    padded = np.pad(np.array(values, float), (0, capacity - len(values)))
    return Heard(jnp.asarray(padded, float)[:, None], jnp.arange(capacity) < len(values))


def first(state: jax.Array, scan: Heard) -> jax.Array:
    return state[:1]


def values_of(scan: Heard) -> tuple[jax.Array, jax.Array]:
    return scan.values, scan.there


def ipda(detection: float, appears: float = 0.1, stays: float = 0.9) -> Ipda:
    # Arrays, so that one compiled step serves all of them.
    target = Target(None, None, *(jnp.asarray(rate, float) for rate in rates(appears, stays, 1.0)))
    association = Association(first, values_of, jnp.array([[ERROR]]), jnp.asarray(detection, float), FALSE)
    birth = Gaussian(jnp.asarray(BIRTH_MEAN), jnp.asarray(BIRTH))
    return Ipda(association, birth, jnp.asarray(STEP), jnp.asarray(NOISE), target, 1.0)


def enumerated(
    scans: list[list[float]], detection: float, appears: float, stays: float, existence: float
) -> tuple[float, np.ndarray]:
    """Existence and mean after the scans: every birth time, every association, each with a Kalman filter."""
    # (weight, mean, covariance); the target that is not there has no Gaussian.
    absent, present = 1 - existence, [(existence, BIRTH_MEAN, BIRTH)]
    for values in scans:
        moved = [(w * stays, STEP @ m, STEP @ c @ STEP.T + NOISE) for w, m, c in present]
        gone = (1 - stays) * sum(w for w, _, _ in present)
        moved.append((absent * appears, BIRTH_MEAN, BIRTH))
        absent = absent * (1 - appears) + gone
        present = []
        for (weight, mean, covariance), number in itertools.product(moved, range(-1, len(values))):
            if number < 0:
                present.append((weight * (1 - detection), mean, covariance))
                continue
            spread = ROW @ covariance @ ROW.T + ERROR
            gain = covariance @ ROW.T / spread
            density = multivariate_normal.pdf(values[number], (ROW @ mean)[0], spread[0, 0])
            after = mean + gain[:, 0] * (values[number] - (ROW @ mean)[0])
            present.append((weight * detection * density / FALSE, after, covariance - gain @ ROW @ covariance))
        total = absent + sum(w for w, _, _ in present)
        absent /= total
        present = [(w / total, m, c) for w, m, c in present]
    there = sum(w for w, _, _ in present)
    return there, sum(w * m for w, m, _ in present) / there


def followed(filter: Ipda, scans: list[list[float]], existence: float) -> Presumed:
    presumed = filter.init(existence)
    for values in scans:
        presumed, _ = taken_in(filter, presumed, heard(values))
    return presumed


@eqx.filter_jit
def taken_in(filter: Ipda, presumed: Presumed, scan: Heard) -> tuple[Presumed, jax.Array]:
    return filter.step(presumed, scan)


@pytest.mark.parametrize("values", [[], [12.0], [3.0, 12.0, 30.0]])
@pytest.mark.parametrize("detection", [0.5, 0.95])
def test_one_scan_is_exact(values: list[float], detection: float) -> None:
    """Nothing is there before, so that only the birth density is merged, with nothing."""
    found = followed(ipda(detection), [values], 0.0)
    existence, mean = enumerated([values], detection, 0.1, 0.9, 0.0)
    near = rounding(np.float32, 300)
    assert float(found.existence) == pytest.approx(existence, rel=near)
    np.testing.assert_allclose(found.state.mean, mean, rtol=near)


def test_a_target_that_cannot_be_missed_or_confused_is_exact() -> None:
    scans = [[11.0], [12.5], [13.4], [14.9]]
    found = followed(ipda(detection=1.0, appears=0.0, stays=0.9), scans, 0.4)
    existence, mean = enumerated(scans, 1.0, 0.0, 0.9, 0.4)
    assert float(found.existence) == pytest.approx(existence, rel=rounding(np.float32, 1000))
    np.testing.assert_allclose(found.state.mean, mean, rtol=rounding(np.float32, 1000))


def test_few_measurements_are_near_the_enumeration() -> None:
    """Merging forgets which part is which: a tenth of existence and half a standard deviation of the mean, here."""
    scans = [[11.0], [12.3, 40.0], [13.1]]
    found = followed(ipda(detection=0.9), scans, 0.0)
    existence, mean = enumerated(scans, 0.9, 0.1, 0.9, 0.0)
    assert float(found.existence) == pytest.approx(existence, abs=0.1)
    np.testing.assert_allclose(found.state.mean, mean, atol=0.5 * math.sqrt(ERROR))


def test_merged_has_the_moments_of_the_mixture() -> None:
    random = np.random.default_rng(0)
    weights, means = np.array([0.2, 0.5, 0.3]), random.normal(size=(3, 2))
    roots = random.normal(size=(3, 2, 2))
    parts = Gaussian(jnp.asarray(means), jnp.asarray(roots @ roots.transpose(0, 2, 1)))
    found = merged(jnp.asarray(weights), parts)
    mean = weights @ means
    covariances = roots @ roots.transpose(0, 2, 1)
    second = sum(w * (c + np.outer(m, m)) for w, m, c in zip(weights, means, covariances, strict=True))
    np.testing.assert_allclose(found.mean, mean, rtol=rounding(np.float32, 30))
    np.testing.assert_allclose(found.covariance, second - np.outer(mean, mean), rtol=1e-5, atol=1e-6)


def test_both_innovations_agree_where_it_is_linear() -> None:
    state = Gaussian(jnp.asarray(BIRTH_MEAN), jnp.asarray(BIRTH))
    one, two = (each(state, lambda state: state[:1] * 0.1, jnp.array([[0.5]])) for each in (extended, unscented))
    for first, second in zip(one, two, strict=True):
        np.testing.assert_allclose(first, second, rtol=rounding(np.float32, 100), atol=1e-6)


def test_unscented_bearing_has_the_moments_of_draws() -> None:
    """A bearing at the end of a turn: mean and spread of draws, to a tenth of the spread."""
    mean, covariance = np.array([-50.0, 1.0]), np.diag([100.0, 400.0])
    draws = np.random.default_rng(1).multivariate_normal(mean, covariance, 100_000)
    off = np.angle(np.exp(1j * (np.arctan2(draws[:, 1], draws[:, 0]) - math.pi)))
    found = unscented(
        Gaussian(jnp.asarray(mean), jnp.asarray(covariance)),
        lambda state: jnp.arctan2(state[1], state[0])[None],
        jnp.zeros((1, 1)),
        turned,
    )
    spread = off.std()
    assert abs(np.angle(np.exp(1j * (float(found.expected[0]) - math.pi))) - off.mean()) < 0.1 * spread
    assert math.sqrt(float(found.covariance[0, 0])) == pytest.approx(spread, rel=0.1)


@eqx.filter_jit
def mixed_in(filter: ImmPda, models: Models, scan: Heard) -> tuple[Models, jax.Array]:
    return filter.step(models, scan)


def test_models_that_never_change_are_data_association_alone() -> None:
    single = ipda(0.9, appears=0.0, stays=1.0)
    presumed, models = single.init(0.3), ImmPda(single).init(0.3)
    for values in ([11.0], [12.3, 40.0], []):
        presumed, _ = taken_in(single, presumed, heard(values))
        models, _ = mixed_in(ImmPda(single), models, heard(values))
        assert float(models.existence) == pytest.approx(float(presumed.existence), rel=rounding(np.float32, 300))
        np.testing.assert_allclose(models.state.mean, presumed.state.mean, rtol=rounding(np.float32, 300))
        np.testing.assert_allclose(models.state.covariance, presumed.state.covariance, rtol=rounding(np.float32, 1000))


def test_interacting_models_by_hand() -> None:
    """One scan, mixed and moved in double precision."""
    single = ipda(0.9, appears=0.2, stays=0.7)
    models, _ = mixed_in(ImmPda(single), ImmPda(single).init(0.4), heard([12.0]))
    covariance = STEP @ BIRTH @ STEP.T + NOISE
    mean, spread = STEP @ BIRTH_MEAN, covariance[0, 0] + ERROR
    evidence = 0.1 + 0.9 * multivariate_normal.pdf(12.0, mean[0], spread) / FALSE
    prior = 0.6 * 0.2 + 0.4 * 0.7
    expected = prior * evidence / (1 - prior + prior * evidence)
    assert float(models.existence) == pytest.approx(expected, rel=rounding(np.float32, 300))
    hit = 0.9 * multivariate_normal.pdf(12.0, mean[0], spread) / FALSE / evidence
    np.testing.assert_allclose(
        models.state.mean, mean + hit * covariance[:, 0] / spread * (12.0 - mean[0]), rtol=rounding(np.float32, 300)
    )


def test_existence_falls_where_nothing_is_heard() -> None:
    single = ipda(0.9, appears=0.1, stays=0.9)
    models = ImmPda(single).init(0.9)
    existence = []
    for _ in range(4):
        models, _ = mixed_in(ImmPda(single), models, heard([]))
        existence.append(float(models.existence))
    assert existence == sorted(existence, reverse=True)
    assert existence[-1] < 0.05


def test_density_of_false_detections_may_come_from_the_scan() -> None:
    """As many as there are over a width of 60."""
    single = ipda(1.0)
    counted = eqx.tree_at(lambda each: each.association.false_density, single, lambda scan: scan.there.sum() / 60.0)
    known = eqx.tree_at(lambda each: each.association.false_density, single, 3 / 60.0)
    values = heard([9.0, 12.0, 30.0])
    told = [taken_in(each, single.init(0.5), values)[0] for each in (counted, known)]
    assert float(told[0].log_odds) == pytest.approx(float(told[1].log_odds), rel=rounding(np.float32, 30))


def test_a_target_that_cannot_be_missed_and_is_not_detected_is_not_there() -> None:
    single = ipda(1.0)
    after, _ = taken_in(single, single.init(0.5), heard([]))
    assert float(after.existence) == 0
    np.testing.assert_array_equal(after.state.mean, single.predict(single.init(0.5)).state.mean)
