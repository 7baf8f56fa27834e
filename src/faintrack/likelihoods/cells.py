r"""Targets in cells: pixels of an image, ranges of a profile, cells of a range-Doppler matrix.

Cells are independent given the target, so the ratio of a scan is a product over the few cells that a target reaches;
those that it does not reach cancel. With :math:`z_i` the value of cell i and :math:`h_i` the share of the target's
level that arrives there

.. math::
    \log \ell(z | x) = \sum_i \log \frac{p(z_i \mid \text{level } u\, h_i(x))}{p(z_i \mid \text{level } 0)} .

Where the cells of a scan are not independent of each other and of the scans before, a logarithm counts by the share
that is (`faintrack.signal.independence`), and the mean ratio without a target is at most 1.

Two functions make a likelihood. The *amplitude* says what a level does to the value of a cell: `gaussian`, `swerling1`,
`swerling0`, `rayleigh`. The *spread* says which share of the level a cell at some offset from the target gets: all of
it and nothing elsewhere (`point`), `spill_over`, `gaussian_spread`. Shares multiply the level of the amplitude model,
whatever it is: a mean amplitude for `gaussian`, a power for the others. Where an amplitude spreads with a share h, its
power spreads with h squared.

With spread, `swerling1` lets the power fluctuate in every cell by itself.
"""

import dataclasses
import functools
import itertools
import math
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from faintrack.beliefs.axis import Axis
from faintrack.errors import InputError
from faintrack.likelihoods.cell_field import (
    Rule,
    added,
    alike,
    envelopes,
    means,
    powers,
    reached,
    shared,
    with_gain,
)
from faintrack.likelihoods.cell_values import Draw, gaussian_value, rayleigh_value, swerling0_value, swerling1_value
from faintrack.sensors.cells import Cells, CellScan

Amplitude = Callable[[Array, Array], Array]
"""Function of (value, level), elementwise, to the log ratio of a cell; 0 where the level is 0."""

Spread = Callable[..., np.ndarray]
"""Function of the offsets from the target to the middle of a cell, one an axis, in cells, to the share of the level."""

FEW = 4
"""Places for each state from which no table of them is made."""

SAME = 12
"""Decimals in which two shares must agree to be taken as one."""


def gaussian(value: Float[Array, "..."], level: Float[Array, "..."] | float) -> Float[Array, "..."]:
    r"""Log likelihood ratio of a cell with Gaussian noise of variance 1, whose mean the target raises.

    Parameters
    ----------
    value : amplitude over the standard deviation of the noise.
    level : mean amplitude under the target, in the same unit.

    Returns
    -------
    Natural log of p(value | target) / p(value | noise).

    Notes
    -----
    .. math:: \log \ell(y) = r y - r^2 / 2

    with y the value and r the level. It is Gaussian itself: mean :math:`\pm r^2 / 2` under target and noise, variance
    :math:`r^2`. Source: stone2002, section 3.3; with spill-over eq. 32.
    Check: the mean of exp(log ratio) under noise is 1.

    Examples
    --------
    >>> float(gaussian(jnp.array(3.0), 2.0))
    4.0
    """
    return level * value - level * level / 2


def swerling1(power: Float[Array, "..."], snr: Float[Array, "..."] | float) -> Float[Array, "..."]:
    r"""Log likelihood ratio of a cell for a Rayleigh-fluctuating target.

    The power of the cell is exponential, with mean 1 under noise and 1 + snr under a target.

    Parameters
    ----------
    power : cell power over mean noise power; linear.
    snr : mean target power over mean noise power in this cell, at least 0; linear.

    Returns
    -------
    Natural log of p(power | target) / p(power | noise).

    Notes
    -----
    .. math:: \log \ell(z) = \frac{s z}{1 + s} - \log(1 + s)

    with z the power and s the snr. Source: stone2002, eq. 37, in power instead of amplitude.
    Check: the mean of exp(log ratio) under noise is 1.

    Examples
    --------
    >>> round(float(swerling1(jnp.array(4.0), jnp.array(1.0))), 4)
    1.3069
    """
    return snr / (1 + snr) * power - jnp.log1p(snr)


def swerling0(power: Float[Array, "..."], snr: Float[Array, "..."] | float) -> Float[Array, "..."]:
    r"""Log likelihood ratio of a cell for a target that does not fluctuate, with unknown phase.

    A constant amplitude in complex Gaussian noise: the amplitude of the cell has Rice's distribution. Parameters and
    result as in `swerling1`.

    Notes
    -----
    .. math:: \log \ell(z) = -s + \log I_0(2 \sqrt{s z})

    with z the power, s the snr, and :math:`I_0` the modified Bessel function.
    Check: the mean of exp(log ratio) under noise is 1.

    Examples
    --------
    >>> round(float(swerling0(jnp.array(4.0), jnp.array(1.0))), 4)
    1.425
    """
    argument = 2 * jnp.sqrt(snr * power)
    return argument - snr + jnp.log(jax.scipy.special.i0e(argument))


