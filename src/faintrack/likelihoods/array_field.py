r"""Sources that are part of an array's background: what is heard beside them.

Sources add in the covariance of the channels. With :math:`d_j` the steering vector of one that is there, and noise of
power :math:`\sigma^2`, snapshots of a bin have the covariance :math:`\sigma^2 G`,

.. math:: G = I + \sum_j L_j \, \mathrm{E}[d_j d_j^*], \qquad
    \frac{p(z \mid G + a d d^*)}{p(z \mid G)} \text{ is a function of } \quad
    w = d^* G^{-1} d, \quad P = \sum_k |d^* G^{-1} z_k|^2, \quad E = \sum_k z_k^* G^{-1} z_k .

Without a source in the background w is the number of channels, P the beam power, E the total power: a likelihood of one
source reads the same three numbers, and needs no other change.

A source is not known exactly, and what is not known of a loud one hides a faint one beside it. So its covariance is
averaged over what is believed of its bearing, to second order by the pattern
:math:`\omega \, s \, d \circ d\tau / d\psi` beside the wave itself, s the standard deviation. Snapshots of a finite
length T hear it at other times in every channel: with :math:`\kappa = 2 \pi^2 / 3` the curvature of the correlation of
the taper with itself, taken as a Gaussian, channels i and j share
:math:`e^{-\kappa (\tau_i - \tau_j)^2 / T^2}` of it, which is a sum of patterns along the array,

.. math:: \sum_n c_n c_n^*, \qquad c_n = d \circ \frac{(\sqrt{2 \kappa} \, \tau / T)^n}{\sqrt{n!}}
    e^{-\kappa \tau^2 / T^2} .

Its spectrum is not known either, and a source at the end of what SNR a likelihood reads may be far louder: the level
that is taken from it grows from four times its own where it is faint to all of it where it is loud,

.. math:: L = 4 a (1 + M a) (1 + a / 10)^4 q ,

q its existence. Of M dimensions a frame then holds as many as expected under the level a itself,

.. math:: M' = \operatorname{tr} G^{-1} \left(I + \sum_j a_j \mathrm{E}[d_j d_j^*]\right).

Columns are taken in one by one (Sherman and Morrison): with :math:`u = G^{-1} b` and :math:`s = 1 + b^* u`, the
inverse of :math:`G + b b^*` is :math:`G^{-1} - u u^* / s`. One whose :math:`b^* u` is next to nothing in every bin is
left out. The energy is summed from what is left,

.. math:: E = \sum_k \left[ y_k^* G_0 y_k + \sum_b |b^* y_k|^2 \right], \qquad y_k = G^{-1} z_k ,

since beside a source of 60 dB nothing of it would be left of a difference in single precision. Of louder ones single
precision leaves a residual of its own; as much counts as energy.

**Alike** are two directions whose steering vectors have a coherence :math:`|d^* d'|^2 / M^2` above one half,
averaged over the band: sources so near each other are one to the array.
"""

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Complex, Float, Int

from faintrack.errors import InputError
from faintrack.numerics.precision import full_precision
from faintrack.numerics.trigonometry import sine_cosine
from faintrack.sensors.array import SensorArray
from faintrack.sensors.beams import BeamGrid, BeamScan
from faintrack.signal.array_background import NoiseModes
from faintrack.signal.beamformer import Beamformer
from faintrack.targets.states import Direction, ToneState, WaveState

ORDERS = 4
"""Of the patterns along the array that a snapshot of finite length leaves of a wave."""

COLUMNS = ORDERS + 1
"""Of the covariance of one source: its patterns along the array, and what a turn adds; and a rise, if it may rise.
As many are read at once."""

TURN = 0.01
"""Angle over which the delays are differentiated; radians."""

CLOSED = 1e4
"""Variance in a column over that of the noise from which on nothing of it is left."""

MISPLACED = 0.02
"""Phase that is not known at the end of an array and the top of the band, however well a bearing is; radians."""

ROUNDED = 1e-5
"""Share of a column below which it lies in the span of others, in single precision."""

NEGLIGIBLE = 1e-4
"""Variance in a column over that of the noise up to which it is left out."""

