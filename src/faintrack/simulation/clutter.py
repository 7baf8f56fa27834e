r"""Range profiles of compound clutter: speckle on a level that is gamma distributed and travels with the waves.

The level is :math:`L(r, t) = F^{-1}(\Phi(g(r, t)))` with g a Gaussian field of unit variance, :math:`\Phi` the normal
and F the gamma distribution with mean 1 and given shape. In a frame that moves with the waves g is smooth in range and
forgets itself in time: its correlation over a distance d and a time t is

.. math:: e^{-(d - c t)^2 / (2 \ell^2)}\, e^{-t / \tau} .

The power of a cell is exponential with mean L, independent from scan to scan (stone2002, section 4.2): over long times
the K distribution.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PRNGKeyArray
from scipy.special import gammainccinv, gammaincinv, ndtr

from faintrack.sensors.cells import Cells, CellScan

QUANTILES = np.linspace(-6.0, 6.0, 601)
"""Normal values between which the gamma quantile is interpolated; a draw lies beyond them once in 5e8."""


class CompoundClutter(eqx.Module):
    """Statistics of the clutter.

    Attributes
    ----------
    shape : of the gamma distribution of the level; small is spiky.
    length : standard deviation of the correlation along range; cells.
    duration : time in which the waves' own shape is forgotten; seconds.
    speed : of the waves along range, positive outward; cells a second.
    mean : level on average.
    """

    shape: float = eqx.field(static=True)
    length: float
    duration: float
    speed: float = 0.0
    mean: float = 1.0

    def level(self, normal: Float[Array, "..."]) -> Float[Array, "..."]:
        """Level where the Gaussian field has a value."""
        below = gammaincinv(self.shape, ndtr(QUANTILES[QUANTILES <= 0]))
        above = gammainccinv(self.shape, ndtr(-QUANTILES[QUANTILES > 0]))
        logs = np.log(np.maximum(np.concatenate([below, above]) / self.shape, np.finfo(np.float32).tiny))
        return self.mean * jnp.exp(jnp.interp(normal, QUANTILES, logs)).astype(normal.dtype)


def draw_levels(
    key: PRNGKeyArray, clutter: CompoundClutter, cells: int, interval: Float[Array, ""] | float, scans: int
) -> Float[Array, "scan range"]:
    """Mean power of the clutter in every cell, scan by scan.

    The field is periodic over twice the cells and a bit, of which the first half is seen.

    Examples
    --------
    >>> draw_levels(jax.random.key(0), CompoundClutter(1.0, 3.0, 10.0), cells=50, interval=0.2, scans=4).shape
    (4, 50)
    """
    period = 2 * cells + 1 + 2 * int(np.ceil(4 * clutter.length))
    wave_number = 2 * np.pi * np.fft.rfftfreq(period)
    # White noise, filtered to the correlation wanted: its Fourier coefficients turn with the waves.
    spectrum = jnp.exp(-((wave_number * clutter.length) ** 2) / 2)
    both = jnp.where(wave_number > 0, 2, 1)
    gain = jnp.sqrt(spectrum * period / jnp.sum(both * spectrum))
    turn = jnp.exp(-1j * wave_number * clutter.speed * interval)
    keep = jnp.exp(-interval / clutter.duration)

    def white(key: PRNGKeyArray) -> Array:
        return jnp.fft.rfft(jax.random.normal(key, (period,)))

    def advance(wave: Array, key: PRNGKeyArray) -> tuple[Array, Array]:
        following = keep * turn * wave + jnp.sqrt(1 - keep**2) * white(key)
        return following, jnp.fft.irfft(gain * wave, period)[:cells]

    first, rest = jax.random.split(key)
    _, field = jax.lax.scan(advance, white(first), jax.random.split(rest, scans))
    return clutter.level(field)


@eqx.filter_jit
def draw_scans(
    key: PRNGKeyArray,
    clutter: CompoundClutter,
    cells: Cells,
    time: Float[Array, " frame"],
    states: object,
    present: Bool[Array, " frame"],
    power: Float[Array, ""] | float,
) -> CellScan:
    """Range profiles with a target of given mean power on a path.

    Parameters
    ----------
    key : random key.
    clutter : its statistics.
    cells : one axis, range.
    time : of the frames, at equal intervals; seconds.
    states : components of shape (frame,); the one that the axis is named after is read.
    present : whether the target is there.
    power : its mean, which adds to the level of the cell that it is in; in the unit of `clutter.mean`.

    Returns
    -------
    Stack of frames, powers of shape (frame, range).

    Examples
    --------
    >>> from faintrack.beliefs.axis import Axis
    >>> from faintrack.targets.states import RangeState
    >>> cells, time = Cells((("range", Axis(0.0, 1.0, 40)),)), 0.2 * jnp.arange(3)
    >>> states = RangeState(jnp.array([10.0, 11.0, 12.0]), jnp.ones(3))
    >>> scans = draw_scans(jax.random.key(0), CompoundClutter(1.0, 3.0, 10.0), cells, time, states, time >= 0, 1e5)
    >>> jnp.argmax(scans.values, axis=1).tolist()
    [10, 11, 12]
    """
    for_level, for_speckle = jax.random.split(key)
    (count,), frames = cells.shape, time.shape[0]
    interval = time[1] - time[0] if frames > 1 else jnp.ones(())
    level = draw_levels(for_level, clutter, count, interval, frames)
    (place,), inside = cells.nearest(states)
    reached = (jnp.arange(count) == place[:, None]) & (inside & present)[:, None]
    speckle = jax.random.exponential(for_speckle, level.shape, level.dtype)
    return CellScan(time, (level + power * reached) * speckle)
