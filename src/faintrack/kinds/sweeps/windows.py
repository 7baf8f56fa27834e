r"""Beliefs in what stands and what moves, one for each window that an echo lies in.

A target that hardly moves shows as a blob like a fixed echo, and moves by less than its own width while it is watched.
So a fixed echo is a hypothesis like the target. A window is a few beams wide and a few pulses long; its belief is one
of `faintrack.beliefs.belief` in one echo, over

- places of an echo that stands, in the window and a margin around it: something there that a target in the window only
  seems to pass is no target;
- places in the window and velocities of one that moves.

The odds of a moving target are those of moving against standing still or not being there,

.. math:: \frac{q_m}{1 - q_m} = \frac{q \sum_{\text{moving}} w_i}{1 - q + q \sum_{\text{still}} w_i}

with q the existence of the echo. Points do not move over a grid, they go straight: the state of a window is the place
in the middle of a `watch`, and every sweep is looked up where the straight line is when the antenna points there;
beyond the margin it says nothing, as another echo may stand there. After the watch velocities have changed. Then the
window is laid out again, about its target if it believes in one, and each of its points takes over the weight of the
point that is there by now; velocities are blurred by the acceleration of that time. Echoes come and go by
`faintrack.targets.target.Target.forecast`.
"""

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from faintrack.beliefs.axis import Axis
from faintrack.beliefs.belief import Belief, moments, update
from faintrack.kinds.sweeps.echoes import Echoes, Rows, turned, wrapped
from faintrack.targets.states import PlanarState
from faintrack.targets.target import Target

TOGETHER = 4
"""Windows that are computed at once: their points fit into the cache of a processor."""


class Windows(eqx.Module):
    """Windows, stacked; those that are not used mean nothing.

    Attributes
    ----------
    log_odds : of an echo, fixed or moving.
    log_weights : of the points, first those that stand.
    odds : log odds of a moving target, after the last sweep.
    since : sweep from which on it is watched; seconds.
    time : in the middle of the watch, of the places; seconds.
    row, column : first row and first sample of the window, when it was laid out.
    x, y, heading : of the antenna, then.
    used : whether there is such a window.
    """

    log_odds: Float[Array, "*window"]
    log_weights: Float[Array, "*window point"]
    odds: Float[Array, "*window"]
    since: Float[Array, "*window"]
    time: Float[Array, "*window"]
    row: Int[Array, "*window"]
    column: Int[Array, "*window"]
    x: Float[Array, "*window"]
    y: Float[Array, "*window"]
    heading: Float[Array, "*window"]
    used: Bool[Array, "*window"]


