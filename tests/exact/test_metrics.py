"""Metrics on sets small enough to work out by hand, and laws that hold on any; intervals cover as often as they say."""

import itertools
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from scipy.special import binom
from scipy.stats import t

from faintrack.errors import InputError
from faintrack.metrics.accuracy import bearing_error, rmse
from faintrack.metrics.consistency import consistency, nees
from faintrack.metrics.detection import time_to_detection
from faintrack.metrics.intervals import binomial_interval, bootstrap_interval, quantile_interval
from faintrack.metrics.sets import bearing_distance, gospa, ospa, single_ospa
from tests.tolerances import assert_equal, assert_mean, rounding

CUTOFF = 2.0
NONE = np.zeros((0, 2))
OPERATIONS = 100
"""Roundings in a sum of a few powers, and in its root."""
SLACK = rounding(np.float64, OPERATIONS) * CUTOFF * 10
"""Rounding of a distance; the largest is below ten cutoffs."""
METRICS = [
    *(partial(ospa, cutoff=CUTOFF, order=order) for order in (1.0, 2.0, 3.5)),
    *(partial(gospa, cutoff=CUTOFF, order=order, alpha=alpha) for order in (1.0, 2.0) for alpha in (0.7, 1.0, 2.0)),
]
each_metric = pytest.mark.parametrize("metric", METRICS, ids=lambda m: f"{m.func.__name__} {m.keywords}")


def random_sets(count: int, sets: int = 2) -> list[list[np.ndarray]]:
    """Of 0 to 4 targets in a square two cutoffs wide, so that some pairs are cut and some are not."""
    rng = np.random.default_rng(3)
    return [[rng.uniform(0, 2 * CUTOFF, (rng.integers(5), 2)) for _ in range(sets)] for _ in range(count)]


# Set distances


def test_ospa_by_hand() -> None:
    """Found at 0 and 10, true at 3: the pair costs 3^2, the other one 5^2, over two targets."""
    apart = ospa([[0.0], [10.0]], [[3.0]], cutoff=5.0)
    assert (apart.localisation, apart.missed, apart.false, apart.cardinality) == (4.5, 0.0, 12.5, 12.5)
    assert apart.total == pytest.approx(np.sqrt(17))
    assert apart.pairs.tolist() == [[0, 0], [1, -1]]


def test_ospa_squares_before_it_assigns() -> None:
    """Two pairs 3 apart, rather than one on the spot and one 5.9 apart, though the latter have the smaller sum."""
    found, true = [[0.0, 0.0], [3.0, 0.0]], [[3.0, 0.0], [5.86, 0.71]]
    assert ospa(found, true, cutoff=10.0).pairs.tolist() == [[0, 0], [1, 1]]
    assert ospa(found, true, cutoff=10.0, order=1.0).pairs.tolist() == [[0, 1], [1, 0]]


def test_gospa_by_hand() -> None:
    """Found at 0 and 10, true at 3 and 20 and 30: one pair, one false, two missed, each 5^2 / 2."""
    apart = gospa([[0.0], [10.0]], [[20.0], [3.0], [30.0]], cutoff=5.0)
    assert (apart.localisation, apart.missed, apart.false) == (9.0, 25.0, 12.5)
    assert apart.total == pytest.approx(np.sqrt(46.5))
    assert apart.pairs.tolist() == [[0, 1], [1, -1], [-1, 0], [-1, 2]]


def test_gospa_with_another_alpha_keeps_far_pairs() -> None:
    """A missed and a false target would cost 2 * 5^2 / 1, a pair as far apart as it likes 5^2."""
    apart = gospa([[0.0]], [[100.0]], cutoff=5.0, alpha=1.0)
    assert (apart.localisation, apart.missed, apart.false, apart.total) == (25.0, 0.0, 0.0, 5.0)
    assert gospa([[0.0]], np.zeros((0, 1)), cutoff=5.0, alpha=1.0).total == 5.0


@each_metric
def test_no_assignment_is_cheaper(metric: Callable) -> None:
    """The definition, with the smallest sum over every assignment of the smaller set to the larger."""
    order, alpha = metric.keywords["order"], metric.keywords.get("alpha", 1.0)
    for found, true in random_sets(25):
        few, many = sorted([found, true], key=len)
        cost = np.minimum(np.linalg.norm(few[:, None] - many, axis=-1), CUTOFF) ** order
        sums = [
            sum(cost[i, j] for i, j in enumerate(choice))
            for choice in itertools.permutations(range(len(many)), len(few))
        ]
        expected = min(sums) + CUTOFF**order / alpha * (len(many) - len(few))
        size = 1 if metric.func is gospa else max(len(many), 1)
        assert_equal(metric(found, true).total, (expected / size) ** (1 / order), np.float64, OPERATIONS)


