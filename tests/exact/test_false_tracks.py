"""False tracks an hour: what the model bounds, and what is counted or continued from peaks."""

import numpy as np
import pytest
from scipy.special import expit, logit

from faintrack import InputError
from faintrack.metrics.false_tracks import (
    HOUR,
    Exceedances,
    bounded_rate,
    bounded_threshold,
    exceedances,
    odds_rate,
    peaks,
    rises,
)
from faintrack.scenario.promise import per_second


@pytest.mark.parametrize(("arrives", "leaves"), [(0.001, 0.005), (0.01, 0.01), (0.05, 0.01)])
def test_odds_gain_at_most_what_is_said(arrives: float, leaves: float) -> None:
    """The slope of existence, p' = arrives (1 - p) - leaves p, carried over to the odds p / (1 - p), at most."""
    existence = np.linspace(0, 0.999, 100_000)
    slope = (arrives * (1 - existence) - leaves * existence) / (1 - existence) ** 2
    np.testing.assert_allclose(odds_rate(arrives, leaves), slope.max(), rtol=1e-6)


def test_threshold_and_rate_are_inverse() -> None:
    rates = np.array([10, 1, 0.1]) / HOUR
    thresholds = [bounded_threshold(rate, 0.001) for rate in rates]
    assert thresholds == sorted(thresholds)
    np.testing.assert_allclose([bounded_rate(threshold, 0.001) for threshold in thresholds], rates, rtol=1e-12)
    # The odds of the threshold are what arrives between two false tracks.
    np.testing.assert_allclose(thresholds[1] / (1 - thresholds[1]), 3.6)


def odds_on_noise(scans: int, seed: int, arrives: float = 0.02, leaves: float = 0.02) -> np.ndarray:
    """Log odds of a filter of one target that a scan tells by one normal number, at noise; the ratio's mean is 1."""
    told = np.random.default_rng(seed).normal(size=scans) - 0.5
    log_odds, existence = np.empty(scans), 0.0
    for scan in range(scans):
        existence = existence * (1 - leaves) + (1 - existence) * arrives
        log_odds[scan] = np.log(existence / (1 - existence)) + told[scan]
        existence = 1 / (1 + np.exp(-log_odds[scan]))
    return log_odds


def test_noise_keeps_the_bound_of_the_model() -> None:
    """40,000 scans a second apart, at thresholds that are passed a hundred times and more; none allowance is needed."""
    log_odds = odds_on_noise(40_000, seed=1)
    for threshold in (0.3, 0.5, 0.7):
        counted = rises(log_odds, float(logit(0.1)), float(logit(threshold)))
        assert 20 < counted <= bounded_rate(threshold, odds_rate(0.02, 0.02)) * 40_000


def test_the_counted_rate_of_other_noise_is_the_promised_one() -> None:
    """Counted: 400 peaks promised in 40,000 s, and in as many other ones; four standard errors of the difference."""
    low = 0.1
    found = exceedances([odds_on_noise(20_000, seed) for seed in (2, 3)], 40_000, low)
    kept = found.kept(0.01, 0.15)
    assert not kept.extrapolated
    assert found.count(kept.threshold.value) == 400
    assert kept.low < 0.01 < kept.high
    counted = rises(odds_on_noise(40_000, 4), float(logit(low)), float(logit(kept.threshold.value)))
    assert abs(counted - 400) < 4 * np.sqrt(2 * 400)


def test_few_peaks_are_continued() -> None:
    """4 promised in 40,000 s, five calibrations: of 400,000 other ones none has more than its interval allows.

    Fewer they may have: departures cap the odds, so that their tail is thinner than an exponential one.
    """
    other = odds_on_noise(400_000, 99)
    for seed in range(5):
        kept = exceedances([odds_on_noise(40_000, seed)], 40_000, 0.1).kept(1e-4, 0.15)
        assert kept.extrapolated
        np.testing.assert_allclose(kept.rate, 1e-4)
        assert kept.low < kept.rate < kept.high
        assert kept.threshold.low < kept.threshold.value < kept.threshold.high
        assert rises(other, float(logit(0.1)), float(logit(kept.threshold.value))) / 400_000 < kept.high


def test_lower_rates_have_higher_thresholds() -> None:
    found = exceedances([odds_on_noise(20_000, 5)], 20_000, 0.1)
    rates = np.geomspace(1e-2, 1e-6, 30)
    thresholds = [found.kept(rate, 0.15).threshold.value for rate in rates]
    # Where counting ends and peaks are continued, the curve may step down by what ten peaks tell.
    counted = rates * 20_000 >= 10
    assert np.all(np.diff(np.array(thresholds)[counted]) >= 0)
    assert np.all(np.diff(np.array(thresholds)[~counted]) > 0)


def test_without_a_peak_a_threshold_follows_from_the_time() -> None:
    """Half a peak is taken for none (Jeffreys), continued with the scale of the model."""
    kept = Exceedances(np.zeros(0), HOUR, 0.0).kept(0.01 / HOUR, 0.5)
    np.testing.assert_allclose(logit(kept.threshold.value), np.log(0.5 / 0.01), rtol=1e-9)
    assert kept.extrapolated


def test_what_passes_every_threshold_is_refused() -> None:
    with pytest.raises(
        InputError, match=r"no threshold keeps 1 false tracks an hour: existence has 100 peaks, up to 1, in 1 h"
    ):
        Exceedances(np.full(100, 16.0), HOUR, 0.0).kept(1 / HOUR, 0.5)


def test_a_peak_is_the_highest_of_its_excursion() -> None:
    assert peaks(np.full(5, 2.0), 1.0).tolist() == [2.0]
    assert peaks(np.zeros(5), 1.0).size == peaks(np.zeros(0), 1.0).size == 0
    assert rises(np.array([2.0, 0.0, 2.0]), 1.0, 2.5) == 0
    assert expit(0.0) == 0.5


@pytest.mark.parametrize(
    "text", ["1/week", "1/week of", "h", "0/h", "-1/h", "nan/h", "inf/h", "1", "", "one/h", "1/h/h"]
)
def test_a_rate_that_is_none(text: str) -> None:
    with pytest.raises(InputError, match="expected a number an hour or a day, such as 1/h or 2/day"):
        per_second(text)
