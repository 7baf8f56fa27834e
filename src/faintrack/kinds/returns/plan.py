"""How the returns of a sonar become a result: bins, tracker on a grid, and what is kept for maps.

Memory does not grow with the number of pings: after eight of them what is believed of position and velocity is kept, of
the others a few numbers. The belief starts one interval before the first ping, so that a target may be there from the
beginning with the probability of a birth.
"""

from dataclasses import fields
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Array, Float, Int, PRNGKeyArray

from faintrack.beliefs.belief import mode
from faintrack.beliefs.grids import Grid, marginal
from faintrack.data.returns import Returns
from faintrack.errors import naming
from faintrack.kinds.kind import Plan
from faintrack.kinds.loop import begun
from faintrack.kinds.returns.build import (
    build_background,
    build_binned,
    build_grid,
    build_tracker,
    chosen,
    ping_spacing,
)
from faintrack.kinds.returns.fit import Fit, FitOfPairs, about_pairs, fit_of_scan
from faintrack.kinds.returns.hydrophones import with_reception
from faintrack.kinds.returns.pairs import reported_by
from faintrack.kinds.returns.sections import ReturnsScenario
from faintrack.kinds.several import Tracker, with_targets
from faintrack.kinds.snapshots import slots_of, snapshots_of
from faintrack.results.schema import estimated, of_scans, planar
from faintrack.sensors.active import Ping
from faintrack.sensors.bistatic import Bistatic
from faintrack.sensors.multistatic import Pings
from faintrack.signal.multistatic_background import MultistaticBackground
from faintrack.signal.returns_background import ReturnsBackground
from faintrack.targets.states import PlanarState

BLOCK_PINGS = 16
"""Pings taken in at once. Files of any length then share one compiled step."""

NEAR_CELLS = 3.0
"""Cells from a known target within which a track is one of it."""

MAPS = {"position": ("x", "y"), "velocity": ("vx", "vy")}
"""What is kept of the belief after some pings, and its axes."""

State = tuple[Any, Any, tuple[Array, ...]]
Heard = Ping | Pings
"""Pings of one pair of a source and a receiver, or of several."""


class ReturnsStep(eqx.Module):
    """Pings through background and tracker.

    Attributes
    ----------
    tracker : what takes in a ping.
    background : that is learnt; None where it is the model's.
    threshold : that returns of each pair exceed, over the mean power of the model's noise.
    grid : that carries its belief.
    """

    tracker: Tracker
    background: ReturnsBackground | MultistaticBackground | None
    threshold: tuple[float, ...]
    grid: Grid = eqx.field(static=True)

    def scans(self, block: tuple[Heard, Int[Array, " ping"]]) -> tuple[Heard, Int[Array, " ping"]]:
        """Some pings, and their places among the snapshots."""
        return block

    def advance(
        self, state: State, scan: tuple[Heard, Int[Array, ""]], key: PRNGKeyArray
    ) -> tuple[State, tuple[Any, PlanarState, Fit]]:
        """Memory, tracker and snapshots after a ping; the estimate, the cell of highest probability, the background."""
        memory, following, maps = state
        ping, slot = scan
        if self.background is None:
            following, estimate = self.tracker.step(following, ping, key)
            fit = fit_of_scan(ping, self.threshold)
        else:
            background: Any = self.background
            read = background.read(memory, ping)
            tracker: Any = self.tracker
            following, estimate = tracker.step(following, read.ping, key)
            hand = following.hand
            parts = tracker.parts(read.ping, hand)
            of_targets = tracker.likelihood.of_targets(read.ping, parts, hand.observable_existence)
            memory = background.learn(memory, ping, read, of_targets)
            fit = fit_of_scan(read.ping, self.threshold, read.expected, read.shape)
        belief = following.belief

        def keep(maps: tuple[Array, ...]) -> tuple[Array, ...]:
            return tuple(
                held.at[slot].set(marginal(belief, self.grid, *names))
                for held, names in zip(maps, MAPS.values(), strict=True)
            )

        maps = jax.lax.cond(slot < len(maps[0]), keep, lambda maps: maps, maps)
        return (memory, following, maps), (estimate, mode(belief), fit)


