"""Whitening of frames: what is known of its residuals without it."""

import itertools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.ndimage import convolve

from faintrack.errors import InputError
from faintrack.signal.background import Whitening, drift, ring_mean
from tests.tolerances import STANDARD_ERRORS, assert_equal

SHAPE = (64, 48)
FRAMES, LEARNT = 120, 80
"""Frames of noise, and those after which the memory has settled: nearly three times its length."""

VARIANCE_ERROR = 0.05
"""Between the variance of residuals and 1. The level rests on about 2 N - 1 = 59 frames and a ring, of 1 + 2 / 59 of it
the inverse has the mean; the mean of the background adds 1 / 59 to what is unknown."""


def noise(level: np.ndarray | float, seed: int = 0) -> np.ndarray:
    return (np.random.default_rng(seed).normal(size=(FRAMES, *SHAPE)) * level).astype(np.float32)


def residuals(frames: np.ndarray, whitening: Whitening | None = None) -> np.ndarray:
    return np.asarray((whitening or Whitening()).whiten(jnp.asarray(frames))[0])


def assert_white(settled: np.ndarray) -> None:
    """Mean 0 within five standard errors, of neighbours as independent as the ring leaves them; variance 1."""
    assert abs(settled.mean()) < STANDARD_ERRORS / np.sqrt(settled.size)
    assert abs(settled.var() - 1) < VARIANCE_ERROR


def test_ring_mean_is_that_of_a_plain_convolution(dtype: type) -> None:
    values = np.random.default_rng(1).normal(size=SHAPE).astype(dtype)
    kernel = np.ones((9, 9))
    kernel[2:7, 2:7] = 0
    expected = convolve(values.astype(float), kernel / kernel.sum(), mode="mirror")
    assert_equal(ring_mean(jnp.asarray(values), 4, 2), expected, dtype, 200, 1.0)


@pytest.mark.parametrize("level", [1e-3, 1.0, 1e4])
def test_noise_of_one_level_becomes_white(level: float) -> None:
    assert_white(residuals(noise(level) + 100 * level)[LEARNT:])


def test_a_level_that_changes_over_the_frame_becomes_one() -> None:
    """A factor of 20 from side to side: 4 % from one pixel to the next."""
    slope = np.geomspace(1, 20, SHAPE[1])
    settled = residuals(noise(slope))[LEARNT:]
    assert_white(settled)
    for part in np.array_split(settled, 4, axis=2):
        assert abs(part.var() - 1) < VARIANCE_ERROR


def test_a_scene_at_rest_is_taken_out() -> None:
    """Stones of ten deviations, one for every pixel, stay below a twentieth of the noise's variance."""
    scene = 10 * np.random.default_rng(2).normal(size=SHAPE)
    settled = residuals(noise(1.0) + scene)[LEARNT:]
    assert_white(settled)
    assert np.var(settled.mean(axis=0)) < VARIANCE_ERROR


def test_pixels_with_levels_of_their_own_keep_a_share_of_it() -> None:
    """The module's last equation, to the error of the variance of 40 residuals averaged over half of the frame."""
    level = np.where(np.random.default_rng(3).random(SHAPE) < 0.5, 1.0, 2.0)
    settled, ring, known = residuals(noise(level))[LEARNT:], 2.5, 30.0
    for own in (1.0, 4.0):
        expected = own * (8 + known - 1) / (8 * ring + (known - 1) * own)
        measured = settled[:, level**2 == own].var()
        assert abs(measured / expected - 1) < 2 * VARIANCE_ERROR


def test_a_scene_that_drifts_is_followed() -> None:
    """Two pixels down and one left a frame; what has just come in says nothing."""
    scene = 10 * np.random.default_rng(4).normal(size=(SHAPE[0] + 240, SHAPE[1] + 120))
    frames = np.stack([scene[240 - 2 * t : 240 - 2 * t + SHAPE[0], t : t + SHAPE[1]] for t in range(FRAMES)])
    white, moved = Whitening().whiten(jnp.asarray(frames + noise(1.0), jnp.float32))
    assert moved[2:].tolist() == [[2, -1]] * (FRAMES - 2)
    assert np.isnan(white[30, :2]).all()
    assert np.isnan(white[30, :, -1]).all()
    # Pixels that have been seen for 20 frames and more, whose memory is younger than above and its error larger; and
    # away from the edge, where the ring is mirrored and tells of the scene what it did not tell before.
    assert abs(np.var(white[LEARNT:, 40:-4, 4:28]) - 1) < 2 * VARIANCE_ERROR


def test_a_target_that_moves_over_the_scene_keeps_its_contrast_and_one_at_rest_loses_it() -> None:
    frames = noise(1.0)
    moving, resting = frames.copy(), frames.copy()
    place = np.arange(FRAMES) % 40 + 4
    moving[np.arange(FRAMES), 40, place] += 8
    resting[:, 40, 40] += 8
    kept = residuals(moving)[np.arange(FRAMES), 40, place][20:40].mean()
    assert abs(kept - 8) < 1
    assert residuals(resting)[-10:, 40, 40].mean() < 4
    assert residuals(resting, Whitening(memory=0))[-10:, 40, 40].mean() > 7


def test_noise_has_no_drift() -> None:
    pictures = noise(1.0)[:20]
    for before, after in itertools.pairwise(pictures):
        assert drift(jnp.asarray(before), jnp.asarray(after)).tolist() == [0, 0]


def test_a_frame_at_a_time_is_the_stack() -> None:
    frames, whitening = noise(1.0), Whitening()
    step = eqx.filter_jit(whitening.step)
    memory, alone = whitening.init(SHAPE), []
    for frame in jnp.asarray(frames[:10]):
        memory, white, _ = step(memory, frame)
        alone.append(white)
    np.testing.assert_allclose(np.stack(alone), residuals(frames)[:10], rtol=1e-3, atol=1e-4)


def test_constant_frames_and_silence_are_finite() -> None:
    for value in (0.0, 255.0):
        white = residuals(np.full((FRAMES, *SHAPE), value, np.float32))
        assert np.all(np.isfinite(white[4:]))
        assert np.all(np.abs(white[4:]) < 1)


def test_loudness_is_irrelevant() -> None:
    frames = noise(1.0) + 50
    np.testing.assert_allclose(residuals(frames * 1024), residuals(frames), rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"guard": 4}, "guard is 4 and outer 4 pixels"),
        ({"guard": -1}, "guard is -1"),
        ({"memory": 2.0}, "memory is 2 frames"),
    ],
)
def test_settings_that_make_no_sense(settings: dict, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        Whitening(**settings)


def test_float64_agrees() -> None:
    frames = noise(1.0)
    single = residuals(frames)
    with jax.enable_x64(True):
        double = residuals(frames.astype(np.float64))
    np.testing.assert_allclose(single, double, rtol=1e-3, atol=1e-3)
