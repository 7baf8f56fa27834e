"""Targets count only while the sensor can see them.

A state beyond the edge of an image has the log ratio 0: no cell speaks for or against it. Particles that drift out stay
there, believed in, until a departure that may be minutes away. Here such a state is as good as refuted. Grids end at
the edge and do not need this: `faintrack.filters.grid` takes what leaves for absent.
"""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from faintrack.sensors.cells import Cells

REFUTED = -100.0
"""Log ratio of a state out of sight; finite, so that a belief of such states alone still has weights."""


class Within(eqx.Module):
    """A likelihood for states in the cells of a sensor.

    Attributes
    ----------
    likelihood : of states in sight.
    cells : of the sensor.

    Examples
    --------
    >>> from faintrack.beliefs.axis import Axis
    >>> from faintrack.likelihoods.cells import CellLikelihood, gaussian
    >>> from faintrack.sensors.cells import CellScan
    >>> from faintrack.targets.states import RangeState
    >>> cells = Cells((("range", Axis(0.0, 1.0, 3)),))
    >>> likelihood = Within(CellLikelihood(cells, gaussian, 2.0), cells)
    >>> scan = CellScan(jnp.array(0.0), jnp.array([0.0, 3.0, 0.0]))
    >>> likelihood.log_ratio(scan, RangeState(jnp.array([1.0, 2.6]), jnp.zeros(2))).tolist()
    [4.0, -100.0]
    """

    likelihood: Any
    cells: Cells = eqx.field(static=True)

    def log_ratio(self, scan: Any, states: Any) -> Float[Array, "..."]:
        """Natural log of p(scan | target at state) / p(scan | no target), `REFUTED` out of sight."""
        return self.in_sight(states) + self.likelihood.log_ratio(scan, states)

    def in_sight(self, states: Any) -> Float[Array, "..."]:
        """What sight alone says of states, also of a target that is silent: 0, or `REFUTED` out of it."""
        return jnp.where(self.cells.nearest(states)[1], 0.0, REFUTED)

    def part(self, scan: Any, states: Any, log_weights: Float[Array, "*points"]) -> Any:
        """What a target puts into the background of a scan, as the likelihood has it."""
        return self.likelihood.part(scan, states, log_weights)

    def beside(self, scan: Any, parts: Any, existence: Float[Array, " target"]) -> Any:
        """Scan as the likelihood has it with other targets as part of its background."""
        return self.likelihood.beside(scan, parts, existence)

    def alike(self, scan: Any, states: Any, centres: Any) -> Bool[Array, "centre *points"]:
        """Whether targets are one to the sensor, as the likelihood has it."""
        return self.likelihood.alike(scan, states, centres)

    def simulate(self, scan: Any, states: Any, present: Bool[Array, ""] | bool, key: PRNGKeyArray) -> Any:
        """Scan as the likelihood draws it; a target out of sight leaves noise alone."""
        _, inside = self.cells.nearest(states)
        return self.likelihood.simulate(scan, states, present & inside, key)
