"""The mean of a likelihood ratio over the cells of a grid, from random states of every cell.

The plain way to the mean that `faintrack.likelihoods.guided` finds from the returns: as many states as are asked for
are drawn evenly in every cell, anew in every scan (aughenbaugh2010, section 5). It takes any likelihood. Where the
ratio has finer structure than the points of a cell are apart, it misses peaks. A likelihood by itself, read at the
states of a grid, is the same with the middle of each cell as its one point.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PRNGKeyArray

from faintrack.beliefs.grids import Grid
from faintrack.errors import InputError
from faintrack.likelihoods.protocols import Likelihood


class RandomPoints(eqx.Module):
    """Log of the mean ratio over random states of each cell.

    Attributes
    ----------
    likelihood : of a state.
    grid : cells.
    count : states in every cell.
    key : random key; every scan makes its own from it and its time.

    Raises
    ------
    InputError : less than one state.

    Examples
    --------
    >>> from faintrack.beliefs.axis import Axis
    >>> from faintrack.likelihoods.cells import CellLikelihood, gaussian
    >>> from faintrack.sensors.cells import Cells, CellScan
    >>> from faintrack.targets.states import RangeState
    >>> likelihood = CellLikelihood(Cells((("range", Axis(0.25, 0.5, 4)),)), gaussian, 2.0)
    >>> means = RandomPoints(likelihood, Grid(RangeState, (("range", Axis(0.5, 1.0, 2)),)), 1000, jax.random.key(0))
    >>> scan = CellScan(jnp.array(0.0), jnp.array([3.0, 0.0, 0.0, 0.0]))
    >>> [round(float(ratio), 1) for ratio in means.log_mean_ratio(scan)]  # log((e^4 + e^-2) / 2), -2
    [3.3, -2.0]
    """

    likelihood: Likelihood
    grid: Grid = eqx.field(static=True)
    count: int = eqx.field(static=True)
    key: PRNGKeyArray

    def __check_init__(self) -> None:
        if self.count < 1:
            raise InputError(f"random points: {self.count} in every cell; expected at least 1.")

    def log_mean_ratio(self, scan: Any) -> Float[Array, "*cells"]:
        """Log of the mean ratio of every cell.

        Parameters
        ----------
        scan : has a time, and what the likelihood reads.
        """
        grid, time = self.grid, jnp.asarray(scan.time, jnp.float32)
        key = jax.random.fold_in(self.key, jax.lax.bitcast_convert_type(time, jnp.uint32))

        def told(number: Int[Array, ""] | int) -> Float[Array, " cell"]:
            return self.likelihood.log_ratio(scan, grid.draw(jax.random.fold_in(key, number)))

        total = jax.lax.fori_loop(1, self.count, lambda number, total: jnp.logaddexp(total, told(number)), told(0))
        return (total - jnp.log(self.count)).reshape(grid.shape)
