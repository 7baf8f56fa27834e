r"""Delay-and-sum beamforming in the frequency domain.

Each snapshot of N samples is transformed with the unitary discrete Fourier transform. For every bin f in the band and
every bearing, the channels are delayed back and summed (bosser2022, eq. 17-18):

.. math:: B_f(\psi) = \Big| \sum_m e^{j 2 \pi f \tau_m(\psi)} z_{mf} \Big|^2

A snapshot cut out of the samples with sharp ends does not hold the same piece of a wave in every channel: what differs
is a share :math:`\tau / T` of its power, of delays :math:`\tau` and length T, and hides what is fainter beside a loud
source. With a **taper**, Hann's window over snapshots that overlap by half, it is
:math:`\frac{2 \pi^2}{3} (\tau / T)^2`, smooth along the array. A sample then counts by the sum of the squared windows
over it, W, and the frame is worth

.. math:: \frac{(\sum_n W_n)^2}{\sum_n W_n^2}

independent samples: the variance of the power of white noise, summed over bins and snapshots, is that of so many.

Waves that are not level cross the array's plane at the trace velocity :math:`c / \cos\varepsilon`, and channels that
lie higher hear them earlier: a **ring** of beams of one elevation is a ring of level beams of that velocity, on spectra
of which the phase :math:`2 \pi f z_m \sin\varepsilon / c` has been taken off. Rings are evenly spaced, four in a main
lobe.

Bins strictly between zero and half the sample rate are used: a constant offset carries no direction, and at half the
sample rate a delay is not defined (bosser2022, eq. 15 has a cosine there).
"""

import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Complex, Float

from faintrack.errors import InputError
from faintrack.numerics.precision import full_precision
from faintrack.sensors.array import SensorArray
from faintrack.sensors.beams import BeamGrid, BeamScan, lobe_width

MOST_RINGS = 128
"""Rings of beams at most."""

MIRROR_METRES = 1e-6
"""How far a channel may lie off the mirror image of another and still be taken for it."""


