"""Histogram PMHT: shots by scipy, a smoother by hand, presence by enumeration, and a likelihood that never falls."""

import dataclasses
import itertools
import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from faintrack.baselines.histogram import Histogram
from faintrack.baselines.histogram_pmht import Candidate, Fit, HistogramPmht
from faintrack.baselines.histogram_tracks import HistogramTracks
from faintrack.baselines.smoother import smooth
from faintrack.beliefs.axis import Axis
from faintrack.sensors.cells import Cells
from faintrack.targets.target import Target, rates
from tests.tolerances import STANDARD_ERRORS, assert_mean, rounding

ROWS, COLUMNS, SCANS = 9, 11, 5
CELLS = Cells((("y", Axis(0.0, 1.0, ROWS)), ("x", Axis(2.0, 1.0, COLUMNS))))
BACKGROUND, LEVEL, WIDTH = 3.0, 12.0, 0.8
# So far that every cell is looked at from everywhere.
WHOLE = Histogram(CELLS, BACKGROUND, LEVEL, WIDTH, reach=10)
NEAR = dataclasses.replace(WHOLE, reach=4)
LOUD = dataclasses.replace(NEAR, level=60.0)

BIRTH, SURVIVAL = 0.01, 0.9
STEP, NOISE = np.array([[1.0, 1.0], [0.0, 1.0]]), 0.04 * np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]])
START = np.array([[1.0, 0.1], [0.1, 0.25]])


def shares_of(place: np.ndarray) -> np.ndarray:
    """Of a target's shots in every cell, by the normal distribution."""
    along = [
        np.diff(stats.norm.cdf(axis.first + np.arange(axis.count + 1) - 0.5, middle, WIDTH))
        for (_, axis), middle in zip(CELLS.axes, place, strict=True)
    ]
    return np.outer(*along)


def draw(places: np.ndarray, seed: int) -> np.ndarray:
    """Shots of a target on a path, scan by scan."""
    means = [BACKGROUND + LEVEL * shares_of(place) for place in places]
    return np.random.default_rng(seed).poisson(means).astype(np.float32)


def pmht(iterations: int, histogram: Histogram = WHOLE) -> HistogramPmht:
    target = Target(None, None, *rates(BIRTH, SURVIVAL, 1.0))
    return HistogramPmht(histogram, target, jnp.asarray(STEP), jnp.asarray(NOISE), 1.0, iterations)


def candidate(mean: np.ndarray, log_odds: float = -1.0, scans: int = SCANS) -> Candidate:
    mean = jnp.asarray(mean, jnp.float32)
    path = jnp.broadcast_to(mean, (scans, *mean.shape))
    return Candidate(mean, jnp.asarray(START, jnp.float32), jnp.asarray(log_odds), jnp.asarray(scans), path)


@eqx.filter_jit
def fitted(pmht: HistogramPmht, counts: jax.Array, candidate: Candidate) -> Fit:
    return pmht.fit(jax.vmap(pmht.histogram.with_margin)(counts), candidate)


@pytest.mark.parametrize("place", [(4.2, 7.7), (0.3, 2.1), (-1.0, 12.9)])
def test_log_ratio_is_that_of_poisson(place: tuple[float, float]) -> None:
    counts = draw(np.array([place]), 0)[0]
    counts[2, 3] = np.nan
    with_target = stats.poisson.logpmf(counts, BACKGROUND + LEVEL * shares_of(np.array(place)))
    expected = np.nansum(with_target - stats.poisson.logpmf(counts, BACKGROUND))
    result = WHOLE.log_ratio(WHOLE.with_margin(jnp.asarray(counts)), jnp.asarray(place))
    assert float(result) == pytest.approx(expected, abs=300 * rounding(np.float32) * float(np.nansum(counts)))


def test_mean_ratio_under_noise_is_1() -> None:
    noise = np.random.default_rng(3).poisson(BACKGROUND, (20_000, ROWS, COLUMNS)).astype(np.float32)
    weak = dataclasses.replace(NEAR, level=3.0)
    ratio = jax.jit(jax.vmap(lambda counts: weak.log_ratio(weak.with_margin(counts), jnp.array([0.4, 7.3]))))
    assert_mean(np.exp(ratio(jnp.asarray(noise))), 1.0)