@each_metric
def test_equal_sets_are_zero_apart(metric: Callable) -> None:
    for found, _ in random_sets(10):
        assert metric(found, found[::-1]).total == 0


@each_metric
def test_which_set_is_found_does_not_matter(metric: Callable) -> None:
    """Missed and false change places."""
    for found, true in random_sets(20):
        there, back = metric(found, true), metric(true, found)
        assert there.total == pytest.approx(back.total, abs=SLACK)
        assert there.missed == back.false


@each_metric
def test_the_way_through_a_third_set_is_not_shorter(metric: Callable) -> None:
    for first, between, last in random_sets(25, sets=3):
        assert metric(first, last).total <= metric(first, between).total + metric(between, last).total + SLACK


@each_metric
def test_parts_add_up(metric: Callable) -> None:
    """To total**order; every target stands in one pair, whose distances and free places give the parts."""
    for found, true in random_sets(20):
        apart = metric(found, true)
        parts = apart.localisation + apart.missed + apart.false
        assert_equal(apart.total ** metric.keywords["order"], parts, np.float64, OPERATIONS)
        rows, columns = apart.pairs.T
        assert sorted(rows[rows >= 0]) == list(range(len(found)))
        assert sorted(columns[columns >= 0]) == list(range(len(true)))
        assert np.all((rows >= 0) | (columns >= 0))
        assert (apart.missed > 0) == np.any(rows < 0)
        assert (apart.false > 0) == np.any(columns < 0)


def test_ospa_stays_below_the_cutoff() -> None:
    assert ospa(NONE, [[0.0, 0.0]], CUTOFF).total == CUTOFF
    for found, true in random_sets(30):
        assert ospa(1e3 * found, true, CUTOFF).total <= CUTOFF + SLACK


def test_bearings_go_the_shorter_way_round() -> None:
    apart = ospa([[np.radians(179)], [0.0]], [[0.0], [np.radians(-179)]], cutoff=1.0, distance=bearing_distance)
    assert apart.pairs.tolist() == [[0, 1], [1, 0]]
    assert apart.total == pytest.approx(np.radians(2) / np.sqrt(2))


def test_single_ospa_is_ospa() -> None:
    declared, present = np.array([True, False])[:, None, None], np.array([True, False])[:, None]
    error = np.array([0.0, 0.5, 7.0])
    actual = single_ospa(declared, error, present, CUTOFF)
    assert actual.shape == (2, 2, 3)
    for place in np.ndindex(actual.shape):
        found = np.full((int(declared[place[0], 0, 0]), 1), error[place[2]])
        true = np.zeros((int(present[place[1], 0]), 1))
        for order in (1.0, 2.0):
            assert actual[place] == pytest.approx(ospa(found, true, CUTOFF, order).total)


# Errors and detection


def test_bearing_error_has_a_sign() -> None:
    found, true = np.radians([179.0, -179.0, 10.0]), np.radians([-179.0, 179.0, 5.0])
    np.testing.assert_allclose(np.degrees(bearing_error(found, true)), [-2, 2, 5], atol=1e-10)


def test_rmse_by_hand() -> None:
    assert rmse([[3.0, 0.0], [4.0, 0.0]]).tolist() == [np.sqrt(12.5), 0.0]
    assert float(rmse([[3.0, 0.0], [4.0, 0.0]], axis=(0, 1))) == 2.5
    assert np.isnan(rmse([1.0, np.nan]))


def test_time_to_detection_by_hand() -> None:
    """Before it appears nothing counts; at that very scan it does; each run may have its own time."""
    declared = [[1, 0, 0, 1], [0, 1, 0, 0], [0, 0, 0, 0]]
    time = [0.5, 1.5, 2.5, 3.5]
    np.testing.assert_array_equal(time_to_detection(declared, time, 1.5), [2.0, 0.0, np.nan])
    np.testing.assert_array_equal(time_to_detection(declared, time, [0.0, 1.0, 0.0]), [0.5, 0.5, np.nan])


