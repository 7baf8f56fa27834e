r"""What an array hears of one source in white noise: spectra of a frame, and its beams.

.. math::
    z_{mf} = v_f \, d_{mf}(\psi) + e_{mf}, \qquad
    v_f \sim \mathcal{CN}(0, a \sigma_f^2), \quad e_{mf} \sim \mathcal{CN}(0, \sigma_f^2)

(bosser2022, eq. 13 in the frequency domain), with d the steering of the array, a the signal to noise ratio and
:math:`\sigma_f^2` the power of the noise. It is the model of the likelihoods of white signals, which draw their scans
here (`beams_of`), and of long simulations (`faintrack.simulation.spectra`).
"""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Complex, Float, PRNGKeyArray

from faintrack.errors import InputError
from faintrack.numerics.draws import normal_pairs
from faintrack.numerics.precision import full_precision
from faintrack.numerics.trigonometry import sine_cosine
from faintrack.sensors.array import SensorArray
from faintrack.sensors.beams import BeamGrid, BeamScan, steering
from faintrack.targets.states import Direction, WaveState


def pairs_of(key: PRNGKeyArray, array: SensorArray, grid: BeamGrid, dtype: Any) -> Complex[Array, " pair"]:
    """The random numbers of one frame, in one row: XLA takes seconds to compile random numbers along five axes."""
    return normal_pairs(key, grid.snapshots * grid.frequency.size * (len(array.gains) + 1), dtype)


def received(
    pairs: Complex[Array, " pair"],
    bearing: Float[Array, ""],
    snr_db: Float[Array, ""],
    array: SensorArray,
    grid: BeamGrid,
    noise_power: Float[Array, " frequency"] | float,
    elevation: Float[Array, ""] | None = None,
) -> Complex[Array, "snapshot frequency channel"]:
    r"""Spectra of one frame (the module's equation).

    Parameters
    ----------
    pairs : of `pairs_of`.
    bearing : of the source; radians.
    snr_db : of the source, at one channel; dB, minus infinity where it is absent.
    array : geometry; dead channels are silent.
    grid : frequencies and snapshots.
    noise_power : in each bin.
    elevation : of the source; radians. Its wave is level where not given.
    """
    frequencies, channels, dtype = grid.frequency.size, len(array.gains), bearing.dtype
    scale = jnp.sqrt(jnp.broadcast_to(jnp.asarray(noise_power, dtype), (frequencies,)) / 2)[:, None]
    signal, noise = jnp.split(pairs, [grid.snapshots * frequencies])
    signal = jnp.sqrt(10 ** (snr_db / 10)) * scale * signal.reshape(grid.snapshots, frequencies, 1)
    noise = scale * noise.reshape(grid.snapshots, frequencies, channels)
    delays = array.delays(bearing[None], None if elevation is None else elevation[None])
    sine, cosine = sine_cosine(2 * jnp.pi * jnp.asarray(grid.frequency, dtype)[:, None] * delays)
    return jnp.asarray(array.alive, dtype) * (signal * jax.lax.complex(cosine, -sine) + noise)


@full_precision
def beams_of(
    grid: BeamGrid,
    scan: BeamScan,
    state: Direction,
    present: Bool[Array, ""] | bool,
    noise_power: Float[Array, "*frequency"] | float,
    key: PRNGKeyArray,
) -> BeamScan:
    """Scan of one frame, drawn.

    Parameters
    ----------
    grid : axes of the scan, with the array.
    scan : its time is kept; where fewer than two channels were used there is silence.
    state : of the source; scalars.
    present : whether it is there.
    noise_power : in each bin.
    key : random key.

    Raises
    ------
    InputError : the grid does not know its array.

    Examples
    --------
    >>> from faintrack.targets.states import BearingState
    >>> import numpy as np
    >>> from faintrack.sensors.array import line_array
    >>> grid = BeamGrid(np.array([500.0]), beams=9, snapshots=4, circular=False, array=line_array(8, 1.5))
    >>> scan = BeamScan(jnp.array(1.0), jnp.zeros((1, 9)), jnp.zeros(1), jnp.array(8.0))
    >>> broadside = BearingState(jnp.array(np.pi / 2), jnp.array(0.0), jnp.array(30.0))
    >>> int(beams_of(grid, scan, broadside, True, 1.0, jax.random.key(0)).beam_power[0].argmax())
    4
    """
    if grid.array is None:
        raise InputError("the grid of beams does not know its array; expected one with an array to draw scans of.")
    array, dtype = grid.array, scan.beam_power.dtype
    pairs = pairs_of(key, array, grid, dtype)
    snr_db = jnp.where(present, state.snr_db, -jnp.inf).astype(dtype)
    elevation = state.elevation.astype(dtype) if isinstance(state, WaveState) else None
    spectra = received(pairs, state.bearing.astype(dtype), snr_db, array, grid, noise_power, elevation)
    bearing, above = grid.directions
    directions = jnp.asarray(bearing, dtype), None if above is None else jnp.asarray(above, dtype)
    vectors = steering(array, jnp.asarray(grid.frequency, dtype), *directions)
    products = jnp.einsum("fbc,kfc->kfb", vectors.conj(), spectra)
    used = scan.channels >= 2
    return dataclasses.replace(
        scan,
        beam_power=jnp.where(used, jnp.sum(jnp.abs(products) ** 2, axis=0), 0),
        total_power=jnp.where(used, jnp.sum(jnp.abs(spectra) ** 2, axis=(0, 2)), 0),
        channels=jnp.where(used, jnp.sum(jnp.asarray(array.alive)), scan.channels).astype(scan.channels.dtype),
    )