class Layout(eqx.Module):
    """What all windows have in common.

    Attributes
    ----------
    echoes : what an echo looks like.
    target : how often echoes come and go.
    moving : share of them that move.
    speeds : eastward and northward, of those that move.
    noise : density of their acceleration; m/s per root second.
    keep : probability of a moving target from which a window follows it.
    """

    echoes: Echoes
    target: Target
    moving: float = eqx.field(static=True)
    speeds: Axis = eqx.field(static=True)
    noise: float = eqx.field(static=True)
    keep: float = eqx.field(static=True)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and samples of a window: four standard deviations of an echo either way."""
        return max(2, round(4 * self.echoes.across)), max(2, round(4 * self.echoes.along))

    @property
    def margin(self) -> tuple[int, int]:
        """Rows and samples around it in which an echo may stand."""
        return self.shape[0] // 2, self.shape[1] // 2

    @property
    def tiles(self) -> tuple[int, int]:
        """Windows that cover the rows and the samples of a sweep."""
        return -(-self.echoes.rows // self.shape[0]), -(-self.echoes.samples // self.shape[1])

    @property
    def standing(self) -> int:
        """Number of points that stand."""
        return math.prod(size + 2 * margin for size, margin in zip(self.shape, self.margin, strict=True))

    @property
    def points(self) -> int:
        """Number of all points."""
        return self.standing + math.prod(self.shape) * self.speeds.count**2

    @property
    def prior(self) -> Float[Array, " point"]:
        """Log weights before any sweep: evenly over all that stands, and over all that moves."""
        speed = np.hypot(self.speeds.values[:, None], self.speeds.values)
        moving = (speed > self.speeds.step / 2) & (speed < self.speeds.edges[-1])
        moves = np.broadcast_to(moving, (*self.shape, *moving.shape)).ravel()
        still = jnp.full(self.standing, (1 - self.moving) / self.standing)
        return jnp.log(jnp.concatenate([still, jnp.where(moves, self.moving / moves.sum(), 0)]))

    @property
    def log_odds(self) -> float:
        """Of an echo in a window before any sweep: those that coming and going lead to."""
        return math.log(self.target.arrival_rate / self.target.departure_rate)

    def empty(self, count: int) -> Windows:
        """So many windows of which none is used."""
        zeros, whole = jnp.zeros(count, jnp.float32), jnp.zeros(count, jnp.int32)
        weights = jnp.zeros((count, self.points), jnp.float32)
        return Windows(zeros, weights, zeros, zeros, zeros, whole, whole, zeros, zeros, zeros, jnp.zeros(count, bool))

    def laid(self, row: Array, column: Array, rows: Rows, ahead: Array) -> Windows:
        """Windows at some rows and samples of a sweep, before it is taken in.

        Parameters
        ----------
        row, column : first of the windows.
        rows : of the sweep.
        ahead : from the sweep to the middle of the watch; seconds.
        """
        row, column = row.astype(jnp.int32), column.astype(jnp.int32)
        time, x, y, heading = rows.at(jnp.mod(row + self.shape[0] // 2, self.echoes.rows))
        log_odds = jnp.full(row.shape, self.log_odds, jnp.float32)
        weights = jnp.broadcast_to(self.prior, (*row.shape, self.points))
        used = jnp.ones(row.shape, bool)
        fresh = Windows(log_odds, weights, log_odds, time, time + ahead, row, column, x, y, heading, used)
        return dataclasses.replace(fresh, odds=self._odds(fresh))

    def centre(self, window: Windows) -> PlanarState:
        """Middle of the windows, at rest."""
        half = self.shape[0] // 2, self.shape[1] // 2
        x, y = self.echoes.position(window.row + half[0], window.column + half[1], window.heading)
        return PlanarState(x + window.x, y + window.y, jnp.zeros_like(x), jnp.zeros_like(x))

    def near(self, window: Windows) -> Int[Array, "*window"]:
        """Row near the windows."""
        return jnp.mod(window.row + self.shape[0] // 2, self.echoes.rows)

    def states(self, window: Windows) -> tuple[PlanarState, PlanarState]:
        """Places that stand, and places and velocities that move, when the window was laid out."""
        (height, width), (above, before) = self.shape, self.margin
        zero = jnp.zeros((1, 1, 1, 1))

        def places(margin: tuple[int, int]) -> tuple[Array, Array]:
            row = window.row - margin[0] + jnp.arange(height + 2 * margin[0], dtype=jnp.float32)
            column = window.column - margin[1] + jnp.arange(width + 2 * margin[1], dtype=jnp.float32)
            x, y = self.echoes.position(row[:, None], column, window.heading)
            return (x + window.x)[..., None, None], (y + window.y)[..., None, None]

        speeds = jnp.asarray(self.speeds.values, jnp.float32)
        moving = PlanarState(*places((0, 0)), speeds[:, None], speeds)
        return PlanarState(*places((above, before)), zero, zero), moving

    def updated(self, window: Windows, rows: Rows, table: Float[Array, "row place"], interval: Array) -> Windows:
        """Window after a sweep; an unused one stays as it is."""
        forecast = self.target.forecast(window.log_odds, interval)
        same, new = forecast.shares
        weights = jnp.logaddexp(window.log_weights + same, self.prior + new)
        belief = Belief(None, weights, forecast.log_odds, window.time)
        ratios = [self._looked_up(window, states, rows, table).ravel() for states in self.states(window)]
        belief, _ = update(belief, jnp.concatenate(ratios))
        window = dataclasses.replace(window, log_weights=belief.log_weights, log_odds=belief.log_odds)
        return dataclasses.replace(window, odds=self._odds(window))

    def _looked_up(
        self, window: Windows, states: PlanarState, rows: Rows, table: Float[Array, "row place"]
    ) -> Float[Array, "..."]:
        """Log ratio of states; 0 where they are in no sweep, or not in the window and its margin."""
        near = self.near(window)
        row, sample = self.echoes.seen(states, window.time, rows, near)
        middle, distance = self.echoes.seen(self.centre(window), window.time, rows, near)
        aside = jnp.abs(turned(row - middle, self.echoes.rows))
        within = (aside <= self.shape[0]) & (jnp.abs(sample - distance) <= self.shape[1])
        number = jnp.round(sample).astype(jnp.int32)
        ratio = table[wrapped(row, self.echoes.rows), jnp.clip(number, 0, table.shape[1] - 1)]
        return jnp.where(within & (number < table.shape[1]), ratio, 0)

    def _odds(self, windows: Windows) -> Float[Array, "*window"]:
        """Log odds of a moving target: the module's equation."""
        still, moving = (
            windows.log_odds + jax.nn.logsumexp(part, axis=-1) for part in self._parts(windows.log_weights)
        )
        return moving - jnp.logaddexp(0.0, still)

    def estimate(self, window: Windows, time: Array) -> tuple[PlanarState, Float[Array, "4 4"]]:
        """Mean and covariance of the moving target of a window at a time."""
        _, log_weights = self._parts(window.log_weights)
        shape = (*self.shape, self.speeds.count, self.speeds.count)
        weights = jax.nn.softmax(log_weights).reshape(shape)
        _, states = self.states(window)
        middle, matrix = moments(Belief(states, jnp.log(weights), window.log_odds, window.time), weights)
        passed = time - window.time
        carried = jnp.eye(4).at[0, 2].set(passed).at[1, 3].set(passed)
        x, y = middle.x + passed * middle.vx, middle.y + passed * middle.vy
        # Cells have a size: a belief that is all in one knows its place no better.
        cell = jnp.diag(self._cell(window) ** 2 / 12)
        return PlanarState(x, y, middle.vx, middle.vy), carried @ (matrix + cell) @ carried.T

    def _cell(self, window: Windows) -> Float[Array, " 4"]:
        """Size of the cells along each component, the longer side along x and y."""
        across = (window.column + self.shape[1] / 2) * self.echoes.spacing * (2 * jnp.pi / self.echoes.rows)
        place = jnp.maximum(across, self.echoes.spacing)
        return jnp.stack([place, place, *[jnp.asarray(self.speeds.step, place.dtype)] * 2])

    def laid_again(self, window: Windows, rows: Rows, ahead: Array) -> Windows:
        """Window laid out anew in a sweep that it has taken in, about its target if it believes in one."""
        near = self.near(window)
        believes = jax.nn.sigmoid(window.odds) >= self.keep
        middle = rows.time[near] + ahead
        target, _ = self.estimate(window, middle)
        centre = jax.tree.map(lambda moved, stays: jnp.where(believes, moved, stays), target, self.centre(window))
        row, column = self.echoes.seen(
            dataclasses.replace(centre, vx=jnp.zeros(()), vy=jnp.zeros(())), middle, rows, near
        )
        first = jnp.mod(jnp.round(row) - self.shape[0] // 2, self.echoes.rows)
        fresh = self.laid(first, jnp.maximum(jnp.round(column) - self.shape[1] // 2, 0), rows, ahead)
        passed = fresh.time - window.time
        still, moving = (
            self._taken_over(window, states, old, new, passed, margin)
            for states, old, new, margin in zip(
                self.states(fresh),
                self._parts(window.log_weights),
                self._parts(fresh.log_weights),
                (self.margin, (0, 0)),
                strict=True,
            )
        )
        joint = jnp.concatenate([still.ravel(), self._blurred(moving, passed).ravel()])
        log_sum = jax.nn.logsumexp(joint)
        again = dataclasses.replace(fresh, log_weights=joint - log_sum, log_odds=window.log_odds + log_sum)
        return dataclasses.replace(again, odds=self._odds(again), since=window.since, used=window.used)

    def _taken_over(
        self,
        window: Windows,
        states: PlanarState,
        old: Float[Array, " point"],
        new: Float[Array, " point"],
        passed: Array,
        margin: tuple[int, int],
    ) -> Float[Array, "row sample vx vy"]:
        """Log weights of states, some time after those of a window: of the point of it that is there by then.

        Parameters
        ----------
        window : as it was laid out before.
        states : to be weighed.
        old, new : log weights of the points of the window, and of states of which nothing is known.
        passed : from the places of the window to the states; seconds.
        margin : of the points around the window; rows and samples.
        """
        x, y = states.x - states.vx * passed - window.x, states.y - states.vy * passed - window.y
        row, sample = self.echoes.place(x, y, window.heading)
        half = self.shape[0] // 2
        above = jnp.round(turned(row - window.row - half, self.echoes.rows)).astype(jnp.int32) + half + margin[0]
        along = jnp.round(sample).astype(jnp.int32) - window.column + margin[1]
        height, width = (size + 2 * extra for size, extra in zip(self.shape, margin, strict=True))
        inside = (above >= 0) & (above < height) & (along >= 0) & (along < width)
        held = old.reshape(height, width, -1)
        speed = jnp.arange(held.shape[-1]).reshape(jnp.broadcast_shapes(states.vx.shape, states.vy.shape))
        taken = held[jnp.clip(above, 0, height - 1), jnp.clip(along, 0, width - 1), speed]
        # Nothing is known yet of places that were not in the window.
        return jnp.where(inside, taken, new.reshape(taken.shape) + self.log_odds - window.log_odds)

    def _blurred(
        self, log_weights: Float[Array, "row sample vx vy"], passed: Array
    ) -> Float[Array, "row sample vx vy"]:
        """Log weights after velocities have changed at random for some time; none comes to rest."""
        share = jnp.minimum(self.noise**2 * passed / (2 * self.speeds.step**2), 1 / 3)
        peak = jnp.max(log_weights)
        weights = jnp.exp(log_weights - peak)
        for axis in (2, 3):
            padding = [(0, 0)] * 4
            padding[axis] = (1, 1)
            padded = jnp.pad(weights, padding, mode="edge")
            before, after = (
                jax.lax.slice_in_dim(padded, start, start + self.speeds.count, axis=axis) for start in (0, 2)
            )
            weights = (1 - 2 * share) * weights + share * (before + after)
        moves = self._parts(self.prior)[1].reshape(weights.shape) > -jnp.inf
        return jnp.where(moves, jnp.log(weights) + peak, -jnp.inf)

    def _parts(self, values: Float[Array, "*window point"]) -> tuple[Array, Array]:
        """What stands, and what moves."""
        return values[..., : self.standing], values[..., self.standing :]


def each_used(function: Callable[[Any], Any], windows: Windows) -> Windows:
    """Windows after a function of one of them; only those up to the last one in use are computed.

    Parameters
    ----------
    function : of a window to a window.
    windows : stacked; as many as `TOGETHER` divides.
    """
    numbers = jnp.arange(windows.used.size)
    stop = jnp.max(jnp.where(windows.used, numbers + 1, 0))

    def some(block: Any, windows: Windows) -> Windows:
        def part(values: Array) -> Array:
            return jax.lax.dynamic_slice_in_dim(values, block * TOGETHER, TOGETHER)

        before = jax.tree.map(part, windows)
        after = jax.vmap(function)(before)
        return jax.tree.map(
            lambda held, values: jax.lax.dynamic_update_slice_in_dim(held, values, block * TOGETHER, 0), windows, after
        )

    return jax.lax.fori_loop(0, -(-stop // TOGETHER), some, windows)
