r"""Returns of an active sonar, drawn without drawing the bins that stay quiet.

Bins exceed the threshold independently. Among those that no target reaches the next exceedance is a geometric number of
bins away, so that a ping costs as many draws as it has returns; the bins around a target are drawn one by one. What
comes out is distributed exactly as if every bin had been drawn, with the mean powers of `faintrack.sensors.active`.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from faintrack.sensors.active import ActiveSonar, Ping


def draw_returns(
    key: PRNGKeyArray,
    sonar: ActiveSonar,
    snr: Float[Array, ""] | float,
    threshold: float,
    ping: Ping,
    state: Any,
    present: Bool[Array, ""] | bool,
) -> tuple[Ping, Int[Array, ""]]:
    """Returns of one ping.

    Parameters
    ----------
    key : random key.
    sonar : bins and response.
    snr : mean power of a target's echo over that of the noise; linear.
    threshold : over the mean power of the noise; linear.
    ping : its time, source and receiver, and number of entries are kept.
    state : of a target; scalars.
    present : whether it is there.

    Returns
    -------
    The ping, and how many returns, at least, it had no entry for: those with the longest delays. Above 0 the draw is
    not what was asked for, and the capacity too small.
    """
    capacity = len(ping.there)
    for_gaps, for_power, for_target = jax.random.split(key, 3)
    # One more than there are entries: where it still lies in a bin of the sonar, returns are missing.
    clutter = _clutter(for_gaps, sonar.size, threshold, capacity + 1)
    missing = clutter[-1] < sonar.size
    quiet_power = threshold + jax.random.exponential(for_power, (capacity + 1,))

    delay, beam, shift = sonar.place(sonar.geometry(ping), state)
    near, off = [], []
    for value, reach in zip((delay, beam, shift), sonar.reach, strict=True):
        number = jnp.floor(value).astype(jnp.int32) + np.arange(-reach, reach + 2)
        near.append(number)
        off.append(number - value)
    bins = jnp.stack(jnp.meshgrid(*near, indexing="ij"), axis=-1).reshape(-1, 3)
    response = sonar.response(off[0][:, None, None], off[1][None, :, None], off[2][None, None, :]).ravel()
    bins = bins.at[:, 1].set(bins[:, 1] % sonar.beams)
    reached = (response > 0) & ((bins >= 0) & (bins < jnp.array(sonar.shape))).all(axis=1)
    reached = reached & present & sonar.heard(delay, shift)
    power = (1 + snr * response) * jax.random.exponential(for_target, response.shape)
    flat = _flat(bins, sonar.shape)
    echo = jnp.where(reached & (power > threshold), flat, sonar.size)

    # In the bins that the target reaches its own draws count, not those of the clutter.
    taken = jnp.where(reached, flat, sonar.size)
    clutter = jnp.where((clutter[:, None] == taken).any(axis=1), sonar.size, clutter)
    every, power = jnp.concatenate([clutter, echo]), jnp.concatenate([quiet_power, power])
    order = jnp.argsort(every)
    there = every[order] < sonar.size
    chosen = order[:capacity]
    kept = every[chosen] < sonar.size
    at = jnp.stack(jnp.unravel_index(jnp.where(kept, every[chosen], 0), sonar.shape), axis=-1).astype(jnp.int32)
    lost = jnp.maximum(there[capacity:].sum(), missing)
    return Ping(ping.time, at, jnp.where(kept, power[chosen], 0), kept, ping.pair), lost


def _clutter(key: PRNGKeyArray, size: int, threshold: float, capacity: int) -> Int[Array, " return"]:
    """Bins that exceed the threshold without a target, ascending; `size` where there is none."""
    quiet = -np.log1p(-np.exp(-threshold))
    gaps = jnp.floor(jax.random.exponential(key, (capacity,)) / quiet)
    # Beyond the last bin nothing is counted; so many capacities still fit into a whole number.
    gaps = jnp.minimum(gaps, min(size, (2**31 - 1) // capacity - 1)).astype(jnp.int32)
    return jnp.minimum(jnp.cumsum(gaps + 1) - 1, size)


def _flat(bins: Int[Array, "bin 3"], shape: tuple[int, int, int]) -> Int[Array, " bin"]:
    return (bins[:, 0] * shape[1] + bins[:, 1]) * shape[2] + bins[:, 2]