def rayleigh(envelope: Float[Array, "..."], snr: Float[Array, "..."] | float) -> Float[Array, "..."]:
    r"""`swerling1` for the envelope: y has Rayleigh's distribution, and y^2 / 2 is the power.

    Notes
    -----
    .. math:: \log \ell(y) = \frac{\lambda y^2}{2 (1 + \lambda)} - \log(1 + \lambda)

    with y the envelope, whose square has the mean 2 under noise, and :math:`\lambda` the snr. Source: stone2002,
    eq. 37. What that paper calls signal to noise ratio is the divergence :math:`\lambda^2 / (1 + \lambda)`.

    Examples
    --------
    >>> round(float(rayleigh(jnp.array(8.0**0.5), 1.0)), 4)
    1.3069
    """
    return swerling1(envelope * envelope / 2, snr)


VALUES: dict[Amplitude, Draw] = {
    gaussian: gaussian_value,
    swerling1: swerling1_value,
    swerling0: swerling0_value,
    rayleigh: rayleigh_value,
}
"""What draws the values that an amplitude model is the ratio of; a model may also have a method `draw`."""

RULES: dict[Amplitude, Rule] = {gaussian: means, swerling1: powers, swerling0: powers, rayleigh: envelopes}
"""How what several targets put into a cell adds; a model may also have a method `rule`."""


def point(*offsets: np.ndarray) -> np.ndarray:
    """Spread of a target that is all in one cell; for `reach` 0."""
    return np.ones(())


@functools.cache
def spill_over(*shares: float) -> Spread:
    """Spread with given shares in the first, second, ... cell from the target along each axis.

    Between the middles of cells, and beyond the last share, straight lines to the next, at last to 0. On several axes
    the shares multiply.

    Examples
    --------
    >>> spill_over(0.5)(np.arange(-2, 3)).tolist()  # stone2002, eq. 32
    [0.0, 0.5, 1.0, 0.5, 0.0]
    """
    heights = (1.0, *shares, 0.0)

    def spread(*offsets: np.ndarray) -> np.ndarray:
        along = [np.interp(np.abs(offset), np.arange(len(heights)), heights) for offset in offsets]
        return functools.reduce(np.multiply, along)

    return spread


@functools.cache
def gaussian_spread(width: float) -> Spread:
    r"""Spread of an optical point, :math:`h = e^{-r^2 / (2 w^2)}` at the distance r from the target.

    Parameters
    ----------
    width : w; cells. For power, that of the amplitude over the square root of 2.

    Raises
    ------
    InputError : a width that is not above 0.

    Examples
    --------
    >>> gaussian_spread(1.0)(np.array([0.0, 1.0]), np.array([0.0, 1.0])).round(4).tolist()
    [1.0, 0.3679]
    """
    if not width > 0:
        raise InputError(f"gaussian_spread: width is {width:g}; expected above 0.")

    def spread(*offsets: np.ndarray) -> np.ndarray:
        return np.exp(-sum(np.square(offset) for offset in offsets) / (2 * width**2))

    return spread


