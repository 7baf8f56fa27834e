"""Thresholds where the false-track probability is known: every sequence of scans written out, or counted.

The problem is a Bernoulli filter without a state: a target comes and goes, and each scan is one number.
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.special import expit, logit

from faintrack.errors import InputError
from faintrack.metrics.thresholds import Stratum, counted_threshold, declaration_probability, wald_threshold
from tests.tolerances import assert_equal

SCANS, APPEARS, STAYS = 10, 0.1, 0.8
APPEARS_AT_ALL = 1 - (1 - APPEARS) ** SCANS
RUNS, FEWER = 20_000, 4_000
"""Draws for one probability, and for a threshold, which takes hundreds of them."""
ALLOWED = 4.0
"""Standard errors. A normal mean strays further once in 16,000 comparisons; this file makes twenty, with fixed keys."""
OPERATIONS = 100
"""Roundings of double precision in a run of ten scans and a mean over the runs."""


@dataclass(frozen=True)
class Problem:
    """How a scan is drawn, given whether the target is present, and the log of its likelihood ratio."""

    draw: Callable[[np.random.Generator, np.ndarray], np.ndarray]
    log_ratio: Callable[[np.ndarray], np.ndarray]


LOUD, FALSE = 0.7, 0.2
"""Probability of a 1 with a target and without."""
TWO_POINT = Problem(
    lambda rng, present: (rng.random(present.shape) < np.where(present, LOUD, FALSE)).astype(float),
    lambda scans: np.where(scans > 0, np.log(LOUD / FALSE), np.log((1 - LOUD) / (1 - FALSE))),
)
SHIFT = 1.5
GAUSSIAN = Problem(
    lambda rng, present: rng.normal(size=present.shape) + SHIFT * present, lambda scans: SHIFT * scans - SHIFT**2 / 2
)


def filtered(problem: Problem, scans: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Log odds of existence and log ratio of the model to noise, after every scan; (run, scan)."""
    existence, log_ratio = np.zeros(len(scans)), np.zeros(len(scans))
    odds, ratios = [], []
    for evidence in np.exp(problem.log_ratio(scans)).T:
        predicted = APPEARS * (1 - existence) + STAYS * existence
        gain = 1 - predicted + predicted * evidence
        existence, log_ratio = predicted * evidence / gain, log_ratio + np.log(gain)
        odds.append(logit(existence))
        ratios.append(log_ratio)
    return np.stack(odds, axis=1), np.stack(ratios, axis=1)


def presence(rng: np.random.Generator, runs: int) -> np.ndarray:
    """Whether the target is there, (run, scan), as the filter supposes."""
    there, life = np.zeros(runs, bool), []
    for _ in range(SCANS):
        there = rng.random(runs) < np.where(there, STAYS, APPEARS)
        life.append(there)
    return np.stack(life, axis=1)


def on_noise(problem: Problem, runs: int, seed: int) -> np.ndarray:
    """Log odds of existence on noise alone."""
    scans = problem.draw(np.random.default_rng(seed), np.zeros((runs, SCANS), bool))
    return filtered(problem, scans)[0]


def whole(problem: Problem, runs: int = RUNS, seed: int = 0) -> list[Stratum]:
    """Draws of the model in one stratum."""
    rng = np.random.default_rng(seed)
    return [Stratum(1.0, *filtered(problem, problem.draw(rng, presence(rng, runs))))]


def split(problem: Problem, runs: int = RUNS, seed: int = 0) -> list[Stratum]:
    """The same, apart where a target appears and where none does."""
    rng = np.random.default_rng(seed)
    life = presence(rng, runs)
    scans, appears = problem.draw(rng, life), life.any(axis=1)
    return [
        Stratum(share, *filtered(problem, scans[chosen]))
        for share, chosen in ((APPEARS_AT_ALL, appears), (1 - APPEARS_AT_ALL, ~appears))
    ]


drawn = pytest.mark.parametrize("draw", [whole, split], ids=["in one stratum", "in two strata"])


# Wald's identity