class Beamformer(eqx.Module):
    """Turns frames of samples into beam powers.

    Attributes
    ----------
    grid : frequencies and bearings.
    first_bin : of the band, counted from zero frequency.
    snapshot : samples in a transform.
    gains : shape (channel,); correction of each channel, 0 for a dead one.
    cosine, sine : shape (frequency, row, pair); weights of each pair of opposite beams, see `beam_power`. Of several
        rings a stack.
    mirrored : whether the array, its channels reversed, is its own mirror image through its centre, as a line is.
    window : shape (sample,); weight of each sample of a snapshot, of mean square 1, where snapshots overlap by half;
        None where they stand side by side.
    raised : shape (ring, frequency, channel); takes off what channels hear earlier because they are higher. None where
        all are level with each other.
    """

    grid: BeamGrid
    first_bin: int = eqx.field(static=True)
    snapshot: int = eqx.field(static=True)
    gains: Float[Array, " channel"]
    cosine: Float[Array, "*ring frequency row pair"]
    sine: Float[Array, "*ring frequency row pair"]
    mirrored: bool = eqx.field(static=True, default=False)
    window: Float[Array, " sample"] | None = None
    raised: Complex[Array, "ring frequency channel"] | None = None

    @property
    def resolution(self) -> Float[Array, ""] | float:
        """Frequency from bin to bin; Hz."""
        return self.grid.frequency[0] / self.first_bin

    def spectra(
        self, samples: Float[Array, "frame sample channel"]
    ) -> Complex[Array, "frame snapshot frequency channel"]:
        """Unitary spectra of the snapshots of each frame, in the band, with the channels' gains applied."""
        count, _, channels = samples.shape
        scaled = samples * (self.gains / math.sqrt(self.snapshot))
        if self.window is None:
            scaled = scaled[:, : self.grid.snapshots * self.snapshot]
            parts = scaled.reshape(count, self.grid.snapshots, self.snapshot, channels)
        else:
            positive = _positive(scaled)
            starts = _starts(scaled.shape[1], self.snapshot)
            parts = jnp.stack([positive[:, start : start + self.snapshot] for start in starts], axis=1)
            parts = parts * self.window[:, None]
        transform = jnp.fft.rfft if self.window is None else jnp.fft.fft
        return transform(parts, axis=2)[:, :, self.first_bin : self.first_bin + self.grid.frequency.size]

    def beam_power(
        self, spectra: Complex[Array, "frame snapshot frequency channel"]
    ) -> Float[Array, "frame frequency beam"]:
        r"""Beam power of each bin and beam, summed over the snapshots of a frame.

        Notes
        -----
        Waves from opposite directions, on a line :math:`\psi` and :math:`\pi - \psi`, have delays of opposite sign.
        With :math:`\theta_m = 2 \pi f \tau_m` two real products serve both beams of such a pair:

        .. math:: B_\pm = \Big| \sum_m \cos\theta_m \, z_m \pm \sum_m \sin\theta_m \, j z_m \Big|^2

        In a mirrored array channels m and m' have delays of opposite sign about the centre, and half of the rows do:

        .. math:: e^{j\theta} z_m + e^{-j\theta} z_{m'} = \cos\theta \, (z_m + z_{m'}) + \sin\theta \, j (z_m - z_{m'})

        XLA multiplies real matrices at twice the speed of complex ones, of the same number of operations.
        """
        if not self.grid.elevations:
            return self._ring(self.cosine, self.sine, spectra)

        def ring(weights: tuple[Array, Array, Array | None]) -> Float[Array, "frame frequency bearing"]:
            cosine, sine, raised = weights
            return self._ring(cosine, sine, spectra if raised is None else spectra * raised)

        rings = jax.lax.map(ring, (self.cosine, self.sine, self.raised))
        return jnp.moveaxis(rings, 0, 2).reshape(*rings.shape[1:3], -1)

    def _ring(
        self,
        cosine: Float[Array, "frequency row pair"],
        sine: Float[Array, "frequency row pair"],
        spectra: Complex[Array, "frame snapshot frequency channel"],
    ) -> Float[Array, "frame frequency bearing"]:
        """Beam power of one ring of beams."""
        if self.mirrored:
            near, far = _halves(spectra)
            both, apart = near + far, near - far
        else:
            both = apart = spectra
        even = self._products(cosine, both.real, both.imag)
        odd = self._products(sine, -apart.imag, apart.real)
        here = jnp.sum((even[0] + odd[0]) ** 2 + (even[1] + odd[1]) ** 2, axis=2)
        opposite = jnp.sum((even[0] - odd[0]) ** 2 + (even[1] - odd[1]) ** 2, axis=2)
        opposite = opposite[..., : self.grid.beams - here.shape[-1]]
        power = jnp.concatenate([here, opposite if self.grid.circular else opposite[..., ::-1]], axis=-1)
        return jnp.moveaxis(power, 0, 1)

    @full_precision
    def _products(self, weights: Array, *parts: Array) -> tuple[Array, ...]:
        return tuple(jnp.einsum("fcb,tkfc->ftkb", weights, part) for part in parts)

    def scan(
        self,
        time: Float[Array, " frame"],
        samples: Float[Array, "frame sample channel"],
        usable: Bool[Array, "frame channel"],
    ) -> BeamScan:
        """Scans of consecutive frames, stacked along the first axis of every field.

        Parameters
        ----------
        time : middle of each frame; seconds.
        samples : zero where a channel is not usable.
        usable : which channels of each frame are used, beside those that are dead.
        """
        return self.scan_spectra(time, self.spectra(samples), usable)

    def scan_spectra(
        self,
        time: Float[Array, " frame"],
        spectra: Complex[Array, "frame snapshot frequency channel"],
        usable: Bool[Array, "frame channel"],
    ) -> BeamScan:
        """Scans from unitary spectra that are already at hand; see `scan`."""
        total = jnp.sum(spectra.real**2 + spectra.imag**2, axis=(1, 3))
        channels = jnp.sum(usable & (self.gains != 0), axis=1).astype(total.dtype)
        return BeamScan(time.astype(total.dtype), self.beam_power(spectra), total, channels, spectra)

    def scan_frame(self, time: Float[Array, ""], spectra: Complex[Array, "snapshot frequency channel"]) -> BeamScan:
        """Scan of a single frame from its unitary spectra, every channel usable."""
        stacked = self.scan_spectra(time[None], spectra[None], jnp.ones((1, spectra.shape[-1]), bool))
        return jax.tree.map(lambda values: values[0], stacked)