# Intervals


def test_binomial_interval_without_successes() -> None:
    """(1 - high)^n = 0.025."""
    low, high = binomial_interval([0, 100], 100)
    assert_equal(high[0], 1 - 0.025**0.01, np.float64, OPERATIONS)
    assert_equal(low[1], 0.025**0.01, np.float64, OPERATIONS)
    assert (low[0], high[1]) == (0.0, 1.0)
    assert [float(end) for end in binomial_interval(0, 0)] == [0.0, 1.0]


@pytest.mark.parametrize("confidence", [0.5, 0.95])
def test_binomial_interval_covers(confidence: float) -> None:
    """Exactly, by the sum over all outcomes; never less than it says."""
    trials = 30
    successes = np.arange(trials + 1)
    low, high = binomial_interval(successes, trials, confidence)
    for p in np.linspace(0.01, 0.99, 99):
        probability = binom(trials, successes) * p**successes * (1 - p) ** (trials - successes)
        assert probability[(low <= p) & (p <= high)].sum() >= confidence


@pytest.mark.parametrize("runs", [1, 20, 71, 72, 400])
@pytest.mark.parametrize("p", [0.5, 0.95])
def test_quantile_interval_covers(runs: int, p: float) -> None:
    """Exactly: values 1, 2, ... are their own ranks, and how many lie below the quantile is binomial.

    An end that is not infinite is the nearest: one rank further in, it alone would leave out more than 0.025.
    """
    low, high = quantile_interval(np.arange(1.0, runs + 1), p)
    below = np.arange(runs + 1)
    probability = binom(runs, below) * p**below * (1 - p) ** (runs - below)
    assert probability[(below >= low) & (below < high)].sum() >= 0.95
    assert np.isinf(low) or probability[below >= low + 1].sum() < 0.975
    assert np.isinf(high) or probability[below < high - 1].sum() < 0.975


def test_quantile_interval_is_open_where_the_runs_say_nothing() -> None:
    """0.95^72 < 0.025 < 0.95^71."""
    assert quantile_interval(np.arange(71.0), 0.95)[1] == np.inf
    assert quantile_interval(np.arange(72.0), 0.95)[1] == 71
    assert quantile_interval(np.arange(71.0), 0.05)[0] == -np.inf
    assert quantile_interval([1.0, np.inf, np.inf, np.inf, np.inf, np.inf, np.inf], 0.5) == (1.0, np.inf)


def test_bootstrap_interval_covers() -> None:
    """The mean of 30 normal values, in 400 studies; 5 standard errors.

    The draws have the spread of the values about their mean, a factor sqrt(29 / 30) below its estimate, and the
    estimate follows Student's t: 0.936 is expected instead of 0.95.
    """
    studies, runs = 400, 30
    values = np.random.default_rng(4).normal(size=(studies, runs))
    low, high = np.transpose(
        [bootstrap_interval(np.mean, study, count=200, seed=seed) for seed, study in enumerate(values)]
    )
    expected = 1 - 2 * t.sf(1.96 * np.sqrt((runs - 1) / runs), runs - 1)
    assert_mean((low <= 0) & (high >= 0), expected)


def test_bootstrap_draws_the_same_runs_from_every_array() -> None:
    """A ratio of two arrays that are alike is 1 whatever is drawn."""
    first = np.array([1.0, 5.0, 2.0])
    low, high = bootstrap_interval(lambda a, b: a.sum() / b.sum(axis=0), (first, np.stack([first, 2 * first], axis=1)))
    assert low.tolist() == high.tolist() == [1.0, 0.5]


def test_bootstrap_repeats_with_its_seed() -> None:
    values = np.arange(10.0)
    assert bootstrap_interval(np.mean, values, seed=1) == bootstrap_interval(np.mean, values, seed=1)
    assert bootstrap_interval(np.mean, values, seed=1) != bootstrap_interval(np.mean, values, seed=2)


# Consistency


def test_nees_by_hand() -> None:
    """The inverse of [[2, 1], [1, 2]] is [[2, -1], [-1, 2]] / 3: 2 / 3 and 6 / 3."""
    said = nees([[1.0, 1.0], [1.0, -1.0]], [[[2.0, 1.0], [1.0, 2.0]]] * 2)
    assert_equal(said.nees, (2 / 3 + 2) / 2, np.float64, OPERATIONS)
    assert_equal(said.predicted, [np.sqrt(2)] * 2, np.float64, OPERATIONS)
    assert said.actual.tolist() == [1.0, 1.0]


