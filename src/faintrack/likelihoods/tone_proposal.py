r"""Newborn tones drawn where beams have any.

The birth density b is cut into cells between frequencies and between beams. Cell c of n is drawn with probability

.. math:: \pi_c = \frac{\alpha}{n} + (1 - \alpha) \frac{\ell_c}{\sum_k \ell_k}

where :math:`\ell_c` is the mean ratio at its corners and over SNR evenly spaced in the birth density, and
:math:`\alpha` one half; bearing and frequency are uniform within the cell, SNR and rate those of b. The weight is
:math:`1 / (n \pi_c)`, birth density over density of the draw, at most 2. Around tones that are in hand the ratio is
that beside them, as nearly as is of use.
"""

import dataclasses

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.likelihoods.tone_field import level_of
from faintrack.numerics.resampling import systematic
from faintrack.sensors.tones import FINENESS, ToneGrid, ToneScan
from faintrack.targets.states import ToneState
from faintrack.targets.target import UniformBirth

EVERYWHERE = 0.5
"""Share of the newborn that is drawn from the birth density as it is."""

LEVELS = 8
"""SNR over which the ratio is averaged."""

SHARES = 4096
"""Of the power of a beam, for which the ratio is tabulated."""

AROUND = 8
"""Bins on either side of a tone in hand in which beams are formed anew."""


def where_tones_stand(
    grid: ToneGrid, scan: ToneScan, birth: UniformBirth, key: PRNGKeyArray, count: int
) -> tuple[ToneState, Float[Array, " count"]]:
    """Draw states from a birth density over all bearings and frequencies, more of them where there are tones.

    Parameters
    ----------
    grid : of the scan.
    scan : one frame.
    birth : uniform; its bearings and frequencies are those of the grid.
    key : random key.
    count : how many to draw.

    Returns
    -------
    States, and the natural log of their weights, birth density over density of the draws.
    """
    ratio = _table(grid, scan, birth)
    pairs = ratio[:-1] + ratio[1:]
    cells = pairs + jnp.roll(pairs, -1, axis=1) if grid.circular else pairs[:, :-1] + pairs[:, 1:]
    share = EVERYWHERE / cells.size + (1 - EVERYWHERE) * (cells / jnp.sum(cells)).ravel()
    for_cell, for_place, for_rest = jax.random.split(key, 3)
    chosen = systematic(for_cell, jnp.log(share), count, count)
    row, column = jnp.divmod(chosen, cells.shape[1])
    up, along = jax.random.uniform(for_place, (2, count), ratio.dtype)
    spacing = float(grid.bearing[1] - grid.bearing[0])
    drawn = dataclasses.replace(
        birth.sample(for_rest, count),
        bearing=(float(grid.bearing[0]) + (column + along) * spacing).astype(ratio.dtype),
        frequency=(grid.lowest + (row + up) * grid.step).astype(ratio.dtype),
    )
    return drawn, -jnp.log(share[chosen] * cells.size)


def _table(grid: ToneGrid, scan: ToneScan, birth: UniformBirth) -> Float[Array, "frequency beam"]:
    """Mean ratio over the SNR of the birth density at every frequency and beam, over its largest value.

    It is a function of the beam's share of the power alone, but for the ends of the band, which have fewer references.
    """
    power, noise, n = _power(grid, scan), scan.noise, jnp.max(scan.references)
    low, high = birth.low.snr_db, birth.high.snr_db
    snr_db = low + (high - low) * (jnp.arange(LEVELS, dtype=power.dtype) + 0.5) / LEVELS
    louder = level_of(grid, snr_db)[:, None] * scan.channels
    shares = (jnp.arange(SHARES, dtype=power.dtype) + 0.5) / SHARES
    log_ratio = -jnp.log1p(louder) - (1 + n) * jnp.log(1 - shares + shares / (1 + louder))
    log_ratio = jax.nn.logsumexp(log_ratio, axis=0) - jnp.log(LEVELS)
    heard = (scan.channels >= 2) & (noise > 0)
    share = jnp.where(heard, power / jnp.where(heard, power + noise, 1), 0)
    loudest = log_ratio[(jnp.max(share) * SHARES).astype(jnp.int32).clip(0, SHARES - 1)]
    ratio = jnp.exp(log_ratio - jnp.maximum(loudest, 0))
    found = ratio[jnp.clip((share * SHARES).astype(jnp.int32), 0, SHARES - 1)]
    return jnp.where(heard, found, jnp.exp(-jnp.maximum(loudest, 0)))


def _power(grid: ToneGrid, scan: ToneScan) -> Float[Array, "frequency beam"]:
    """Power of every beam, around tones in hand of what is left beside them."""
    if scan.field is None:
        return scan.power
    field, size = scan.field, min(2 * FINENESS * AROUND + 1, grid.count)

    def anew(power: Array, frequency: Array) -> tuple[Array, None]:
        start = jnp.round(grid.place(frequency)).astype(jnp.int32) - FINENESS * AROUND
        start = jnp.clip(start, 0, grid.count - size)

        def there(power: Array) -> Array:
            spectra = jax.lax.dynamic_slice_in_dim(field.spectra, start, size)
            some = grid.lowest + grid.step * (start + jnp.arange(size)).astype(power.dtype)
            return jax.lax.dynamic_update_slice_in_dim(power, grid.powers(some, spectra), start, axis=0)

        return jax.lax.cond(frequency > 0, there, lambda power: power, power), None

    power, _ = jax.lax.scan(anew, scan.power, field.frequency)
    return power
