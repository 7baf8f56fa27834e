"""Single precision says what double precision says."""

from typing import Any

import jax
import numpy as np
import pytest

from faintrack.filters.run import run
from tests.scenes import CIRCLE, LIKELIHOODS, LINE, Scene, followed, log_ratio
from tests.tolerances import assert_equal, assert_same_mean

KEYS = 100


def in_both(function: Any) -> list[np.ndarray]:
    """What a function of the type of real values gives in single and in double precision."""
    results = []
    for dtype in (np.float32, np.float64):
        with jax.enable_x64(dtype is np.float64):
            results.append(jax.tree.map(np.asarray, function(dtype)))
    return results


@pytest.mark.parametrize("case", LIKELIHOODS)
@pytest.mark.parametrize("array", [LINE, CIRCLE], ids=["line", "circle"])
@pytest.mark.parametrize("signal", [0.0, 30.0], ids=["noise", "a loud source"])
def test_log_ratio(case: str, array: Any, signal: float) -> None:
    """500 roundings of terms as large as the ratio; a loud source makes it a few hundred."""
    rng = np.random.default_rng(4)
    samples = rng.normal(size=(16, 4)) + signal * rng.normal(size=(16, 1))

    def ratios(dtype: type) -> Any:
        scene = Scene(dtype, array)
        return log_ratio(LIKELIHOODS[case](scene), scene.scan(samples), scene.points())

    single, double = in_both(ratios)
    assert single.dtype == np.float32
    assert double.dtype == np.float64
    assert_equal(single, double, np.float32, 500, scale=np.abs(double).max())


def test_filter_run() -> None:
    """100 keys each, since a key draws other numbers in the other precision; 5 standard errors."""

    def summaries(dtype: type) -> np.ndarray:
        filter, likelihood, scans = followed(dtype)
        rows = []
        for key in jax.random.split(jax.random.key(1), KEYS):
            belief, _, log_evidence = run(filter, likelihood, scans, key)
            weights, states = np.exp(belief.log_weights), belief.states
            components = np.stack([np.cos(states.bearing), states.bearing_rate, states.snr_db])
            rows.append(np.concatenate([components @ weights, belief.log_odds[None], log_evidence]))
        return np.stack(rows)

    single, double = in_both(summaries)
    assert single.dtype == np.float32
    assert double.dtype == np.float64
    assert_same_mean(single, double)
