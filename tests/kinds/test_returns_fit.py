"""What is told of pings without a track: nothing where they are the background's, and in which way they are not."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.beliefs.axis import Axis
from faintrack.data.returns import from_columns
from faintrack.kinds.returns.fit import RANKS, Fit, FitOfPings, about_bins, about_contacts, fit_of
from faintrack.sensors.active import ActiveSonar, Pulse, ping
from faintrack.signal.lone_returns import neighbours
from faintrack.signal.pings import in_bins

THRESHOLD, BINS, PINGS = 6.0, 64_000, 20
EXPECTED = BINS * np.exp(-THRESHOLD)


def fit_after(returns: float, excess: float, learnt: bool = True, tracked: bool = False) -> FitOfPings:
    """Fit after pings with so many returns on average, whose excess has this mean."""
    rng = np.random.default_rng(0)
    counts = rng.poisson(returns, PINGS)
    ranks = np.array(
        [np.histogram(np.exp(-excess * rng.exponential(size=count)), bins=RANKS, range=(0, 1))[0] for count in counts]
    )
    fit = FitOfPings(BINS, THRESHOLD, learnt)
    fit.add(Fit(jnp.asarray(ranks), jnp.zeros(PINGS), jnp.zeros(PINGS)), counts, np.full(PINGS, tracked))
    return fit


def test_the_model_s_own_noise_is_not_remarked() -> None:
    fit = fit_after(EXPECTED, 1.0)
    assert fit.remarks() == fit.misfits() == ()


def test_a_number_of_returns_that_is_not_the_model_s_is_told() -> None:
    """Noise of mean 1.5 exceeds 6 with the probability e^-4."""
    fit = fit_after(BINS * np.exp(-4.0), 1.0)
    (remark,) = fit.remarks()
    assert "as if it were +1.8 dB" in remark
    assert "it was learnt" in remark
    assert fit.misfits() == ()
    fit = fit_after(BINS * np.exp(-4.0), 1.0, learnt=False)
    (misfit,) = fit.misfits()
    assert "existence may be wrong, expected background.learn" in misfit
    assert fit.remarks() == ()


@pytest.mark.parametrize(("excess", "side"), [(2.0, "more"), (0.5, "fewer")])
def test_an_excess_that_does_not_fit_is_told(excess: float, side: str) -> None:
    """A tenth lies beyond e^-y = 0.1 where the mean is 1, 32 % where it is 2, 1 % where it is a half."""
    (misfit,) = fit_after(EXPECTED, excess).misfits()
    assert f"{side} than fit: existence may be wrong" in misfit
    assert f"{100 * 0.1 ** (1 / excess):.1g}"[0] in misfit.split("track ")[1][:3]


def test_pings_with_a_track_do_not_count() -> None:
    fit = fit_after(10 * EXPECTED, 3.0, tracked=True)
    assert fit.remarks() == fit.misfits() == ()


def test_ranks_are_tenths_of_the_excess() -> None:
    sonar = ActiveSonar(Pulse(2000.0, 1.0, 50.0), Axis(4.0, 0.02, 100), 16, 0.1, None)
    bins = np.stack([np.arange(3), np.zeros(3, int), np.zeros(3, int)], axis=1)
    power = THRESHOLD - np.log(np.array([0.05, 0.55, 0.95]))
    ranks = fit_of(ping(sonar, 0.0, bins, power, 8), THRESHOLD).ranks
    np.testing.assert_array_equal(ranks, np.isin(np.arange(RANKS), [0, 5, 9]))
    assert jax.tree.leaves(ranks)[0].sum() == 3


def test_bins_that_are_left_out_are_told() -> None:
    (sentence,) = about_bins((3, 1, 2), True)
    assert "one of every 3 in delay and 2 in Doppler is read (background.every)" in sentence
    assert about_bins((3, 1, 1), False) == ()


@pytest.mark.parametrize("clustered", [True, False])
def test_contacts_that_were_told_as_returns_are_recognised(clustered: bool) -> None:
    """Echoes of 30 dB in bins of half their width: one return each, or with those beside it."""
    sonar = ActiveSonar(Pulse(2000.0, 1.0, 10.0), Axis(2.0, 0.05, 200), 24, math.radians(12), None)
    offsets = [0.0] if clustered else [0.0, 0.05]
    delay = np.add.outer(3.0 + 0.1 * np.arange(40), offsets)
    columns = {
        "time_s": np.repeat(60.0 * np.arange(40), len(offsets)),
        "delay_s": delay.ravel(),
        "bearing_deg": np.full(delay.size, 90.0),
        "snr_db": np.full(delay.size, 30.0),
    }
    loud = neighbours(in_bins(from_columns(columns), sonar, THRESHOLD), THRESHOLD)
    # h is 0.4 half a width off: both bins beside fall below 6 with the probability 0.015 squared.
    assert loud.returns == delay.size
    assert loud.expected == pytest.approx(delay.size, rel=1e-3)
    assert loud.found == (0 if clustered else delay.size)
    said = about_contacts(loud)
    assert bool(said) == clustered
    assert not clustered or "a scenario with [contacts]" in said[0]
