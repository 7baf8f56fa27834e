r"""Tones that are part of the background of a scan: what is heard beside them.

At each frequency f the spectra of the channels have the covariance :math:`\sigma^2 G`,

.. math:: G = I + \sum_j 2 q_j a_j K((\nu_j - f) T) \, \mathrm{E}[d_j d_j^*] ,

with :math:`q_j` the probability that tone j is there, :math:`a_j = \frac{8}{\pi^2} r_j T` its power over that of the
noise at a channel, K the envelope of the kernel of `faintrack.sensors.tones`, taken two standard deviations of the
frequency nearer, and the factor 2 for what is not known of the level. The covariance is averaged over what is believed
of the bearing, and over what it turns within a frame, to second order by the pattern
:math:`s \, \partial d / \partial \psi` beside d. Another tone of the same bearing is heard as soon as it is some bins
away, one of the same frequency in another beam.

Columns are taken in one by one (Sherman and Morrison): with :math:`u = G^{-1} b` and :math:`s = 1 + b^* u` the inverse
of :math:`G + b b^*` is :math:`G^{-1} - u u^* / s`.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from faintrack.likelihoods.array_field import MISPLACED, source_of
from faintrack.numerics.precision import full_precision
from faintrack.sensors.tones import FINENESS, PEAK, ToneGrid, ToneScan, envelope
from faintrack.targets.states import ToneState

COLUMNS = 2
"""Of the covariance of one tone: the wave, and what a turn adds."""

REACH = 64
"""Bins to either side in which a tone is part of the background: beyond them it is 84 dB down."""

TURN = 1e-3
"""Angle over which a steering vector is differentiated; radians."""


class ToneField(eqx.Module):
    r"""Tones in the background of a scan.

    Attributes
    ----------
    columns : :math:`G^{-1} = I - Q Q^*` at every frequency, what each tone adds to Q; zero of one that is not there.
    spectra : :math:`G^{-1} z`.
    frequency : of the tones, Hz; those that are not there lie below any band.
    """

    columns: Complex[Array, "*scan source frequency column channel"]
    spectra: Complex[Array, "*scan frequency channel"]
    frequency: Float[Array, "*scan source"]


class Tones(eqx.Module):
    """What is believed of tones that are there, one entry each, or of one.

    Attributes
    ----------
    bearing, deviation : mean and standard deviation; radians.
    frequency, width : mean and standard deviation; Hz.
    level : power over that of the noise in a bin, at one channel.
    """

    bearing: Float[Array, "*source"]
    deviation: Float[Array, "*source"]
    frequency: Float[Array, "*source"]
    width: Float[Array, "*source"]
    level: Float[Array, "*source"]


def level_of(grid: ToneGrid, snr_db: Float[Array, "*points"]) -> Float[Array, "*points"]:
    """Power a of a tone over that of the noise in its bin at one channel; of an SNR in 1 Hz, dB."""
    return PEAK * grid.frame * 10 ** (snr_db / 10)


def tone_of(grid: ToneGrid, states: ToneState, log_weights: Float[Array, " point"]) -> Tones:
    """One tone, certain to be there, from the points of its belief."""
    weights, believed = jnp.exp(log_weights), source_of(states, log_weights)
    frequency = jnp.sum(weights * states.frequency)
    width = jnp.sqrt(jnp.sum(weights * (states.frequency - frequency) ** 2))
    # A source that turns is heard from as many directions as it passes within a frame.
    passed = jnp.sum(weights * states.bearing_rate) * grid.frame
    deviation = jnp.sqrt(believed.deviation**2 + passed**2 / 12)
    return Tones(believed.bearing, deviation, frequency, width, PEAK * grid.frame * believed.snr)


@full_precision
def beside(grid: ToneGrid, scan: ToneScan, tones: Tones, existence: Float[Array, " source"]) -> ToneScan:
    """Scan with tones as part of its background; what was received stays in it as it is.

    Parameters
    ----------
    grid : of the scan.
    scan : it may have a field already.
    tones : one entry each.
    existence : probability that each is there; one with 0 adds nothing.
    """
    dtype = scan.power.dtype
    heard = (jnp.sum(jnp.abs(scan.spectra) ** 2, axis=0) > 0).astype(dtype)
    count, channels = scan.spectra.shape
    none = jnp.zeros((0, count, COLUMNS, channels), scan.spectra.dtype)
    before = ToneField(none, scan.spectra, jnp.zeros(0, dtype)) if scan.field is None else scan.field
    first = len(before.columns)
    columns = jnp.pad(before.columns, ((0, len(existence)), *((0, 0),) * 3))
    size = min(2 * FINENESS * REACH + 1, count)

    def added(held: tuple[Array, Array], source: tuple[Array, Tones, Array]) -> tuple[tuple[Array, Array], None]:
        return jax.lax.cond(source[2] > 0, taken_in, lambda held, source: held, held, source), None

    def taken_in(held: tuple[Array, Array], source: tuple[Array, Tones, Array]) -> tuple[Array, Array]:
        number, tone, there = source
        start = jnp.clip(jnp.round(grid.place(tone.frequency)).astype(jnp.int32) - size // 2, 0, count - size)
        columns = jax.lax.dynamic_slice_in_dim(held[0], start, size, axis=1)
        spectra = jax.lax.dynamic_slice_in_dim(held[1], start, size)
        frequency = grid.lowest + grid.step * (start + jnp.arange(size)).astype(dtype)
        away = jnp.maximum(jnp.abs(frequency - tone.frequency) - 2 * tone.width, 0) * grid.frame
        strength = jnp.sqrt(2 * there * tone.level * envelope(away))[:, None] * heard
        wave, right, left = (
            grid.steered(frequency, jnp.full_like(frequency, tone.bearing) + turn) for turn in (0.0, TURN, -TURN)
        )
        turned = (right - left) / (2 * TURN)
        largest = jnp.max(jnp.abs(turned), axis=1, keepdims=True)
        deviation = jnp.sqrt(tone.deviation**2 + (MISPLACED / jnp.maximum(largest, MISPLACED)) ** 2)
        # Beyond a lobe the direction is not known at all: the pattern is no larger than the wave itself.
        turned = turned * jnp.minimum(deviation, 1 / jnp.maximum(largest, 1))
        for place, pattern in enumerate((wave, turned)):
            column = pattern * strength
            inner = jnp.einsum("sfrc,fc->sfr", columns.conj(), column)
            own = column - jnp.einsum("sfr,sfrc->fc", inner, columns)
            scale = 1 + jnp.maximum(jnp.einsum("fc,fc->f", column.conj(), own).real, 0)
            along = jnp.einsum("fc,fc->f", column.conj(), spectra)
            spectra = spectra - (along / scale)[:, None] * own
            columns = columns.at[first + number, :, place].set(own / jnp.sqrt(scale)[:, None])
        return (
            jax.lax.dynamic_update_slice_in_dim(held[0], columns, start, axis=1),
            jax.lax.dynamic_update_slice_in_dim(held[1], spectra, start, axis=0),
        )

    each = (jnp.arange(len(existence)), tones, existence)
    (columns, spectra), _ = jax.lax.scan(added, (columns, before.spectra), each)
    there = jnp.where(existence > 0, tones.frequency, -jnp.inf).astype(dtype)
    return dataclasses.replace(scan, field=ToneField(columns, spectra, jnp.concatenate([before.frequency, there])))


def coherence(grid: ToneGrid, centres: ToneState) -> Float[Array, "centre beam"]:
    """Coherence of every beam with the direction of each centre, at its frequency."""
    mine = grid.steered(centres.frequency, centres.bearing)
    bearing = jnp.asarray(np.asarray(grid.bearing), centres.frequency.dtype)
    beams = grid.steered(*jnp.broadcast_arrays(centres.frequency[:, None], bearing))
    alive = jnp.asarray(grid.array.gains != 0, centres.frequency.dtype)
    share = jnp.einsum("sbc,sc,c->sb", beams.conj(), mine, alive) / jnp.sum(alive)
    return share.real**2 + share.imag**2
