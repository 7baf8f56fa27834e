r"""Motion on a grid by a kernel for every component and its rate.

On a uniform grid the displacement depends on the velocity alone, and the components move independently, so that the
transition splits into one kernel for (x, vx), one for (y, vy): two banded products in place of one over all cells. The
kernel is what moving very many particles from every cell and counting them would give:

.. math::
    K(d, l \mid j) = \mathrm{E}\left[ P(x' \in \text{cell } i + d, \; v' \in \text{cell } l) \right],
    \qquad x \sim U(\text{cell } i), \; v \sim U(\text{cell } j)

for the motion's step :math:`x' = x + g v + a u + b w, \; v' = e v + c u` (`faintrack.targets.motion.Step`). The mean
over x is exact, the mean over v a sum over points within the cell; given both velocities' cells x' is taken as normal
with the exact mean and variance. Velocities beyond the grid are held in its last cell; what leaves the grid does so by
its place.

Where it errs: a weight is spread over its cell anew in every step, which adds up to a quarter of a cell's square to the
variance of x a step (less the fewer cells the target crosses), as numerical diffusion does. Choose cells no wider than
the target moves in one step, or a step long enough.

Scans that come when they like have an interval of their own each (`separable_unevenly`): it is cut into as many equal
steps as come nearest to a usual one, and the kernel is worked out for their length.
"""

import functools
import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray
from scipy.special import ndtr

from faintrack.beliefs.axis import Axis
from faintrack.beliefs.grids import Grid
from faintrack.filters.grid import Advance, Tabled, in_steps, left_the_grid
from faintrack.numerics.precision import full_precision
from faintrack.targets.motion import Step

POINTS = 64
"""Velocities within a cell over which the kernel is averaged."""

NEGLIGIBLE = 1e-9
"""Probability of a displacement that is left out of the kernel."""


class Separable(eqx.Module):
    """Kernels of all components; see `separable`.

    Attributes
    ----------
    grid : cells.
    interval : of one step; seconds.
    kernels : for every moving component, shape (new rate, displacement, rate).
    leaving : for every moving component, shape (rate, place); probability of leaving the grid in one step.
    """

    grid: Grid = eqx.field(static=True)
    interval: float = eqx.field(static=True)
    kernels: tuple[Float[np.ndarray, "_ _ _"], ...]
    leaving: tuple[Float[np.ndarray, "_ _"], ...]

    def carry(
        self, log_weights: Float[Array, "*cells"], start: Any, end: Any, key: PRNGKeyArray
    ) -> tuple[Float[Array, "*cells"], Float[Array, ""]]:
        """Weights at `end` and what has left the grid; `key` is not used."""
        return in_steps(self.advances(key), log_weights, start, end, self.interval)

    def advances(self, key: PRNGKeyArray) -> list[Advance]:
        """For every moving component a function of (weights, number) to weights after a step and what has left."""
        return [
            functools.partial(_advance, *pair, kernel, leaving)
            for pair, kernel, leaving in zip(self.grid.pairs, self.kernels, self.leaving, strict=True)
        ]


class SeparableUnevenly(eqx.Module):
    """Kernels worked out for every interval; see `separable_unevenly`.

    Attributes
    ----------
    grid : cells.
    motion : with `step(interval)`.
    interval : a usual one; seconds.
    reach : cells that a step goes at most, for every moving component.
    """

    grid: Grid = eqx.field(static=True)
    motion: Any
    interval: float = eqx.field(static=True)
    reach: tuple[int, ...] = eqx.field(static=True)

    def carry(
        self, log_weights: Float[Array, "*cells"], start: Any, end: Any, key: PRNGKeyArray
    ) -> tuple[Float[Array, "*cells"], Float[Array, ""]]:
        """Weights at `end` and what has left the grid; `key` is not used."""
        dtype = log_weights.dtype
        whole = jnp.asarray(end - start, dtype)
        length = whole / jnp.maximum(jnp.round(whole / self.interval), 1)
        # No time is no step, whatever its kernel.
        length = jnp.where(length > 0, length, self.interval)
        step = Step(*(jnp.asarray(value, dtype) for value in self.motion.step(length)))
        advances = []
        for (place, rate), reach in zip(self.grid.pairs, self.reach, strict=True):
            kernel = _traced_kernel(self.grid.axes[place][1], self.grid.axes[rate][1], step, reach)
            leaving = _leaving(kernel, self.grid.axes[place][1].count)
            advances.append(functools.partial(_advance, place, rate, kernel, leaving))
        return in_steps(advances, log_weights, start, end, length)


