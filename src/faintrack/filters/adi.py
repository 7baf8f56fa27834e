r"""Motion on a grid by the Fokker-Planck equation, one axis at a time.

A density that moves with its velocity, driven by white acceleration of density q, obeys

.. math::
    \frac{\partial p}{\partial t} = -v_x \frac{\partial p}{\partial x} - v_y \frac{\partial p}{\partial y}
        + \frac{q}{2} \frac{\partial^2 p}{\partial v_x^2} + \frac{q}{2} \frac{\partial^2 p}{\partial v_y^2}

(kreucher2011, eq. 16). Each term is stepped by itself, implicitly, with first-order upwind differences for the
advection and central ones for the diffusion:

.. math::
    \left(1 + \frac{|v| T}{\Delta}\right) p_i' - \frac{|v| T}{\Delta} p_{i \mp 1}' = p_i, \qquad
    -\frac{q T}{2 \Delta_v^2} p_{j-1}' + \left(1 + \frac{q T}{\Delta_v^2}\right) p_j'
        - \frac{q T}{2 \Delta_v^2} p_{j+1}' = p_j

Both matrices are diagonally dominant with non-positive neighbours, so their inverses are positive: weights stay
positive for steps of any length. Columns of the inverses sum to 1, but at the edge that the stream flows over: weight
is kept, or has left the grid. No weight flows over the edges of the velocity.

The inverse of the upwind step is the same from every cell: with :math:`c = |v| T / \Delta` and :math:`g = c / (1 + c)`
it carries :math:`\frac{1}{1 + c} g^k` of a weight over k cells, and n such steps carry :math:`\binom{n + k - 1}{k}
\frac{g^k}{(1 + c)^n}`; that of the diffusion falls as fast. Both are cut off where they are negligible, and applied as
sums over a few neighbours, which stand on the side that the stream comes from: one step reads and writes the weights a
few times.

Where it errs: the implicit upwind step moves the mean exactly and adds :math:`|v| T \Delta + (v T)^2` to the variance
of x, however small the noise: it is the most diffusive of the transports. `substeps` lowers the second term, finer
cells the first.
"""

import functools
import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.beliefs.axis import Axis
from faintrack.beliefs.grids import Grid
from faintrack.filters.grid import Advance, Tabled, in_steps, left_the_grid

NEGLIGIBLE = 1e-6
"""Share of a weight that is not carried to neighbours far away, but to the near ones in proportion."""


class Stream(eqx.Module):
    """Rates that carry weight the same way.

    Attributes
    ----------
    first, last : of the rates, the last not included.
    forward : towards higher places; otherwise towards lower ones.
    shares : of what arrives at a place from so many cells before it.
    """

    first: int = eqx.field(static=True)
    last: int = eqx.field(static=True)
    forward: bool = eqx.field(static=True)
    shares: Float[np.ndarray, "distance rate"]


class AlternatingDirections(eqx.Module):
    """Inverses for every axis, as weights of neighbours; see `alternating_directions`.

    Attributes
    ----------
    grid : cells.
    interval : of one step; seconds.
    streams : for every moving component those of its rates, back and forth.
    spreads : for every rate, shape (offset, rate); share that arrives at a rate from as many cells before it, offsets
        from the lowest to the highest.
    leaving : for every moving component, shape (rate, place); share that leaves the grid in one step.
    """

    grid: Grid = eqx.field(static=True)
    interval: float = eqx.field(static=True)
    streams: tuple[tuple[Stream, ...], ...]
    spreads: tuple[Float[np.ndarray, "_ _"], ...]
    leaving: tuple[Float[np.ndarray, "_ _"], ...]

    def carry(
        self, log_weights: Float[Array, "*cells"], start: Any, end: Any, key: PRNGKeyArray
    ) -> tuple[Float[Array, "*cells"], Float[Array, ""]]:
        """Weights at `end` and what has left the grid; `key` is not used."""
        return in_steps(self.advances(key), log_weights, start, end, self.interval)

    def advances(self, key: PRNGKeyArray) -> list[Advance]:
        """For every moving component a function of (weights, number) to weights after a step and what has left."""
        tables = zip(self.grid.pairs, self.streams, self.spreads, self.leaving, strict=True)
        return [functools.partial(_advance, *pair, flow, spread, gone) for pair, flow, spread, gone in tables]