def beamformer(
    array: SensorArray,
    sample_rate: float,
    frame: float = 1.0,
    band: tuple[float, float] | None = None,
    beams: int | None = None,
    snapshot: float | None = None,
    dtype: type = np.float32,
    taper: bool = False,
    elevation: tuple[float, float] | None = None,
) -> Beamformer:
    r"""Plan the analysis of an array's frames.

    Parameters
    ----------
    array : geometry, sound speed, gains.
    sample_rate : Hz.
    frame : seconds between scans; each frame is analysed whole.
    band : lowest and highest frequency in Hz; everything between zero and half the sample rate where not given.
    beams : number of bearings; where not given, four in a main lobe at the top of the band, at least 180 and at most
        1440.
    snapshot : seconds in one transform, at most `frame`; where not given, the shortest that is 16 times the time a
        wave takes along the array and has at least 32 bins in the band, or the frame.
    dtype : numpy type of real values.
    taper : snapshots overlap by half, under Hann's window, where a frame holds two or more side by side.
    elevation : lowest and highest elevation of waves above the horizon, radians; all are level where not given.

    Raises
    ------
    InputError : a band without a bin, beyond half the sample rate, or a frame that is too short; elevations that the
        array cannot tell, or more than `MOST_RINGS` rings of them.

    Examples
    --------
    >>> from faintrack.sensors.array import line_array
    >>> plan = beamformer(line_array(55, 0.375), sample_rate=4000.0, frame=0.075, beams=180)
    >>> plan.grid.frequency.size, plan.grid.beams, plan.grid.snapshots
    (149, 180, 1)
    """
    nyquist = sample_rate / 2
    low, high = (0.0, nyquist) if band is None else band
    if not 0 <= low < high:
        raise InputError(f"band is {low:g} to {high:g} Hz; expected 0 <= low < high.")
    if high > nyquist:
        raise InputError(
            f"band reaches {high:g} Hz; the sample rate of {sample_rate:g} Hz allows at most {nyquist:g} Hz."
        )
    if not frame > 0:
        raise InputError(f"frame is {frame:g} s; expected more than 0.")
    length = round(frame * sample_rate)
    if snapshot is None:
        used = array.positions[array.alive]
        transit = np.linalg.norm(used[:, None] - used[None], axis=-1).max() / array.sound_speed
        shortest = max(16 * transit, 32 / (high - low))
        size = length // max(1, int(length / (shortest * sample_rate)))
    else:
        if not 0 < snapshot <= frame:
            raise InputError(f"snapshot is {snapshot:g} s; expected more than 0 and at most the frame, {frame:g} s.")
        size = round(snapshot * sample_rate)
    if size < 4:
        raise InputError(f"frame is {frame:g} s, {length} samples at {sample_rate:g} Hz; expected at least 4 samples.")
    resolution = sample_rate / size
    tapered = taper and length // size > 1
    bins = np.arange(1, (size - 1) // 2 + 1)
    bins = bins[(bins * resolution >= low) & (bins * resolution <= high)]
    clear = (bins >= 2) & (bins <= size / 2 - 3)
    if tapered and clear.any():
        # Where a taper meets the negative frequencies of a loud source, which seem to come from its mirror image.
        bins = bins[clear]
    if bins.size == 0:
        raise InputError(
            f"band {low:g} to {high:g} Hz holds no frequency bin; bins are {resolution:g} Hz apart for "
            f"a frame of {frame:g} s."
        )
    frequency = bins * resolution
    if beams is None:
        lobe = lobe_width(array, float(frequency[-1]))
        span = 2 * np.pi if array.circular else np.pi
        beams = int(np.clip(math.ceil(4 * span / lobe), 180, 1440))
    if beams < 8:
        raise InputError(f"beams is {beams}; expected at least 8.")
    snapshots, independent, window = length // size, 1.0, None
    if tapered:
        squared = np.sin(np.pi * (np.arange(size) + 0.5) / size) ** 4
        snapshots, independent = len(_starts(length, size)), _independent(length, squared)
        window = jnp.asarray(np.sqrt(squared / squared.mean()), dtype)
    elevations = () if elevation is None else _elevations(array, float(frequency[-1]), *elevation)
    grid = BeamGrid(frequency, beams, snapshots, array.circular, array, independent, elevations)
    # The second half of the beams is opposite to the first; on a circle of an odd number none is opposite to another.
    pairs = beams if array.circular and beams % 2 else (beams + 1) // 2
    delays = np.asarray(array.delays(grid.bearing[:pairs]))
    mirrored = _is_mirrored(array)
    share: np.ndarray = np.ones(1)
    if mirrored:
        near, far = _halves(delays)
        delays = (near - far) / 2
        # A channel in the centre is its own mirror image and counts once.
        share = np.where(np.arange(delays.shape[1]) < len(array.gains) // 2, 1.0, 0.5)[:, None]
    phase = 2 * np.pi * frequency[:, None, None] * delays.T
    raised = None
    if elevations:
        phase = np.cos(elevations)[:, None, None, None] * phase
        height = array.positions[:, 2] / array.sound_speed
        if np.any(height[array.alive]):
            turns = np.sin(elevations)[:, None, None] * frequency[:, None] * height
            raised = jnp.asarray(np.exp(-2j * np.pi * turns).astype(np.result_type(dtype, np.complex64)))
    cosine, sine = (jnp.asarray(part, dtype) for part in (share * np.cos(phase), np.sin(phase)))
    return Beamformer(grid, int(bins[0]), size, jnp.asarray(array.gains, dtype), cosine, sine, mirrored, window, raised)


def _elevations(array: SensorArray, frequency: float, low: float, high: float) -> tuple[float, ...]:
    """Elevations of rings, four in a main lobe at a frequency, and one beyond either end."""
    if not array.circular:
        raise InputError(
            "the array is a line, which hears every wave of a cone about its axis alike; expected no elevation_deg."
        )
    if low < 0 and not np.ptp(array.positions[array.alive, 2]):
        raise InputError(
            f"elevation_deg begins at {math.degrees(low):g}, and the channels lie in a level plane, which cannot tell "
            "above from below; expected 0 or more."
        )
    between = max(2, math.ceil(4 * (high - low) / lobe_width(array, frequency)))
    if between + 3 > MOST_RINGS:
        raise InputError(
            f"elevations from {math.degrees(low):g} to {math.degrees(high):g} degrees take {between + 3} rings of "
            f"beams at {frequency:g} Hz; expected at most {MOST_RINGS}: a lower band, or fewer elevations."
        )
    step = (high - low) / between
    return tuple((low + step * np.arange(-1, between + 2)).tolist())


def _positive(samples: Float[Array, "frame sample channel"]) -> Complex[Array, "frame sample channel"]:
    """Positive frequencies of each frame.

    A taper spreads the negative ones of a loud source into bins near zero and near half the sample rate, where they
    seem to come from its mirror image. Taken from the whole frame, what is left of them lies at its ends, where the
    taper is small.
    """
    length = samples.shape[1]
    spectra = jnp.fft.rfft(samples, axis=1)[:, 1 : (length + 1) // 2]
    return jnp.fft.ifft(jnp.pad(spectra, ((0, 0), (1, length - 1 - spectra.shape[1]), (0, 0))), axis=1)


def _starts(length: int, size: int) -> range:
    """First samples of snapshots of a size that overlap by half within a frame."""
    return range(0, length - size + 1, max(size // 2, 1))


def _independent(length: int, squared: Float[np.ndarray, " sample"]) -> float:
    """Independent samples of a frame, over those that its snapshots count (the module's equation)."""
    size, starts = len(squared), _starts(length, len(squared))
    weight = np.zeros(length)
    for start in starts:
        weight[start : start + size] += squared
    return float(weight.sum() ** 2 / np.sum(weight**2) / (len(starts) * size))


def _is_mirrored(array: SensorArray) -> bool:
    """Whether channel m and the m-th from the end lie opposite each other, all about one centre."""
    sums = array.positions + array.positions[::-1]
    return bool(np.abs(sums - sums[0]).max() <= MIRROR_METRES)


def _halves(values: Any) -> tuple[Any, Any]:
    """First half of the last axis, and its mirror image from the end; one in the middle is in both."""
    half = (values.shape[-1] + 1) // 2
    return values[..., :half], values[..., ::-1][..., :half]
