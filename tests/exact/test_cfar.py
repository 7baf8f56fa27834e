"""Levels and detections on beam powers made by hand; on noise, as many false alarms as were asked for."""

from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.baselines.cfar import Calibration, CellAveraging, Detections, calibrate, cell_averaging
from faintrack.errors import InputError
from faintrack.sensors.array import line_array
from faintrack.sensors.beams import BeamGrid, BeamScan
from tests.scenes import COLOURED, Scene
from tests.tolerances import assert_equal, rounding

BEAMS, GUARD, WINDOW = 13, 2, 3
OPERATIONS = 20
"""Roundings in one level: a sum over bins, a mean over the window, a quotient."""
ALLOWED = 4.0
"""Standard errors. A normal mean strays further once in 16,000 comparisons; this file makes a hundred, with fixed
keys."""
FRAMES, FALSE_ALARMS = 4000, 0.05
BROAD = Scene(np.float32, line_array(8, spacing=1.5))
"""Eight channels on a line and 36 beams, for the trials on noise."""

either = pytest.mark.parametrize("circular", [False, True], ids=["line", "circle"])


def grid(circular: bool) -> BeamGrid:
    return BeamGrid(np.array([100.0, 200.0, 300.0]), beams=BEAMS, snapshots=1, circular=circular)


def detector(circular: bool, threshold: float = 2.0, noise_power: np.ndarray | None = None) -> CellAveraging:
    known = None if noise_power is None else jnp.asarray(noise_power, jnp.float32)
    return cell_averaging(grid(circular), GUARD, WINDOW, threshold, known)


def scan(beam_power: np.ndarray, total_power: np.ndarray | None = None, channels: float = 4.0) -> BeamScan:
    """From powers of shape (frequency, beam), or (beam,) for the same in every bin."""
    beam_power = np.broadcast_to(beam_power, (3, BEAMS))
    total_power = np.ones(3) if total_power is None else total_power
    fields = (0.0, beam_power, total_power, channels)
    return BeamScan(*(jnp.asarray(values, jnp.float32) for values in fields))


@eqx.filter_jit
def level(detector: CellAveraging, scan: BeamScan) -> jax.Array:
    return detector.level(scan)


@eqx.filter_jit
def detect(detector: CellAveraging, scan: BeamScan) -> Detections:
    return detector.detect(scan)


def found(detections: Detections) -> list[int]:
    return np.flatnonzero(detections.found).tolist()


def by_hand(response: np.ndarray, circular: bool) -> np.ndarray:
    """Response over the mean of the beams 3, 4 and 5 away on either side, as far as there are any."""
    levels = []
    for beam in range(BEAMS):
        around = [beam + side * away for side in (-1, 1) for away in (3, 4, 5)]
        if circular:
            around = [other % BEAMS for other in around]
        levels.append(response[beam] / np.mean([response[other] for other in around if 0 <= other < BEAMS]))
    return np.array(levels)


# By hand


@either
def test_level_is_the_response_over_the_mean_around(circular: bool) -> None:
    power = np.random.default_rng(0).exponential(size=(3, BEAMS))
    expected = by_hand(power.T @ (1 / COLOURED), circular)
    assert_equal(level(detector(circular, noise_power=COLOURED), scan(power)), expected, np.float32, OPERATIONS)
    assert_equal(
        level(detector(circular, noise_power=np.array(0.3)), scan(power)),
        by_hand(power.sum(axis=0), circular),
        np.float32,
        OPERATIONS,
    )


@either
def test_without_a_noise_power_every_bin_counts_alike(circular: bool) -> None:
    power = np.random.default_rng(1).exponential(size=(3, BEAMS))
    total = np.array([0.5, 2.0, 3.0])
    expected = by_hand(power.T @ (1 / total), circular)
    scale = np.array([1e-5, 1.0, 1e4])
    assert_equal(level(detector(circular), scan(power, total)), expected, np.float32, OPERATIONS)
    scaled = scan(power * scale[:, None], total * scale)
    assert_equal(level(detector(circular), scaled), expected, np.float32, OPERATIONS)