def steps_within(way: float, cell: float) -> int:
    """Steps of an interval in which a target goes so far: of half a cell each at most.

    A longer step smears a target by as much again as it moves.

    Examples
    --------
    >>> steps_within(3.0, 2.0), steps_within(0.0, 2.0)
    (3, 1)
    """
    return max(math.ceil(2 * way / cell - 1e-9), 1)


def alternating_directions(
    grid: Grid, velocity_noise: float, interval: float, substeps: int = 1
) -> AlternatingDirections:
    """Inverses of the module's equations on a grid.

    Parameters
    ----------
    grid : uniform; the rate of every component that moves is an axis too.
    velocity_noise : density of the acceleration along each axis, the root of q; m/s per root second.
    interval : between scans; s.
    substeps : implicit steps in an interval; they cost no more than one.

    Raises
    ------
    InputError : a component without its rate.

    Examples
    --------
    >>> from faintrack.targets.states import RangeState
    >>> grid = Grid(RangeState, (("range", Axis(0.0, 1.0, 50)), ("range_rate", Axis(-1.0, 1.0, 3))))
    >>> [stream.shares.shape for stream in alternating_directions(grid, 0.1, 1.0).streams[0]]
    [(19, 1), (19, 2)]
    """
    pairs = [(grid.axes[place][1], grid.axes[rate][1]) for place, rate in grid.pairs]
    ways = [_ways(place, rate, interval, substeps) for place, rate in pairs]
    spreads = [
        np.linalg.matrix_power(_diffusion(rate, velocity_noise**2, interval / substeps), substeps) for _, rate in pairs
    ]
    return AlternatingDirections(
        grid,
        interval,
        tuple(_streams(shares, rate) for shares, (_, rate) in zip(ways, pairs, strict=True)),
        tuple(_neighbours(spread) for spread in spreads),
        tuple(_leaving(shares, rate) for shares, (_, rate) in zip(ways, pairs, strict=True)),
    )


def _advance(
    place: int,
    rate: int,
    streams: tuple[Stream, ...],
    spread: Float[Tabled, "offset rate"],
    leaving: Float[Tabled, "rate place"],
    weights: Float[Array, "*cells"],
    number: Array | int,
) -> tuple[Array, Array]:
    """Weights after the step of one component and its rate, and what has left the grid; both linear."""
    moved = _spread(spread, _carried(streams, weights, place, rate), rate)
    return moved, left_the_grid(weights, place, rate, leaving)


def _carried(
    streams: tuple[Stream, ...], weights: Float[Array, "*cells"], place: int, rate: int
) -> Float[Array, "*cells"]:
    """Weights moved along an axis as their rates say."""
    # Axes behind that of the place are one: rows that a processor's vector units go along are then long.
    rows = weights.reshape(*weights.shape[:place], -1) if rate < place else weights
    stride = rows.shape[place] // weights.shape[place]
    parts = []
    for stream in streams:
        part = jax.lax.slice_in_dim(rows, stream.first, stream.last, axis=rate)
        reach = stride * (len(stream.shares) - 1)
        padded = _padded(part, place, *((reach, 0) if stream.forward else (0, reach)))
        starts = range(reach, -1, -stride) if stream.forward else range(0, reach + 1, stride)
        parts.append(_summed(stream.shares, rate, padded, place, starts, rows.shape[place]))
    return jnp.concatenate(parts, axis=rate).reshape(weights.shape)


def _spread(shares: Float[Tabled, "offset rate"], weights: Float[Array, "*cells"], rate: int) -> Float[Array, "*cells"]:
    """Weights spread along the axis of a rate."""
    reach = len(shares) // 2
    rows = weights.reshape(*weights.shape[: rate + 1], -1)
    padded = _padded(rows, rate, reach, reach)
    starts = range(2 * reach, -1, -1)
    return _summed(shares, rate, padded, rate, starts, rows.shape[rate]).reshape(weights.shape)


