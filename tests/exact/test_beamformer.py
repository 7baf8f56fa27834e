"""A plane wave adds up at its bearing, and beam power is what delaying and summing gives."""

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.data.recording import from_samples
from faintrack.errors import InputError
from faintrack.sensors.array import SensorArray, line_array, sensor_array
from faintrack.sensors.beams import BeamScan
from faintrack.signal.beamformer import Beamformer, beamformer
from faintrack.signal.frames import frames
from tests.scenes import CIRCLE, LINE, part, scan_frames
from tests.tolerances import assert_equal

RATE, SIZE = 1000.0, 32
OPERATIONS = 500
"""Roundings from samples to beam power: a transform, a sum over channels, a sum over bins."""
HIGH = np.array([[0.0, 0.0, 0.4], [1.8, 0.3, -0.9], [-0.4, 1.5, 0.0], [-1.2, -1.4, 1.3]])
ARRAYS = {"line": LINE, "plane": CIRCLE, "space": sensor_array(HIGH)}


def waveform(seed: int = 0) -> np.ndarray:
    """Noise without an offset and without a part at half the sample rate."""
    spectrum = np.fft.rfft(np.random.default_rng(seed).normal(size=SIZE))
    spectrum[[0, -1]] = 0
    return np.fft.irfft(spectrum)


def plane_wave(array: SensorArray, direction: np.ndarray, wave: np.ndarray) -> np.ndarray:
    """What each channel hears of a wave from a unit vector, delays going around the frame; (sample, channel)."""
    delay = -array.positions @ direction / array.sound_speed
    frequency = np.fft.rfftfreq(len(wave), 1 / RATE)
    return np.fft.irfft(np.fft.rfft(wave)[:, None] * np.exp(-2j * np.pi * frequency[:, None] * delay), axis=0)


def compass(bearing: float) -> np.ndarray:
    """Horizontal unit vector, clockwise from north."""
    return np.array([np.sin(bearing), np.cos(bearing), 0.0])


def scan(plan: Beamformer, samples: np.ndarray, dtype: type) -> BeamScan:
    usable = jnp.ones((1, samples.shape[1]), bool)
    return part(scan_frames(plan, jnp.zeros(1, dtype), jnp.asarray(samples[None], dtype), usable), 0)


def plan_for(array: SensorArray, dtype: type = np.float64, beams: int = 72, **options: Any) -> Beamformer:
    return beamformer(array, RATE, frame=SIZE / RATE, snapshot=SIZE / RATE, beams=beams, dtype=dtype, **options)


@pytest.mark.parametrize("case", ARRAYS)
@pytest.mark.parametrize("beam", [5, 30, 60])
def test_a_plane_wave_adds_up_at_its_bearing(case: str, beam: int, dtype: type) -> None:
    """M channels in phase: M^2 times the power of the wave, in every bin; nowhere more."""
    array = ARRAYS[case]
    plan, wave = plan_for(array, dtype), waveform()
    bearing = plan.grid.bearing[beam]
    # The line lies along north, from its first channel.
    heard = scan(plan, plane_wave(array, compass(bearing), wave), dtype)
    power = np.abs(np.fft.rfft(wave)[1:-1]) ** 2 / SIZE
    assert_equal(heard.beam_power[:, beam], 16 * power, dtype, OPERATIONS, scale=power.max())
    assert_equal(heard.total_power, 4 * power, dtype, OPERATIONS, scale=power.max())
    assert np.argmax(np.sum(heard.beam_power, axis=0)) == beam


def test_power_is_that_of_the_samples(dtype: type) -> None:
    """Parseval: each bin strictly between zero and half the rate stands twice in a real signal."""
    samples = np.stack([waveform(seed) for seed in range(4)], axis=1)
    total = scan(plan_for(CIRCLE, dtype), samples, dtype).total_power
    assert_equal(2 * np.sum(total), np.sum(samples**2), dtype, OPERATIONS)


@pytest.mark.parametrize("heading", [0.0, 0.7, -2.0])
@pytest.mark.parametrize("side", [1, -1])
def test_a_line_hears_both_of_its_sides_alike(heading: float, side: int, float64: type) -> None:
    array = line_array(4, 1.5, heading=heading)
    plan = plan_for(array)
    bearing = plan.grid.bearing[25]
    power = np.sum(
        scan(plan, plane_wave(array, compass(heading + side * bearing), waveform()), float64).beam_power, axis=0
    )
    assert np.argmax(power) == 25
    assert_equal(power[25], 16 * np.sum(waveform() ** 2) / 2, float64, OPERATIONS)


