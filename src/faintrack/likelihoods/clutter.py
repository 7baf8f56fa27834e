r"""Targets in compound clutter whose level is known in part.

The power of a cell is exponential; of its mean level an inverse gamma density with shape n and scale a is known, from a
`faintrack.signal.clutter.ClutterTracker`. A target multiplies the mean by 1 + s. With the level integrated out

.. math::
    p(z \mid s) = \int_0^\infty \frac{e^{-z / ((1 + s) L)}}{(1 + s) L}\, \frac{a^n}{\Gamma(n)} L^{-n-1} e^{-a/L}\, dL
    = \frac{n a^n}{1 + s} \left(a + \frac{z}{1 + s}\right)^{-n-1},

Lomax's density, and the ratio to the same at s = 0 is

.. math::
    \log \ell = -\log(1 + s) + (n + 1) \left[\log\left(1 + \frac{z}{a}\right)
        - \log\left(1 + \frac{z}{a (1 + s)}\right)\right].

For n to infinity it is `faintrack.likelihoods.cells.swerling1` at z over the level a / n; the less is known, the less a
strong echo tells: never more than :math:`n \log(1 + s)`. Source of the problem: stone2002, section 4.2.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from faintrack.likelihoods.cell_field import alike, on_places, powers, with_gain
from faintrack.sensors.cells import Cells
from faintrack.signal.clutter import ClutterScan, Level


def lomax(power: Float[Array, "..."], level: Level, ratio: Float[Array, "..."] | float) -> Float[Array, "..."]:
    """Log likelihood ratio of a cell: the module's equation.

    Parameters
    ----------
    power : of the cell.
    level : of the clutter, known without this power; in the same unit.
    ratio : s, mean power of the target over mean power of the clutter, at least 0; linear.

    Returns
    -------
    Natural log of p(power | target) / p(power | clutter). Check: the mean of exp(log ratio) under clutter is 1.

    Examples
    --------
    >>> known_well = Level(jnp.array(1e6), jnp.array(2e6))  # level 2: the value of `swerling1` at power 4, snr 1
    >>> round(float(lomax(jnp.array(8.0), known_well, 1.0)), 3)
    1.307
    >>> known_badly = Level(jnp.array(4.0), jnp.array(8.0))
    >>> round(float(lomax(jnp.array(8.0), known_badly, 1.0)), 3)
    0.745
    """
    relative = power / level.scale
    return (level.shape + 1) * (jnp.log1p(relative) - jnp.log1p(relative / (1 + ratio))) - jnp.log1p(ratio)


def to_clutter(level: Level, target: Float[Array, ""] | float) -> Float[Array, ""] | float:
    """Target of given power over the clutter's, the same in every cell."""
    return target


def absolute(level: Level, target: Float[Array, ""] | float) -> Float[Array, "..."]:
    """Target of given power, over the level that is expected: s = P n / a.

    The scale of the unknown level is then still integrated out as a common factor of target and clutter, which keeps
    the mean ratio at 1.
    """
    return target * level.shape / level.scale


class ClutterLikelihood(eqx.Module):
    """Log ratio of a target in one cell of compound clutter.

    Attributes
    ----------
    cells : of the scans, with axes named after components of the state.
    target : its strength, as `measure` reads it; linear.
    measure : `to_clutter` or `absolute`.

    Examples
    --------
    >>> from faintrack.beliefs.axis import Axis
    >>> from faintrack.targets.states import RangeState
    >>> likelihood = ClutterLikelihood(Cells((("range", Axis(0.0, 1.0, 3)),)), 1.0)
    >>> level = Level(jnp.full(3, 4.0), jnp.full(3, 8.0))
    >>> scan = ClutterScan(jnp.array(0.0), jnp.array([0.0, 8.0, 0.0]), level)
    >>> ratio = likelihood.log_ratio(scan, RangeState(jnp.array([1.2, 9.0]), jnp.zeros(2)))
    >>> [round(float(each), 3) for each in ratio]
    [0.745, 0.0]
    """

    cells: Cells = eqx.field(static=True)
    target: Float[Array, ""] | float
    measure: Callable = eqx.field(static=True, default=to_clutter)

    def table(self, scan: ClutterScan) -> Float[Array, "*cells"]:
        """Log ratio of a target in every cell; 0 where the value is missing, which is not a number."""
        target = self.measure(scan.level, self.target)
        ratio = lomax(scan.values, scan.level, target if scan.gain is None else target * scan.gain)
        return jnp.where(jnp.isnan(scan.values), 0, ratio)

    def part(self, scan: ClutterScan, states: Any, log_weights: Float[Array, "*points"]) -> Float[Array, "*cells"]:
        """Probability of a target to be in every cell."""
        return on_places(self.cells, states, log_weights)

    def beside(
        self, scan: ClutterScan, parts: Float[Array, "target *cells"], existence: Float[Array, " target"]
    ) -> ClutterScan:
        """Frame with other targets as part of its background: they raise the level of their cells."""
        mean = jnp.tensordot(existence, parts, axes=1) * self.measure(scan.level, self.target)
        return with_gain(scan, *powers(scan.values, mean, mean))

    def alike(self, scan: ClutterScan, states: Any, centres: Any) -> Bool[Array, "centre *points"]:
        """Whether targets lie in the same cell or next to each other."""
        return alike(self.cells, 0, states, centres)

    @eqx.filter_jit
    def log_ratio(self, scan: ClutterScan, states: object) -> Float[Array, "..."]:
        """Natural log of p(scan | target at state) / p(scan | no target); 0 for a state outside all cells."""
        place, inside = self.cells.nearest(states)
        return jnp.where(inside, self.table(scan)[place], 0)

    def simulate(
        self, scan: ClutterScan, states: object, present: Bool[Array, ""] | bool, key: PRNGKeyArray
    ) -> ClutterScan:
        """Frame whose mean levels are drawn from what is known of them, with a target in one cell or without."""
        for_level, for_speckle = jax.random.split(key)
        known, dtype = scan.level, scan.values.dtype
        level = known.scale / jax.random.gamma(for_level, known.shape, scan.values.shape, dtype)
        place, inside = self.cells.nearest(states)
        target = jnp.broadcast_to(jnp.asarray(self.measure(known, self.target), dtype), level.shape)
        ratio = jnp.zeros_like(level).at[place].set(jnp.where(inside & present, target[place], 0))
        values = (1 + ratio) * level * jax.random.exponential(for_speckle, level.shape, dtype)
        return dataclasses.replace(scan, values=values)