def _padded(weights: Float[Array, "..."], axis: int, before: int, after: int) -> Float[Array, "..."]:
    """Weights with nothing beyond the ends of an axis."""
    return jnp.pad(weights, [(before, after) if number == axis else (0, 0) for number in range(weights.ndim)])


def _summed(
    shares: Float[Tabled, "start by"], by: int, padded: Float[Array, "..."], axis: int, starts: range, count: int
) -> Float[Array, "..."]:
    """Sum of parts of an axis that begin at `starts`, each times its share, which depends on the cell of another."""
    table = jnp.asarray(shares, padded.dtype).reshape(len(starts), -1, *(1,) * (padded.ndim - 1 - by))
    parts = (jax.lax.slice_in_dim(padded, start, start + count, axis=axis) for start in starts)
    return functools.reduce(jnp.add, (share * part for share, part in zip(table, parts, strict=True)))


def _ways(place: Axis, rate: Axis, interval: float, substeps: int) -> Float[np.ndarray, "distance rate"]:
    """Share of a weight that goes so many cells, for all places that there are; what is negligible is left out."""
    courant = np.abs(rate.values) * interval / substeps / place.step
    distance = np.arange(1, place.count)[:, None]
    further = courant / (1 + courant) * (distance + substeps - 1) / distance
    ways = np.cumprod(np.concatenate([(1 + courant[None]) ** -substeps, further]), axis=0)
    total = ways.sum(axis=0)
    ways[ways <= NEGLIGIBLE] = 0
    # None is left where a target crosses the whole grid in a step.
    kept = np.maximum(ways.sum(axis=0), np.finfo(float).tiny)
    return ways * np.where(total > 1 - NEGLIGIBLE, 1, total) / kept


def _streams(ways: Float[np.ndarray, "distance rate"], rate: Axis) -> tuple[Stream, ...]:
    """Rates that go back, and the others."""
    back = int(np.count_nonzero(rate.values < 0))
    streams = []
    for first, last, forward in ((0, back, False), (back, rate.count, True)):
        if first < last:
            shares = ways[:, first:last]
            reach = np.max(np.flatnonzero(shares.any(axis=1)), initial=0)
            streams.append(Stream(first, last, forward, shares[: reach + 1]))
    return tuple(streams)


def _leaving(ways: Float[np.ndarray, "distance rate"], rate: Axis) -> Float[np.ndarray, "rate place"]:
    """Share that goes further than there are places ahead."""
    forward = np.maximum(1 - np.cumsum(ways, axis=0), 0)[::-1].T
    return np.where(rate.values[:, None] < 0, forward[:, ::-1], forward)


def _neighbours(matrix: Float[np.ndarray, "along along"]) -> Float[np.ndarray, "offset along"]:
    """Shares of the neighbours in the product with a matrix whose columns are where from, made to add up to 1."""
    count = len(matrix)
    kept = np.where(matrix > NEGLIGIBLE, matrix, 0)
    kept /= kept.sum(axis=0)
    apart = np.arange(count)[:, None] - np.arange(count)
    reach = int(np.abs(np.where(kept > 0, apart, 0)).max())
    shares = np.zeros((2 * reach + 1, count))
    for offset in range(-reach, reach + 1):
        to = np.arange(max(offset, 0), count + min(offset, 0))
        shares[offset + reach, to] = kept[to, to - offset]
    return shares


def _diffusion(rate: Axis, density: float, interval: float) -> Float[np.ndarray, "rate rate"]:
    """Inverse of the central step of the velocity, nothing flowing over its edges."""
    share = density * interval / (2 * rate.step**2)
    beside = np.eye(rate.count, k=1) + np.eye(rate.count, k=-1)
    return np.linalg.inv(np.eye(rate.count) + share * (np.diag(beside.sum(axis=0)) - beside))
