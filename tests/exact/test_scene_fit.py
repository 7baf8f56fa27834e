"""What results say of residuals that do not look as the background says."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from faintrack.signal.fit import BEYOND, nothing_seen


def said(values: np.ndarray, independent: float, expected: float = 1e-3) -> tuple[str, ...]:
    fit = nothing_seen().seen(jnp.asarray(values), jnp.full(values.shape, independent))
    return (*fit.misfits(expected), *fit.remarks())


def test_the_limit_is_the_quantile_of_the_tails() -> None:
    assert stats.t(10).sf(BEYOND / 0.8**0.5) == pytest.approx(1e-3, rel=1e-3)


def test_what_fits_is_not_mentioned() -> None:
    noise = np.random.default_rng(0).standard_t(10.0, size=(300, 300)) * 0.8**0.5
    assert said(noise, 0.5) == ()
    assert nothing_seen().misfits(1e-3) == nothing_seen().remarks() == ()
    assert said(np.full((4, 4), np.nan), 0.01) == ()


def test_spikes_and_repetition_are_named_with_a_remedy() -> None:
    noise = np.random.default_rng(1).normal(size=(300, 300))
    noise[::10, ::10] = 8
    (spikes,) = said(noise, 0.5)
    assert spikes.startswith("Without a target 1 % of the cells are above 3.7 deviations")
    assert "raise tracker.declare" in spikes
    (repeated,) = said(np.random.default_rng(2).normal(size=(300, 300)), 0.02)
    assert repeated.startswith("Only 2 % of what a frame says is new")