@pytest.fixture(scope="module")
def every_sequence() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Probability under noise, log odds and log ratio of each of the 1,024 sequences of two-point scans."""
    scans = np.array(list(itertools.product([0.0, 1.0], repeat=SCANS)))
    probability = np.prod(np.where(scans > 0, FALSE, 1 - FALSE), axis=1)
    return probability, *filtered(TWO_POINT, scans)


def test_the_problem_carries_a_likelihood_ratio(every_sequence: tuple[np.ndarray, ...]) -> None:
    probability, _, log_ratio = every_sequence
    assert_equal(probability @ np.exp(log_ratio), np.ones(SCANS), np.float64, OPERATIONS)


@drawn
@pytest.mark.parametrize("threshold", [0.3, 0.7, 0.9])
def test_declarations_on_noise_as_by_enumeration(
    draw: Callable[..., list[Stratum]], threshold: float, every_sequence: tuple[np.ndarray, ...]
) -> None:
    """20,000 draws of the model; 4 of the standard errors that are reported."""
    probability, log_odds, _ = every_sequence
    expected = probability[log_odds.max(axis=1) >= logit(threshold)].sum()
    estimate, error = declaration_probability(draw(TWO_POINT), threshold)
    assert 0 < error < 0.1 * expected
    assert abs(estimate - expected) < ALLOWED * error


@drawn
def test_declarations_on_noise_as_counted(draw: Callable[..., list[Stratum]]) -> None:
    """20,000 draws of the model and 200,000 of noise; 4 standard errors of the difference."""
    threshold = 0.95
    counted = np.mean(on_noise(GAUSSIAN, 200_000, seed=1).max(axis=1) >= logit(threshold))
    estimate, error = declaration_probability(draw(GAUSSIAN), threshold)
    assert abs(estimate - counted) < ALLOWED * np.hypot(error, np.sqrt(counted * (1 - counted) / 200_000))


@drawn
def test_the_standard_error_is_that_of_repetition(draw: Callable[..., list[Stratum]]) -> None:
    """400 repetitions; 4 standard errors of a standard deviation, 1 in the root of 800 where it is of normal numbers.

    Splitting one draw leaves the size of each stratum to chance, which moves the mean of 400 errors by far less.
    """
    found = np.array([declaration_probability(draw(GAUSSIAN, 500, seed), 0.9) for seed in range(400)])
    estimates, errors = found.T
    spread = estimates.std(ddof=1)
    assert abs(spread / np.sqrt(np.mean(errors**2)) - 1) < ALLOWED / np.sqrt(2 * len(found))


def test_strata_add_up() -> None:
    with_target, without = split(GAUSSIAN)
    alone = [
        declaration_probability([Stratum(1.0, stratum.log_odds, stratum.log_ratio)], 0.9)
        for stratum in (with_target, without)
    ]
    shares = np.array([with_target.probability, without.probability])
    estimate, error = declaration_probability([with_target, without], 0.9)
    assert_equal(estimate, shares @ [each[0] for each in alone], np.float64, OPERATIONS)
    assert_equal(error, np.hypot(*(shares * [each[1] for each in alone])), np.float64, OPERATIONS)


def test_the_first_declaration_counts() -> None:
    """One run that passes at its second scan and again, higher, at its third."""
    run = Stratum(1.0, np.array([[-1.0, 3.0, 5.0]]), np.log([[1.0, 4.0, 50.0]]))
    assert declaration_probability([run], expit(2.0)) == (pytest.approx(1 / 4), 0.0)
    assert declaration_probability([run], expit(4.0)) == (pytest.approx(1 / 50), 0.0)
    assert declaration_probability([run], expit(6.0)) == (0.0, 0.0)


# The threshold itself


@drawn
@pytest.mark.parametrize("probability", [0.1, 0.003])
def test_the_threshold_inverts_the_probability(draw: Callable[..., list[Stratum]], probability: float) -> None:
    """Up to the search's own steps, which are finer than a 400th of the log odds that occur."""
    strata = draw(GAUSSIAN, FEWER)
    found = wald_threshold(strata, probability)
    highest = np.concatenate([stratum.log_odds.max(axis=1) for stratum in strata])
    step = 2 * np.ptp(highest) / 400
    assert declaration_probability(strata, found.value)[0] <= probability
    assert declaration_probability(strata, expit(logit(found.value) - step))[0] > probability
    assert found.low <= found.value <= found.high
    assert found.low < found.high
    # Where the interval ends the estimate is told from the wanted probability, by 1.96 standard errors.
    for end, side in ((found.low, 1), (found.high, -1)):
        estimate, error = declaration_probability(strata, end)
        before, after = (declaration_probability(strata, expit(logit(end) + off))[0] for off in (-step, step))
        assert abs(estimate - side * 1.96 * error - probability) < before - after


@drawn
def test_noise_passes_the_threshold_as_often_as_wanted(draw: Callable[..., list[Stratum]]) -> None:
    """4,000 draws of the model and 200,000 of noise; 4 standard errors of the difference, and a step of the search."""
    probability = 0.01
    strata = draw(GAUSSIAN, FEWER)
    level = logit(wald_threshold(strata, probability).value)
    highest = on_noise(GAUSSIAN, 200_000, seed=2).max(axis=1)
    error = declaration_probability(strata, expit(level))[1]
    allowed = ALLOWED * np.hypot(error, np.sqrt(probability * (1 - probability) / 200_000))
    reached = np.concatenate([stratum.log_odds.max(axis=1) for stratum in strata])
    one_step = np.mean((highest >= level - np.ptp(reached) / 400) & (highest < level))
    assert abs(np.mean(highest >= level) - probability) < allowed + one_step


def test_counting_and_the_identity_agree() -> None:
    """The two intervals, each of 95 %, overlap: they would not once in some hundreds of pairs of studies."""
    counted = counted_threshold(on_noise(GAUSSIAN, 20_000, seed=3).max(axis=1), 0.01)
    found = wald_threshold(split(GAUSSIAN, 2000), 0.01)
    assert max(counted.low, found.low) < min(counted.high, found.high)


def test_runs_that_do_not_reach_the_probability() -> None:
    with pytest.raises(InputError, match="the runs do not reach a threshold with a false-track probability of 1e-12"):
        wald_threshold(split(GAUSSIAN, 40), 1e-12)


# By counting


def test_the_counted_threshold_is_a_quantile() -> None:
    """Of 1, 2, ..., 100 (here a twentieth of them) ten reach 91; the interval is that of the 90 % quantile."""
    highest = np.random.default_rng(0).permutation(np.arange(1.0, 101.0)) / 20
    found = counted_threshold(highest, 0.1)
    assert_equal(logit([found.value, found.low, found.high]), np.array([91, 84, 96]) / 20, np.float64, OPERATIONS)
    assert np.mean(highest >= logit(found.value) - 1e-9) == pytest.approx(0.1)


def test_a_wider_interval_for_more_confidence() -> None:
    highest = np.random.default_rng(0).normal(size=1000)
    wide, narrow = (counted_threshold(highest, 0.1, confidence) for confidence in (0.99, 0.8))
    assert wide.low < narrow.low < wide.value == narrow.value < narrow.high < wide.high


def test_few_runs_do_not_bound_the_threshold() -> None:
    found = counted_threshold(np.linspace(-3.0, 3.0, 20), 0.01)
    assert found.high == 1
    assert found.value == expit(3.0)
