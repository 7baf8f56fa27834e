"""Samples that are drawn have the variances, spectra, bearings and times that were asked for."""

import math

import jax.numpy as jnp
import numpy as np
import pytest
import scipy.signal

from faintrack.sensors.array import SensorArray, line_array, sensor_array
from faintrack.signal.beamformer import beamformer
from faintrack.simulation.samples import Source, draw_samples

RATE = 1000.0
ARRAY = line_array(8, 0.75)
ROUND = sensor_array(np.array([[0.0, 5.0], [4.0, -3.0], [-4.0, -3.0], [0.5, 0.5]]), sound_speed=340.0)


def draw(array: SensorArray, *sources: Source, duration: float = 20.0, **more: float) -> np.ndarray:
    return np.concatenate(list(draw_samples(array, sources, duration, RATE, **more)))


def test_noise_has_its_power_and_is_independent_between_channels() -> None:
    samples = draw(ARRAY, noise_power=4.0)
    standard_error = math.sqrt(2 / len(samples))
    np.testing.assert_allclose(samples.var(axis=0) / 4, 1, atol=5 * standard_error)
    off_diagonal = np.corrcoef(samples.T) - np.eye(8)
    assert np.abs(off_diagonal).max() < 5 / math.sqrt(len(samples))


@pytest.mark.parametrize("slope_db", [-6.0, 3.0])
def test_coloured_noise_has_its_slope_and_power(slope_db: float) -> None:
    samples = draw(ARRAY, duration=100.0, noise_slope_db=slope_db)
    frequency, power = scipy.signal.welch(samples, RATE, nperseg=1000, axis=0)
    octaves = np.log2(frequency[20:400])
    fitted = np.polyfit(octaves, 10 * np.log10(power[20:400].mean(axis=1)), 1)[0]
    # The filter of finite length bends the spectrum by a few tenths of a decibel an octave.
    assert abs(fitted - slope_db) < 0.3
    np.testing.assert_allclose(samples.var(), 1, rtol=0.05)


def test_source_has_its_snr() -> None:
    samples = draw(ARRAY, Source(snr_db=10.0, bearing=1.0), duration=60.0)
    # Source and noise are white: a standard error of sqrt(2 / n), times a few for the windows that fade segments.
    np.testing.assert_allclose(samples.var(axis=0), 11, rtol=0.03)


@pytest.mark.parametrize(("array", "bearing"), [(ARRAY, 0.4), (ARRAY, 2.5), (ROUND, -2.0), (ROUND, 0.7)])
def test_source_comes_from_its_bearing_with_all_its_power(array: SensorArray, bearing: float) -> None:
    samples = draw(array, Source(snr_db=20.0, bearing=bearing))
    plan = beamformer(array, RATE, frame=1.0, band=(20.0, 150.0), beams=720)
    scans = plan.scan(
        jnp.arange(20.0), jnp.asarray(samples).reshape(20, 1000, -1), jnp.ones((20, len(array.gains)), bool)
    )
    power = np.asarray(scans.beam_power.sum(axis=(0, 1)) / scans.total_power.sum())
    assert abs(plan.grid.bearing[power.argmax()] - bearing) < 2 * np.pi / 720
    # A snapshot of two channels shares what is left of it after their delay; noise adds incoherently.
    delays = array.delays(np.array(bearing))
    shared = 1 - np.abs(delays[:, None] - delays) * RATE / plan.snapshot
    channels = len(array.gains)
    expected = (channels + 100 * shared.sum()) / (channels * (1 + 100))
    assert power.max() == pytest.approx(expected, rel=0.01)


def test_source_moves() -> None:
    source = Source(snr_db=20.0, bearing=1.0, bearing_rate=0.02, start=5.0)
    samples = draw(ARRAY, source)
    plan = beamformer(ARRAY, RATE, frame=1.0, beams=720)
    scans = plan.scan(jnp.arange(20.0), jnp.asarray(samples).reshape(20, 1000, -1), jnp.ones((20, 8), bool))
    found = plan.grid.bearing[np.asarray(scans.beam_power.sum(axis=1)).argmax(axis=1)][6:]
    np.testing.assert_allclose(found, source.bearing_at(np.arange(6, 20) + 0.5), atol=0.012)


def test_source_appears_and_leaves() -> None:
    samples = draw(ARRAY, Source(snr_db=20.0, bearing=np.pi / 2, start=5.0, end=12.0))
    loud = samples.reshape(200, 100, 8).var(axis=(1, 2)) > 10
    assert np.flatnonzero(loud)[[0, -1]].tolist() == [50, 119]


def test_same_seed_same_samples_and_another_seed_others() -> None:
    np.testing.assert_array_equal(draw(ARRAY, Source(0.0, 1.0)), draw(ARRAY, Source(0.0, 1.0)))
    assert not np.array_equal(draw(ARRAY, seed=1), draw(ARRAY, seed=2))


def test_a_longer_recording_begins_like_a_shorter_one() -> None:
    short, long = draw(ARRAY, Source(0.0, 1.0), duration=3.3), draw(ARRAY, Source(0.0, 1.0), duration=5.0)
    assert len(short) == 3300
    np.testing.assert_array_equal(short, long[:3300])


def test_gains_of_the_array_file_are_undone() -> None:
    array = sensor_array(ARRAY.positions, gains=np.array([1, -1, 0, 2, 1, 1, 1, 1.0]))
    plain, recorded = draw(ARRAY), draw(array)
    np.testing.assert_allclose(recorded[:, [0, 1, 3]] * [1, -1, 2], plain[:, [0, 1, 3]], rtol=1e-6)
    assert not recorded[:, 2].any()


def test_a_source_above_the_horizon_is_heard_as_its_delays_say() -> None:
    """Phases between channels, against the product of positions and direction: 5 standard errors of each."""
    bearing, elevation = -2.0, 1.1
    high = sensor_array(np.column_stack([ROUND.positions[:, :2], [0.0, 2.0, -1.0, 0.5]]), sound_speed=340.0)
    samples = draw(high, Source(snr_db=30.0, bearing=bearing, elevation=elevation), duration=40.0)
    direction = [np.cos(elevation) * np.sin(bearing), np.cos(elevation) * np.cos(bearing), np.sin(elevation)]
    delays = -high.positions @ direction / 340.0
    for channel in (1, 2, 3):
        frequency, cross = scipy.signal.csd(samples[:, 0], samples[:, channel], RATE, nperseg=256)
        few = (frequency > 20) & (frequency < 100)
        apart = np.angle(cross[few] * np.exp(2j * np.pi * frequency[few] * (delays[channel] - delays[0])))
        # Of some 300 segments, half as many of them independent, with a coherence of 0.997 or so.
        assert np.abs(apart).max() < 5 * 0.06 / math.sqrt(2 * 150)
