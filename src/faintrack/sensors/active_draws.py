r"""Returns of an active sonar, drawn without drawing the bins that stay quiet.

Bins exceed the threshold independently. Among those that no target reaches the next exceedance is a geometric number of
bins away, so that a ping costs as many draws as it has returns; the bins around a target are drawn one by one. What
comes out is distributed exactly as if every bin had been drawn, with the mean powers of `faintrack.sensors.active`. Of
several targets the mean powers add: their echoes have no common phase.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from faintrack.sensors.active import ActiveSonar, Ping
from faintrack.sensors.bistatic import Bistatic


def draw_returns(
    key: PRNGKeyArray,
    sonar: ActiveSonar,
    snr: Float[Array, "..."] | float,
    threshold: float,
    ping: Ping,
    state: Any,
    present: Bool[Array, "*target"] | bool,
) -> tuple[Ping, Int[Array, ""]]:
    """Returns of one ping.

    Parameters
    ----------
    key : random key.
    sonar : bins and response.
    snr : mean power of a target's echo over that of the noise, or of each target's; linear.
    threshold : over the mean power of the noise; linear.
    ping : its time, source and receiver, and number of entries are kept.
    state : of a target, scalars; or of several, all of one shape.
    present : whether it is there, or each of them.

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

    bins, rise = _around(sonar, sonar.geometry(ping), state, jnp.asarray(present), jnp.asarray(snr))
    reached = (rise > 0) & ((bins >= 0) & (bins < jnp.array(sonar.shape))).all(axis=1)
    power = (1 + rise) * jax.random.exponential(for_target, rise.shape)
    flat = _flat(bins, sonar.shape)
    reached = reached & _foremost(jnp.where(reached, flat, sonar.size))
    echo = jnp.where(reached & (power > threshold), flat, sonar.size)

    # In the bins that a target reaches its own draws count, not those of the clutter.
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


def _around(
    sonar: ActiveSonar, pair: Bistatic, state: Any, present: Bool[Array, "*target"], snr: Float[Array, "..."]
) -> tuple[Int[Array, "bin 3"], Float[Array, " bin"]]:
    """Bins around the places of targets, one target after the other, and what all of them add to the mean in each."""
    place = jnp.stack([jnp.ravel(value) for value in jnp.broadcast_arrays(*sonar.place(pair, state))], axis=-1)
    there = jnp.broadcast_to(present, place.shape[:1]) & sonar.heard(place[:, 0], place[:, 2])
    offsets = np.stack(
        np.meshgrid(*(np.arange(-reach, reach + 2) for reach in sonar.reach), indexing="ij"), axis=-1
    ).reshape(-1, 3)
    bins = (jnp.floor(place).astype(jnp.int32)[:, None] + offsets).reshape(-1, 3)
    off = bins - place[:, None]
    beam = off[..., 1] - sonar.beams * jnp.round(off[..., 1] / sonar.beams)
    power = jnp.broadcast_to(snr, place.shape[:1])[:, None]
    rise = jnp.where(there[:, None], power * sonar.response(off[..., 0], beam, off[..., 2]), 0).sum(axis=0)
    return bins.at[:, 1].set(bins[:, 1] % sonar.beams), rise


def _foremost(values: Int[Array, " bin"]) -> Bool[Array, " bin"]:
    """Whether each value is the first of its kind."""
    order = jnp.argsort(values, stable=True)
    ascending = values[order]
    first = jnp.append(True, ascending[1:] != ascending[:-1])[: len(values)]
    return jnp.zeros(len(values), bool).at[order].set(first)


def _clutter(key: PRNGKeyArray, size: int, threshold: float, capacity: int) -> Int[Array, " return"]:
    """Bins that exceed the threshold without a target, ascending; `size` where there is none."""
    quiet = -np.log1p(-np.exp(-threshold))
    gaps = jnp.floor(jax.random.exponential(key, (capacity,)) / quiet)
    # Beyond the last bin nothing is counted; so many capacities still fit into a whole number.
    gaps = jnp.minimum(gaps, min(size, (2**31 - 1) // capacity - 1)).astype(jnp.int32)
    return jnp.minimum(jnp.cumsum(gaps + 1) - 1, size)


def _flat(bins: Int[Array, "bin 3"], shape: tuple[int, int, int]) -> Int[Array, " bin"]:
    return (bins[:, 0] * shape[1] + bins[:, 1]) * shape[2] + bins[:, 2]