@full_precision
def _advance(
    place: int,
    rate: int,
    kernel: Float[Tabled, "rate displacement rate"],
    leaving: Float[Tabled, "rate place"],
    weights: Float[Array, "*cells"],
    number: Array | int,
) -> tuple[Array, Array]:
    """Weights after the step of one component, and what has left the grid; both linear."""
    front = jnp.moveaxis(weights, (rate, place), (0, 1))
    count, reach = front.shape[1], kernel.shape[1] // 2
    padded = jnp.pad(front, ((0, 0), (reach, reach), *[(0, 0)] * (front.ndim - 2)))
    shifted = jnp.stack([padded[:, 2 * reach - d : 2 * reach - d + count] for d in range(2 * reach + 1)])
    moved = jnp.tensordot(jnp.asarray(kernel, weights.dtype), shifted, axes=((1, 2), (0, 1)))
    return jnp.moveaxis(moved, (0, 1), (rate, place)), left_the_grid(weights, place, rate, leaving)


def separable(grid: Grid, motion: Any, interval: float) -> Separable:
    """Kernels of a motion on a grid.

    Parameters
    ----------
    grid : uniform; the rate of every component that moves is an axis too.
    motion : with `step(interval)`; nearly constant velocity or Ornstein-Uhlenbeck.
    interval : between scans; s.

    Raises
    ------
    InputError : a component without its rate.

    Examples
    --------
    >>> from faintrack.targets.motion import PlanarMotion
    >>> from faintrack.targets.states import RangeState
    >>> grid = Grid(RangeState, (("range", Axis(0.0, 1.0, 50)), ("range_rate", Axis(-1.0, 1.0, 3))))
    >>> separable(grid, PlanarMotion(0.0), 1.0).kernels[0].shape
    (3, 5, 3)
    """
    step = Step(*(float(value) for value in motion.step(interval)))
    kernels = [_kernel(grid.axes[place][1], grid.axes[rate][1], step) for place, rate in grid.pairs]
    leaving = [
        _leaving(kernel, grid.axes[place][1].count) for kernel, (place, _) in zip(kernels, grid.pairs, strict=True)
    ]
    return Separable(grid, interval, tuple(kernels), tuple(leaving))


LONGEST = 1.5
"""Of the usual interval: the longest step that an uneven one is cut into."""