def test_one_component_is_a_one_by_one_covariance() -> None:
    error, variance = np.array([[1.0, 3.0], [2.0, 1.0]]), np.array([[4.0, 9.0], [1.0, 1.0]])
    said = consistency(error, variance)
    assert_equal(said.nees, [(1 / 4 + 4) / 2, (1 + 1) / 2], np.float64, OPERATIONS)
    assert_equal(said.predicted, np.sqrt([2.5, 5.0]), np.float64, OPERATIONS)
    assert_equal(said.actual, np.sqrt([2.5, 5.0]), np.float64, OPERATIONS)


def test_nees_interval_covers_an_honest_estimator() -> None:
    """3000 studies of 20 runs with two correlated components of different size, 5 standard errors."""
    runs, studies = 20, 3000
    root = np.array([[1.0, 0.0], [50.0, 30.0]])
    errors = np.random.default_rng(5).normal(size=(runs, studies, 2)) @ root.T
    said = nees(errors, np.broadcast_to(root @ root.T, (runs, studies, 2, 2)))
    assert_mean(said.nees, 2.0)
    assert_mean((said.low <= said.nees) & (said.nees <= said.high), 0.95)


# Input


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ospa(NONE, NONE, 0.0), "cutoff is 0; expected a finite number above 0."),
        (lambda: gospa(NONE, NONE, np.nan), "cutoff is nan"),
        (lambda: ospa(NONE, NONE, 1.0, order=0.5), "order is 0.5; expected a finite number, at least 1."),
        (lambda: gospa(NONE, NONE, 1.0, alpha=2.5), "alpha is 2.5"),
        (lambda: ospa([1.0, 2.0], NONE, 1.0), r"found has shape \(2,\); expected \(targets, components\)"),
        (lambda: ospa(NONE, [[1.0, 2.0, 3.0]], 1.0), "found has 2 components and true has 3"),
        (lambda: gospa(NONE, [[np.nan, 0.0]], 1.0), "true holds values that are not finite"),
        (lambda: ospa([[0.0]], [[1.0]], 1.0, distance=np.subtract), r"distance gives shape \(1, 1, 1\)"),
        (lambda: single_ospa(True, np.nan, True, 1.0), "error is negative or not a number"),
        (lambda: single_ospa([True] * 2, [0.0] * 3, True, 1.0), r"shapes \(2,\), \(3,\) and \(\)"),
        (lambda: single_ospa(True, 1.0, True, -1.0), "cutoff is -1"),
        (lambda: time_to_detection([[True]], [1.0, 2.0]), r"declared has shape \(1, 1\) and time \(2,\)"),
        (lambda: time_to_detection([True, True], [2.0, 1.0]), "time does not increase"),
        (lambda: time_to_detection([[True]], [1.0], [0.0, 1.0]), r"appears has shape \(2,\)"),
        (lambda: binomial_interval(3, 2), "successes and trials are out of range"),
        (lambda: binomial_interval(0.5, 2), "expected whole numbers"),
        (lambda: binomial_interval([1, 2], [3, 3, 3]), r"shapes \(2,\) and \(3,\)"),
        (lambda: binomial_interval(1, 2, 95), "confidence is 95; expected a number between 0 and 1."),
        (lambda: quantile_interval([np.nan], 0.5), "values has shape .* or holds NaN"),
        (lambda: quantile_interval([], 0.5), "values has shape"),
        (lambda: quantile_interval([1.0], 1.0), "probability is 1"),
        (lambda: bootstrap_interval(np.mean, (np.ones(2), np.ones(3))), r"samples has \[2, 3\] runs"),
        (lambda: bootstrap_interval(np.mean, []), "samples"),
        (lambda: bootstrap_interval(np.mean, np.ones(2), count=0), "count is 0"),
        (lambda: consistency([1.0], [1.0, 2.0]), r"error has shape \(1,\) and variance \(2,\)"),
        (lambda: consistency([1.0], [0.0]), "not positive definite"),
        (lambda: nees([[1.0]], [[1.0]]), r"errors has shape \(1, 1\) and covariances \(1, 1\)"),
        (lambda: nees([[np.inf]], [[[1.0]]]), "not finite"),
    ],
)
def test_what_cannot_be_used_is_named(call: Callable, message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()