IMPRECISE = 1e-8
"""Share of what was received that single precision may leave behind."""

CURVATURE = 2 * np.pi**2 / 3
"""Of the correlation of Hann's window with itself, in units of its length."""

COHERENT = 0.5
"""Coherence from which on two directions are alike."""

BINS = 8
"""Frequencies at which the coherence is looked at."""


class ArrayField(eqx.Module):
    r"""Sources in the background of a scan.

    Attributes
    ----------
    columns : :math:`G^{-1} = I - Q Q^*` in every bin; zero beyond `used`.
    patterns : B, with :math:`G = I + B B^*`; zero where nothing is left of a column.
    used : columns of all sources.
    spectra : :math:`G^{-1} z`.
    energy : E.
    dimensions : :math:`M'`.
    noise : that the sources stand in; white where None, otherwise :math:`G_0` takes the place of I.
    power, gain : P and w of every beam, where they have been worked out already.
    """

    columns: Complex[Array, "*scan column frequency channel"]
    patterns: Complex[Array, "*scan column frequency channel"]
    used: Int[Array, "*scan"]
    spectra: Complex[Array, "*scan snapshot frequency channel"]
    energy: Float[Array, "*scan frequency"]
    dimensions: Float[Array, "*scan frequency"]
    noise: NoiseModes | None = None
    power: Float[Array, "*scan frequency bearing"] | None = None
    gain: Float[Array, "*scan frequency bearing"] | None = None


class Sources(eqx.Module):
    """What is believed of sources that are there, one entry each, or of one.

    Attributes
    ----------
    bearing, deviation : mean and standard deviation; radians.
    snr : power over that of the noise at one channel, linear.
    existence : probability that it is there.
    elevation, elevation_deviation : mean and standard deviation, radians; None of level waves.
    """

    bearing: Float[Array, "*source"]
    deviation: Float[Array, "*source"]
    snr: Float[Array, "*source"]
    existence: Float[Array, "*source"]
    elevation: Float[Array, "*source"] | None = None
    elevation_deviation: Float[Array, "*source"] | None = None


def source_of(states: Direction | ToneState, log_weights: Float[Array, " point"]) -> Sources:
    """One source, certain to be there, from the points of its belief."""
    weights = jnp.exp(log_weights)
    sine, cosine = sine_cosine(states.bearing)
    middle = jnp.arctan2(jnp.sum(weights * sine), jnp.sum(weights * cosine))
    off = states.bearing - middle
    off = off - 2 * jnp.pi * jnp.round(off / (2 * jnp.pi))
    deviation = jnp.sqrt(jnp.sum(weights * off**2))
    snr = 10 ** (jnp.sum(weights * states.snr_db) / 10)
    if not isinstance(states, WaveState):
        return Sources(middle, deviation, snr, jnp.ones_like(snr))
    elevation = jnp.sum(weights * states.elevation)
    above = jnp.sqrt(jnp.sum(weights * (states.elevation - elevation) ** 2))
    return Sources(middle, deviation, snr, jnp.ones_like(snr), elevation, above)


def steered(
    array: SensorArray,
    frequency: Float[Array, " frequency"],
    bearing: Float[Array, " bearing"],
    elevation: Float[Array, " bearing"] | None = None,
) -> tuple[Complex[Array, "frequency bearing channel"], Float[Array, "bearing channel"]]:
    """Steering vectors, and the delays about their mean; s."""
    delays = array.delays(bearing, elevation)
    sine, cosine = sine_cosine(2 * jnp.pi * frequency[:, None, None] * delays)
    return jax.lax.complex(cosine, -sine), delays - jnp.mean(delays, axis=-1, keepdims=True)


