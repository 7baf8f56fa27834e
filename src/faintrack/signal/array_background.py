r"""Noise that is correlated between the channels of an array, learnt as the data come.

Noise that arrives from all directions alike has the correlation :math:`\operatorname{sinc}(2 f r / c)` between
channels a distance r apart (Cook, Waterhouse, Berendt, Edelman and Thompson 1955); that of the sensors has none. With
:math:`\rho` the share of the first in a bin, the channels have the covariance

.. math:: \sigma^2 \left[(1 - \rho) I + \rho \Gamma\right] = \sigma^2 V \operatorname{diag}(\mu) V^T, \qquad
    \mu_i = 1 - \rho + \rho \lambda_i ,

with :math:`\Gamma = V \operatorname{diag}(\lambda) V^T` whatever the share. So all that the data say of it is the mean
power :math:`y_i` of each mode :math:`v_i^T z`. With the scale integrated out the share has the log likelihood

.. math:: -M \log \sum_i \frac{y_i}{\mu_i} - \sum_i \log \mu_i

for every snapshot, summed over some neighbouring bins; the share is the best of `SHARES`. The powers are remembered for
`MEMORY` frames, without what the sources in hand are held to have put there, so that a source that stays is not
learnt. All of the first frames are learnt from, and one in `EVERY` of the others.

What does not fit shows in the modes: where those that beams read are louder than the others, as the model has them, a
beam holds more than one of M parts of the energy. With :math:`r_i = y_i / \mu_i`, and :math:`c_i` the part that mode i
has of :math:`d^* G_0^{-1} d`, averaged over the beams, the energy has the dimensions

.. math:: M' = \sum_i r_i \Big/ \sum_i c_i r_i .
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Complex, Float, Int

from faintrack.numerics.precision import full_precision
from faintrack.sensors.array import SensorArray
from faintrack.sensors.beams import BeamScan, steering
from faintrack.signal.beamformer import Beamformer

# fmt: off
SHARES = np.array([
    0, 0.002, 0.005, 0.01, 0.02, 0.03, 0.05, 0.08, 0.12, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8,
    0.9, 0.95, 0.98, 0.99, 0.995, 0.998, 0.999,
])
# fmt: on
"""Of isotropic noise that are told apart; some noise of the sensors is always left."""

MEMORY = 60.0
"""Frames that are remembered."""

EVERY = 4
"""Frames from one that is learnt from to the next; the first few all are."""

LOUD_DB = 10.0
"""SNR of a source at one channel from which on what it leaves behind is no noise; dB."""

AROUND = 4
"""Bins on either side that a share is fitted to."""


class NoiseModes(eqx.Module):
    r"""What is known of the noise in every bin: :math:`G_0^{-1} = V \operatorname{diag}(1 / \mu) V^T`.

    Attributes
    ----------
    vectors : V, of the channels in use.
    weights : one over mu.
    gain : :math:`d^* G_0^{-1} d` of every beam.
    dimensions : :math:`M'`.
    white : whether all of mu are 1.
    """

    vectors: Float[Array, "frequency channel mode"]
    weights: Float[Array, "frequency mode"]
    gain: Float[Array, "frequency beam"]
    dimensions: Float[Array, " frequency"]
    white: Bool[Array, ""]

    def solved(self, values: Complex[Array, "*stack frequency channel"]) -> Complex[Array, "*stack frequency channel"]:
        """Vectors times the inverse of the covariance."""
        return self._times(self.weights, values)

    def applied(self, values: Complex[Array, "*stack frequency channel"]) -> Complex[Array, "*stack frequency channel"]:
        """Vectors times the covariance."""
        return self._times(1 / self.weights, values)

    @full_precision
    def _times(
        self, variance: Float[Array, "frequency mode"], values: Complex[Array, "*stack frequency channel"]
    ) -> Complex[Array, "*stack frequency channel"]:
        def times() -> Complex[Array, "*stack frequency channel"]:
            # XLA multiplies real matrices at twice the speed of a real and a complex one.
            parts = jnp.stack([values.real, values.imag])
            modes = jnp.einsum("fcm,p...fc->p...fm", self.vectors, parts)
            return jax.lax.complex(*jnp.einsum("fcm,p...fm->p...fc", self.vectors, variance * modes))

        return jax.lax.cond(self.white, lambda: values, times)


class Learnt(eqx.Module):
    """What is remembered of the noise.

    Attributes
    ----------
    powers : of the modes; all zero before the first frame.
    share : number of the likeliest of `SHARES`.
    frames : since the start.
    """

    powers: Float[Array, "frequency mode"]
    share: Int[Array, " frequency"]
    frames: Int[Array, ""]


class ArrayBackground(eqx.Module):
    """Fits the share of isotropic noise in every bin.

    Attributes
    ----------
    vectors, values : V and lambda of every bin.
    gains, parts : of `NoiseModes`, and c, for every one of `SHARES`.
    """

    vectors: Float[Array, "frequency channel mode"]
    values: Float[Array, "frequency mode"]
    gains: Float[Array, "share frequency beam"]
    parts: Float[Array, "share frequency mode"]

    def init(self) -> Learnt:
        """What is remembered before any frame."""
        return Learnt(jnp.zeros_like(self.values), jnp.zeros(len(self.values), jnp.int32), jnp.array(0, jnp.int32))

    def noise(self, learnt: Learnt, scan: BeamScan, loudest_db: Float[Array, ""]) -> NoiseModes:
        """Noise of a frame, from what is remembered; of the first, from the frame itself.

        Parameters
        ----------
        learnt : so far.
        scan : with its spectra.
        loudest_db : SNR of the loudest source in hand. Above `LOUD_DB` what it leaves behind hides the noise between
            channels, which then counts as white.
        """
        known = jnp.any(learnt.powers > 0)
        learnt = jax.lax.cond(known, lambda: learnt, lambda: self._fitted(learnt, self.powers(scan.spectra)))
        share, powers = learnt.share, learnt.powers
        mu = self._spread(jnp.asarray(SHARES, powers.dtype)[share])
        gain = jnp.take_along_axis(self.gains, share[None, :, None], axis=0)[0]
        relative = _smooth(powers.T).T / mu
        parts = jnp.take_along_axis(self.parts, share[None, :, None], axis=0)[0]
        in_beams = jnp.sum(parts * relative, axis=1)
        # Beams that hold less than their part have lost it to sources in hand, and say nothing of the noise.
        dimensions = jnp.sum(relative, axis=1) / jnp.where(in_beams > 0, in_beams, 1)
        dimensions = jnp.minimum(dimensions, relative.shape[1])
        whole = self._whole(scan, loudest_db)
        weights, gain = jnp.where(whole, 1 / mu, 1), jnp.where(whole, gain, scan.channels)
        return NoiseModes(self.vectors, weights, gain, jnp.where(whole, dimensions, scan.channels), ~whole)

    def learn(
        self, learnt: Learnt, scan: BeamScan, explained: Callable[[], BeamScan], loudest_db: Float[Array, ""]
    ) -> Learnt:
        """What is remembered after a frame; one with a channel missing or a loud source is passed over.

        Parameters
        ----------
        learnt : before.
        scan : of the frame.
        explained : gives the scan with the sources in hand as part of its background, in white noise.
        loudest_db : as of `noise`.
        """
        due = (learnt.frames < 2 * EVERY) | (learnt.frames % EVERY == 0)

        def taken() -> Learnt:
            passed = jnp.where(learnt.frames < 2 * EVERY, 1, EVERY)
            powers = self.powers(explained().field.spectra).astype(learnt.powers.dtype)
            return self._fitted(learnt, (1 - passed / MEMORY) * learnt.powers + passed * powers)

        after = jax.lax.cond(due & self._whole(scan, loudest_db), taken, lambda: learnt)
        return eqx.tree_at(lambda after: after.frames, after, learnt.frames + 1)

    def _whole(self, scan: BeamScan, loudest_db: Float[Array, ""]) -> Bool[Array, ""]:
        """Whether modes are those of a frame: with a channel missing they are others, and the noise counts as white."""
        return (scan.channels == self.values.shape[1]) & (loudest_db <= LOUD_DB)

    def _fitted(self, learnt: Learnt, powers: Float[Array, "frequency mode"]) -> Learnt:
        powers = powers.astype(learnt.powers.dtype)
        return Learnt(powers, self.share(powers).astype(jnp.int32), learnt.frames)

    def share(self, powers: Float[Array, "frequency mode"]) -> Array:
        """Number of the likeliest of `SHARES` in every bin (the module's second equation)."""

        def log_likelihood(share: Array) -> Float[Array, " frequency"]:
            mu = self._spread(jnp.full(len(powers), share))
            total = jnp.sum(powers / mu, axis=1)
            some = total > 0
            return jnp.where(some, -mu.shape[1] * jnp.log(jnp.where(some, total, 1)), 0) - jnp.sum(jnp.log(mu), axis=1)

        fits = jax.lax.map(log_likelihood, jnp.asarray(SHARES, powers.dtype))
        return jnp.argmax(_smooth(fits), axis=0)

    @full_precision
    def powers(self, spectra: Complex[Array, "snapshot frequency channel"]) -> Float[Array, "frequency mode"]:
        """Power of every mode in a frame, over that of all in its bin."""
        parts = (jnp.einsum("fcm,kfc->kfm", self.vectors, part) for part in (spectra.real, spectra.imag))
        power = jnp.sum(sum(part**2 for part in parts), axis=0)
        total = jnp.sum(power, axis=1, keepdims=True)
        return jnp.where(total > 0, power / jnp.where(total > 0, total, 1), 0)

    def _spread(self, share: Float[Array, " frequency"]) -> Float[Array, "frequency mode"]:
        """Variance of every mode, mu."""
        return 1 - share[:, None] + share[:, None] * self.values


def _smooth(rows: Float[Array, "row frequency"]) -> Float[Array, "row frequency"]:
    """Sums over neighbouring bins."""
    ones = jnp.ones(2 * AROUND + 1, rows.dtype)
    return jax.vmap(lambda row: jnp.convolve(jnp.pad(row, AROUND, mode="edge"), ones, "valid"))(rows)


def array_background(beamformer: Beamformer) -> ArrayBackground:
    """Background of the recordings that a beamformer is for.

    Examples
    --------
    >>> from faintrack.sensors.array import line_array
    >>> from faintrack.signal.beamformer import beamformer
    >>> background = array_background(beamformer(line_array(4, 1.5), 1000.0, band=(100.0, 200.0), beams=9))
    >>> background.values.shape[1], round(float(background.values[0].sum()), 3)
    (4, 4.0)
    """
    array, grid = beamformer.grid.array, beamformer.grid
    assert array is not None
    used = np.asarray(array.alive)
    correlation = isotropic(array, grid.frequency)[:, used][:, :, used]
    values, inside = np.linalg.eigh(correlation)
    vectors = np.zeros((len(values), len(used), values.shape[1]))
    vectors[:, used] = inside
    bearing, elevation = grid.directions
    gains = np.empty((len(SHARES), len(values), len(bearing)), np.float32)
    parts = np.empty((len(SHARES), *values.shape), np.float32)
    for number, frequency in enumerate(grid.frequency):
        directions = steering(array, np.array([frequency]), bearing, elevation)[0]
        power = np.abs(directions @ vectors[number]) ** 2
        mu = 1 - SHARES[:, None] + SHARES[:, None] * np.maximum(values[number], 0)
        gains[:, number] = (1 / mu) @ power.T
        parts[:, number] = (1 / gains[:, number]) @ power / mu / len(bearing)
    dtype = beamformer.cosine.dtype
    return ArrayBackground(*(jnp.asarray(part, dtype) for part in (vectors, np.maximum(values, 0), gains, parts)))


def isotropic(array: SensorArray, frequency: Float[np.ndarray, " frequency"]) -> np.ndarray:
    """Correlation between channels of noise from all directions, shape (frequency, channel, channel).

    Examples
    --------
    >>> from faintrack.sensors.array import line_array
    >>> isotropic(line_array(2, 1.5), np.array([250.0, 500.0])).round(3)[:, 0, 1].tolist()
    [0.637, 0.0]
    """
    apart = np.linalg.norm(array.positions[:, None] - array.positions, axis=-1)
    return np.sinc(2 * frequency[:, None, None] * apart / array.sound_speed)
