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

The inverse of the upwind step is a geometric series, :math:`\frac{1}{1 + c} g^k` with :math:`c = |v| T / \Delta` and
:math:`g = c / (1 + c)`, the same from every cell; that of the diffusion falls as fast. Both are computed once, cut off
where they are negligible, and applied as sums over a few neighbours: one step reads and writes the weights a few times.

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

from faintrack.axis import Axis
from faintrack.filters.grid import Advance, Tabled, in_steps, left_the_grid
from faintrack.grids import Grid

NEGLIGIBLE = 1e-6
"""Share of a weight that is not carried to neighbours far away, but to the near ones in proportion."""


class AlternatingDirections(eqx.Module):
    """Inverses for every axis, as weights of neighbours; see `alternating_directions`.

    Attributes
    ----------
    grid : cells.
    interval : of one step; seconds.
    flows : for every moving component, shape (offset, rate, place); share that arrives at a place from as many cells
        before it, offsets from the lowest to the highest.
    spreads : for every rate, shape (offset, 1, rate); the same along the rate.
    leaving : for every moving component, shape (rate, place); share that leaves the grid in one step.
    """

    grid: Grid = eqx.field(static=True)
    interval: float = eqx.field(static=True)
    flows: tuple[Float[np.ndarray, "_ _ _"], ...]
    spreads: tuple[Float[np.ndarray, "_ 1 _"], ...]
    leaving: tuple[Float[np.ndarray, "_ _"], ...]

    def carry(
        self, log_weights: Float[Array, "*cells"], start: Any, end: Any, key: PRNGKeyArray
    ) -> tuple[Float[Array, "*cells"], Float[Array, ""]]:
        """Weights at `end` and what has left the grid; `key` is not used."""
        return in_steps(self.advances(key), log_weights, start, end, self.interval)

    def advances(self, key: PRNGKeyArray) -> list[Advance]:
        """For every moving component a function of (weights, number) to weights after a step and what has left."""
        tables = zip(self.grid.pairs, self.flows, self.spreads, self.leaving, strict=True)
        return [
            functools.partial(_advance, place, rate, flow, spread, gone) for (place, rate), flow, spread, gone in tables
        ]


def steps_within(way: float, cell: float) -> int:
    """Steps of an interval in which a target goes so far: of half a cell each at most.

    A longer step smears a target by as much again as it moves.

    Examples
    --------
    >>> steps_within(3.0, 2.0), steps_within(0.0, 2.0)
    (3, 1)
    """
    return max(math.ceil(2 * way / cell), 1)


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
    >>> alternating_directions(grid, 0.1, 1.0).flows[0].shape
    (37, 3, 50)
    """
    pairs = [(grid.axes[place][1], grid.axes[rate][1]) for place, rate in grid.pairs]
    step = interval / substeps
    flows = [np.linalg.matrix_power(_advection(place, rate, step), substeps) for place, rate in pairs]
    spreads = [np.linalg.matrix_power(_diffusion(rate, velocity_noise**2, step), substeps) for _, rate in pairs]
    leaving = [np.where((gone := 1 - flow.sum(axis=1)) > NEGLIGIBLE, gone, 0) for flow in flows]
    near_flows = tuple(_neighbours(flow, 1 - gone) for flow, gone in zip(flows, leaving, strict=True))
    near_spreads = tuple(_neighbours(spread[None], np.ones((1, len(spread)))) for spread in spreads)
    return AlternatingDirections(grid, interval, near_flows, near_spreads, tuple(leaving))


def _advance(
    place: int,
    rate: int,
    flow: Float[Tabled, "offset rate place"],
    spread: Float[Tabled, "_ 1 rate"],
    leaving: Float[Tabled, "rate place"],
    weights: Float[Array, "*cells"],
    number: Array | int,
) -> tuple[Array, Array]:
    """Weights after the step of one component and its rate, and what has left the grid; both linear."""
    moved = _from_neighbours(spread, _from_neighbours(flow, weights, place, rate), rate, place)
    return moved, left_the_grid(weights, place, rate, leaving)


def _from_neighbours(
    shares: Float[Tabled, "offset by along"], weights: Float[Array, "*cells"], along: int, by: int
) -> Float[Array, "*cells"]:
    """Sum over neighbours along an axis, their shares depending on the cell of that axis and of the axis `by`."""
    count, reach = weights.shape[along], shares.shape[0] // 2
    shape = [1] * weights.ndim
    shape[along], shape[by] = shares.shape[2], shares.shape[1]
    ordered = jnp.asarray(shares, weights.dtype)
    ordered = ordered if by < along else jnp.swapaxes(ordered, 1, 2)
    padded = jnp.pad(weights, [(reach, reach) if axis == along else (0, 0) for axis in range(weights.ndim)])
    moved = jnp.zeros((), weights.dtype)
    for offset in range(-reach, reach + 1):
        origin = jax.lax.slice_in_dim(padded, reach - offset, reach - offset + count, axis=along)
        moved = moved + ordered[offset + reach].reshape(shape) * origin
    return moved


def _neighbours(
    matrices: Float[np.ndarray, "by along along"], sums: Float[np.ndarray, "by along"]
) -> Float[np.ndarray, "offset by along"]:
    """Shares of the neighbours in products with matrices whose columns are where from, made to add up to `sums`."""
    count = matrices.shape[1]
    kept = np.where(matrices > NEGLIGIBLE, matrices, 0)
    kept *= (sums / kept.sum(axis=1))[:, None]
    apart = np.arange(count)[:, None] - np.arange(count)
    reach = int(np.abs(np.where(kept.any(axis=0), apart, 0)).max())
    shares = np.zeros((2 * reach + 1, len(matrices), count))
    for offset in range(-reach, reach + 1):
        to = np.arange(max(offset, 0), count + min(offset, 0))
        shares[offset + reach][:, to] = kept[:, to, to - offset]
    return shares


def _advection(place: Axis, rate: Axis, interval: float) -> Float[np.ndarray, "rate place place"]:
    """Inverse of the upwind step at every velocity."""
    courant = rate.values * interval / place.step
    one, below = np.eye(place.count), np.eye(place.count, k=-1)
    forward, backward = np.maximum(courant, 0)[:, None, None], np.maximum(-courant, 0)[:, None, None]
    return np.linalg.inv(one + forward * (one - below) + backward * (one - below.T))


def _diffusion(rate: Axis, density: float, interval: float) -> Float[np.ndarray, "rate rate"]:
    """Inverse of the central step of the velocity, nothing flowing over its edges."""
    share = density * interval / (2 * rate.step**2)
    beside = np.eye(rate.count, k=1) + np.eye(rate.count, k=-1)
    return np.linalg.inv(np.eye(rate.count) + share * (np.diag(beside.sum(axis=0)) - beside))