class CellLikelihood(eqx.Module):
    """Log ratio of a target of known level in independent cells.

    Attributes
    ----------
    cells : of the scans, with axes named after components of the state.
    amplitude : what a level does to the value of a cell.
    level : of the target at its peak; one number, or one a cell of the sensor where that hears unevenly.
    spread : share of the level in the cells around the target.
    reach : how many cells from its own, along every axis, a target is looked for; there the spread is cut off.
    oversample : positions within a cell that are told apart, along every axis; the middle is one of an odd number.

    Raises
    ------
    InputError : `reach` is below 0, or `oversample` below 1.

    Examples
    --------
    Gaussian cells with spill-over, u = 2 (stone2002, eq. 32):

    >>> from faintrack.targets.states import RangeState
    >>> cells = Cells((("range", Axis(1.0, 1.0, 100)),))
    >>> likelihood = CellLikelihood(cells, gaussian, 2.0, spill_over(0.5), reach=1)
    >>> scan = CellScan(jnp.array(0.0), jnp.zeros(100).at[30].set(2.0))
    >>> likelihood.log_ratio(scan, RangeState(jnp.array([30.0, 31.0, 40.0, 200.0]), jnp.zeros(4))).tolist()
    [-1.0, 1.0, -3.0, 0.0]
    """

    cells: Cells = eqx.field(static=True)
    amplitude: Amplitude = eqx.field(static=True)
    level: Float[Array, "*cells"] | float
    spread: Spread = eqx.field(static=True, default=point)
    reach: int = eqx.field(static=True, default=0)
    oversample: int = eqx.field(static=True, default=1)

    def __check_init__(self) -> None:
        if self.reach < 0 or self.oversample < 1:
            raise InputError(
                f"cell likelihood: reach is {self.reach} and oversample {self.oversample}; "
                "expected at least 0, and at least 1."
            )

    @property
    def places(self) -> Cells:
        """Where a target can lie: positions within the cells, and in as many cells around the sensor as it reaches."""

        def finer(axis: Axis) -> Axis:
            step = axis.step / self.oversample
            first = axis.first - self.reach * axis.step - (self.oversample - 1) / 2 * step
            return Axis(first, step, (axis.count + 2 * self.reach) * self.oversample)

        return Cells(tuple((name, finer(axis)) for name, axis in self.cells.axes))

    @property
    def shares(self) -> Float[np.ndarray, "..."]:
        """Share of the level around a target: first by its position within a cell, an axis each, then by cell.

        The shape is (oversample, oversample, ..., 2 reach + 1, 2 reach + 1, ...).
        """
        dimensions = len(self.cells.axes)
        within = (np.arange(self.oversample) - (self.oversample - 1) / 2) / self.oversample
        offset = np.arange(-self.reach, self.reach + 1) - within[:, None]
        offsets = [
            np.expand_dims(offset, [other for other in range(2 * dimensions) if other % dimensions != axis])
            for axis in range(dimensions)
        ]
        shape = (self.oversample,) * dimensions + (2 * self.reach + 1,) * dimensions
        return np.broadcast_to(self.spread(*offsets), shape)

    def levels(self, state: object) -> Float[Array, "*cells"]:
        """Level in every cell of a target at one state, whose components are scalars."""
        dimensions = len(self.cells.axes)
        place, inside = self.places.nearest(state)
        position = tuple(each % self.oversample for each in place)
        away = []
        for axis, (each, count) in enumerate(zip(place, self.cells.shape, strict=True)):
            # Cells from -reach are counted from 0, in `places` as in `shares`.
            number = jnp.arange(count) - each // self.oversample + 2 * self.reach
            away.append(jnp.expand_dims(number, [other for other in range(dimensions) if other != axis]))
        reached = functools.reduce(jnp.logical_and, [(each >= 0) & (each <= 2 * self.reach) for each in away])
        near = tuple(jnp.clip(each, 0, 2 * self.reach) for each in away)
        return jnp.where(inside & reached, jnp.asarray(self.shares)[position + near], 0) * self.level

    @property
    def draw(self) -> Draw:
        """Draws the value of every cell, from a key and the levels.

        Raises
        ------
        InputError : nothing is known about how to draw values of the amplitude model.
        """
        draw = getattr(self.amplitude, "draw", VALUES.get(self.amplitude))
        if draw is None:
            name = getattr(self.amplitude, "__name__", self.amplitude)
            known = ", ".join(amplitude.__name__ for amplitude in VALUES)
            raise InputError(f"amplitude {name}: there is no simulation of it; expected one of {known}.")
        return draw

    def simulate(self, scan: CellScan, states: object, present: Bool[Array, ""] | bool, key: PRNGKeyArray) -> CellScan:
        """Frame drawn from the module's model; cells without a value (NaN) stay so.

        Parameters
        ----------
        scan : frame whose values are drawn anew.
        states : of a target; scalars. It counts as lying at the nearest of `places`.
        present : whether it is there.
        key : random key.
        """
        values = self.draw(key, jnp.where(present, self.levels(states), 0).astype(scan.values.dtype))
        return dataclasses.replace(scan, values=jnp.where(jnp.isnan(scan.values), jnp.nan, values))

    def table(self, scan: CellScan) -> Float[Array, "..."]:
        """Log ratio at every one of the `places`; a cell whose value is not a number (NaN) says nothing."""
        reach, dimensions, dtype = self.reach, len(self.cells.axes), scan.values.dtype
        shares = self.shares
        _, first, kind = np.unique(shares.round(SAME), return_index=True, return_inverse=True)
        kind = kind.reshape(shares.shape)
        # Values are padded and silenced, not ratios: XLA works a Bessel function out slowly within a pad or a select.
        missing = jnp.isnan(scan.values)
        values = jnp.pad(jnp.where(missing, 0, scan.values), 2 * reach)
        counted = (~missing).astype(dtype)
        heard = jnp.pad(counted if scan.independent is None else counted * scan.independent, 2 * reach)
        level = jnp.asarray(self.level, dtype)
        if scan.gain is not None:
            level = level * scan.gain
        level = jnp.pad(level, 2 * reach) if level.ndim else level
        # One logarithm or Bessel function a cell and kind of share; a position then adds what lies around it.
        share = jnp.asarray(shares.ravel()[first], dtype).reshape(-1, *(1,) * dimensions)
        told = jax.lax.optimization_barrier(heard * self.amplitude(values, level * share))
        shape = tuple(count + 2 * reach for count in self.cells.shape)

        def around(position: tuple[int, ...]) -> Array:
            total = jnp.zeros(shape, dtype)
            for start in itertools.product(range(2 * reach + 1), repeat=dimensions):
                window = tuple(slice(first, first + count) for first, count in zip(start, shape, strict=True))
                total = total + told[kind[position + start]][window]
            return total

        positions = list(itertools.product(range(self.oversample), repeat=dimensions))
        parts = jnp.stack([around(position) for position in positions])
        parts = parts.reshape((self.oversample,) * dimensions + shape)
        order = [axis for pair in range(dimensions) for axis in (dimensions + pair, pair)]
        return parts.transpose(order).reshape(self.places.shape)

    def few(self, states: Any) -> bool:
        """Whether states are so few that the cells around each are read sooner than a table of all places is made."""
        shapes = [jnp.shape(getattr(states, name)) for name, _ in self.cells.axes]
        return FEW * math.prod(np.broadcast_shapes(*shapes)) < self.places.size

    def around(self, scan: CellScan, states: Any) -> Float[Array, "*points"]:
        """As `log_ratio`, from the cells around each state."""
        dtype = scan.values.dtype
        shares = jnp.asarray(self.shares, dtype)
        cell, share, inside = reached(self.places, shares, self.reach, self.oversample, states)
        values, level = scan.values[cell], jnp.asarray(self.level, dtype)
        heard = inside & ~jnp.isnan(values)
        level = level[cell] if level.ndim else level
        if scan.gain is not None:
            level = level * scan.gain[cell]
        told = self.amplitude(jnp.where(heard, values, 0), level * share)
        if scan.independent is not None:
            told = scan.independent[cell] * told
        return jnp.sum(jnp.where(heard, told, 0), axis=0)

    def part(
        self, scan: CellScan, states: Any, log_weights: Float[Array, "*points"]
    ) -> tuple[Float[Array, "*cells"], Float[Array, "*cells"]]:
        """Mean of what a target puts into every cell and mean square, see `faintrack.likelihoods.cell_field`.

        Raises
        ------
        InputError : the level is not the same for all cells.
        """
        if jnp.ndim(self.level):
            raise InputError("cell likelihood: targets beside others need a level that is the same for all cells.")
        mean, square = self.shared(states, log_weights)
        return self.level * mean, self.level**2 * square

    def shared(
        self, states: Any, log_weights: Float[Array, "*points"]
    ) -> tuple[Float[Array, "*cells"], Float[Array, "*cells"]]:
        """As `part`, of a target of the level 1."""
        geometry = self.places, self.shares, self.reach, self.oversample
        return shared(*geometry, states, log_weights, self.few(states))

    def beside(
        self,
        scan: CellScan,
        parts: tuple[Float[Array, "target *cells"], Float[Array, "target *cells"]],
        existence: Float[Array, " target"],
    ) -> CellScan:
        """Frame with other targets as part of its background, see `faintrack.likelihoods.cell_field`.

        Raises
        ------
        InputError : nothing is known of how such values add.
        """
        rule = getattr(self.amplitude, "rule", RULES.get(self.amplitude))
        if rule is None:
            name = getattr(self.amplitude, "__name__", self.amplitude)
            raise InputError(f"amplitude {name}: it is not known how the values of several targets add.")
        return with_gain(scan, *rule(scan.values, *added(*parts, existence)))

    def alike(self, scan: CellScan, states: Any, centres: Any) -> Bool[Array, "centre *points"]:
        """Whether targets reach the same cells."""
        return alike(self.cells, self.reach, states, centres)

    @eqx.filter_jit
    def log_ratio(self, scan: CellScan, states: object) -> Float[Array, "..."]:
        """Natural log of p(scan | target at state) / p(scan | no target).

        Parameters
        ----------
        scan : one frame.
        states : the components that the axes of the cells are named after are read.

        Returns
        -------
        The module's equation at the place nearest to each state: of many states a table, made once a frame. Cells
        outside the sensor are left out; a state that reaches no cell has log ratio 0.
        """
        if self.few(states):
            return self.around(scan, states)
        # Read from memory: XLA would otherwise form the table anew for every point.
        table = jax.lax.optimization_barrier(self.table(scan))
        place, inside = self.places.nearest(states)
        return jnp.where(inside, table[place], 0)