@full_precision
def beside(beamformer: Beamformer, scan: BeamScan, sources: Sources) -> BeamScan:
    """Scan with sources as part of its background; what was received stays in it as it is.

    Parameters
    ----------
    beamformer : that made the scan.
    scan : with its spectra; it may have a field already.
    sources : one whose existence is 0 adds nothing.

    Raises
    ------
    InputError : the scan has no spectra.
    """
    if scan.spectra is None:
        raise InputError("the scan of an array has no spectra; expected them, for sources in its background.")
    array, grid, dtype = beamformer.grid.array, beamformer.grid, scan.total_power.dtype
    assert array is not None
    frequency = jnp.asarray(grid.frequency, dtype)
    resolution = beamformer.resolution
    # Channels that are silent in a frame hear no source either.
    heard = (jnp.sum(jnp.abs(scan.spectra) ** 2, axis=(0, 1)) > 0).astype(dtype)
    snr, channels = sources.snr, scan.channels
    level = 4 * snr * (1 + channels * snr) * (1 + snr / 10) ** 4 * sources.existence
    true = jnp.where(level > 0, snr * sources.existence / jnp.where(level > 0, level, 1), 0)

    above = () if sources.elevation is None else (sources.elevation, sources.elevation_deviation)
    columns_of_each = COLUMNS + (1 if above else 0)

    def added(held: Any, source: Any) -> tuple[Any, None]:
        return jax.lax.cond(source[2] > 0, taken_in, lambda held, source: held, held, source), None

    def patterns_of(source: tuple[Array, ...]) -> Complex[Array, "column frequency channel"]:
        bearing, deviation, level, _, *raised = source
        directions = [jnp.stack([bearing, bearing + TURN, bearing - TURN, *(bearing for _ in raised)])]
        if raised:
            elevation = raised[0]
            directions.append(jnp.stack([*(elevation for _ in range(3)), elevation + TURN, elevation - TURN]))
        vectors, delays = steered(array, frequency, *directions)
        middle, lag = vectors[:, 0] * heard, resolution * delays[0]
        turned = jnp.pi / TURN * frequency[:, None] * (delays[1] - delays[2])
        # Positions are not known to less than this either.
        least = MISPLACED / jnp.maximum(jnp.max(jnp.abs(turned)), jnp.finfo(dtype).tiny)
        turned = jnp.sqrt(deviation**2 + least**2) * turned
        # Beyond a lobe the direction is not known at all: the pattern is no larger than the wave itself.
        turned = turned / jnp.maximum(jnp.max(jnp.abs(turned), axis=1, keepdims=True), 1)
        stretched = jnp.sqrt(2 * CURVATURE) * lag
        faded = jnp.exp(-CURVATURE * lag**2)
        shapes = jnp.stack([stretched**order / math.sqrt(math.factorial(order)) for order in range(ORDERS)]) * faded
        shapes = jnp.broadcast_to(shapes[:, None], (ORDERS, *turned.shape))
        beside = [shapes, turned[None]]
        if raised:
            lifted = raised[1] * jnp.pi / TURN * frequency[:, None] * (delays[3] - delays[4])
            beside.append((lifted / jnp.maximum(jnp.max(jnp.abs(lifted), axis=1, keepdims=True), 1))[None])
        return middle * jnp.concatenate(beside) * jnp.sqrt(level)

    def taken_in(held: tuple[Array, ...], source: tuple[Array, ...]) -> tuple[Array, ...]:
        patterns, true = patterns_of(source), source[3]

        def beside_column(solved: Array, columns: Array) -> Array:
            inner = jnp.einsum("rfc,pfc->prf", columns.conj(), patterns)
            return solved - jnp.einsum("prf,rfc->pfc", inner, columns)

        alone = patterns if noise is None else noise.solved(patterns)
        whole = jnp.einsum("pfc,pfc->pf", patterns.conj(), alone).real
        solved = _over(held[0], held[2], beside_column, alone)

        def one(place: Any, held: tuple[Array, ...]) -> tuple[Array, ...]:
            columns, left, used, spectra, share, solved = held
            column, own = patterns[place], solved[place]
            rest = jnp.einsum("fc,fc->f", column.conj(), own).real
            # What lies in loud columns already but for a rounding error is left out.
            rest = jnp.where(rest > ROUNDED * whole[place], rest, 0)
            some = jnp.max(rest) > NEGLIGIBLE
            rest = jnp.where(some, rest, 0)
            own, scale = jnp.where((rest > 0)[:, None], own, 0), 1 + rest
            along = jnp.einsum("fc,kfc->kf", column.conj(), spectra)
            spectra = spectra - jnp.einsum("kf,fc->kfc", along / scale, own)
            column_of_inverse = own / jnp.sqrt(scale)[:, None]
            columns = columns.at[used].set(column_of_inverse)
            left = left.at[used].set(jnp.where((some & (scale < CLOSED))[:, None], column, 0))
            inner = jnp.einsum("fc,pfc->pf", column_of_inverse.conj(), patterns)
            solved = solved - inner[..., None] * column_of_inverse
            # What the column takes of the trace, less what of it is there under the level itself.
            taken = jnp.sum(jnp.abs(column_of_inverse) ** 2, axis=1) if noise is None else 1 - 1 / scale
            share = share + taken - true * (1 - 1 / scale)
            return columns, left, used + some, spectra, share, solved

        return jax.lax.fori_loop(0, columns_of_each, one, (*held, solved))[:-1]

    before = scan.field if scan.field is not None else _empty(scan)
    noise = before.noise
    room = ((0, -(-len(sources.bearing) * columns_of_each // COLUMNS) * COLUMNS), (0, 0), (0, 0))
    columns, left = jnp.pad(before.columns, room), jnp.pad(before.patterns, room)
    start = (columns, left, before.used, before.spectra, jnp.zeros_like(frequency))
    each = (sources.bearing, sources.deviation, level, true, *above)
    (columns, left, used, spectra, share), _ = jax.lax.scan(added, start, each)
    some = jnp.any(level > 0)
    lost = IMPRECISE * scan.total_power
    energy = jax.lax.cond(some, lambda: _energy(spectra, left, used, noise) + lost, lambda: before.energy)
    dimensions = jnp.maximum(before.dimensions - share, 1)
    return dataclasses.replace(scan, field=ArrayField(columns, left, used, spectra, energy, dimensions, noise))


def _over(
    columns: Complex[Array, "column frequency channel"],
    used: Int[Array, ""],
    function: Callable[[Any, Complex[Array, "some frequency channel"]], Any],
    start: Any,
) -> Any:
    """What a function makes of the columns in use, some at once, beginning with `start`."""
    if not len(columns):
        return start

    def some(number: Any, held: Any) -> Any:
        return function(held, jax.lax.dynamic_slice_in_dim(columns, COLUMNS * number, COLUMNS))

    return jax.lax.fori_loop(0, (used + COLUMNS - 1) // COLUMNS, some, start)


def _empty(scan: BeamScan) -> ArrayField:
    """Field without a source, in white noise."""
    assert scan.spectra is not None
    bins, channels = scan.spectra.shape[1:]
    none, used = jnp.zeros((0, bins, channels), scan.spectra.dtype), jnp.array(0)
    return ArrayField(none, none, used, scan.spectra, scan.total_power, jnp.full_like(scan.total_power, scan.channels))


def _energy(
    spectra: Complex[Array, "snapshot frequency channel"],
    patterns: Complex[Array, "column frequency channel"],
    used: Int[Array, ""],
    noise: NoiseModes | None,
) -> Float[Array, " frequency"]:
    """E from what is left of the spectra (the module's last equation)."""

    def more(energy: Array, patterns: Array) -> Array:
        return energy + jnp.sum(jnp.abs(jnp.einsum("rfc,kfc->rkf", patterns.conj(), spectra)) ** 2, axis=(0, 1))

    alone = spectra if noise is None else noise.applied(spectra)
    return _over(patterns, used, more, jnp.sum((spectra.conj() * alone).real, axis=(0, 2)))


@full_precision
def in_noise(scan: BeamScan, noise: NoiseModes) -> BeamScan:
    """Scan whose background is noise that is correlated between channels.

    Parameters
    ----------
    scan : with its spectra, and without a field.
    noise : of its bins.
    """
    assert scan.spectra is not None
    spectra = noise.solved(scan.spectra)
    energy = jnp.sum((scan.spectra.conj() * spectra).real, axis=(0, 2))
    field = dataclasses.replace(_empty(scan), spectra=spectra, energy=energy, dimensions=noise.dimensions, noise=noise)
    return dataclasses.replace(scan, field=field)


def beams_beside(
    beamformer: Beamformer, scan: BeamScan
) -> tuple[Float[Array, "frequency bearing"], Float[Array, "frequency bearing"]]:
    """P and w of every beam of a scan with a field."""
    field = scan.field
    if field.power is not None:
        return field.power, field.gain
    shape = (len(field.energy), beamformer.grid.beams * beamformer.grid.rings)
    before = jnp.full(shape, scan.channels) if field.noise is None else field.noise.gain
    gain = _over(
        field.columns, field.used, lambda gain, columns: gain - beamformer.beam_power(columns[None])[0], before
    )
    alone = (field.used == 0) & (True if field.noise is None else field.noise.white)
    power = jax.lax.cond(alone, lambda: scan.beam_power, lambda: beamformer.beam_power(field.spectra[None])[0])
    return power, jnp.maximum(gain, 0)


@full_precision
def directions_beside(
    vectors: Complex[Array, "frequency direction channel"], scan: BeamScan
) -> tuple[Float[Array, "frequency direction"], Float[Array, "frequency direction"]]:
    """P and w in the directions of some steering vectors."""
    field = scan.field
    spectra = scan.spectra if field is None else field.spectra
    power = jnp.sum(jnp.abs(jnp.einsum("fbc,kfc->kfb", vectors.conj(), spectra)) ** 2, axis=0)
    gain = jnp.full_like(power, scan.channels)
    if field is None:
        return power, gain
    if field.noise is not None:
        stacked = jnp.moveaxis(vectors, 1, 0)
        gain = jnp.moveaxis(jnp.sum((stacked.conj() * field.noise.solved(stacked)).real, axis=2), 0, 1)

    def less(gain: Array, columns: Array) -> Array:
        return gain - jnp.sum(jnp.abs(jnp.einsum("fbc,rfc->rfb", vectors.conj(), columns)) ** 2, axis=0)

    return power, jnp.maximum(_over(field.columns, field.used, less, gain), 0)


def with_beams(beamformer: Beamformer, scan: BeamScan) -> BeamScan:
    """Scan with P and w of every beam worked out."""
    power, gain = jax.lax.optimization_barrier(beams_beside(beamformer, scan))
    return dataclasses.replace(scan, field=dataclasses.replace(scan.field, power=power, gain=gain))


def coherence(
    grid: BeamGrid, bearing: Float[Array, " source"], dtype: Any, elevation: Float[Array, " source"] | None = None
) -> Float[Array, "source beam"]:
    """Coherence of directions with those of all beams, averaged over the band (the module's last paragraph)."""
    array = grid.array
    assert array is not None
    few = np.unique(np.linspace(0, grid.frequency.size - 1, BINS).round().astype(int))
    frequency = jnp.asarray(grid.frequency[few], dtype)
    around, above = grid.directions
    directions = jnp.asarray(around, dtype), None if above is None else jnp.asarray(above, dtype)
    beams, _ = steered(array, frequency, *directions)
    vectors, _ = steered(array, frequency, bearing, elevation)
    alive = jnp.asarray(array.alive, dtype)
    products = jnp.einsum("fsc,fbc->fsb", (vectors * alive).conj(), beams)
    return jnp.mean(jnp.abs(products) ** 2, axis=0) / jnp.sum(alive) ** 2


def alike(grid: BeamGrid, states: Direction, centres: Direction) -> Bool[Array, "centre *points"]:
    """Which directions are alike to those of the centres, taken at the nearest beams."""
    elevation = centres.elevation if isinstance(centres, WaveState) else None
    close = coherence(grid, centres.bearing, states.bearing.dtype, elevation) > COHERENT
    first, spacing = grid.bearing[0], grid.bearing[1] - grid.bearing[0]
    number = jnp.round((states.bearing - first) / spacing).astype(jnp.int32)
    number = number % grid.beams if grid.circular else jnp.clip(number, 0, grid.beams - 1)
    if isinstance(states, WaveState):
        lowest, step = grid.elevations[0], grid.elevations[1] - grid.elevations[0]
        ring = jnp.clip(jnp.round((states.elevation - lowest) / step).astype(jnp.int32), 0, grid.rings - 1)
        number = ring * grid.beams + number
    return close[:, number]
