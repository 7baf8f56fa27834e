"""Broken pixels under a moving scene, and steps of the data."""

import jax.numpy as jnp
import numpy as np

from faintrack.signal.background import Whitening

SHAPE = (48, 48)
BROKEN = (20, 30)


def seen(speed: int, value: float, frames: int = 40, seed: int = 0) -> np.ndarray:
    """Frames of a scene that moves along x under a detector with one broken pixel."""
    rng = np.random.default_rng(seed)
    wide = rng.normal(size=(SHAPE[0], SHAPE[1] + frames * abs(speed)))
    scene = np.stack([wide[:, speed * number : speed * number + SHAPE[1]] for number in range(frames)])
    frames_seen = 5 * scene + rng.normal(size=scene.shape)
    frames_seen[(slice(None), *BROKEN)] = value
    return frames_seen.astype(np.float32)


def residuals(frames: np.ndarray) -> np.ndarray:
    return np.asarray(Whitening().whiten(jnp.asarray(frames))[0])


def test_a_pixel_that_is_alone_while_the_scene_moves_is_left_out() -> None:
    for value in (60.0, -60.0):
        left = residuals(seen(1, value))
        assert np.isnan(left[20:, *BROKEN]).all()
        # Its neighbours are not disturbed by what it would have left in the memory of the scene.
        beside = left[25:, BROKEN[0] - 1 : BROKEN[0] + 2, BROKEN[1] - 3 : BROKEN[1] + 4]
        assert np.nanmax(np.abs(beside)) < 6


def test_a_pixel_in_doubt_is_not_read() -> None:
    """The scene stands still in every other frame: four moves take eight frames, and the pixel is read in none."""
    for value in (60.0, -60.0):
        frames = np.repeat(seen(1, value, frames=8), 2, axis=0)
        left = residuals(frames)[4:, *BROKEN]
        assert np.nanmax(np.abs(left), initial=0) < 4


def test_a_scene_at_rest_has_no_bad_pixels_and_a_sound_detector_few() -> None:
    assert np.isfinite(residuals(seen(0, 60.0))[5:]).all()
    sound = seen(1, 0.0)
    sound[(slice(None), *BROKEN)] = sound[:, 20, 31]
    assert np.isnan(residuals(sound)[20:, 4:-4, 4:-4]).mean() < 1e-3


def test_a_point_between_pixels_is_no_broken_one() -> None:
    """A target of the width 0.55 that a camera holds in the middle of a pixel lights the pixels beside it."""
    frames = seen(1, 0.0)
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    frames += 60 * np.exp(-((y - BROKEN[0]) ** 2 + (x - BROKEN[1]) ** 2) / (2 * 0.55**2)).astype(np.float32)
    frames[(slice(None), *BROKEN)] = 60
    assert np.isfinite(residuals(frames)[5:, *BROKEN]).all()


def test_deviations_are_no_finer_than_the_steps_of_the_data() -> None:
    """A sky that is one value but for a step of 1 here and there: nobody knows it better than the root of 1/12."""
    frames = np.full((20, *SHAPE), 100.0, np.float32)
    frames[:, 5, 5] = 101
    frames[15:, 24, 24] = 101
    assert 2 < residuals(frames)[15, 24, 24] <= 12**0.5 + 1e-3
