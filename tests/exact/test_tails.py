"""Tails of residuals: the law is found, a target is not learnt, and what is read has the law that is granted."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.stats

from faintrack.likelihoods.heavy_tails import student
from faintrack.signal.tails import LAWS, Tails, Weighed, _tables

TAILS = Tails(memory=30.0)
STEP = jax.jit(TAILS.step)


def drawn(freedom: float, stretch: float = 1.0, frames: int = 12, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return stretch * ((freedom - 2) / freedom) ** 0.5 * rng.standard_t(freedom, (frames, 64, 64)).astype(np.float32)


def seen(frames: np.ndarray) -> tuple[Weighed, np.ndarray]:
    weighed = TAILS.init((64, 64))
    for frame in frames:
        weighed, read = STEP(weighed, jnp.asarray(frame))
    return weighed, np.asarray(read)


@pytest.mark.parametrize("law", [(10.0, 1.0), (4.0, 1.0), (2.5, 1.0), (10.0, 1.5), (3.0, 2.0)])
def test_the_law_is_found(law: tuple[float, float]) -> None:
    weighed, _ = seen(drawn(*law))
    assert LAWS[int(TAILS.law(weighed))] == law


@pytest.mark.parametrize("law", [(4.0, 1.0), (3.0, 1.5)])
def test_the_mean_ratio_of_what_is_read_is_one(law: tuple[float, float]) -> None:
    """Of the law that is found, by integration; as it is, spikes make it many."""
    freedom, stretch = law
    scale = stretch * ((freedom - 2) / freedom) ** 0.5
    values = np.linspace(-400, 400, 800_001)
    density = scipy.stats.t.pdf(values / scale, freedom) / scale
    table = _tables()[LAWS.index(law)]
    place = np.log1p(np.abs(values)) * ((len(table) - 1) / np.log1p(1e4))
    read = np.sign(values) * np.interp(place, np.arange(len(table)), table)
    ratio = np.exp(np.asarray(student(10.0, 0.7)(jnp.asarray(read), 4.0), float))
    # No residual is made larger: in the middle, where the heavier law is narrower, a little is lost.
    assert 0.9 < np.trapezoid(ratio * density, values) < 1.01
    as_it_is = np.exp(np.asarray(student(10.0, 0.7)(jnp.asarray(values), 4.0), float))
    assert np.trapezoid(as_it_is * density, values) > 1.5


def test_what_fits_is_left_as_it_is() -> None:
    frames = drawn(10.0)
    _, read = seen(frames)
    np.testing.assert_array_equal(read, frames[-1])


def test_targets_are_not_learnt() -> None:
    """Five targets of thirty deviations that pass forty pixels are in less than half of the tiles."""
    frames = drawn(10.0, frames=40)
    for number, frame in enumerate(frames):
        for row in (6, 18, 30, 42, 54):
            frame[row - 1 : row + 2, number : number + 3] += 30.0
    weighed, read = seen(frames)
    assert int(TAILS.law(weighed)) == 0
    np.testing.assert_array_equal(read, frames[-1])


def test_pixels_that_are_missing_say_nothing() -> None:
    frames = drawn(3.0)
    frames[:, 20:40] = np.nan
    weighed, read = seen(frames)
    assert LAWS[int(TAILS.law(weighed))] == (3.0, 1.0)
    np.testing.assert_array_equal(np.isnan(read), np.isnan(frames[-1]))
