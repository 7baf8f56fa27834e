"""Returns of an active sonar through a tracker on a grid, block by block of pings.

What `faintrack.kinds.session` is for recordings of an array this is for returns. One compiled step serves every block,
and the memory that it takes does not grow with the number of pings: after eight of them what is believed of position
and velocity is kept, of the others a few numbers.

The belief starts one interval before the first ping, so that a target may be there from the beginning with the
probability of a birth.
"""

from collections.abc import Iterator
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from faintrack.kinds.session import collect
from faintrack.kinds.session_frames import slots_of, snapshots_of
from faintrack.scenario.build_returns import build_binned, build_grid, build_returns_tracker, ping_interval
from faintrack.scenario.model import Scenario
from jaxtyping import Array

from faintrack.beliefs.belief import mode
from faintrack.beliefs.grids import Grid, marginal
from faintrack.data.returns import Returns
from faintrack.errors import naming
from faintrack.results.result import Result, marginals_dataset, pings_dataset
from faintrack.sensors.active import Ping
from faintrack.sensors.bistatic import Bistatic
from faintrack.targets.states import PlanarState
from faintrack.trackers.single import Estimate, Following, SingleTargetTracker

BLOCK_PINGS = 16
"""Pings taken in at once. Files of any length then share one compiled step."""


def track_returns(returns: Returns, scenario: Scenario) -> Result:
    """Tracks of the targets in the returns of a sonar.

    Parameters
    ----------
    returns : as measured, see `faintrack.io.returns.read_returns` and `faintrack.data.returns.from_columns`.
    scenario : with tables of the sonar and the grid.

    Raises
    ------
    InputError : returns and scenario do not fit together.

    Examples
    --------
    >>> from faintrack.data.returns import from_columns
    >>> scenario = Scenario.model_validate({
    ...     "sonar": {
    ...         "pulse": {"frequency": 2000.0, "duration": 1.0, "bandwidth": 4.0}, "delay": [2.0, 16.0],
    ...         "delay_step": 0.2, "beams": 12, "beam_width_deg": 30.0, "source": [0, 0], "receiver": [0, 0],
    ...         "threshold_db": 9.0, "snr_db": 12.0,
    ...     },
    ...     "grid": {"x": [-12e3, 12e3], "y": [-12e3, 12e3], "cells": [8, 8], "speed": 9.0, "speeds": 3},
    ... })
    >>> columns = {
    ...     "time_s": np.arange(10.0) * 60, "delay_s": np.full(10, 10.0), "bearing_deg": np.zeros(10),
    ...     "snr_db": np.full(10, 12.0),
    ... }
    >>> result = track_returns(from_columns(columns), scenario)
    >>> (track,) = result.tracks
    >>> track.label, result.data.position.dims
    (1, ('snapshot', 'x', 'y'))
    """
    return collect(track_ping_blocks(returns, scenario), scenario, None)


def track_ping_blocks(returns: Returns, scenario: Scenario, block_pings: int = BLOCK_PINGS) -> Iterator[xr.Dataset]:
    """Yield what is known of consecutive pings, a block at a time, and in the end the snapshots.

    Parameters
    ----------
    returns, scenario : as `track_returns`.
    block_pings : pings taken in at once.
    """
    with naming(returns.origin):
        binned = build_binned(scenario, returns)
        grid = build_grid(scenario)
        tracker = build_returns_tracker(scenario, binned, grid)
        interval = ping_interval(returns)
    length = returns.length
    snapshots = snapshots_of(length)
    since_start = returns.times - returns.times[0]
    attributes = {
        "source": returns.origin,
        "first_ping_time": float(returns.times[0]),
        "ping_interval": interval,
        "capacity": binned.capacity,
    }
    key = jax.random.key(scenario.filter.seed)
    shapes = [[dict(grid.axes)[name].count for name in names] for names in (("x", "y"), ("vx", "vy"))]
    carried = (
        tracker.init(jax.random.fold_in(key, 2**31 - 1)),
        tuple(jnp.full((len(snapshots), *shape), -jnp.inf, jnp.float32) for shape in shapes),
    )
    for start in range(0, length, block_pings):
        # The last block is filled up with its last ping: what is believed after that is not read.
        numbers = np.minimum(np.arange(start, start + block_pings), length - 1)
        used = min(block_pings, length - start)
        slots = np.where(np.arange(block_pings) < used, slots_of(numbers, snapshots), len(snapshots))
        pings = binned.pings(numbers)
        pings = eqx.tree_at(lambda pings: pings.time, pings, jnp.asarray(since_start[numbers] + interval, float))
        carried, (estimates, modes) = _take_in(tracker, grid, carried, (pings, jnp.asarray(slots)), key)
        estimates, modes = jax.tree.map(lambda values, used=used: np.asarray(values)[:used], (estimates, modes))
        told = {"returns": returns.counts[numbers], **_places(binned.sonar.geometry(pings), block_pings)}
        told = {name: values[:used] for name, values in told.items()}
        yield pings_dataset(since_start[numbers[:used]], estimates, modes, told, attributes)
    position, velocity = map(np.asarray, carried[1])
    yield marginals_dataset(since_start[snapshots], position, velocity, grid, attributes)


def _places(pair: Bistatic, count: int) -> dict[str, np.ndarray]:
    """Where source and receiver were in some pings; m."""
    return {
        f"{platform}_{name}": np.broadcast_to(getattr(getattr(pair, platform), name), count)
        for platform in ("source", "receiver")
        for name in ("x", "y")
    }


@eqx.filter_jit
def _take_in(
    tracker: SingleTargetTracker,
    grid: Grid,
    carried: tuple[Following, tuple[Array, ...]],
    block: tuple[Ping, Array],
    key: Array,
) -> tuple[tuple[Following, tuple[Array, ...]], tuple[Estimate, PlanarState]]:
    """Tracker and snapshots after a block; the estimates, and the cells of highest probability."""

    def advance(carried: Any, item: tuple[Ping, Array]) -> Any:
        following, held = carried
        ping, slot = item
        following, estimate = tracker.step(following, ping, key)
        belief = following.belief

        def keep(held: tuple[Array, ...]) -> tuple[Array, ...]:
            names = ("x", "y"), ("vx", "vy")
            return tuple(
                values.at[slot].set(marginal(belief, grid, *of)) for values, of in zip(held, names, strict=True)
            )

        held = jax.lax.cond(slot < len(held[0]), keep, lambda held: held, held)
        return (following, held), (estimate, mode(belief))

    return jax.lax.scan(advance, carried, block)
