"""Beam power of a line array, ours against Acoular's and against a plain matrix product of NumPy."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from faintrack.bench.acoular_peer import acoular_seconds
from faintrack.bench.beam_problem import FRAMES, SNAPSHOTS, draw_frames, plan_of
from faintrack.bench.machine import Machine, beam_operations
from faintrack.bench.rows import Row, row, timed
from faintrack.bench.sizes import Sizes
from faintrack.sensors.beams import steering
from faintrack.signal.beamformer import Beamformer


def beam_power_acoular(machine: Machine, sizes: Sizes) -> Row:
    """From samples to beam power, summed over the snapshots of a frame on both sides."""
    _, plan = plan_of(sizes)
    frames = draw_frames(sizes)
    on_device, usable, middle = jnp.asarray(frames), jnp.ones((FRAMES, sizes.channels), bool), jnp.arange(float(FRAMES))
    scan = eqx.filter_jit(plan.scan)
    timing = timed(lambda: scan(middle, on_device, usable), sizes.repeat_seconds).per(FRAMES)
    peer = acoular_seconds(sizes)
    beside = (
        "Acoular is not installed"
        if peer is None
        else "peer: Acoular in an interpreter of its own, one frame at a time, cross spectra and steering in its time"
    )
    note = (
        f"samples to beam power, a frame of {SNAPSHOTS} snapshots, {plan.grid.frequency.size} frequencies, "
        f"{sizes.beams} beams, {sizes.channels} channels, blocks of {FRAMES} frames, steering at hand; {beside}; "
        "limit: beam sums at the rate of a large matrix product"
    )
    target = None if peer is None else 1e3 * peer
    return row("beam_power_acoular", "ms", timing, note, target, peer, machine.seconds(_operations(plan, sizes)))


def beam_power_numpy(machine: Machine, sizes: Sizes) -> Row:
    """From spectra to beam power; NumPy multiplies complex matrices, one a frequency."""
    array, plan = plan_of(sizes)
    spectra = jax.block_until_ready(eqx.filter_jit(plan.spectra)(jnp.asarray(draw_frames(sizes))))
    beam_power = eqx.filter_jit(plan.beam_power)
    timing = timed(lambda: beam_power(spectra), sizes.repeat_seconds).per(FRAMES)
    weights = np.conj(steering(array, plan.grid.frequency, plan.grid.bearing)).astype(np.complex64)
    columns = np.moveaxis(np.asarray(spectra), (2, 3), (0, 1)).reshape(*spectra.shape[2:], -1)

    def theirs() -> np.ndarray:
        sums = np.matmul(weights, columns)
        power = sums.real**2 + sums.imag**2
        return power.reshape(*power.shape[:2], FRAMES, SNAPSHOTS).sum(axis=-1)

    peer = timed(theirs, sizes.repeat_seconds).least / FRAMES
    note = (
        f"spectra to beam power, a frame's share of {FRAMES}, sizes as above; peer: numpy.matmul in complex64 and "
        "the sum of squares, its columns already in order; limit: as above"
    )
    return row("beam_power_numpy", "ms", timing, note, 1e3 * peer, peer, machine.seconds(_operations(plan, sizes)))


def _operations(plan: Beamformer, sizes: Sizes) -> float:
    return beam_operations(plan.grid.frequency.size, sizes.beams, sizes.channels, SNAPSHOTS)
