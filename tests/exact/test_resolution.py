"""Bins that are finer than the resolution are recognised by their returns and thinned, independent ones are not."""

import math

import numpy as np
import pytest

from faintrack.beliefs.axis import Axis
from faintrack.data.returns import Returns, from_columns
from faintrack.sensors.active import ActiveSonar, Pulse
from faintrack.signal.pings import Binned, in_bins
from faintrack.signal.resolution import linked_bins, thinned

THRESHOLD, PINGS = 6.0, 6
DELAYS, BEAMS = 1200, 36


def binned(power: np.ndarray) -> Binned:
    """Returns of some pings, from the power of every bin; shape (ping, delay, beam)."""
    sonar = ActiveSonar(
        Pulse(2000.0, 1.0, 50.0), Axis(4.0, 0.005, DELAYS), BEAMS, math.radians(8), None, reach=(12, 6, 0)
    )
    number, delay, beam = np.nonzero(power > THRESHOLD)
    return in_bins(returns(number, delay, beam, power[power > THRESHOLD]), sonar, THRESHOLD)


def returns(number: np.ndarray, delay: np.ndarray, beam: np.ndarray, power: np.ndarray) -> Returns:
    return from_columns(
        {
            "time_s": 60.0 * number,
            "delay_s": 4.0 + 0.005 * delay,
            "bearing_deg": (90 - 360 / BEAMS * beam) % 360,
            "snr_db": 10 * np.log10(power),
        }
    )


def noise(seed: int, width: int = 1, axis: int = 1) -> np.ndarray:
    """Power of noise of mean 1 that fills 1/width of the band along an axis; shape (ping, delay, beam)."""
    rng = np.random.default_rng(seed)
    shape = (PINGS, DELAYS, BEAMS)
    spectrum = np.fft.fft(rng.normal(size=shape) + 1j * rng.normal(size=shape), axis=axis)
    kept = np.abs(np.fft.fftfreq(shape[axis])) < 0.5 / width
    power = np.abs(np.fft.ifft(spectrum * np.expand_dims(kept, [0, 3 - axis]), axis=axis)) ** 2
    return power / power.mean()


@pytest.mark.parametrize("seed", range(3))
def test_independent_bins_are_told_as_such(seed: int) -> None:
    assert linked_bins(binned(noise(seed))) == (1, 1, 1)


@pytest.mark.parametrize(("width", "fewest"), [(2, 2), (4, 3), (8, 5)])
def test_bins_finer_than_the_resolution_are_recognised(width: int, fewest: int) -> None:
    """Where the band fills 1/w, bins w apart are independent, and those from two thirds of that on nearly so."""
    delay, beam, doppler = linked_bins(binned(noise(3, width)))
    assert fewest <= delay <= width
    assert (beam, doppler) == (1, 1)


def test_beams_that_overlap_are_thinned_evenly() -> None:
    """A divisor of the 36 beams, also where three would do."""
    delay, beam, _ = linked_bins(binned(noise(4, 4, axis=2)))
    assert delay == 1
    assert beam in (3, 4)


def test_echoes_of_targets_are_not_taken_for_fine_bins() -> None:
    """Two targets that fill five beams and three delays in every ping, beside 107 returns of noise."""
    power = noise(5)
    for number in range(PINGS):
        for delay, beam in ((200 + 3 * number, 5), (700, 20)):
            power[number, delay : delay + 3, beam : beam + 5] += 40.0
    assert linked_bins(binned(power)) == (1, 1, 1)


def test_level_by_delay_is_not_taken_for_fine_bins() -> None:
    """A tenth of the bins above the threshold over a third of the delays: chance alone puts returns side by side."""
    level = np.where(np.arange(DELAYS) < 400, 2.6, 1.0)[:, None]
    assert linked_bins(binned(noise(6) * level)) == (1, 1, 1)


def test_thinned_returns_are_those_of_every_other_bin() -> None:
    power = noise(7, 4)
    fine = binned(power)
    coarse = thinned(fine, (4, 2, 1), THRESHOLD)
    assert coarse.sonar.shape == (DELAYS // 4, BEAMS // 2, 1)
    assert coarse.sonar.reach == (3, 3, 0)
    kept = power[:, ::4, ::2]
    number, delay, beam = np.nonzero(kept > THRESHOLD)
    np.testing.assert_array_equal(coarse.returns.ping[coarse.order], number)
    np.testing.assert_array_equal(coarse.bins[:, :2], np.stack([delay, beam], axis=1))
    np.testing.assert_allclose(coarse.returns.power[coarse.order], kept[kept > THRESHOLD], rtol=1e-9)
    np.testing.assert_array_equal(coarse.returns.times, fine.returns.times)
    # A place has the same delay in both.
    np.testing.assert_allclose(coarse.sonar.delay.values, fine.sonar.delay.values[::4])


def test_few_returns_tell_nothing() -> None:
    power = np.zeros((PINGS, DELAYS, BEAMS))
    power[0, 10:14, 3] = 20.0
    assert linked_bins(binned(power)) == (1, 1, 1)