def separable_unevenly(grid: Grid, motion: Any, interval: float) -> SeparableUnevenly:
    """Motion on a grid over intervals that differ.

    Parameters
    ----------
    grid, motion : as of `separable`.
    interval : a usual one between scans; s. Others take the more steps the longer they are.

    Examples
    --------
    >>> from faintrack.targets.motion import PlanarMotion
    >>> from faintrack.targets.states import RangeState
    >>> grid = Grid(RangeState, (("range", Axis(0.0, 1.0, 50)), ("range_rate", Axis(-1.0, 1.0, 3))))
    >>> transport = separable_unevenly(grid, PlanarMotion(0.0), 1.0)
    >>> there = jnp.full(grid.shape, -jnp.inf).at[20, 2].set(0.0)
    >>> moved, _ = transport.carry(there, 0.0, 5.3, jax.random.key(0))
    >>> round(float(jnp.exp(moved).sum(axis=1) @ jnp.arange(50.0)), 2)
    25.3
    """
    longest = separable(grid, motion, LONGEST * interval)
    return SeparableUnevenly(grid, motion, interval, tuple(kernel.shape[1] // 2 + 1 for kernel in longest.kernels))


def _kernel(place: Axis, rate: Axis, step: Step) -> Float[np.ndarray, "rate displacement rate"]:
    """The module's kernel: new rate, displacement in cells, rate."""
    chance, middle, width = _displaced(place, rate, step)
    counted = chance > NEGLIGIBLE
    reach = math.ceil(np.max(np.where(counted, np.abs(middle) + 6 * width, 0))) + 1
    offsets = np.arange(-reach, reach + 1)[:, None, None, None]
    kernel = np.einsum("djml,jml->ldj", _fallen(offsets, middle, width), np.where(counted, chance, 0))
    kernel /= kernel.sum(axis=(0, 1))
    used = np.flatnonzero(kernel.sum(axis=0).max(axis=1) > NEGLIGIBLE)
    needed = np.abs(used - reach).max()
    kernel = kernel[:, reach - needed : reach + needed + 1]
    return kernel / kernel.sum(axis=(0, 1))


@full_precision
def _traced_kernel(place: Axis, rate: Axis, step: Step, reach: int) -> Float[Array, "rate displacement rate"]:
    """`_kernel` of a step that is an array, with a reach that is known before."""
    chance, middle, width = _displaced(place, rate, step)
    offsets = np.arange(-reach, reach + 1)[:, None, None, None]
    # Where nothing falls, differences of large numbers in single precision would leave something.
    near = jnp.abs(offsets - middle) < 1 + 6 * width
    fallen = jnp.where(near, _fallen(offsets, middle, width), 0)
    kernel = jnp.einsum("djml,jml->ldj", fallen, jnp.where(chance > NEGLIGIBLE, chance, 0))
    return kernel / kernel.sum(axis=(0, 1))


def _fallen(offsets: np.ndarray, middle: Tabled, width: Tabled) -> Any:
    """Share of a cell's targets in every displaced cell, the displacement being normal."""
    ramp = functools.partial(_ramp, width=width)
    falls = ramp(offsets + 1 - middle) - 2 * ramp(offsets - middle) + ramp(offsets - 1 - middle)
    return _library(falls).maximum(falls, 0)


def _library(values: Any) -> Any:
    """Functions for these values: those of JAX where a step is traced, of NumPy where a table is made, in double."""
    return jnp if isinstance(values, jax.Array) else np


def _displaced(place: Axis, rate: Axis, step: Step) -> tuple[Any, Any, Any]:
    """Of velocities within a cell, to every new one: the probability, mean and deviation of the displacement in cells.

    Shapes (rate, point, new rate); of a step of arrays, arrays.
    """
    numbers = _library(step.c)
    within = (np.arange(POINTS) + 0.5) / POINTS - 0.5
    velocity: Any = rate.values[:, None] + rate.step * within
    edges: Any = rate.edges.copy()
    edges[0], edges[-1] = -np.inf, np.inf
    if numbers is jnp:
        velocity, edges = (jnp.asarray(each, jnp.result_type(step.c)) for each in (velocity, edges))
    # Without noise the rate's own cell is a step function, which the smallest of numbers turns into the same formulas.
    noise = numbers.maximum(step.c, 1e-9 * rate.step)
    low, high = ((e - step.decay * velocity[..., None]) / noise for e in (edges[:-1], edges[1:]))
    cumulative = jax.scipy.special.ndtr if numbers is jnp else ndtr
    # In the upper tail the difference of two numbers near 1 would lose everything.
    chance = numbers.where(low > 0, cumulative(-low) - cumulative(-high), cumulative(high) - cumulative(low))
    drawn, spread = _truncated_moments(low, high, chance)
    middle = (step.gain * velocity[..., None] + step.a * drawn) / place.step
    width = numbers.sqrt(step.b**2 + step.a**2 * spread) / place.step
    return chance, middle, width


def _truncated_moments(low: Any, high: Any, chance: Any) -> tuple[Any, Any]:
    """Mean and variance of a unit normal number between two bounds."""
    numbers = _library(chance)

    def density(x: Any) -> Any:
        return numbers.exp(-0.5 * x * x) / math.sqrt(2 * math.pi)

    safe = numbers.maximum(chance, 1e-30)
    lows, highs = (numbers.where(numbers.isfinite(x), x, 0) for x in (low, high))
    mean = (density(low) - density(high)) / safe
    variance = 1 + (lows * density(low) - highs * density(high)) / safe - mean**2
    likely = chance > NEGLIGIBLE
    return numbers.where(likely, mean, 0), numbers.where(likely, numbers.clip(variance, 0, 1), 0)


def _ramp(x: Any, width: Any) -> Any:
    """Integral of the normal distribution function of this width; max(x, 0) where it has none."""
    numbers = _library(width)
    scaled = x / numbers.maximum(width, 1e-12)
    bell = numbers.exp(-0.5 * numbers.minimum(scaled**2, 1400)) / math.sqrt(2 * math.pi)
    cumulative = jax.scipy.special.ndtr if numbers is jnp else ndtr
    return numbers.where(width > 1e-9, x * cumulative(scaled) + width * bell, numbers.maximum(x, 0))


def _leaving(kernel: Any, count: int) -> Any:
    """Probability of ending off the grid from every cell, shape (rate, place)."""
    reach = kernel.shape[1] // 2
    displaced = np.arange(count)[:, None] + np.arange(-reach, reach + 1)
    off = (displaced < 0) | (displaced >= count)
    return _library(kernel).einsum("dj,id->ji", kernel.sum(axis=0), off.astype(float))
