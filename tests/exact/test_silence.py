"""A target that may fall silent, against the matrix exponential of its chain."""

import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg
from scipy.special import expit, logit

from faintrack.targets.silence import Silence
from tests.tolerances import rounding

ROUNDING = rounding(np.float32, 10)

NEVER_LOST = -np.inf


@pytest.mark.parametrize("interval", [1.0, 40.0])
@pytest.mark.parametrize(
    ("falls", "returns", "ends", "leaves"),
    [
        (0.02, 0.2, 0.05, 0.005),
        (1e-7, 1e-6, 1e-6, 1e-7),
        (0.0, 0.0, 0.0, 0.0),
        (0.3, 0.3, 0.0, 0.0),
        (0.0, 0.2, 0.1, 0.35),
    ],
)
def test_forecast(falls: float, returns: float, ends: float, leaves: float, interval: float) -> None:
    rates = np.array([[-(falls + leaves), returns, 0], [falls, -(returns + ends), 0], [leaves, ends, 0]])
    heard, silent, gone = scipy.linalg.expm(rates * interval) @ [0.9 * 0.7, 0.9 * 0.3, 0.1]
    odds, of_heard = Silence(falls, returns, ends).forecast(
        jnp.asarray(logit(0.9)), jnp.asarray(logit(0.7)), leaves, interval, jnp.asarray(NEVER_LOST)
    )
    assert float(odds) == pytest.approx(np.log((heard + silent) / gone), abs=ROUNDING)
    assert float(of_heard) == pytest.approx(np.log(heard / silent), abs=ROUNDING)


def test_two_modes_that_are_one() -> None:
    """A silent one changes as often as a heard one leaves: the modes are moved apart by a thousandth."""
    rates = np.array([[-0.3, 0.2, 0], [0.0, -0.3, 0], [0.3, 0.1, 0]])
    heard, silent, gone = scipy.linalg.expm(rates * 2.0) @ [0.9 * 0.7, 0.9 * 0.3, 0.1]
    odds, of_heard = Silence(0.0, 0.2, 0.1).forecast(
        jnp.asarray(logit(0.9)), jnp.asarray(logit(0.7)), 0.3, 2.0, jnp.asarray(NEVER_LOST)
    )
    assert float(odds) == pytest.approx(np.log((heard + silent) / gone), abs=1e-3)
    assert float(of_heard) == pytest.approx(np.log(heard / silent), abs=1e-3)


def test_what_moves_away_is_gone() -> None:
    odds, heard = Silence(0.0, 0.0, 0.0).forecast(
        jnp.asarray(logit(0.8)), jnp.asarray(jnp.inf), 0.0, 1.0, jnp.asarray(np.log(0.25))
    )
    assert float(expit(odds)) == pytest.approx(0.6, abs=ROUNDING)
    assert float(expit(heard)) == 1
