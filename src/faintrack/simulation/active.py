"""Returns of an active sonar: a ping at a time, and the room that it needs; see `faintrack.sensors.active_draws`."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from faintrack.likelihoods.exceedances import ExceedanceLikelihood
from faintrack.sensors.active import Ping
from faintrack.sensors.active_draws import draw_returns
from faintrack.sensors.bistatic import Bistatic


@eqx.filter_jit
def draw_ping(
    key: PRNGKeyArray,
    likelihood: ExceedanceLikelihood,
    capacity: int,
    time: Float[Array, ""],
    state: Any,
    present: Bool[Array, "*target"] | bool,
    pair: Bistatic | None = None,
) -> tuple[Ping, Int[Array, ""]]:
    """Returns of one ping.

    Parameters
    ----------
    key : random key.
    likelihood : sonar, SNR and threshold.
    capacity : entries of the ping; see `capacity_for`.
    time : of transmission; seconds.
    state : of a target, scalars; or of several, all of one shape.
    present : whether it is there, or each of them.
    pair : source and receiver, where they move.

    Returns
    -------
    The ping, and how many returns, at least, it had no entry for: those with the longest delays. Above 0 the draw is
    not what was asked for, and the capacity too small.
    """
    empty = Ping(time, jnp.zeros((capacity, 3), jnp.int32), jnp.zeros(capacity), jnp.zeros(capacity, bool), pair)
    snr = likelihood.drawn_snr(jax.random.fold_in(key, 0), jnp.shape(present))
    return draw_returns(key, likelihood.sonar, snr, likelihood.threshold, empty, state, present)


def capacity_for(likelihood: ExceedanceLikelihood, targets: int = 1) -> int:
    """Entries that a simulated ping fills up in fewer than one of a million: clutter, and the echoes of targets."""
    clutter = likelihood.sonar.size * np.exp(-likelihood.threshold)
    sonar = likelihood.sonar
    around = [np.arange(-reach, reach + 1.0) for reach in sonar.reach]
    response = sonar.tabled(*np.meshgrid(*around, indexing="ij"))
    echo = np.exp(-likelihood.threshold / (1 + float(likelihood.snr) * response)).sum()
    expected = clutter + targets * echo
    return int(16 * np.ceil((expected + 5 * np.sqrt(expected) + 8) / 16))