@pytest.mark.parametrize(
    ("direction", "bearing_deg"), [((0, 1), 0.0), ((1, 0), 90.0), ((0, -1), -180.0), ((-1, 0), -90.0), ((1, 1), 45.0)]
)
def test_bearings_run_clockwise_from_north(direction: tuple[int, int], bearing_deg: float, float64: type) -> None:
    unit = np.array([*direction, 0]) / np.hypot(*direction)
    plan = plan_for(CIRCLE)
    power = np.sum(scan(plan, plane_wave(CIRCLE, unit, waveform()), float64).beam_power, axis=0)
    assert np.degrees(plan.grid.bearing[np.argmax(power)]) == pytest.approx(bearing_deg)


def test_a_wave_from_the_east_reaches_the_east_first() -> None:
    delays = sensor_array(np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 1.0]])).delays(np.array(np.pi / 2))
    assert delays[1] < delays[0] == pytest.approx(delays[2])


def test_heights_matter_to_no_horizontal_wave(float64: type) -> None:
    flat = sensor_array(HIGH * [1, 1, 0])
    samples = plane_wave(flat, compass(0.3), waveform())
    expected, actual = (scan(plan_for(array), samples, float64).beam_power for array in (flat, ARRAYS["space"]))
    assert_equal(actual, expected, float64, OPERATIONS, scale=100.0)


def test_a_vertical_line_measures_from_the_zenith(float64: type) -> None:
    array = sensor_array(np.outer(np.arange(4.0), [0, 0, 1.5]))
    plan = plan_for(array)
    bearing = plan.grid.bearing[20]
    direction = np.array([0.0, np.sin(bearing), np.cos(bearing)])
    power = np.sum(scan(plan, plane_wave(array, direction, waveform()), float64).beam_power, axis=0)
    assert np.argmax(power) == 20


@pytest.mark.parametrize(("beam", "shift"), [(0, 2), (36, 1), (54, 0), (72, -1), (108, -2)])
def test_whole_delays_are_shifts_of_the_samples(beam: int, shift: int, float64: type) -> None:
    """Channels two samples of sound apart, seen along the line, at 60 degrees, across it, and from behind."""
    array = line_array(5, spacing=2 * 1500.0 / RATE)
    plan = plan_for(array, beams=109)
    assert np.cos(plan.grid.bearing[beam]) == pytest.approx(shift / 2)
    samples = np.stack([waveform(seed) for seed in range(5)], axis=1)
    # The wave reaches the channel ahead earlier, by `shift` samples: it waits for the others.
    summed = sum(np.roll(samples[:, channel], shift * channel) for channel in range(5))
    power = scan(plan, samples, float64).beam_power[:, beam]
    assert_equal(2 * np.sum(power), np.sum(summed**2), float64, OPERATIONS)


def test_a_band_is_a_choice_of_bins(float64: type) -> None:
    samples = np.random.default_rng(1).normal(size=(SIZE, 4))
    whole, band = plan_for(LINE), plan_for(LINE, band=(100.0, 250.0))
    chosen = (whole.grid.frequency >= 100) & (whole.grid.frequency <= 250)
    np.testing.assert_array_equal(band.grid.frequency, [125.0, 156.25, 187.5, 218.75, 250.0])
    expected, actual = scan(whole, samples, float64), scan(band, samples, float64)
    assert_equal(actual.beam_power, expected.beam_power[chosen], float64, OPERATIONS, scale=100.0)
    assert_equal(actual.total_power, expected.total_power[chosen], float64, OPERATIONS)


def test_snapshots_add_up(float64: type) -> None:
    samples = np.random.default_rng(1).normal(size=(3 * SIZE, 4))
    plan = beamformer(LINE, RATE, frame=3 * SIZE / RATE, snapshot=SIZE / RATE, beams=72, dtype=float64)
    parts = [scan(plan_for(LINE), part, float64) for part in np.split(samples, 3)]
    whole = scan(plan, samples, float64)
    assert plan.grid.snapshots == 3
    for field in ("beam_power", "total_power"):
        expected = sum(np.asarray(getattr(part, field)) for part in parts)
        assert_equal(getattr(whole, field), expected, float64, OPERATIONS, scale=100.0)


