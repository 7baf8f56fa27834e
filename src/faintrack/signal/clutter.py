r"""Clutter tracker: what the power of a cell without a target will be, from what it was and what is around it.

In compound clutter the power of a cell is exponential (the speckle of many scatterers) with a mean level that differs
from cell to cell and changes slowly in time (stone2002, section 4.2). Given powers :math:`z_j` with the weights
:math:`w_j`, and an inverse gamma density with shape n and scale a of the level before, the density after is inverse
gamma again. Forgetting with a factor f before every scan lets the level drift:

.. math::
    n \leftarrow f n + \sum_j w_j, \qquad a \leftarrow f a + \sum_j w_j z_j .

The level is about a / n, known to a relative error of about :math:`1 / \sqrt{n}`. `faintrack.likelihoods.clutter` takes
n and a as they are and integrates the level out. A scan is judged by the scans before it and by neighbouring cells of
the same scan outside a guard, not by the cell itself: a target does not hide itself. One that stays in its cell does so
from the next scan on, unless `own` is 0 and neighbours alone tell.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from faintrack.sensors.cells import CellScan


class Level(eqx.Module):
    """Inverse gamma density of the mean level of every cell.

    Attributes
    ----------
    shape : n, about the number of powers that the level is known from; above 0.
    scale : a, about their sum; above 0.
    """

    shape: Float[Array, "..."]
    scale: Float[Array, "..."]


class ClutterScan(eqx.Module):
    """One frame with what is known about the clutter in it, or a stack of them.

    Attributes
    ----------
    time : seconds.
    values : power of every cell.
    level : of the clutter, known without the cell's own power.
    gain : what the level of a target counts in each cell, where others are part of the background; 1 where None.
    """

    time: Float[Array, "*frame"]
    values: Float[Array, "..."]
    level: Level
    gain: Float[Array, "..."] | None = None


class ClutterTracker(eqx.Module):
    """How the level is followed.

    Attributes
    ----------
    forget : f, from 0 to 1: how much a scan still counts in the next; about 1 / (1 - f) scans are remembered.
    own : weight of a cell's own power; at most 1.
    neighbour : weight of the power of a training cell, at most 1: how alike the levels of neighbours are.
    guard : cells on either side, along the last axis, that a target in the cell may reach.
    train : training cells on either side, beyond the guard.

    Examples
    --------
    >>> tracker = ClutterTracker(forget=0.5)
    >>> level, used = tracker.step(tracker.init(jnp.full(3, 2.0)), jnp.array([2.0, 40.0, 2.0]))
    >>> used.scale.tolist(), level.scale.tolist(), level.shape.tolist()
    ([1.0, 1.0, 1.0], [3.0, 41.0, 3.0], [1.5, 1.5, 1.5])
    """

    forget: float
    own: float = 1.0
    neighbour: float = 0.0
    guard: int = eqx.field(static=True, default=1)
    train: int = eqx.field(static=True, default=0)

    def init(self, level: Float[Array, "*cells"], shape: float = 1.0) -> Level:
        """Level before the first scan, known as if from `shape` powers with this mean."""
        return Level(jnp.full_like(level, shape), level * shape)

    def step(self, past: Level, power: Float[Array, "*cells"]) -> tuple[Level, Level]:
        """Take in one scan.

        Parameters
        ----------
        past : level after the scans before.
        power : of every cell of this scan.

        Returns
        -------
        Level after this scan; and the one to judge this scan by, which does not know a cell's own power.
        """
        used = Level(
            self.forget * past.shape + self.neighbour * self._around(jnp.ones_like(power)),
            self.forget * past.scale + self.neighbour * self._around(power),
        )
        return Level(used.shape + self.own, used.scale + self.own * power), used

    def run(self, level: Level, scans: CellScan) -> tuple[Level, ClutterScan]:
        """Level after a stack of scans, and the scans with the level to judge each by."""
        level, used = jax.lax.scan(self.step, level, scans.values)
        return level, ClutterScan(scans.time, scans.values, used)

    def _around(self, power: Float[Array, "*cells"]) -> Float[Array, "*cells"]:
        """Sum over the training cells of every cell, as far as there are such."""
        reach, count = self.guard + self.train, power.shape[-1]
        padded = jnp.pad(power, [(0, 0)] * (power.ndim - 1) + [(reach, reach)])
        starts = [*range(self.train), *range(reach + self.guard + 1, 2 * reach + 1)]
        return sum((padded[..., start : start + count] for start in starts), start=jnp.zeros_like(power))
