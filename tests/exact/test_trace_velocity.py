"""The speed at which waves cross an array is told where it is not what is expected, and only there."""

import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.kinds.recording.trace import with_trace_velocity
from faintrack.sensors.array import SensorArray, line_array, sensor_array
from faintrack.sensors.beams import BeamGrid
from faintrack.signal.beamformer import beamformer
from faintrack.signal.channels import doubts
from faintrack.signal.trace_velocity import crossing
from faintrack.targets.states import WaveState
from faintrack.trackers.single import Estimate

PLACES = np.array([[0.0, 60.0], [55.0, -30.0], [-40.0, -35.0], [10.0, 5.0], [-30.0, 40.0]])
FLAT = sensor_array(PLACES, 340.0)
FRAMES = 4


def planned(array: SensorArray = FLAT, **options: tuple[float, float]) -> BeamGrid:
    return beamformer(array, 50.0, 10.0, (1.0, 8.0), **options).grid


def heard(grid: BeamGrid, *sources: tuple[float, float, float], seed: int = 0) -> np.ndarray:
    """Spectra of frames with plane waves of (bearing, slowness, amplitude over the noise)."""
    assert grid.array is not None
    rng = np.random.default_rng(seed)
    shape = FRAMES, grid.snapshots, grid.frequency.size, len(grid.array.gains)

    def drawn(*size: int) -> np.ndarray:
        return (rng.normal(size=size) + 1j * rng.normal(size=size)) / np.sqrt(2)

    spectra = drawn(*shape)
    for bearing, slowness, amplitude in sources:
        towards = np.array([np.sin(bearing), np.cos(bearing), 0.0])
        advance = slowness * grid.array.positions @ towards / grid.array.sound_speed
        wave = amplitude * drawn(*shape[:-1], 1)
        spectra += wave * np.exp(2j * np.pi * grid.frequency[:, None] * advance)
    return spectra


@pytest.mark.parametrize("slowness", [0.25, 0.5, 0.87, 1.15])
@pytest.mark.parametrize("amplitude", [1.0, 10.0])
def test_the_speed_of_a_wave_is_told(slowness: float, amplitude: float) -> None:
    grid = planned()
    found = crossing(grid, heard(grid, (1.0, slowness, amplitude)))
    assert found is not None
    assert found.unexpected
    assert abs(found.slowness - slowness) < 0.03
    if slowness > 0.4:
        assert abs(found.bearing - 1.0) < 0.1


@pytest.mark.parametrize(
    "sources", [(), ((1.0, 0.3),), ((1.0, 3.0), (-2.0, 3.0)), ((0.5, 1.0), (0.9, 1.0)), ((2.0, 30.0),)]
)
def test_level_waves_are_left_alone(sources: tuple[tuple[float, float], ...]) -> None:
    grid = planned()
    waves = [(bearing, 1.0, amplitude) for bearing, amplitude in sources]
    for seed in range(5):
        found = crossing(grid, heard(grid, *waves, seed=seed))
        assert found is not None
        assert not found.unexpected


def test_what_is_alike_in_all_channels_is_hum_and_no_wave() -> None:
    grid = planned()
    for amplitude in (1.0, 10.0):
        found = crossing(grid, heard(grid, (1.0, 0.0, amplitude)))
        assert found is not None
        assert not found.unexpected


def test_what_rings_of_beams_look_for_is_expected() -> None:
    wave = (1.0, 0.5, 3.0)
    for elevation, unexpected in (((0.0, 1.4), False), ((0.0, 0.5), True)):
        grid = planned(elevation=elevation)
        found = crossing(grid, heard(grid, wave))
        assert found is not None
        assert found.unexpected == unexpected


def test_a_line_tells_no_speed() -> None:
    grid = planned(line_array(5, 20.0, 340.0))
    assert crossing(grid, heard(grid, (1.0, 0.5, 3.0))) is None


def test_channels_are_judged_by_waves_of_their_speed() -> None:
    grid = planned()
    spectra = heard(grid, (1.0, 0.5, 3.0))
    assert doubts(grid, spectra, 0.5) == []
    spectra[..., 3] *= -1
    assert [doubt.channels for doubt in doubts(grid, spectra, 0.5)] == [(3,)]


def test_trace_velocities_of_a_belief() -> None:
    """Against a million draws of the elevation; the expansion ends at the second order."""
    mean, deviation = np.radians([20.0, 60.0]), np.radians([3.0, 1.0])
    covariance = np.zeros((2, 4, 4))
    covariance[:, 3, 3], covariance[:, 0, 0] = deviation**2, 0.01
    covariance[:, 0, 3] = covariance[:, 3, 0] = 0.05 * deviation
    none = jnp.zeros(2)
    state = WaveState(none, none, none, jnp.asarray(mean))
    found = with_trace_velocity(
        Estimate(none, none, jnp.zeros(2, int), none, state, jnp.asarray(covariance), none), 340.0
    )
    draws = np.random.default_rng(0).normal(size=(2, 500_000, 2))
    draws = np.concatenate([draws, -draws], axis=1)
    elevation = mean[:, None] + deviation[:, None] * draws[..., 0]
    bearing = 0.05 * draws[..., 0] + np.sqrt(0.01 - 0.05**2) * draws[..., 1]
    speed = 340.0 / np.cos(elevation)
    np.testing.assert_allclose(found.mean.trace_velocity, speed.mean(axis=1), rtol=1e-3)
    np.testing.assert_allclose(found.covariance[:, 4, 4], speed.var(axis=1), rtol=0.03)
    np.testing.assert_allclose(found.covariance[:, 4, 0], (speed * bearing).mean(axis=1), rtol=0.03)
    np.testing.assert_array_equal(found.covariance, np.swapaxes(found.covariance, 1, 2))