def test_table_is_the_log_ratio_of_every_cell() -> None:
    counts = jnp.asarray(draw(np.array([[4.2, 7.7]]), 1)[0]).at[5, 5].set(jnp.nan)
    table = NEAR.table(counts)
    for row, column in ((4, 5), (0, 0), (8, 3)):
        place = jnp.array([row * 1.0, column + 2.0])
        assert float(table[row, column]) == pytest.approx(
            float(NEAR.log_ratio(NEAR.with_margin(counts), place)), abs=1000 * rounding(np.float32) * 10
        )


@pytest.mark.parametrize("place", [(4.2, 7.7), (0.3, 2.1)])
def test_shots_are_attributed_by_integration(place: tuple[float, float]) -> None:
    """Fine points of the plane, each with the density of the target: those in a cell share what it holds."""
    counts = draw(np.array([place]), 2)[0]
    counts[4, 6] = np.nan
    fine = 40
    along = [(np.arange(-10 * fine, 22 * fine) + 0.5) / fine - 0.5 for _ in range(2)]
    density = np.outer(*(stats.norm.pdf(each, middle, WIDTH) / fine for each, middle in zip(along, place, strict=True)))
    number = [np.floor(each - first + 0.5).astype(int) for each, first in zip(along, (0, 2), strict=True)]
    inside = np.outer(*((each >= 0) & (each < count) for each, count in zip(number, counts.shape, strict=True)))
    held = counts[np.clip(number[0], 0, ROWS - 1)[:, None], np.clip(number[1], 0, COLUMNS - 1)]
    share = shares_of(np.array(place))
    rate = (BACKGROUND + LEVEL * share)[np.clip(number[0], 0, ROWS - 1)[:, None], np.clip(number[1], 0, COLUMNS - 1)]
    shots = LEVEL * density * np.where(inside & ~np.isnan(held), np.nan_to_num(held) / rate, 1)
    middle = [(shots.sum(axis=1 - axis) @ along[axis]) / shots.sum() for axis in range(2)]
    result, middle_result = WHOLE.attribute(WHOLE.with_margin(jnp.asarray(counts)), jnp.asarray(place))
    # Sums over squares of 1 / 40 of a cell are good to the square of that.
    assert float(result) == pytest.approx(shots.sum(), rel=1e-3)
    np.testing.assert_allclose(middle_result, middle, atol=1e-3)