def test_a_silent_bin_is_left_out() -> None:
    power = np.random.default_rng(1).exponential(size=(3, BEAMS)) * np.array([1, 0, 1])[:, None]
    expected = by_hand(power.sum(axis=0), False)
    assert_equal(level(detector(False), scan(power, np.array([1.0, 0.0, 1.0]))), expected, np.float32, OPERATIONS)


@either
@pytest.mark.parametrize("noise_power", [None, np.ones(3)], ids=["unknown", "known"])
def test_silence_says_nothing(circular: bool, noise_power: np.ndarray | None) -> None:
    detections = detect(detector(circular, 0.5, noise_power), scan(np.zeros(BEAMS), np.zeros(3)))
    np.testing.assert_array_equal(detections.level, 1)
    assert not found(detections)
    assert np.isfinite(detections.bearing).all()


@either
def test_even_power_is_no_detection(circular: bool) -> None:
    assert not found(detect(detector(circular, 0.5), scan(np.ones(BEAMS))))


@either
@pytest.mark.parametrize("beam", [0, 5, BEAMS - 1])
def test_one_loud_beam_is_one_detection(circular: bool, beam: int) -> None:
    power = np.ones(BEAMS)
    power[beam] = 9
    detections = detect(detector(circular), scan(power))
    assert found(detections) == [beam]
    assert_equal(detections.level[beam], 9.0, np.float32, OPERATIONS)
    assert_equal(detections.bearing[beam], grid(circular).bearing[beam], np.float32, OPERATIONS)


@either
def test_of_a_run_of_loud_beams_the_highest_is_detected(circular: bool) -> None:
    power = np.array([1, 1, 1, 1, 1, 30, 40, 35, 1, 1, 1, 1, 1.0])
    detections = detect(detector(circular), scan(power))
    assert_equal(detections.level[5:8], power[5:8], np.float32, OPERATIONS)
    assert found(detections) == [6]


@either
def test_two_equal_beams_are_one_detection_between_them(circular: bool) -> None:
    power = np.array([1, 1, 1, 1, 1, 40, 40, 1, 1, 1, 1, 1, 1.0])
    detections = detect(detector(circular), scan(power))
    assert found(detections) == [6]
    middle = np.mean(grid(circular).bearing[5:7])
    assert_equal(detections.bearing[6], middle, np.float32, OPERATIONS, scale=np.pi)


@either
@pytest.mark.parametrize("offset", [-0.45, -0.2, 0.3])
@pytest.mark.parametrize("beam", [1, 6, BEAMS - 2])
def test_a_parabola_finds_a_peak_between_beams(circular: bool, offset: float, beam: int) -> None:
    """Three beams on a parabola with its top between two of them; the guard keeps the references free of them."""
    power = np.ones(BEAMS)
    beside = np.array([-1, 0, 1])
    power[beam + beside] = 20 - 4 * (beside - offset) ** 2
    detections = detect(detector(circular), scan(power))
    bearing = grid(circular).bearing
    assert found(detections) == [beam]
    expected = bearing[beam] + offset * (bearing[1] - bearing[0])
    assert_equal(detections.bearing[beam], expected, np.float32, OPERATIONS, scale=np.pi)


def test_a_peak_across_the_seam_of_a_circle() -> None:
    power = np.ones(BEAMS)
    beside = np.array([-1, 0, 1])
    power[beside] = 20 - 4 * (beside + 0.3) ** 2
    detections = detect(detector(True), scan(power))
    assert found(detections) == [0]
    # Half a spacing before the first beam is half a spacing behind the last but for a turn.
    expected = np.pi - 0.3 * 2 * np.pi / BEAMS
    off = float(detections.bearing[0]) - expected
    assert abs((off + np.pi) % (2 * np.pi) - np.pi) < np.pi * rounding(np.float32, OPERATIONS)


