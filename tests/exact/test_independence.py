"""Correlated residuals against dense covariances and the scenes that they come from."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.signal.independence import LASTING, Independence
from tests.tolerances import STANDARD_ERRORS

SHAPE = (40, 40)
FRAMES = 120


def learnt(noise: np.ndarray, moved: np.ndarray | None = None, spread: float = 0.0) -> np.ndarray:
    """Share after all frames, away from the edges."""
    learns = Independence(spread, memory=60.0, around=8)
    moved = np.zeros((len(noise), 2), int) if moved is None else moved
    steps = jax.jit(lambda *scan: jax.lax.scan(lambda held, each: learns.step(held, *each), learns.init(SHAPE), scan))
    return np.asarray(steps(jnp.asarray(noise, jnp.float32), jnp.asarray(moved))[1][-1])[4:-4, 4:-4]


def drawn(correlation: float, seed: int) -> np.ndarray:
    """Noise of variance 1 whose correlation at a lag of l frames is correlation**l, from its dense covariance."""
    lag = np.abs(np.subtract.outer(np.arange(FRAMES), np.arange(FRAMES)))
    root = np.linalg.cholesky(correlation**lag + 1e-9 * np.eye(FRAMES))
    return np.einsum("tu,uyx->tyx", root, np.random.default_rng(seed).normal(size=(FRAMES, *SHAPE)))


def faded(correlation: float) -> float:
    """Sum of the covariance of a frame with the frames before, faded, by plain addition."""
    own = sum(LASTING ** (lag - 1) * correlation**lag for lag in range(1, 200))
    # What is taken for known at the start has been forgotten to e^-2 of 5 frames in some 52.
    past, prior = 60 * (1 - np.exp(-2)), 5 * np.exp(-2)
    return 1 + 2 * (past * own + prior * 1.0) / (past + prior)


@pytest.mark.parametrize("correlation", [0.3, 0.6])
def test_correlation_in_time_is_that_of_the_dense_covariance(correlation: float) -> None:
    """1600 pixels in some 60 frames, a fifth of them independent: an error of 2 %, and the cut at three deviations."""
    share = learnt(drawn(correlation, 0)).mean()
    assert share == pytest.approx(1 / faded(correlation), rel=STANDARD_ERRORS * 0.02)


def test_what_moves_with_the_scene_is_followed() -> None:
    """Noise that stays with a scene which moves by three pixels a frame repeats itself as much as one at rest."""
    still = drawn(0.6, 1)
    moving = np.stack([np.roll(frame, 3 * number, axis=1) for number, frame in enumerate(still)])
    share = learnt(moving, np.tile([0, 3], (FRAMES, 1))).mean()
    assert share == pytest.approx(1 / faded(0.6), rel=STANDARD_ERRORS * 0.03)
    assert learnt(moving).mean() > 0.8


def test_neighbours_that_agree_count_once() -> None:
    """Variance of the weighed sum from the dense covariance of a patch of nine pixels."""
    rng, spread = np.random.default_rng(2), 0.5
    white = rng.normal(size=(FRAMES, SHAPE[0] + 1, SHAPE[1] + 1))
    noise = (white[:, 1:, 1:] + white[:, :-1, 1:] + white[:, 1:, :-1] + white[:, :-1, :-1]) / 2
    y, x = (axis.ravel() for axis in np.mgrid[:3, :3])
    apart = [np.abs(np.subtract.outer(axis, axis)) for axis in (y, x)]
    covariance = np.prod([np.clip(1 - each / 2, 0, 1) * (each < 2) for each in apart], axis=0)
    weights = np.outer([spread, 1, spread], [spread, 1, spread]).ravel()
    expected = weights @ weights / (weights @ covariance @ weights)
    assert learnt(noise, spread=spread).mean() == pytest.approx(expected, rel=STANDARD_ERRORS * 0.02)


def test_white_noise_counts_in_full_and_what_is_missing_says_nothing() -> None:
    noise = np.random.default_rng(3).normal(size=(FRAMES, *SHAPE))
    assert learnt(noise).mean() == pytest.approx(1 / faded(0.0), rel=STANDARD_ERRORS * 0.02)
    noise[:, 10, 10] = np.nan
    assert np.isfinite(learnt(noise)).all()
    assert learnt(np.full((5, *SHAPE), np.nan)) == pytest.approx(1 / 3)


def test_what_counts_less_never_errs_towards_a_target() -> None:
    """The mean over noise of a ratio to the power of the share is at most 1."""
    from faintrack.likelihoods.heavy_tails import student

    noise = np.random.default_rng(4).standard_t(10.0, size=200_000) * 0.8**0.5
    ratio = np.asarray(student(10.0, slack=0.7)(jnp.asarray(noise), 5.0), float)
    means = [np.exp(share * ratio).mean() for share in (0.1, 0.3, 1.0)]
    assert max(means[:2]) < 1
    error = np.exp(ratio).std() / noise.size**0.5
    assert abs(means[2] - 1) < STANDARD_ERRORS * error
