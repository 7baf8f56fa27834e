r"""Newborn particles drawn where a scan points.

The birth density b is cut into cells between the beams, between their rings where there are several, and between values
of the SNR. Cell c is drawn with probability

.. math:: \pi_c = \frac{\alpha}{n} + (1 - \alpha) \frac{\ell_c}{\sum_k \ell_k}

where :math:`\ell_c` is the mean ratio at the corners of the cell, n the number of cells, and :math:`\alpha` one half;
the state is uniform
within its cell. Its weight is :math:`1 / (n \pi_c)`, birth density over density of the draw, at most 2. The particles
so stand for
the birth density, as Monte Carlo integration with importance sampling does, and land where they can matter.
"""

import dataclasses
from typing import Protocol, runtime_checkable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.numerics.resampling import systematic
from faintrack.sensors.beams import BeamGrid, BeamScan
from faintrack.targets.states import Direction, WaveState
from faintrack.targets.target import UniformBirth

EVERYWHERE = 0.5
"""Share of the newborn that is drawn from the birth density as it is."""

SNR_CELLS = 20
"""Cells of the SNR between the ends of the birth density."""


@runtime_checkable
class Tabled(Protocol):
    """Likelihood whose ratio is a table over the bearings of a grid and any SNR."""

    @property
    def grid(self) -> BeamGrid:
        """Axes of the scans."""

    def table(self, scan: BeamScan, snr_db: Float[Array, " snr"]) -> Float[Array, "beam snr"]:
        """Log ratio at every beam of the grid and the given SNR; dB."""


def along_beams(
    likelihood: Tabled, scan: BeamScan, birth: UniformBirth, key: PRNGKeyArray, count: int
) -> tuple[Direction, Float[Array, " count"]]:
    """Draw states from a birth density over all bearings, more of them where a scan points.

    Parameters
    ----------
    likelihood : with a table of its ratio.
    scan : one frame.
    birth : uniform; its SNR has an upper and a lower end, its bearings are those of the grid.
    key : random key.
    count : how many to draw.

    Returns
    -------
    States, and the natural log of their weights, birth density over density of the draws.
    """
    grid = likelihood.grid
    if grid.elevations:
        return _along_rings(likelihood, scan, birth, key, count)
    snr_db = birth.low.snr_db + (birth.high.snr_db - birth.low.snr_db) * jnp.linspace(0, 1, SNR_CELLS + 1)
    table = likelihood.table(scan, snr_db)
    following = jnp.roll(table, -1, axis=0)
    pairs = jnp.logaddexp(table, following) if grid.circular else jnp.logaddexp(table[:-1], table[1:])
    cells = jnp.logaddexp(pairs[:, :-1], pairs[:, 1:])
    share = EVERYWHERE / cells.size + (1 - EVERYWHERE) * jax.nn.softmax(cells.ravel())
    for_cell, for_place, for_rest = jax.random.split(key, 3)
    chosen = systematic(for_cell, jnp.log(share), count, count)
    place = jax.random.uniform(for_place, (2, count), table.dtype)
    row, column = jnp.divmod(chosen, SNR_CELLS)
    first, spacing = float(grid.bearing[0]), float(grid.bearing[1] - grid.bearing[0])
    bearing = first + (row + place[0]) * spacing
    step_db = (birth.high.snr_db - birth.low.snr_db) / SNR_CELLS
    states = birth.sample(for_rest, count)
    drawn = dataclasses.replace(
        states, bearing=bearing.astype(table.dtype), snr_db=birth.low.snr_db + (column + place[1]) * step_db
    )
    return drawn, -jnp.log(share[chosen] * cells.size)


def _along_rings(
    likelihood: Tabled, scan: BeamScan, birth: UniformBirth, key: PRNGKeyArray, count: int
) -> tuple[WaveState, Float[Array, " count"]]:
    """As `along_beams`, over rings of beams: the birth density reaches from the second to the last but one."""
    grid = likelihood.grid
    step_db = (birth.high.snr_db - birth.low.snr_db) / SNR_CELLS
    snr_db = birth.low.snr_db + step_db * jnp.arange(SNR_CELLS + 1)
    table = likelihood.table(scan, snr_db).reshape(grid.rings, grid.beams, -1)[1:-1]
    pairs = jnp.logaddexp(table, jnp.roll(table, -1, axis=1))
    pairs = jnp.logaddexp(pairs[:-1], pairs[1:])
    cells = jnp.logaddexp(pairs[..., :-1], pairs[..., 1:])
    share = EVERYWHERE / cells.size + (1 - EVERYWHERE) * jax.nn.softmax(cells.ravel())
    for_cell, for_place, for_rest = jax.random.split(key, 3)
    chosen = systematic(for_cell, jnp.log(share), count, count)
    ring, row, column = jnp.unravel_index(chosen, cells.shape)
    place = jax.random.uniform(for_place, (3, count), table.dtype)
    bearing = float(grid.bearing[0]) + (row + place[0]) * float(grid.bearing[1] - grid.bearing[0])
    elevation = grid.elevations[1] + (ring + place[1]) * (grid.elevations[1] - grid.elevations[0])
    drawn = WaveState(
        bearing.astype(table.dtype),
        birth.sample(for_rest, count).bearing_rate,
        birth.low.snr_db + (column + place[2]) * step_db,
        elevation.astype(table.dtype),
    )
    return drawn, -jnp.log(share[chosen] * cells.size)