def plan(returns: Returns, scenario: ReturnsScenario) -> Plan:
    """How the returns of a sonar become a result.

    Raises
    ------
    InputError : returns and scenario do not fit together.
    """
    scenario = with_reception(scenario)
    with naming(returns.origin):
        parts, grid, spacing = build_binned(scenario, returns), build_grid(scenario), ping_spacing(returns)
        tracker = build_tracker(scenario, parts, grid, spacing)
        background = build_background(scenario, tracker, parts)
    one = len(parts) == 1
    reported = reported_by(scenario, returns, parts)
    fit = FitOfPairs(parts, background is not None)
    since, snapshots = returns.times - returns.times[0], snapshots_of(returns.length)
    counts = {name: axis.count for name, axis in grid.axes}
    maps = tuple(
        jnp.full((len(snapshots), *(counts[name] for name in names)), -jnp.inf, jnp.float32) for names in MAPS.values()
    )
    attributes = {
        "kind": "returns",
        "source": returns.origin,
        "start_time": "",
        "first_scan_time": float(returns.times[0]),
        "scan_interval": spacing.interval,
        "capacity": max(part.binned.capacity for part in parts),
    }

    def read(start: int, stop: int) -> tuple[Heard, Int[np.ndarray, " ping"]]:
        numbers = np.arange(start, min(stop, returns.length))
        # From one interval before the first ping on, so that a target may be there from the beginning.
        times = since[numbers] + spacing.interval
        pings = tuple(eqx.tree_at(lambda pings: pings.time, part.binned.pings(numbers), times) for part in parts)
        scans = pings[0] if one else Pings(times, pings, jnp.asarray(reported[numbers]))
        return scans, slots_of(numbers, snapshots)

    def rows(start: int, block: tuple[Heard, Int[np.ndarray, " ping"]], outputs: tuple[Any, ...]) -> xr.Dataset:
        scans, count = block[0], len(block[1])
        numbers = np.arange(start, start + count)
        pings = scans.pings if isinstance(scans, Pings) else (scans,)
        places = [_places(part.binned.sonar.geometry(ping), count) for part, ping in zip(parts, pings, strict=True)]
        estimates, modes, fits = outputs
        fit.add(fits, numbers, reported[numbers], np.any(estimates.label.reshape(count, -1) > 0, axis=1))
        data = _dataset(since[numbers], estimates, modes, returns.counts[numbers])
        told: dict[str, tuple[Any, str, str]] = {
            name: (np.stack([each[name] for each in places], axis=-1), "m", f"{name[-1]} of the {name[:-2]}")
            for name in places[0]
        }
        if background is not None:
            expected, shape = (np.reshape(each, (count, -1)) for each in (fits.expected, fits.shape))
            told["background_returns"] = expected, "1", "returns of the ping expected without a target"
            told["tail_shape"] = shape, "1", "shape of the tail of the background"
        for name, (values, unit, long_name) in told.items():
            if one:
                data[name] = of_scans(values[:, 0], unit, long_name)
            else:
                data[name] = ("time", "pair"), values, {"units": unit, "long_name": long_name}
        if not one:
            counts = np.stack([part.binned.returns.counts[numbers] for part in parts], axis=-1)
            data["returns_of_pair"] = (
                ("time", "pair"),
                np.where(reported[numbers], counts, -1),
                {"units": "1", "long_name": "returns that were read; -1 where the pair did not report"},
            )
            data = data.assign_coords(pair=[part.pair.name for part in parts])
        return data.assign_attrs(attributes)

    def close(state: State) -> xr.Dataset:
        return _maps(since[snapshots], [np.asarray(held) for held in state[2]], grid)

    return Plan(
        scenario=with_targets(chosen(scenario, parts[0].every if one else None), tracker),
        step=ReturnsStep(tracker, background, tuple(part.threshold for part in parts), grid),
        state=(None if background is None else background.init(), begun(tracker, scenario.filter.seed), maps),
        read=read,
        rows=rows,
        length=returns.length,
        size=BLOCK_PINGS,
        seed=scenario.filter.seed,
        within=NEAR_CELLS * max(axis.step for name, axis in grid.axes if name in MAPS["position"]),
        limits={"x": scenario.grid.x, "y": scenario.grid.y},
        checks=about_pairs(parts, scenario.background.every is None),
        remarks=fit.remarks,
        misfits=fit.misfits,
        close=close,
    )


def _places(pair: Bistatic, count: int) -> dict[str, Float[np.ndarray, " ping"]]:
    """Where source and receiver were in some pings; m."""
    return {
        f"{platform}_{name}": np.broadcast_to(getattr(getattr(pair, platform), name), count)
        for platform in ("source", "receiver")
        for name in ("x", "y")
    }


def _dataset(times: np.ndarray, estimates: Any, modes: PlanarState, counts: np.ndarray) -> xr.Dataset:
    """Estimates of consecutive pings in the schema, with the likeliest cell and the number of returns."""
    data = estimated(times, estimates, planar())
    for field in fields(modes):
        data[f"{field.name}_mode"] = of_scans(
            getattr(modes, field.name), data[field.name].attrs["units"], f"most probable {field.name}"
        )
    data["returns"] = of_scans(counts, "1", "returns of the ping")
    data.time.attrs["long_name"] = "time from the first ping"
    return data


def _maps(times: np.ndarray, maps: list[np.ndarray], grid: Grid) -> xr.Dataset:
    """What is believed of position and velocity after some pings, with a snapshot axis in place of time."""
    coordinates: dict[str, Any] = {
        f"axis_{name}": (
            f"axis_{name}",
            axis.values,
            {"units": "m/s" if name in MAPS["velocity"] else "m", "long_name": name},
        )
        for name, axis in grid.axes
    }
    coordinates["snapshot"] = ("snapshot", times, {"units": "s", "long_name": "time from the first ping"})
    variables = {
        name: (
            ("snapshot", *(f"axis_{axis}" for axis in axes)),
            values,
            {"units": "1", "long_name": f"log of the probability of a cell of {name}, if a target exists"},
        )
        for (name, axes), values in zip(MAPS.items(), maps, strict=True)
    }
    return xr.Dataset(variables, coordinates)
