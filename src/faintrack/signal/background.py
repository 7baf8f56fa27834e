r"""Frames of a structured, drifting scene whitened: background and noise level of every pixel, estimated as they come.

What a pixel shows without a target is predicted from two sides. **Space**: the mean A z over a ring around it, which
leaves out a guard as wide as a target, follows haze and slopes at once. **Time**: what the ring leaves over, the bright
stone and the dark tree, is remembered, and the memory moves with the scene when the camera turns. With :math:`z_t` the
frame,

.. math::
    r_t = z_t - A z_t, \qquad u_t = r_t - b_{t-1}, \qquad
    s_t^2 = \frac{k \, A u_t^2 + (n - 1) (1 + 1/n) v_{t-1}}{k + n - 1}, \qquad w_t = u_t / s_t

where the memory holds for every pixel its background b, the variance v about it, and the number n of frames that it
knows; k frames is what the ring around a pixel counts for. The residual w has mean 0 and variance 1, and takes part in
the memory only afterwards, cut off at c deviations, :math:`\tilde u = s \max(-c, \min(c, w))`, so that what passes by
leaves little behind:

.. math::
    n' = (1 - 1/N) \, n + 1, \qquad b_t = b_{t-1} + \frac{\tilde u_t}{n'}, \qquad
    v_t = v_{t-1} + \frac{1}{n' - 1} \left( \frac{n}{n + 1} \tilde u_t^2 - v_{t-1} \right).

Without forgetting these are mean and variance of all frames so far, one frame at a time. Before each frame b, v and n
are moved by the drift of the scene in whole pixels, where the correlation of r with b is highest; what enters at the
edge has n = 0. Three numbers a pixel are carried, however long the sequence.

**A target must move over the scene.** One that stands still in it is background by definition: at the same stone for
N frames, it is part of the stone. In a camera that follows the target, the scene moves instead, and that serves. For a
target at rest before a camera at rest use the ring alone (`memory` 0).

The variance of w is 1, to 5 %, where the level is the same over the ring. Where single pixels have levels of their own
it is :math:`\sigma_i^2 (k + n - 1) / (k A\sigma_i^2 + (n - 1) \sigma_i^2)`, between 1 and what the ring alone would
give. Along the edges, within the reach of the ring, the ring is mirrored and predicts a drifting scene worse: in one
of ten deviations a pixel the variance there is about half as much again.

Pixels that are broken are left out (`faintrack.signal.bad_pixels`). Values that were rounded to steps of d are never
known better than :math:`d^2 / 12`, the variance of the rounding; d is the least difference of two neighbours so far.
"""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from faintrack.errors import InputError
from faintrack.signal.bad_pixels import BadPixels, no_bad_pixels
from faintrack.signal.windows import shifted, square_sum

SMALLEST = 1e-6
"""Least variance over the mean square of a frame: constant frames, padding and saturation divide by it."""

SIGNIFICANT = 6.0
"""Peak of a correlation over its root mean square from which a drift is believed; noise reaches 5 in 65,000 places."""


class Memory(eqx.Module):
    """What is known of the scene behind each pixel.

    Attributes
    ----------
    mean : of what the ring leaves over; the frames' unit.
    variance : about it.
    frames : how many frames it rests on, the old ones forgotten.
    pixels : which of the detector's are bad.
    step : least difference between neighbouring values, other than 0; the frames' unit.
    """

    mean: Float[Array, "y x"]
    variance: Float[Array, "y x"]
    frames: Float[Array, "y x"]
    pixels: BadPixels
    step: Float[Array, ""]