@pytest.mark.parametrize("channels", [0.0, 1.0])
def test_fewer_than_two_channels_detect_nothing(channels: float) -> None:
    power = np.ones(BEAMS)
    power[5] = 9
    assert not found(detect(detector(False), scan(power, channels=channels)))


def test_a_detector_that_is_not_calibrated_detects_nothing() -> None:
    power = np.ones(BEAMS)
    power[5] = 1e6
    assert not found(detect(cell_averaging(grid(False), GUARD, WINDOW), scan(power)))


@pytest.mark.parametrize(("guard", "window"), [(-1, 2), (1, 0), (3, 4), (20, 1)])
@either
def test_guard_and_window_must_fit(circular: bool, guard: int, window: int) -> None:
    with pytest.raises(InputError, match=rf"CFAR guard {guard} and window {window} beams; expected .* {BEAMS} beams"):
        cell_averaging(grid(circular), guard, window)


# On noise


@eqx.filter_jit
def detect_all(detector: CellAveraging, scans: BeamScan) -> Detections:
    return jax.vmap(detector.detect)(scans)


@dataclass(frozen=True)
class Trial:
    """A calibration, and frames of fresh noise for the detector that it gave."""

    wanted: CellAveraging
    calibration: Calibration
    levels: np.ndarray
    found: np.ndarray


@pytest.fixture(scope="module", params=["known", "unknown"])
def trial(request: pytest.FixtureRequest) -> Trial:
    """Where no noise power is known, the noise of the trial is 50 times as strong as the calibration's and slopes by
    15 dB where that was white."""
    known = request.param == "known"
    noise_power = jnp.asarray(COLOURED if known else 50 * COLOURED, jnp.float32)
    wanted = cell_averaging(BROAD.grid, 4, 6, noise_power=noise_power if known else None)
    calibration = calibrate(wanted, BROAD.beamformer, BROAD.array, FALSE_ALARMS, jax.random.key(1), FRAMES)
    scans = BROAD.draw(jax.random.key(2), FRAMES, noise_power=noise_power)
    detections = detect_all(calibration.detector, scans)
    return Trial(wanted, calibration, np.asarray(detections.level), np.asarray(detections.found))


def test_each_beam_raises_as_many_false_alarms_as_wanted(trial: Trial) -> None:
    """4,000 frames to calibrate and 4,000 to try; 4 standard errors, each 0.005 with both draws counted.

    A threshold that is a quantile of n draws is passed with a probability of variance p (1 - p) / n, and the share that
    pass it among n others has as much again.
    """
    rate = np.mean(trial.levels > np.asarray(trial.calibration.detector.threshold), axis=0)
    error = np.sqrt(2 * FALSE_ALARMS * (1 - FALSE_ALARMS) / FRAMES)
    np.testing.assert_allclose(rate, FALSE_ALARMS, rtol=0, atol=ALLOWED * error)


def test_false_detections_a_frame(trial: Trial) -> None:
    """4,000 frames to calibrate and 4,000 to try; 4 standard errors, both counts counted.

    The calibration counts the draws from which its thresholds came, so that its own count varies less than a fresh one.
    """
    counts = trial.found.sum(axis=1)
    error = counts.std(ddof=1) * np.sqrt(2 / FRAMES)
    assert abs(counts.mean() - float(trial.calibration.false_detections)) < ALLOWED * error
    # Beams exceed together, and only the highest of them is a detection.
    assert 0 < counts.mean() < FALSE_ALARMS * BROAD.grid.beams


def test_calibration_changes_the_threshold_alone(trial: Trial) -> None:
    wanted, found = trial.wanted, trial.calibration.detector
    np.testing.assert_array_equal(found.reference, wanted.reference)
    np.testing.assert_array_equal(found.grid.bearing, wanted.grid.bearing)
    assert eqx.tree_equal(found.noise_power, wanted.noise_power)
    assert (found.threshold > 1).all()
