r"""How heavy the tails of a scene's residuals are, and each residual as the one that is as rare under another law.

A likelihood takes its noise for Student's distribution with some degrees of freedom. Residuals of another scene have
more that lie far out, and each such spike is then taken for a target. So of a few laws, :math:`s \, t_\nu` with
:math:`t_\nu` of variance 1, the likeliest is found, and a residual x is read as

.. math:: x' = F^{-1}(F_{\nu, s}(x)),

F the distribution that the likelihood takes for granted: as rare there as x is here. Under the law that is found the
mean ratio is then 1, whatever the likelihood. No residual is made larger.

A target must not be learnt. It is in a few places, and a law is everywhere: the logarithms of the densities are summed
in tiles, the old ones forgotten, and a law has the median over the tiles.
"""

import dataclasses
import functools
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import scipy.stats
from jaxtyping import Array, Float

LAWS = tuple((freedom, stretch) for stretch in (1.0, 1.25, 1.5, 2.0) for freedom in (10.0, 6.0, 4.0, 3.0, 2.5))
"""Degrees of freedom and standard deviation of the laws that are told apart; the first is what is taken for granted."""

TILES = 8
"""Along each axis, at most."""

SAMPLES = 64
"""Pixels along each axis that are looked at in a frame, at most."""

SURE = 1.0
"""Nats in a tile by which another law is likelier before it is taken."""

FARTHEST, POINTS = 1e4, 512
"""Largest residual that is told from larger ones, and entries of a table."""


class Weighed(eqx.Module):
    """What is remembered of the laws.

    Attributes
    ----------
    log_density : of every law, summed over a tile.
    """

    log_density: Float[Array, "law y x"]


@dataclasses.dataclass(frozen=True)
class Tails:
    """Finds the law of residuals, and reads them as those of the law that is taken for granted.

    Attributes
    ----------
    memory : frames after which residuals are forgotten.

    Examples
    --------
    >>> import jax
    >>> tails = Tails(memory=30.0)
    >>> weighed = tails.init((64, 64))
    >>> spiky = jax.random.t(jax.random.key(0), 3.0, (20, 64, 64)) / 3**0.5
    >>> for frame in spiky:
    ...     weighed, read = tails.step(weighed, frame)
    >>> LAWS[int(tails.law(weighed))], round(float(jnp.abs(spiky[-1]).max())), round(float(jnp.abs(read).max()))
    ((3.0, 1.0), 28, 7)
    """

    memory: float = 30.0

    def init(self, shape: tuple[int, ...], dtype: Any = jnp.float32) -> Weighed:
        """Before the first frame."""
        return Weighed(jnp.zeros((len(LAWS), *(self._tiles(count) for count in shape)), dtype))

    def step(self, weighed: Weighed, residuals: Float[Array, "y x"]) -> tuple[Weighed, Float[Array, "y x"]]:
        """Take in a frame.

        Parameters
        ----------
        weighed : after the frame before.
        residuals : over their deviation; one that is not a number says nothing.

        Returns
        -------
        What is remembered, and the residuals as they are read.
        """
        few = residuals[tuple(slice(None, None, -(-count // SAMPLES)) for count in residuals.shape)]
        tiles = weighed.log_density.shape[1:]
        size = [count // tile for count, tile in zip(few.shape, tiles, strict=True)]
        few = few[: size[0] * tiles[0], : size[1] * tiles[1]]
        sums = []
        for freedom, stretch in LAWS:
            density = _log_density(few, freedom, stretch)
            density = jnp.where(jnp.isnan(few), 0, density).reshape(tiles[0], size[0], tiles[1], size[1])
            sums.append(density.sum(axis=(1, 3)))
        weighed = Weighed((1 - 1 / self.memory) * weighed.log_density + jnp.stack(sums))
        law = self.law(weighed)
        place = jnp.log1p(jnp.abs(residuals)) * ((POINTS - 1) / np.log1p(FARTHEST))
        table = jnp.asarray(_tables(), residuals.dtype)[law]
        read = jnp.sign(residuals) * jnp.interp(place, jnp.arange(POINTS), table)
        return weighed, jnp.where((law == 0) | jnp.isnan(residuals), residuals, read)

    def law(self, weighed: Weighed) -> Array:
        """Number of the likeliest of `LAWS`."""
        medians = jnp.median(weighed.log_density.reshape(len(LAWS), -1), axis=1)
        return jnp.argmax(medians.at[0].add(SURE))

    def _tiles(self, count: int) -> int:
        return max(1, min(TILES, min(count, SAMPLES) // 8))


def _log_density(values: Array, freedom: float, stretch: float) -> Array:
    """Of Student's distribution with a standard deviation; but for a constant that all laws share."""
    scale = stretch * ((freedom - 2) / freedom) ** 0.5
    constant = float(scipy.stats.t.logpdf(0.0, freedom)) - float(np.log(scale))
    return constant - (freedom + 1) / 2 * jnp.log1p((values / scale) ** 2 / freedom)


@functools.cache
def _tables() -> Float[np.ndarray, "law point"]:
    """x' of every law at points that are even in log(1 + x)."""
    values = np.expm1(np.linspace(0, np.log1p(FARTHEST), POINTS))
    granted, _ = LAWS[0]
    rows = []
    for freedom, stretch in LAWS:
        beyond = scipy.stats.t.sf(values / (stretch * ((freedom - 2) / freedom) ** 0.5), freedom)
        read = scipy.stats.t.isf(beyond, granted) * ((granted - 2) / granted) ** 0.5
        rows.append(np.minimum(read, values))
    return np.array(rows)
