"""From sweeps to tracks: windows are opened where echoes are, and what moves in them is declared.

A sweep goes through the steps of `SweepsTracker.step`. A window is opened on every part of the picture in which some
place is likelier an echo than nothing, and closed when its echo is gone. Of windows whose targets are at one place the
likelier explains it: neighbours see the same target, and one that passes from a window to the next keeps its label.

A young window knows too little of how its echo fluctuates: for a few sweeps what wanders at random looks like motion,
and with a look at every sweep some will pass any threshold. So a target is declared when its echo has been watched for
a while, however likely it is before.
"""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from faintrack.kinds.sweeps.echoes import Rows, turned, wrapped
from faintrack.kinds.sweeps.windows import Layout, Windows, each_used
from faintrack.targets.states import PlanarState

GONE = 0.01
"""Probability of an echo below which its window is closed."""

APART = 3.0
"""Standard deviations of an echo within which two targets are the same."""


class Sweep(eqx.Module):
    """A sweep, or a stack of them.

    Attributes
    ----------
    rows : when and whence they looked.
    values : intensity over the deviation of a cell; shape (..., row, sample).
    time : of the middle of the sweep; seconds from the first.
    """

    rows: Rows
    values: Any
    time: Any


class Watching(eqx.Module):
    """What is known between sweeps.

    Attributes
    ----------
    windows : that are open.
    time : of the last sweep; seconds.
    laid : when the windows were last laid out anew; seconds.
    window : that each slot follows; -1 where it is free.
    label : of each slot; 0 where its target is not declared.
    labels : given so far.
    """

    windows: Windows
    time: Float[Array, ""]
    laid: Float[Array, ""]
    window: Int[Array, " slot"]
    label: Int[Array, " slot"]
    labels: Int[Array, ""]


class SweepEstimate(eqx.Module):
    """What is said after a sweep.

    Attributes
    ----------
    existence : probability that a moving target is in each slot; 0 in a free one.
    label : of each slot; 0 where it is not declared.
    mean, covariance : of the target in each slot, in the middle of the sweep.
    windows : that are open.
    unwatched : echoes that lie in no window because none was free.
    full : a target was likely enough for a slot, and none was free.
    """

    existence: Float[Array, "*sweep slot"]
    label: Int[Array, "*sweep slot"]
    mean: PlanarState
    covariance: Float[Array, "*sweep slot 4 4"]
    windows: Int[Array, "*sweep"]
    unwatched: Int[Array, "*sweep"]
    full: Bool[Array, "*sweep"]