def test_gains_correct_their_channels(float64: type) -> None:
    """An inverted and a faint channel, put right, are as good as new."""
    gains = np.array([1.0, -1.0, 4.0, 1.0])
    samples = plane_wave(CIRCLE, compass(1.0), waveform())
    repaired = scan(plan_for(sensor_array(CIRCLE.positions, gains=gains)), samples / gains, float64)
    expected = scan(plan_for(CIRCLE), samples, float64)
    assert_equal(repaired.beam_power, expected.beam_power, float64, OPERATIONS, scale=100.0)


def test_a_channel_that_is_no_number_is_absent_from_its_frame(float64: type) -> None:
    samples = np.random.default_rng(1).normal(size=(2 * SIZE, 4))
    samples[3, 2] = np.nan
    block = next(frames(from_samples(samples, RATE), SIZE, block=2, dtype=float64))
    plan = plan_for(CIRCLE)
    scans = plan.scan(jnp.asarray(block.time), jnp.asarray(block.samples), jnp.asarray(block.usable))
    heard = [0, 1, 3]
    expected = scan(plan_for(sensor_array(CIRCLE.positions[heard])), samples[:SIZE, heard], float64)
    assert scans.channels.tolist() == [3.0, 4.0]
    assert_equal(scans.beam_power[0], expected.beam_power, float64, OPERATIONS, scale=100.0)
    assert_equal(scans.beam_power[1], scan(plan, samples[SIZE:], float64).beam_power, float64, OPERATIONS, scale=100.0)


def test_single_precision_is_double_precision_rounded(float64: type) -> None:
    samples = np.random.default_rng(1).normal(size=(SIZE, 4))
    double, single = (scan(plan_for(CIRCLE, dtype), samples, dtype) for dtype in (np.float64, np.float32))
    assert single.beam_power.dtype == np.float32
    assert_equal(single.beam_power, double.beam_power, np.float32, OPERATIONS, scale=1.0)


@pytest.mark.parametrize("case", ["plane", "space", "mirrored"])
@pytest.mark.parametrize("beams", [12, 13])
def test_rings_of_beams_delay_and_sum(case: str, beams: int, dtype: type) -> None:
    """Every beam of every ring, against channels delayed by the product of position and direction."""
    mirrored = sensor_array(np.array([[0.3, 1.0, 0.2], [-1.5, 0.4, 0.0], [1.5, -0.4, 0.0], [-0.3, -1.0, -0.2]]))
    array = mirrored if case == "mirrored" else ARRAYS[case]
    plan = plan_for(array, dtype, beams, elevation=(0.0, 1.2))
    assert plan.mirrored == (case == "mirrored")
    samples = np.random.default_rng(4).normal(size=(SIZE, 4))
    heard = scan(plan, samples, dtype)
    bearing, elevation = plan.grid.directions
    assert elevation is not None
    assert len(bearing) == beams * plan.grid.rings
    assert elevation[beams] == pytest.approx(0)
    assert elevation[-beams - 1] == pytest.approx(1.2)
    level = np.cos(elevation)
    direction = np.stack([level * np.sin(bearing), level * np.cos(bearing), np.sin(elevation)])
    spectra = np.fft.rfft(samples, axis=0)[1:-1] / np.sqrt(SIZE)
    advance = array.positions @ direction / array.sound_speed
    turned = np.exp(-2j * np.pi * plan.grid.frequency[:, None, None] * advance)
    power = np.abs(np.einsum("fcb,fc->fb", turned, spectra)) ** 2
    assert_equal(heard.beam_power, power, dtype, OPERATIONS, scale=power.max())


def test_elevations_that_an_array_cannot_tell_are_refused() -> None:
    with pytest.raises(InputError, match="the array is a line, which hears every wave of a cone"):
        plan_for(LINE, elevation=(0.0, 1.0))
    with pytest.raises(InputError, match=r"elevation_deg begins at -28\.6479, and the channels lie in a level plane"):
        plan_for(CIRCLE, elevation=(-0.5, 1.0))
    assert plan_for(ARRAYS["space"], elevation=(-0.5, 1.0)).grid.elevations[1] == -0.5
    wide = sensor_array(1000 * CIRCLE.positions)
    with pytest.raises(InputError, match=r"rings of beams at 468\.75 Hz; expected at most 128"):
        plan_for(wide, elevation=(0.0, 1.0))
