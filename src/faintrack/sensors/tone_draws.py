"""Spectra of a frame drawn from the model: noise of power 1, and a tone."""

import dataclasses

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, PRNGKeyArray

from faintrack.sensors.tones import PEAK, ToneGrid, ToneScan, kernel
from faintrack.targets.states import ToneState


def draw_tone(
    grid: ToneGrid, scan: ToneScan, states: ToneState, present: Bool[Array, ""] | bool, key: PRNGKeyArray
) -> ToneScan:
    """Scan in which each frequency is drawn for itself, as the likelihood has it, and so has its references.

    Parameters
    ----------
    grid : of the scan.
    scan : its time, channels and references are kept.
    states : of one tone; scalars.
    present : whether it is there.
    key : random key.
    """
    for_noise, for_tone, for_references = jax.random.split(key, 3)
    dtype, shape = scan.power.dtype, scan.spectra.shape
    heard = jnp.asarray(grid.array.gains != 0, dtype)
    frequency = jnp.asarray(grid.frequency, dtype)
    parts = jax.random.normal(for_noise, (2, *shape), dtype) * jnp.sqrt(0.5) * heard
    amplitude = jax.random.normal(for_tone, (2,), dtype) * jnp.sqrt(0.5)
    level = PEAK * grid.frame * 10 ** (states.snr_db / 10) * kernel((frequency - states.frequency) * grid.frame)
    wave = grid.steered(frequency, jnp.broadcast_to(states.bearing, frequency.shape)) * heard
    tone = jnp.where(present, jnp.sqrt(level), 0)[:, None] * wave * jax.lax.complex(*amplitude)
    spectra = jax.lax.complex(*parts) + tone
    noise = scan.channels * jax.random.gamma(for_references, scan.references[:, None], scan.noise.shape, dtype)
    energy = scan.channels * scan.references
    power = grid.powers(frequency, spectra)
    return dataclasses.replace(scan, spectra=spectra, power=power, noise=noise, energy=energy, field=None)
