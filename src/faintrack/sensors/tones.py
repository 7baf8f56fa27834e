r"""One frame of an array as spectra in which tones are looked for, and the noise around every frequency.

A tone of machinery lies within one bin of a transform as long as a frame. With half a sine for a window h, of mean
square 1, over the N samples of the frame, centred and unitary,

.. math:: z_m(f) = \frac{1}{\sqrt N} \sum_n h_n x_{mn} e^{-2 \pi i f (n - (N - 1) / 2) / f_s} ,

a tone of amplitude A at :math:`\nu` has :math:`|z(f)| = \frac{A}{2} \sqrt{N} \, W((\nu - f) T)` with

.. math:: W(x) = \frac{2 \sqrt 2}{\pi} \, \frac{\cos \pi x}{1 - 4 x^2},

and over noise of variance :math:`\sigma^2` in a sample, r the power of the tone over that of the noise in 1 Hz,

.. math:: \frac{|z|^2}{\sigma^2} = r T W^2, \qquad W(0)^2 = \frac{8}{\pi^2} .

A frame without a window would hear a tone 0.9 dB better, and another a hundred bins away; Hann's window hears it 0.9 dB
worse. Of white noise bins two apart are independent. Frequencies are a quarter of a bin apart, so that values between
them can be read; the phase at the middle of the frame leaves z smooth.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from faintrack.numerics.trigonometry import sine_cosine
from faintrack.sensors.array import SensorArray
from faintrack.sensors.beams import bearings

FINENESS = 4
"""Frequencies a bin, which is one over the length of a frame."""

PEAK = 8 / np.pi**2
"""Square of W at 0."""


class ToneScan(eqx.Module):
    """Spectra of one frame.

    Attributes
    ----------
    time : middle of the frame; seconds from the start of the recording.
    spectra : z, with the channels' gains.
    power : :math:`|d^* z|^2` of every beam; shape (frequency, beam).
    noise : power of a beam at the frequencies around each, summed over `references` of them; shape (frequency, beam).
    energy : sum over the channels of the power at the frequencies around each, summed over them too.
    references : frequencies around each, independent of each other, that tell the noise.
    channels : number of channels that were used; below 2 the frame says nothing.
    field : tones that are part of the background; None where there are none (`faintrack.likelihoods.tone_field`).
    """

    time: Float[Array, "*scan"]
    spectra: Complex[Array, "*scan frequency channel"]
    power: Float[Array, "*scan frequency beam"]
    noise: Float[Array, "*scan frequency beam"]
    energy: Float[Array, "*scan frequency"]
    references: Float[Array, "*scan frequency"]
    channels: Float[Array, "*scan"]
    field: Any = None


class ToneGrid(eqx.Module):
    """The axes on which a frame is analysed.

    Attributes
    ----------
    lowest : frequency; Hz.
    count : frequencies, `FINENESS` a bin.
    frame : length of a frame; s.
    beams : number of bearings at which the noise is told.
    circular : whether bearings run around the full circle.
    array : what hears.
    """

    lowest: float = eqx.field(static=True)
    count: int = eqx.field(static=True)
    frame: float = eqx.field(static=True)
    beams: int = eqx.field(static=True)
    circular: bool = eqx.field(static=True)
    array: SensorArray

    @property
    def frequency(self) -> Float[np.ndarray, " frequency"]:
        """Frequencies, evenly spaced; Hz."""
        return self.lowest + self.step * np.arange(self.count)

    @property
    def bearing(self) -> Float[np.ndarray, " bearing"]:
        """Bearings of the beams; radians."""
        return bearings(self.beams, self.circular)

    @property
    def step(self) -> float:
        """From frequency to frequency; Hz."""
        return 1 / (FINENESS * self.frame)

    def steered(
        self, frequency: Float[Array, "*points"], bearing: Float[Array, "*points"]
    ) -> Complex[Array, "*points channel"]:
        """Steering vector d of every pair of a frequency, Hz, and a bearing, radians."""
        delays = self.array.delays(bearing)
        sine, cosine = sine_cosine(2 * jnp.pi * frequency[..., None] * delays)
        return jax.lax.complex(cosine, -sine)

    def powers(
        self, frequency: Float[Array, " some"], spectra: Complex[Array, "some channel"]
    ) -> Float[Array, "some beam"]:
        """Power of every beam at some frequencies, of which the spectra are given."""
        bearing = jnp.asarray(self.bearing, frequency.dtype)
        vectors = self.steered(*jnp.broadcast_arrays(frequency[:, None], bearing))
        heard = jnp.einsum("fbc,fc->fb", vectors.conj(), spectra)
        return heard.real**2 + heard.imag**2

    def place(self, frequency: Float[Array, "..."]) -> Float[Array, "..."]:
        """Where frequencies lie among those of the grid; those beyond an end at it."""
        return jnp.clip((frequency - self.lowest) / self.step, 0, self.count - 1)


def kernel(off: Float[Array, "..."]) -> Float[Array, "..."]:
    """Square of W over that at 0: power of a tone that is so many bins off.

    Examples
    --------
    >>> [round(float(x), 4) for x in kernel(jnp.array([0.0, 0.5, 1.0, 1.5, 2.5, 3.0]))]
    [1.0, 0.6169, 0.1111, 0.0, 0.0, 0.0008]
    """
    squared = 4 * off**2
    at_half = jnp.abs(squared - 1) < 1e-3
    value = jnp.cos(jnp.pi * off) / jnp.where(at_half, 1, 1 - squared)
    return jnp.where(at_half, (jnp.pi / 4) ** 2, value**2)


def envelope(off: Float[Array, "..."]) -> Float[Array, "..."]:
    """As `kernel`, without the zeros between side lobes.

    Examples
    --------
    >>> [round(float(x), 4) for x in envelope(jnp.array([0.0, 1.0, 1.5, 3.0]))]
    [1.0, 0.1111, 0.0156, 0.0008]
    """
    beyond = jnp.maximum(jnp.abs(off), 1)
    return jnp.where(jnp.abs(off) < 1, kernel(off), 1 / (4 * beyond**2 - 1) ** 2)
