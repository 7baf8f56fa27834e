r"""A target whose level is one of several, nobody knows which: the mean of their ratios.

.. math:: \ell(z | x) = \frac{1}{K} \sum_{k=1}^K \ell(z | x, u_k)

A mean of likelihood ratios is a likelihood ratio, that of a target whose level is drawn anew in every scan. It keeps
the level out of the state, which saves a dimension; the price is what a level that lasts would have told, at most
log K a scan. Where the level changes slowly and frames are many, make it a component of the state instead.
"""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from faintrack.errors import InputError
from faintrack.likelihoods.cells import CellLikelihood
from faintrack.sensors.cells import CellScan


class UnknownLevel(eqx.Module):
    """Mean over likelihoods that differ in the target's level.

    Attributes
    ----------
    parts : likelihoods of the same cells, with the same spread and reach; equally probable.

    Raises
    ------
    InputError : no likelihood, or likelihoods of different cells.

    Examples
    --------
    >>> from faintrack.beliefs.axis import Axis
    >>> from faintrack.likelihoods.cells import gaussian
    >>> from faintrack.sensors.cells import Cells
    >>> from faintrack.targets.states import RangeState
    >>> cells = Cells((("range", Axis(0.0, 1.0, 3)),))
    >>> likelihood = UnknownLevel(tuple(CellLikelihood(cells, gaussian, level) for level in (1.0, 3.0)))
    >>> scan = CellScan(jnp.array(0.0), jnp.array([0.0, 3.0, 0.0]))
    >>> round(float(likelihood.log_ratio(scan, RangeState(jnp.array(1.0), jnp.array(0.0)))), 4)
    3.9338
    """

    parts: tuple[CellLikelihood, ...]

    def __check_init__(self) -> None:
        if not self.parts:
            raise InputError("unknown level: there is no likelihood; expected one for every level.")
        if len({part.places for part in self.parts}) > 1:
            raise InputError("unknown level: the likelihoods have different places; expected the same cells and reach.")

    def table(self, scan: CellScan) -> Float[Array, "..."]:
        """Log ratio at every one of the places of the parts: the module's equation."""
        return jax.nn.logsumexp(jnp.stack([part.table(scan) for part in self.parts]), axis=0) - jnp.log(len(self.parts))

    def around(self, scan: CellScan, states: Any) -> Float[Array, "level *points"]:
        """Log ratio of each level, from the cells around each state."""
        levels = jnp.stack([jnp.asarray(part.level, scan.values.dtype) for part in self.parts])
        return jax.vmap(lambda level: dataclasses.replace(self.parts[0], level=level).around(scan, states))(levels)

    def part(
        self, scan: CellScan, states: Any, log_weights: Float[Array, "*points"]
    ) -> tuple[Float[Array, "*cells"], Float[Array, "*cells"]]:
        r"""Mean of what a target puts into every cell and mean square, of the level that the frame says it has.

        Notes
        -----
        The levels are weighed by :math:`\sum_i w_i \ell(z | x_i, u_k)`, of which their mean and mean square are taken
        (`faintrack.likelihoods.cell_field`).
        """
        first = self.parts[0]
        levels = jnp.stack([jnp.asarray(part.level, scan.values.dtype) for part in self.parts])
        if first.few(states):
            ratios = self.around(scan, states)
        else:
            place, inside = first.places.nearest(states)
            tables = [jax.lax.optimization_barrier(part.table(scan)) for part in self.parts]
            ratios = jnp.stack([jnp.where(inside, table[place], 0) for table in tables])
        chance = jax.nn.softmax(jax.nn.logsumexp(log_weights + ratios, axis=tuple(range(1, ratios.ndim))))
        mean, square = first.shared(states, log_weights)
        return (chance @ levels) * mean, (chance @ levels**2) * square

    def beside(
        self,
        scan: CellScan,
        parts: tuple[Float[Array, "target *cells"], Float[Array, "target *cells"]],
        existence: Float[Array, " target"],
    ) -> CellScan:
        """Frame with other targets as part of its background."""
        return self.parts[0].beside(scan, parts, existence)

    def alike(self, scan: CellScan, states: Any, centres: Any) -> Bool[Array, "centre *points"]:
        """Whether targets reach the same cells."""
        return self.parts[0].alike(scan, states, centres)

    def log_ratio(self, scan: CellScan, states: Any) -> Float[Array, "*points"]:
        """Natural log of p(scan | target at state) / p(scan | no target); 0 for a state that reaches no cell."""
        if self.parts[0].few(states):
            return jax.nn.logsumexp(self.around(scan, states), axis=0) - jnp.log(len(self.parts))
        place, inside = self.parts[0].places.nearest(states)
        return jnp.where(inside, jax.lax.optimization_barrier(self.table(scan))[place], 0)

    def simulate(self, scan: CellScan, states: Any, present: Bool[Array, ""] | bool, key: PRNGKeyArray) -> CellScan:
        """Frame with a target of one of the levels, drawn anew; see `CellLikelihood.simulate`."""
        for_level, for_values = jax.random.split(key)
        number = jax.random.randint(for_level, (), 0, len(self.parts))
        draws = [lambda key, part=part: part.simulate(scan, states, present, key) for part in self.parts]
        return jax.lax.switch(number, draws, for_values)
