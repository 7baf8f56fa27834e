"""Motion on a grid by particles from every cell: draw, move, count.

As many particles are drawn evenly in every cell, moved by the motion model, and their weight is added to the cell that
they end in (aughenbaugh2010, section 3). It takes any motion that can be drawn from, and costs as many draws as cells
times particles in every scan; `faintrack.filters.separable` gives the mean of it, exactly and thousands of times
cheaper, where the motion allows.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PRNGKeyArray

from faintrack.beliefs.components import rates
from faintrack.beliefs.grids import Grid
from faintrack.filters.grid import Advance, in_steps
from faintrack.targets.target import Motion


class CellParticles(eqx.Module):
    """Particles from every cell.

    Attributes
    ----------
    grid : cells.
    motion : has `move(states, interval, key)`.
    interval : of one step; seconds.
    count : particles a cell.
    """

    grid: Grid = eqx.field(static=True)
    motion: Motion
    interval: float = eqx.field(static=True)
    count: int = eqx.field(static=True, default=10)

    def carry(
        self, log_weights: Float[Array, "*cells"], start: Any, end: Any, key: PRNGKeyArray
    ) -> tuple[Float[Array, "*cells"], Float[Array, ""]]:
        """Weights at `end` and what has left the grid. Rates beyond the grid are held in its last cell."""
        return in_steps(self.advances(key), log_weights, start, end, self.interval)

    def advances(self, key: PRNGKeyArray) -> list[Advance]:
        """Function of (weights, number) to weights after a step and what has left."""
        return [lambda weights, number: self._advance(weights, jax.random.fold_in(key, number))]

    def _advance(self, weights: Float[Array, "*cells"], key: PRNGKeyArray) -> tuple[Array, Array]:
        each = (weights / self.count).ravel()

        def drop(number: Array, counted: Array) -> Array:
            """Add what one particle of every cell carries; behind the cells, what has left them."""
            landing = self._landing(jax.random.fold_in(key, number), weights.dtype)
            return counted.at[landing].add(each)

        counted = jax.lax.fori_loop(0, self.count, drop, jnp.zeros(weights.size + 1, weights.dtype))
        return counted[:-1].reshape(weights.shape), counted[-1]

    def _landing(self, key: PRNGKeyArray, dtype: Any) -> Int[Array, " cell"]:
        """Number of the cell that one particle of every cell ends in; the number of cells where it has left."""
        for_place, for_motion = jax.random.split(key)
        grid = self.grid
        moved = self.motion.move(grid.draw(for_place, dtype), self.interval, for_motion)
        speeds = set(rates(grid.kind).values())
        landing, inside = jnp.zeros(grid.size, jnp.int32), jnp.ones(grid.size, bool)
        for name, axis in grid.axes:
            index = axis.nearest(getattr(moved, name))
            if name not in speeds:
                inside &= (index >= 0) & (index < axis.count)
            landing = landing * axis.count + jnp.clip(index, 0, axis.count - 1)
        return jnp.where(inside, landing, grid.size)
