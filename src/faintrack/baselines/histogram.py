r"""Cells as a histogram of shots, some of them a target's.

Histogram PMHT (Streit 2001) takes what a cell holds, a power or an amplitude, as a number of shots: quanta that fell
into the cell, each from the noise or from the target. A target at x sends :math:`\mu` of them, spread about x by the
density g of its point spread, the noise :math:`\lambda` into every cell; Poisson's law gives cell i

.. math::
    n_i \sim \text{Poisson}(\lambda + \mu h_i(x)), \qquad
    h_i(x) = \int_i g(\tau - x)\, d\tau, \qquad
    \log \ell(n | x) = \sum_i n_i \log\left( 1 + \frac{\mu h_i(x)}{\lambda} \right) - \mu h_i(x) .

Given their number, shots fall into cells independently with shares as :math:`\lambda + \mu h_i`: Streit's multinomial,
whose mixing proportion of the target is :math:`\mu / (\mu + \lambda N)` with N cells. Numbers need not be whole, since
nothing but the mean of the parts is asked of them.

**The quantum** is what a shot is worth, :math:`n_i = z_i / h`. It decides how much is believed: with twice as many
shots a scan counts twice. Noise has Poisson's mean and variance where

.. math:: h = \frac{\operatorname{var} z}{\operatorname{E} z} \quad \text{under noise.}

Streit lets it go to nothing, and the noise of the motion with it, so that the balance of both becomes a free parameter.
Take amplitudes where there is a choice: for a constant amplitude in complex Gaussian noise the log ratio is nearly
linear in the amplitude (`faintrack.likelihoods.cells.swerling0`), as :math:`\log \ell(n | x)` is in n; of powers a
single strong cell of noise would count for too much.

**Expectation.** Which shots are the target's is hidden, and so is where in its cell each fell. Given x' they are

.. math::
    w_i = n_i \frac{\mu h_i(x')}{\lambda + \mu h_i(x')}, \qquad
    c_i = \frac{1}{h_i(x')} \int_i \tau\, g(\tau - x')\, d\tau

in number and in their mean place. Of a cell that was not measured (NaN), or lies outside the sensor, nothing is known,
and the target is expected to have sent what it sends, :math:`w_i = \mu h_i(x')`; a scan that measured nothing near the
target is left out, W = 0. With a Gaussian g of width w the
complete log likelihood of x is then, but for a constant, that of one measurement of the place,

.. math::
    \sum_i w_i \log g(c_i - x) = -\frac{W}{2 w^2} |z - x|^2 + \ldots, \qquad
    W = \sum_i w_i, \qquad z = \frac{1}{W} \sum_i w_i c_i .
"""

import functools
from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from faintrack.numerics.precision import full_precision
from faintrack.sensors.cells import Cells