def kalman(mean: np.ndarray, measured: np.ndarray, precision: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Means of Rauch, Tung and Striebel's smoother on one axis; means and covariances of the filter."""
    row, spread, before, known = np.array([[1.0, 0.0]]), START, [], []
    for place, exactness in zip(measured, precision, strict=True):
        before.append((mean, spread))
        if exactness > 0:
            gain = spread @ row.T / (row @ spread @ row.T + 1 / exactness)
            mean, spread = mean + gain[:, 0] * (place - mean[0]), spread - gain @ row @ spread
        known.append((mean, spread))
        mean, spread = STEP @ mean, STEP @ spread @ STEP.T + NOISE
    smoothed = [known[-1][0]]
    for scan in range(len(measured) - 2, -1, -1):
        gain = known[scan][1] @ STEP.T @ np.linalg.inv(before[scan + 1][1])
        smoothed.insert(0, known[scan][0] + gain @ (smoothed[0] - before[scan + 1][0]))
    return np.array(smoothed), np.array([mean for mean, _ in known]), np.array([spread for _, spread in known])


def test_smoother_is_that_of_rauch_tung_and_striebel() -> None:
    random = np.random.default_rng(5)
    mean, measured, precision = random.normal(size=(2, 2)), random.normal(0, 3, (6, 2)), random.uniform(0, 2, 6)
    precision[2] = 0
    result = smooth(*(jnp.asarray(each) for each in (mean, START, STEP, NOISE, measured, precision)))
    near = {"rtol": 0, "atol": 300 * rounding(np.float32)}
    for axis in range(2):
        smoothed, filtered, covariance = kalman(mean[axis], measured[:, axis], precision)
        np.testing.assert_allclose(result.mean[:, axis], smoothed, **near)
        np.testing.assert_allclose(result.filtered[:, axis], filtered, **near)
        np.testing.assert_allclose(result.covariance, covariance, **near)


def test_without_noise_one_iteration_is_a_kalman_smoother_of_the_middles() -> None:
    """Every shot is the target's, which is certain to be there."""
    histogram = dataclasses.replace(WHOLE, background=1e-9)
    truth = np.array([4.0, 6.0]) + np.arange(SCANS)[:, None] * np.array([0.3, 0.6])
    counts = np.random.default_rng(6).poisson([LEVEL * shares_of(place) for place in truth]).astype(np.float32)
    begun = candidate(np.array([[4.2, 0.0], [6.1, 0.5]]))
    result = fitted(pmht(1, histogram), jnp.asarray(counts), begun)
    attribute = jax.jit(lambda counts, place: histogram.attribute(histogram.with_margin(counts), place))
    told = [attribute(scan, begun.mean[:, 0]) for scan in jnp.asarray(counts)]
    shots, middle = (np.asarray([each[part] for each in told]) for part in range(2))
    # All shots of the sensor, and a few that miss it.
    assert np.all(shots >= counts.sum(axis=(1, 2)) * (1 - 1e-4))
    np.testing.assert_allclose(result.presence, 1, atol=1e-3)
    for axis in range(2):
        smoothed, _, _ = kalman(np.asarray(begun.mean[axis]), middle[:, axis], shots / WIDTH**2)
        np.testing.assert_allclose(result.path[:, axis], smoothed, atol=1e-3)


def log_density(path: np.ndarray, mean: np.ndarray) -> float:
    """Of a path under the motion."""
    total = sum(stats.multivariate_normal.logpdf(path[0, axis], mean[axis], START) for axis in range(2))
    for scan, axis in itertools.product(range(1, len(path)), range(2)):
        total += stats.multivariate_normal.logpdf(path[scan, axis], STEP @ path[scan - 1, axis], NOISE)
    return float(total)


@pytest.mark.parametrize("seed", range(4))
def test_no_iteration_lowers_the_likelihood(seed: int) -> None:
    """The target leaves after three scans, is missing from one pixel, and begins a pixel off."""
    truth = np.array([4.0, 6.0]) + np.arange(SCANS)[:, None] * np.array([0.4, 0.7])
    counts = draw(truth, seed)
    counts[3:] = np.random.default_rng(seed + 10).poisson(BACKGROUND, counts[3:].shape)
    counts[1, 4, 5] = np.nan
    mean = np.array([[4.8, 0.0], [5.2, 0.0]])
    one, start = pmht(1), candidate(mean)
    values = []
    for _ in range(12):
        result = fitted(one, jnp.asarray(counts), start)
        values.append(log_density(np.asarray(result.path, float), mean) + float(result.log_likelihood))
        start = dataclasses.replace(start, path=result.path)
    assert np.all(np.diff(values) >= -1e-3)
    assert values[-1] > values[0]


def last_seen(log_ratio: np.ndarray) -> list[float]:
    """Probability of every last scan times the ratio until then."""
    ends = [1 - SURVIVAL] * (SCANS - 1) + [1.0]
    ratios = np.exp(np.cumsum(np.asarray(log_ratio, float)))
    return [SURVIVAL**last * ends[last] * ratios[last] for last in range(SCANS)]


def test_presence_is_that_of_all_last_scans() -> None:
    counts = draw(np.array([[4.0, 6.0]] * SCANS), 7)
    result = fitted(pmht(2), jnp.asarray(counts), candidate(np.array([[4.0, 0.0], [6.0, 0.0]]), -6.0))
    weights = last_seen(result.log_ratio)
    expected = [sum(weights[scan:]) / sum(weights) for scan in range(SCANS)]
    np.testing.assert_allclose(result.presence, expected, rtol=1e-4)
    assert float(result.log_likelihood) == pytest.approx(math.log(sum(weights)), abs=1e-4)
    weights = last_seen(result.log_ratio + result.log_width)
    assert float(result.log_odds) == pytest.approx(
        math.log(weights[-1] / (math.exp(6.0) + sum(weights[:-1]))), abs=1e-4
    )


def test_ratio_of_all_paths_is_that_of_draws() -> None:
    """Mean ratio over paths drawn from the prior, in narrow cells with hardly any noise.

    Laplace takes all shots to be known for the target's, and where in its cell each fell, which here is nearly so.
    """
    cells = Cells((("range", Axis(0.0, 0.2, 50)),))
    histogram = Histogram(cells, 1e-3, 5.0, WIDTH, reach=25)
    shots = np.array([[3.6, 4.3, 4.4, 5.4], [4.0, 4.9, 5.2, 6.4]])
    counts = np.array([np.histogram(each, 50, (-0.1, 9.9))[0] for each in shots], np.float32)
    mean = np.array([[4.0, 0.3]])
    result = fitted(pmht(30, histogram), jnp.asarray(counts), candidate(mean, scans=2))
    random = np.random.default_rng(9)
    first = mean[0] + random.multivariate_normal([0, 0], START, 20_000)
    second = first @ STEP.T + random.multivariate_normal([0, 0], NOISE, 20_000)
    total = np.zeros(20_000)
    for scan, places in zip(jnp.asarray(counts), (first, second), strict=True):
        wider = histogram.with_margin(scan)
        each = jax.jit(jax.vmap(lambda place, wider=wider: histogram.log_ratio(wider, place)))
        total += np.asarray(each(jnp.asarray(places[:, :1], jnp.float32)), float)
    top = total.max()
    ratios = np.exp(total - top)
    expected, error = math.log(ratios.mean()) + top, ratios.std() / ratios.mean() / math.sqrt(len(ratios))
    assert STANDARD_ERRORS * error < 0.1
    assert float((result.log_ratio + result.log_width).sum()) == pytest.approx(expected, abs=STANDARD_ERRORS * error)


def tracks(window: int) -> HistogramTracks:
    start = jnp.diag(jnp.array([0.25, 0.25]))
    return HistogramTracks(pmht(20, LOUD), start, window, capacity=6, starts=3, near=1.0, alike=0.5)


def test_a_target_without_noise_is_found_within_its_cell() -> None:
    """Every cell holds its mean, so that the likeliest path is the true one; the batch moves on from scan 4.

    The prior of the rates holds it back, and every scan that is dropped, by what was known at it.
    """
    truth = np.array([2.3, 3.6]) + np.arange(8)[:, None] * np.array([0.4, 0.7])
    counts = np.array([BACKGROUND + LOUD.level * shares_of(place) for place in truth], np.float32)
    score, state = tracks(4).follow(jnp.asarray(counts))
    np.testing.assert_allclose(state[3:, :, 0], truth[3:], atol=0.1)
    np.testing.assert_allclose(state[-1, :, 1], [0.4, 0.7], atol=0.05)
    assert np.all(np.diff(score[:4]) > 0)
    assert float(score[-1]) > 5


def test_existence_falls_as_that_of_a_target_where_nothing_is_measured() -> None:
    truth = np.array([[4.0, 6.0]] * 4)
    counts = np.array([BACKGROUND + LOUD.level * shares_of(place) for place in truth], np.float32)
    silent = np.full((3, ROWS, COLUMNS), np.nan, np.float32)
    score, _ = tracks(8).follow(jnp.asarray(np.concatenate([counts, silent])))
    for before, after in itertools.pairwise(np.asarray(score, float)[3:]):
        stays = SURVIVAL / (1 + math.exp(-before))
        assert after == pytest.approx(math.log(stays / (1 - stays)), abs=1e-2)
