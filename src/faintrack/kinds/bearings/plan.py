"""Sets of bearings through a tracker, block by block of scans.

What `faintrack.kinds.session` is for recordings of an array this is for what a detector has made of one. One compiled
step serves every block. The belief starts one interval before the first scan, so that a target may be there from the
beginning with the probability of a birth.
"""

from collections.abc import Iterator
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from faintrack.kinds.session import collect
from faintrack.scenario.build_bearings import build_bearings_tracker, build_sensor
from faintrack.scenario.model import Scenario
from jaxtyping import Array

from faintrack.beliefs.belief import covariance
from faintrack.data.bearings import Bearings
from faintrack.errors import naming
from faintrack.numerics.precision import full_precision
from faintrack.results.result import Result, bearings_dataset
from faintrack.sensors.bearing_sets import ObserverSets
from faintrack.signal.bearing_sets import in_sets
from faintrack.trackers.single import Estimate, Following, SingleTargetTracker

BLOCK_SCANS = 64
"""Scans taken in at once. Files of any length then share one compiled step."""


def track_bearings(bearings: Bearings, scenario: Scenario) -> Result:
    """Tracks of the targets in sets of bearings.

    Parameters
    ----------
    bearings : as reported, see `faintrack.io.bearings.read_bearings` and `faintrack.data.bearings.from_columns`.
    scenario : with a table of the bearings.

    Raises
    ------
    InputError : bearings and scenario do not fit together.

    Examples
    --------
    >>> from faintrack.data.bearings import from_columns
    >>> scenario = Scenario.model_validate({
    ...     "bearings": {"error_deg": 2.0, "detection_probability": 0.9, "false_per_scan": 3.0, "speed": 10.0,
    ...                  "range": [100.0, 2000.0]},
    ...     "filter": {"particles": 500, "births": 200},
    ... })
    >>> time = np.arange(12.0)
    >>> heard = from_columns({
    ...     "time_s": time, "bearing_deg": np.full(12, 30.0), "observer_x_m": 5 * time, "observer_y_m": 0 * time,
    ... })
    >>> result = track_bearings(heard, scenario)
    >>> len(result.tracks), bool(result.data.association[-1].sum() > 0.9)
    (1, True)
    """
    return collect(track_bearing_blocks(bearings, scenario), scenario, None)


def track_bearing_blocks(
    bearings: Bearings, scenario: Scenario, block_scans: int = BLOCK_SCANS
) -> Iterator[xr.Dataset]:
    """Yield what is known of consecutive scans, a block at a time.

    Parameters
    ----------
    bearings, scenario : as `track_bearings`.
    block_scans : scans taken in at once.
    """
    table = scenario.bearings
    assert table is not None, "bearings are tracked with a table of them"
    with naming(bearings.origin):
        scans = in_sets(bearings, build_sensor(table), table.capacity)
    tracker = build_bearings_tracker(scenario)
    length = bearings.length
    since = bearings.times - bearings.times[0]
    interval = float(since[-1] / (length - 1)) if length > 1 else 1.0
    scans = eqx.tree_at(lambda scans: scans.time, scans, jnp.asarray(since + interval, float))
    attributes = {"source": bearings.origin, "first_scan_time": float(bearings.times[0]), "scan_interval": interval}
    key = jax.random.key(scenario.filter.seed)
    following = tracker.init(jax.random.fold_in(key, 2**31 - 1))
    for start in range(0, length, block_scans):
        # The last block is filled up with its last scan: what is believed after that is not read.
        numbers = np.minimum(np.arange(start, start + block_scans), length - 1)
        used = min(block_scans, length - start)
        block = jax.tree.map(lambda leaf, numbers=numbers: leaf[numbers], scans)
        following, told = _take_in(tracker, following, block, key)
        estimates, more = jax.tree.map(lambda values, used=used: np.asarray(values)[:used], told)
        kept = numbers[:used]
        sets = jax.tree.map(lambda leaf, kept=kept: np.asarray(leaf)[kept], scans.sets)
        more = {**more, "heard": np.where(sets.there, (90 - np.degrees(sets.bearing)) % 360, np.nan)}
        more["association"] = np.where(sets.there, more["association"], np.nan)
        yield bearings_dataset(since[kept], estimates, more, bearings.place[kept], bearings.observers, attributes)


@eqx.filter_jit
@full_precision
def _take_in(
    tracker: SingleTargetTracker, following: Following, block: ObserverSets, key: Array
) -> tuple[Following, tuple[Estimate, dict[str, Array]]]:
    """Tracker after a block; the estimates, and what else is told of every scan."""

    def advance(following: Following, scan: ObserverSets) -> Any:
        following, estimate = tracker.step(following, scan, key)
        belief = following.belief
        likelihood: Any = tracker.likelihood
        assert belief.born is not None, "particles know when their target was born"
        weights = jnp.exp(belief.log_weights)
        share = likelihood.association(scan, belief.states) @ weights
        mine = jnp.where(following.active & (belief.born > following.declared), 0, weights)
        across = covariance(belief, mine / mine.sum())[0, 1]
        return following, (estimate, {"association": belief.existence * share, "xy_covariance": across})

    return jax.lax.scan(advance, following, block)