class Histogram(eqx.Module):
    """Shots that noise and a target send into the cells of a sensor.

    Attributes
    ----------
    cells : of the sensor; all axes in the unit of `width`.
    background : shots of the noise in a cell and scan, mean; above 0.
    level : shots of a target in a scan, mean; those that miss the sensor included.
    width : standard deviation of the point spread.
    reach : cells on either side of a target, along every axis, that are looked at; those beyond tell nothing.

    Examples
    --------
    >>> from faintrack.beliefs.axis import Axis
    >>> histogram = Histogram(Cells((("range", Axis(0.0, 1.0, 20)),)), 4.0, 9.0, 0.8, reach=4)
    >>> counts = histogram.with_margin(jnp.full(20, 4.0).at[6:8].set(8.0))
    >>> shots, middle = histogram.attribute(counts, jnp.array([6.2]))
    >>> bool(middle[0] > 6.2)
    True
    >>> bool(histogram.log_ratio(counts, jnp.array([6.5])) > 0 > histogram.log_ratio(counts, jnp.array([12.0])))
    True
    """

    cells: Cells = eqx.field(static=True)
    background: Float[Array, ""] | float
    level: Float[Array, ""] | float
    width: Float[Array, ""] | float
    reach: int = eqx.field(static=True)

    def with_margin(self, counts: Float[Array, "*cells"]) -> Float[Array, "*wider"]:
        """Shots of every cell, with as many unmeasured cells around the sensor as a target reaches."""
        return jnp.pad(counts, self.reach, constant_values=jnp.nan)

    def log_ratio(self, counts: Float[Array, "*wider"], place: Float[Array, " axis"]) -> Float[Array, ""]:
        """Natural log of p(counts | target at the place) / p(counts | noise); of counts `with_margin`."""
        near, shares, _ = self._around(counts, place)
        expected = self.level * functools.reduce(jnp.multiply.outer, shares)
        return jnp.where(jnp.isnan(near), 0, near * jnp.log1p(expected / self.background) - expected).sum()

    @full_precision
    def attribute(
        self, counts: Float[Array, "*wider"], place: Float[Array, " axis"]
    ) -> tuple[Float[Array, ""], Float[Array, " axis"]]:
        """Expected number of shots of a target at the place, W, and their middle, z; of counts `with_margin`."""
        near, shares, leans = self._around(counts, place)
        rate = self.background + self.level * functools.reduce(jnp.multiply.outer, shares)
        # What cells hold beyond what is expected of them: the expected shots of a whole target lie about its place.
        beyond = jnp.where(jnp.isnan(near), 0, near / rate - 1)

        def total(vectors: Sequence[Array]) -> Array:
            return functools.reduce(jnp.matmul, reversed(vectors), beyond)

        shots = self.level * (1 + total(shares))
        away = [total([*shares[:axis], lean, *shares[axis + 1 :]]) for axis, lean in enumerate(leans)]
        measured = ~jnp.isnan(near).all()
        return jnp.where(measured, shots, 0), place + self.level * jnp.stack(away) / shots

    def table(self, counts: Float[Array, "*cells"]) -> Float[Array, "*cells"]:
        """Log ratio of a target in the middle of every cell; of counts without a margin."""
        dimensions, seen = counts.ndim, ~jnp.isnan(counts)
        offsets = jnp.arange(-self.reach, self.reach + 2) - 0.5
        along = [self._shares(axis.step * offsets)[0] for _, axis in self.cells.axes]
        expected = self.level * functools.reduce(jnp.multiply.outer, along)
        images = jnp.stack([jnp.where(seen, counts, 0), seen.astype(counts.dtype)])[None]
        kernels = jnp.stack([jnp.log1p(expected / self.background), -expected])[None].astype(counts.dtype)
        padding = [(self.reach, self.reach)] * dimensions
        return jax.lax.conv_general_dilated(images, kernels, (1,) * dimensions, padding, precision="highest")[0, 0]

    def _around(
        self, counts: Float[Array, "*wider"], place: Float[Array, " axis"]
    ) -> tuple[Float[Array, "..."], list[Array], list[Array]]:
        """Counts near a place; along every axis the share of a target's shots, and their offset from it times that."""
        axes = [axis for _, axis in self.cells.axes]
        size = 2 * self.reach + 1
        first = [jnp.clip(axis.nearest(place[number]), 0, axis.count - 1) for number, axis in enumerate(axes)]
        near = jax.lax.dynamic_slice(counts, first, (size,) * len(axes))
        along = []
        for number, axis in enumerate(axes):
            # The margin is as wide as the reach: what starts at its cell k has cell k of the sensor in the middle.
            edges = axis.first + axis.step * (first[number] + jnp.arange(-self.reach, self.reach + 2) - 0.5)
            along.append(self._shares(edges.astype(place.dtype) - place[number]))
        return near, [share for share, _ in along], [lean for _, lean in along]

    def _shares(self, edges: Float[Array, " edge"]) -> tuple[Float[Array, " cell"], Float[Array, " cell"]]:
        """Share of a target's shots between edges, and their mean offset times that; edges are offsets from it."""
        scaled = edges / self.width
        below = 0.5 * jax.scipy.special.erf(scaled / 2**0.5)
        density = jnp.exp(-0.5 * scaled**2) / (2 * jnp.pi) ** 0.5
        return jnp.diff(below), -self.width * jnp.diff(density)
