r"""Means over the cells of a grid that has an axis for the target's SNR.

Where it is not known how loud a target is, its SNR becomes a component of the state that does not move: the grid has an
axis `snr_db`, every level of it is a target with that SNR, and the recursion weighs them by what they explain. The SNR
is so estimated together with everything else, and marginalised where it does not matter. The cost is that of as many
grids as there are levels.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from faintrack.beliefs.grids import Grid
from faintrack.errors import InputError
from faintrack.likelihoods.exceedances import ExceedanceLikelihood
from faintrack.likelihoods.guided import Guided
from faintrack.sensors.active import ActiveSonar, Ping


class GuidedSnr(eqx.Module):
    """Log of the mean ratio of every cell, from samples near the returns, for every SNR of the grid.

    Attributes
    ----------
    levels : `faintrack.likelihoods.guided.Guided` of every SNR, stacked.
    grid : with the axis `snr_db`, and those that the sonar needs.

    Raises
    ------
    InputError : a grid without the axis `snr_db`.
    """

    levels: Guided
    grid: Grid = eqx.field(static=True)

    def __init__(self, sonar: ActiveSonar, threshold: float, grid: Grid, **more: Any) -> None:
        axis = dict(grid.axes).get("snr_db")
        if axis is None:
            raise InputError(f"unknown SNR: the grid has the axes {', '.join(grid.names)}; expected snr_db among them.")
        each = [
            Guided(ExceedanceLikelihood(sonar, 10.0 ** (level / 10), threshold), grid, **more) for level in axis.values
        ]
        self.levels = jax.tree.map(lambda *leaves: jnp.stack(leaves), *each)
        self.grid = grid

    def log_mean_ratio(self, ping: Ping) -> Float[Array, "..."]:
        """Log of the mean ratio of every cell, shape of the grid, 1 along axes that do not matter.

        Parameters
        ----------
        ping : returns of one ping.
        """
        place = self.grid.names.index("snr_db")
        means = eqx.filter_vmap(lambda level: level.log_mean_ratio(ping))(self.levels)
        return jnp.moveaxis(means.squeeze(place + 1), 0, place)