class Whitening(eqx.Module):
    """Turns frames into residuals of mean 0 and variance 1, one after the other.

    Attributes
    ----------
    outer : reach of the ring along each axis; pixels.
    guard : reach of what it leaves out, the target's; pixels.
    memory : N, frames after which the scene is forgotten; 0 remembers nothing, and drift does not matter.
    ring_frames : k, frames that the ring's estimate of the level counts for.
    cut : c, deviations at which a residual is cut off before it is remembered.
    least : frames that a pixel must be known for; until then its residual is not a number, and says nothing.

    Raises
    ------
    InputError : a guard that is below 0 or not within the ring, or a memory shorter than `least`.

    Examples
    --------
    >>> noise = 3.0 * jax.random.normal(jax.random.key(0), (40, 64, 64))
    >>> residuals, drift = Whitening().whiten(100.0 + noise)
    >>> round(float(residuals[20:].std()), 1), int(jnp.abs(drift).sum())
    (1.0, 0)
    """

    outer: int = eqx.field(static=True, default=4)
    guard: int = eqx.field(static=True, default=2)
    memory: float = eqx.field(static=True, default=30.0)
    ring_frames: float = eqx.field(static=True, default=8.0)
    cut: float = eqx.field(static=True, default=5.0)
    least: float = eqx.field(static=True, default=3.0)

    def __check_init__(self) -> None:
        if not 0 <= self.guard < self.outer:
            raise InputError(
                f"whitening: guard is {self.guard} and outer {self.outer} pixels; expected 0 <= guard < outer."
            )
        if self.memory and self.memory <= self.least:
            raise InputError(
                f"whitening: memory is {self.memory:g} frames; expected 0, or more than the {self.least:g} of least."
            )

    def init(self, shape: tuple[int, ...], dtype: Any = jnp.float32) -> Memory:
        """Memory before the first frame."""
        nothing = jnp.zeros(shape, dtype)
        return Memory(nothing, nothing, nothing, no_bad_pixels(shape, dtype), jnp.array(jnp.inf, dtype))

    def step(
        self, memory: Memory, frame: Float[Array, "y x"]
    ) -> tuple[Memory, Float[Array, "y x"], Int[Array, " axis"]]:
        """Whiten one frame.

        Parameters
        ----------
        memory : after the frame before.
        frame : any unit.

        Returns
        -------
        The memory; the residuals over their standard deviation, NaN where too little is known; how far the scene has
        moved since the last frame along y and x, in pixels.
        """
        # Less one of its pixels, so that a frame without contrast leaves zeros and not roundings.
        flat = frame - frame[0, 0]
        left = flat - ring_mean(flat, self.outer, self.guard)
        power = jnp.mean(jnp.square(frame))
        apart = jnp.abs(jnp.diff(frame, axis=1))
        step = jnp.minimum(memory.step, jnp.min(jnp.where(apart > 0, apart, jnp.inf)))
        rounding = jnp.where(jnp.isfinite(step), jnp.square(step) / 12, 0)
        floor = jnp.maximum(jnp.where(power > 0, SMALLEST * power, 1), rounding)

        def around(values: Array) -> Array:
            return jnp.maximum(ring_mean(jnp.square(values), self.outer, self.guard), floor)

        if not self.memory:
            memory = dataclasses.replace(memory, step=step)
            return memory, left / jnp.sqrt(around(left)), jnp.zeros(2, jnp.int32)
        raw, flat = left, memory.pixels.mended(flat)
        left = flat - ring_mean(flat, self.outer, self.guard)
        # Each over its local level: otherwise the loudest corner of the frame decides on the drift.
        moved = drift(memory.mean / jnp.sqrt(around(memory.mean)), left / jnp.sqrt(around(left)))
        pixels = memory.pixels.seen(raw, jnp.sqrt(around(raw)), jnp.any(moved != 0))
        mean, variance, known = (shifted(values, moved) for values in (memory.mean, memory.variance, memory.frames))
        seen = jnp.maximum(known - 1, 0)
        off = left - mean
        expected = jnp.maximum((1 + 1 / jnp.maximum(known, 1)) * variance, rounding)
        deviation = jnp.sqrt((self.ring_frames * around(off) + seen * expected) / (self.ring_frames + seen))
        residual = off / deviation
        told = jnp.where(known < self.least, off, jnp.clip(residual, -self.cut, self.cut) * deviation)
        frames = (1 - 1 / self.memory) * known + 1
        change = known / (known + 1) * jnp.square(told) - variance
        learned = Memory(
            mean + told / frames,
            # One frame knows a mean and nothing about it.
            variance + jnp.where(known > 0, change / jnp.maximum(frames - 1, 1), 0),
            frames,
            pixels,
            step,
        )
        silent = (known < self.least) | pixels.bad | memory.pixels.bad | pixels.doubted
        return learned, jnp.where(silent, jnp.nan, residual), moved

    @eqx.filter_jit
    def whiten(self, frames: Float[Array, "frame y x"]) -> tuple[Float[Array, "frame y x"], Int[Array, "frame axis"]]:
        """Whiten a stack of frames from nothing known; residuals and drift of each as `step` gives them."""

        def advance(memory: Memory, frame: Array) -> tuple[Memory, tuple[Array, Array]]:
            memory, residual, moved = self.step(memory, frame)
            return memory, (residual, moved)

        return jax.lax.scan(advance, self.init(frames.shape[1:], frames.dtype), frames)[1]


def ring_mean(values: Float[Array, "y x"], outer: int, guard: int) -> Float[Array, "y x"]:
    """Mean over a square ring around each pixel; the frame is mirrored at its edges.

    Parameters
    ----------
    values : of a frame, at least `outer` + 1 pixels along each axis.
    outer, guard : reach of the ring and of what it leaves out, along each axis; pixels.

    Examples
    --------
    >>> spot = jnp.zeros((7, 7)).at[3, 3].set(16.0)
    >>> ring_mean(spot, 2, 1)[3].tolist()
    [0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    """
    count = (2 * outer + 1) ** 2 - (2 * guard + 1) ** 2
    return (square_sum(values, outer) - square_sum(values, guard)) / count


def drift(before: Float[Array, "y x"], after: Float[Array, "y x"]) -> Int[Array, " axis"]:
    """Whole pixels along y and x by which a scene has moved, where the circular correlation of two pictures is highest.

    Parameters
    ----------
    before, after : pictures without their mean; outliers beyond three deviations are cut off.

    Returns
    -------
    0 and 0 where the peak is not `SIGNIFICANT`.

    Examples
    --------
    >>> scene = jax.random.normal(jax.random.key(0), (32, 32))
    >>> drift(scene, jnp.roll(scene, (2, -5), axis=(0, 1))).tolist()
    [2, -5]
    """

    def spectrum(picture: Array) -> Array:
        limit = 3 * jnp.std(picture)
        return jnp.fft.rfft2(jnp.clip(picture, -limit, limit))

    correlation = jnp.fft.irfft2(spectrum(before).conj() * spectrum(after), s=before.shape)
    peak = jnp.stack(jnp.unravel_index(jnp.argmax(correlation), before.shape))
    half = jnp.array(before.shape) // 2
    moved = (peak + half) % jnp.array(before.shape) - half
    believed = jnp.max(correlation) > SIGNIFICANT * jnp.sqrt(jnp.mean(jnp.square(correlation)))
    return jnp.where(believed, moved, 0)