class SweepsTracker(eqx.Module):
    """Opens windows, and declares, follows and drops what moves in them.

    Attributes
    ----------
    layout : of the windows.
    capacity : of windows.
    slots : targets in hand at most.
    declare, drop : existence at which a track begins, and below which it ends.
    hold : time that an echo is watched before a track begins; seconds.
    watch : time after which windows are laid out anew; seconds.
    nearest : sample from which on echoes are looked for.
    """

    layout: Layout
    capacity: int = eqx.field(static=True)
    slots: int = eqx.field(static=True)
    declare: float = eqx.field(static=True)
    drop: float = eqx.field(static=True)
    hold: float = eqx.field(static=True)
    watch: float = eqx.field(static=True)
    nearest: int = eqx.field(static=True)

    def init(self) -> Watching:
        """State before the first sweep."""
        none = jnp.full(self.slots, -1, jnp.int32)
        zero = jnp.zeros((), jnp.float32)
        return Watching(self.layout.empty(self.capacity), zero, zero, none, none + 1, jnp.array(0, jnp.int32))

    def step(self, watching: Watching, sweep: Sweep) -> tuple[Watching, SweepEstimate]:
        """Take in a sweep: open windows, update them, declare, and lay them out anew when it is time."""
        rows = sweep.rows
        table = self.layout.echoes.table(sweep.values, jnp.asarray(rows.received))
        ahead = watching.laid + self.watch / 2 - sweep.time
        windows, unwatched = self._opened(watching.windows, rows, table, ahead)
        interval = jnp.maximum(sweep.time - watching.time, 0)
        windows = each_used(lambda window: self.layout.updated(window, rows, table, interval), windows)
        watching = dataclasses.replace(watching, windows=windows, time=sweep.time)
        watching, estimate = self._declared(watching, sweep, unwatched)
        windows = watching.windows
        kept = windows.used & (jax.nn.sigmoid(windows.log_odds) >= GONE)
        windows = dataclasses.replace(windows, used=kept)
        due = sweep.time - watching.laid >= self.watch
        windows = jax.lax.cond(
            due,
            lambda windows: each_used(
                lambda window: self.layout.laid_again(window, rows, jnp.asarray(self.watch / 2)), windows
            ),
            lambda windows: windows,
            windows,
        )
        laid = jnp.where(due, sweep.time, watching.laid)
        return dataclasses.replace(watching, windows=windows, laid=laid), estimate

    def _opened(
        self, windows: Windows, rows: Rows, table: Float[Array, "row place"], ahead: Array
    ) -> tuple[Windows, Array]:
        """Windows with new ones where echoes are that no window covers, and the number for which none was free."""
        layout, echoes = self.layout, self.layout.echoes
        width, (down, along) = layout.shape[1], layout.tiles
        first = jnp.arange(down) * echoes.rows // down
        of_row = jnp.clip(jnp.arange(echoes.rows) * down // echoes.rows, 0, down - 1)
        of_sample = jnp.arange(echoes.samples) // width
        best = jnp.full((down, along), -jnp.inf).at[of_row[:, None], of_sample].max(table[:, : echoes.samples])
        # What a window covers is where its middle is now.
        row, sample = echoes.seen(layout.centre(windows), windows.time, rows, layout.near(windows))
        at = of_row[wrapped(row, echoes.rows)], jnp.clip(jnp.round(sample).astype(jnp.int32) // width, 0, along - 1)
        covered = jnp.zeros((down, along), bool).at[at].max(windows.used)
        wanted = (best > 0) & ~covered & (jnp.arange(along) * width >= self.nearest)
        score = jnp.where(wanted, best, -jnp.inf).ravel()
        count = min(self.capacity, score.size)
        _, order = jax.lax.top_k(score, count)
        number = jnp.sum(wanted)
        free = ~windows.used
        rank = jnp.cumsum(free) - 1
        opens = free & (rank < jnp.minimum(number, count))
        tile = order[jnp.clip(rank, 0, count - 1)]
        column = jnp.minimum(tile % along * width, echoes.samples - width)
        fresh = layout.laid(first[tile // along], column, rows, ahead)

        def chosen(new: Array, held: Array) -> Array:
            return jnp.where(opens.reshape(-1, *(1,) * (held.ndim - 1)), new, held)

        windows = jax.tree.map(chosen, dataclasses.replace(fresh, used=opens), windows)
        return windows, number - jnp.sum(opens)

    def _declared(self, watching: Watching, sweep: Sweep, unwatched: Array) -> tuple[Watching, SweepEstimate]:
        """Slots after a sweep: the likeliest windows, each target once, with the labels that they have."""
        layout, echoes, windows = self.layout, self.layout.echoes, watching.windows
        odds = jnp.where(windows.used, windows.odds, -jnp.inf)
        count = min(2 * self.slots, self.capacity)
        odds, numbers = jax.lax.top_k(odds, count)
        existence = jax.nn.sigmoid(odds)
        mean, covariance = jax.lax.map(
            lambda number: layout.estimate(jax.tree.map(lambda leaf: leaf[number], windows), sweep.time), numbers
        )
        row, sample = echoes.seen(mean, sweep.time, sweep.rows, layout.near(windows)[numbers])
        off = turned(row[:, None] - row, echoes.rows)
        same = (jnp.abs(off) < APART * echoes.across) & (jnp.abs(sample[:, None] - sample) < APART * echoes.along)
        eligible = existence >= self.drop

        def consider(number: Any, owner: Array) -> Array:
            # The likelier of them that speaks for itself.
            earlier = same[number] & (owner == jnp.arange(count)) & (jnp.arange(count) < number)
            return owner.at[number].set(jnp.where(jnp.any(earlier), jnp.argmax(earlier), number))

        owner = jax.lax.fori_loop(0, count, consider, jnp.arange(count))

        # Slots go with the window that speaks for theirs; the one with the older label stays where two do.
        follows = (watching.window[:, None] == numbers) & (watching.window[:, None] >= 0)
        candidate = jnp.where(jnp.any(follows, axis=1), owner[jnp.argmax(follows, axis=1)], -1)
        age = jnp.where(watching.label > 0, watching.label, jnp.iinfo(jnp.int32).max)
        order = jnp.arange(self.slots)
        older = (age < age[:, None]) | ((age == age[:, None]) & (order < order[:, None]))
        rival = jnp.any((candidate == candidate[:, None]) & older, axis=1)
        kept = (candidate >= 0) & ~rival & eligible[candidate]
        candidate = jnp.where(kept, candidate, -1)

        held = jnp.any(candidate == jnp.arange(count)[:, None], axis=1)
        fresh = eligible & (owner == jnp.arange(count)) & ~held
        free = ~kept
        turn = jnp.cumsum(free) - 1
        arrivals = jnp.argsort(~fresh, stable=True)
        fills = free & (turn < jnp.sum(fresh))
        candidate = jnp.where(fills, arrivals[jnp.clip(turn, 0, count - 1)], candidate)

        there = candidate >= 0
        label = jnp.where(kept, watching.label, 0)
        watched = sweep.time - windows.since[numbers] >= self.hold
        declares = there & (label == 0) & (watched & (existence >= self.declare))[candidate]
        label = jnp.where(declares, watching.labels + jnp.cumsum(declares), label)
        estimate = SweepEstimate(
            jnp.where(there, existence[candidate], 0),
            label,
            jax.tree.map(lambda leaf: leaf[candidate], mean),
            covariance[candidate],
            jnp.sum(windows.used),
            unwatched,
            jnp.sum(fresh) > jnp.sum(fills),
        )
        window = jnp.where(there, numbers[candidate], -1).astype(jnp.int32)
        labels = watching.labels + jnp.sum(declares)
        return dataclasses.replace(watching, window=window, label=label, labels=labels), estimate
