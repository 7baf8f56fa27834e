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
"""

import functools
import math
from typing import Any

import equinox as eqx
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


def _kernel(place: Axis, rate: Axis, step: Step) -> Float[np.ndarray, "rate displacement rate"]:
    """The module's kernel: new rate, displacement in cells, rate."""
    within = (np.arange(POINTS) + 0.5) / POINTS - 0.5
    velocity = rate.values[:, None] + rate.step * within
    edges = rate.edges.copy()
    edges[0], edges[-1] = -np.inf, np.inf
    # Without noise the rate's own cell is a step function, which the smallest of numbers turns into the same formulas.
    noise = max(step.c, 1e-9 * rate.step)
    low, high = ((e - step.decay * velocity[..., None]) / noise for e in (edges[:-1], edges[1:]))
    # In the upper tail the difference of two numbers near 1 would lose everything.
    chance = np.where(low > 0, ndtr(-low) - ndtr(-high), ndtr(high) - ndtr(low))
    drawn, spread = _truncated_moments(low, high, chance)
    middle = (step.gain * velocity[..., None] + step.a * drawn) / place.step
    width = np.sqrt(step.b**2 + step.a**2 * spread) / place.step
    counted = chance > NEGLIGIBLE
    reach = math.ceil(np.max(np.where(counted, np.abs(middle) + 6 * width, 0))) + 1
    offsets = np.arange(-reach, reach + 1)[:, None, None, None]
    ramp = functools.partial(_ramp, width=width)
    falls = ramp(offsets + 1 - middle) - 2 * ramp(offsets - middle) + ramp(offsets - 1 - middle)
    kernel = np.einsum("djml,jml->ldj", np.maximum(falls, 0), np.where(counted, chance, 0))
    kernel /= kernel.sum(axis=(0, 1))
    used = np.flatnonzero(kernel.sum(axis=0).max(axis=1) > NEGLIGIBLE)
    needed = np.abs(used - reach).max()
    kernel = kernel[:, reach - needed : reach + needed + 1]
    return kernel / kernel.sum(axis=(0, 1))


def _truncated_moments(low: np.ndarray, high: np.ndarray, chance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance of a unit normal number between two bounds."""

    def density(x: np.ndarray) -> np.ndarray:
        return np.exp(-0.5 * x * x) / math.sqrt(2 * math.pi)

    safe = np.maximum(chance, 1e-30)
    lows, highs = (np.where(np.isfinite(x), x, 0) for x in (low, high))
    mean = (density(low) - density(high)) / safe
    variance = 1 + (lows * density(low) - highs * density(high)) / safe - mean**2
    likely = chance > NEGLIGIBLE
    return np.where(likely, mean, 0), np.where(likely, np.clip(variance, 0, 1), 0)


def _ramp(x: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Integral of the normal distribution function of this width; max(x, 0) where it has none."""
    scaled = x / np.maximum(width, 1e-12)
    bell = np.exp(-0.5 * np.minimum(scaled**2, 1400)) / math.sqrt(2 * math.pi)
    return np.where(width > 1e-9, x * ndtr(scaled) + width * bell, np.maximum(x, 0))


def _leaving(kernel: np.ndarray, count: int) -> Float[np.ndarray, "rate place"]:
    """Probability of ending off the grid from every cell."""
    reach = kernel.shape[1] // 2
    displaced = np.arange(count)[:, None] + np.arange(-reach, reach + 1)
    off = (displaced < 0) | (displaced >= count)
    return np.einsum("dj,id->ji", kernel.sum(axis=0), off)
