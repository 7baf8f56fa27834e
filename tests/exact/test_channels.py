"""Changes to channels are named where they are, and only there."""

import numpy as np
import pytest

from faintrack.kinds.recording.channels import LoudFrames
from faintrack.sensors.array import SensorArray, line_array, sensor_array
from faintrack.sensors.beams import BeamGrid, steering
from faintrack.signal.beamformer import Beamformer, beamformer
from faintrack.signal.channels import doubts

ARRAYS = {
    "line": line_array(8, 1.5),
    "flat": sensor_array(np.array([[0.0, 0.0], [3.0, 0.5], [1.0, 4.0], [-2.0, 1.5], [2.0, -3.0]])),
}
FRAMES = 6


def plan_of(array: SensorArray) -> Beamformer:
    return beamformer(array, 1000.0, 0.5, (50.0, 350.0), snapshot=0.125)


def planned(array: SensorArray) -> BeamGrid:
    return plan_of(array).grid


def heard(grid: BeamGrid, *sources: tuple[float, float], seed: int = 0) -> np.ndarray:
    """Spectra of frames with plane waves of (bearing, amplitude over the noise)."""
    assert grid.array is not None
    rng = np.random.default_rng(seed)
    shape = (FRAMES, grid.snapshots, grid.frequency.size)

    def drawn(*more: int) -> np.ndarray:
        return (rng.normal(size=(*shape, *more)) + 1j * rng.normal(size=(*shape, *more))) / np.sqrt(2)

    spectra = drawn(len(grid.array.gains))
    for bearing, amplitude in sources:
        vectors = steering(grid.array, grid.frequency, np.array([bearing]))[:, 0]
        spectra += amplitude * drawn()[..., None] * vectors
    return spectra


@pytest.mark.parametrize("name", ARRAYS)
@pytest.mark.parametrize("factor", [-1.0, 0.5, 2.0])
@pytest.mark.parametrize("channel", [0, 2, 4])
def test_a_wrong_factor_is_named(name: str, factor: float, channel: int) -> None:
    grid = planned(ARRAYS[name])
    # A channel of half the gain takes little of what a faint source tells.
    spectra = heard(grid, (1.0, 1.0 if abs(factor) >= 1 else 4.0), seed=channel)
    spectra[..., channel] *= factor
    (doubt,) = doubts(grid, spectra)
    assert (doubt.channels, doubt.factor) == ((channel,), 1 / factor)
    assert doubt.after > doubt.before > 0


def test_exchanged_channels_are_named() -> None:
    grid = planned(ARRAYS["flat"])
    spectra = heard(grid, (1.0, 1.0))
    spectra[..., [1, 3]] = spectra[..., [3, 1]]
    (doubt,) = doubts(grid, spectra)
    assert (doubt.channels, doubt.factor) == ((1, 3), 1.0)


def test_two_that_are_reversed_are_both_named() -> None:
    grid = planned(ARRAYS["line"])
    spectra = heard(grid, (1.0, 1.0))
    spectra[..., [1, 4]] *= -1
    assert sorted(doubt.channels for doubt in doubts(grid, spectra)) == [(1,), (4,)]


@pytest.mark.parametrize("name", ARRAYS)
@pytest.mark.parametrize("sources", [(), ((1.0, 0.3),), ((1.0, 3.0), (2.0, 3.0)), ((0.5, 30.0),)])
def test_channels_as_they_should_be_are_left_alone(name: str, sources: tuple[tuple[float, float], ...]) -> None:
    grid = planned(ARRAYS[name])
    assert [doubts(grid, heard(grid, *sources, seed=seed)) for seed in range(5)] == [[]] * 5


def test_frames_that_lack_a_channel_tell_nothing_of_it() -> None:
    grid = planned(ARRAYS["line"])
    spectra = heard(grid, (1.0, 1.0))
    spectra[..., 3] = 0
    assert doubts(grid, spectra) == []


def test_a_frame_that_is_taken_twice_is_kept_once() -> None:
    """A plan may be run again: existence is the same, and samples have no order."""
    frames = np.random.default_rng(0).normal(size=(3, 500, 8)).astype(np.float32)
    once, twice = (LoudFrames(plan_of(ARRAYS["line"])) for _ in range(2))
    for loud in (once, twice, twice):
        loud.take(0, frames, np.ones((3, 1)))
    names = tuple("01234567")
    assert twice.checked(names) == once.checked(names)
