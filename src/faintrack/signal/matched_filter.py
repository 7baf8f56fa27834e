r"""From the samples of an array to the matched filter's output of an active sonar: pulses, replicas, beams, normaliser.

A pulse is a function of time, :math:`r(t) = e^{j \phi(t)}` for :math:`0 \le t < T`, with the phase

.. math::
    \phi(t) = 2 \pi (f_0 - B/2) t + \pi B t^2 / T \quad \text{(linear sweep; CW with } B = 0), \qquad
    \phi(t) = -\frac{2 \pi f_1 f_2 T}{B} \log\left(1 - \frac{B t}{f_2 T}\right) \quad \text{(hyperbolic)},

:math:`f_1, f_2 = f_0 \mp B/2`, or a carrier that a code of :math:`\pm 1` turns over, or what a file holds. An echo
that is shifted by :math:`\nu` is the pulse in a time that runs :math:`\eta = 1 + \nu / f_0` as fast. With the replica's
energy 1 the output for noise of unit variance in a sample has mean power 1,

.. math:: y(\tau) = \sum_n x_n \, r^*(\eta (n / f_s - \tau)) \Big/ \sqrt{\textstyle\sum_n |r(\eta n / f_s)|^2} .

It is taken in the frequency domain, in the bins in which the replica has any energy, and of beams
:math:`\frac{1}{M} \sum_m d_m^*(f) X_m(f)`, phase and sum of the channels with the steering vectors of
`faintrack.sensors.beams`.

The **split window** normaliser divides by the mean of N cells on both sides, beyond a guard. In exponential noise of
any level the ratio exceeds :math:`\eta` with the probability

.. math:: (1 + \eta / N)^{-N},

a tail of the shape 1/N (`faintrack.signal.returns_background`), heavier than exponential by what the mean is uncertain.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import scipy.fft
import scipy.interpolate
import scipy.signal
from jaxtyping import Complex, Float

from faintrack.sensors.array import SensorArray
from faintrack.sensors.beams import steering

NEGLIGIBLE = 1e-5
"""Of the largest amplitude in a replica's spectrum: bins below it are left out."""


@dataclass(frozen=True)
class Waveform:
    """A pulse as a function of time.

    Attributes
    ----------
    value : function of seconds to complex values, 0 before the pulse and from its end on.
    duration : s.
    frequency : in its middle, from which Doppler shifts count; Hz.
    """

    value: Callable[[np.ndarray], np.ndarray]
    duration: float
    frequency: float

    def samples(self, sample_rate: float, doppler: float = 0.0) -> Complex[np.ndarray, " sample"]:
        """Replica of unit energy of an echo with a Doppler shift (Hz), from its first sample on."""
        scale = 1 + doppler / self.frequency
        count = math.ceil(self.duration / scale * sample_rate)
        values = self.value(scale * np.arange(count) / sample_rate)
        return values / np.linalg.norm(values)


def sweep(frequency: float, duration: float, bandwidth: float = 0.0, hyperbolic: bool = False) -> Waveform:
    """Linear or hyperbolic sweep upwards, or with no bandwidth a pulse of constant frequency (the module's equations).

    Parameters
    ----------
    frequency : in the middle of the band; Hz.
    duration : s.
    bandwidth : Hz.
    hyperbolic : whether the period, in place of the frequency, changes evenly: its echo does not lose by Doppler.

    Examples
    --------
    >>> replica = sweep(200.0, 0.5, 50.0).samples(1000.0)
    >>> len(replica), round(float(np.sum(abs(replica) ** 2)), 6)
    (500, 1.0)
    """
    low, high = frequency - bandwidth / 2, frequency + bandwidth / 2

    def phase(time: np.ndarray) -> np.ndarray:
        if hyperbolic and bandwidth > 0:
            return -2 * np.pi * low * high * duration / bandwidth * np.log1p(-bandwidth * time / (high * duration))
        return 2 * np.pi * low * time + np.pi * bandwidth * time**2 / duration

    def value(time: np.ndarray) -> np.ndarray:
        inside = (time >= 0) & (time < duration)
        return np.where(inside, np.exp(1j * phase(np.where(inside, time, 0))), 0)

    return Waveform(value, duration, frequency)


def coded(frequency: float, duration: float, code: tuple[int, ...]) -> Waveform:
    """Carrier whose sign follows a code, its chips of equal length.

    Examples
    --------
    >>> coded(250.0, 0.013, (1, 1, 1, 1, 1, -1, -1, 1, 1, -1, 1, -1, 1)).samples(1000.0).real.round(2)[:5].tolist()
    [0.28, 0.0, -0.28, -0.0, 0.28]
    """
    signs = np.array([*code, 0.0])

    def value(time: np.ndarray) -> np.ndarray:
        chip = np.floor(time / duration * len(code) + 1e-9)
        inside = (chip >= 0) & (chip < len(code))
        return signs[np.where(inside, chip, len(code)).astype(int)] * np.exp(2j * np.pi * frequency * time)

    return Waveform(value, duration, frequency)


def recorded(samples: Float[np.ndarray, " sample"], sample_rate: float, frequency: float) -> Waveform:
    """Pulse as it was sampled; between samples its envelope is a cubic spline.

    Parameters
    ----------
    samples : of the pulse alone.
    sample_rate : Hz.
    frequency : in its middle; Hz.

    Examples
    --------
    >>> time = np.arange(400) / 1000
    >>> pulse = recorded(np.cos(2 * np.pi * 100 * time), 1000.0, 100.0)
    >>> pulse.duration, round(float(abs(pulse.value(np.array([0.2005])))[0]), 3)
    (0.4, 1.0)
    """
    time = np.arange(len(samples)) / sample_rate
    envelope = scipy.signal.hilbert(samples) * np.exp(-2j * np.pi * frequency * time)
    spline = scipy.interpolate.CubicSpline(time, envelope)
    duration = len(samples) / sample_rate

    def value(at: np.ndarray) -> np.ndarray:
        inside = (at >= 0) & (at < duration)
        return np.where(inside, spline(np.where(inside, at, 0)) * np.exp(2j * np.pi * frequency * at), 0)

    return Waveform(value, duration, frequency)


def matched(
    samples: Float[np.ndarray, "sample channel"],
    array: SensorArray,
    bearings: Float[np.ndarray, " beam"],
    replicas: list[Complex[np.ndarray, " tap"]],
    sample_rate: float,
) -> Iterator[Complex[np.ndarray, "doppler sample"]]:
    """Yield the output for every replica, beam by beam (the module's third equation).

    Parameters
    ----------
    samples : of all channels; those that are not used may hold anything.
    array : geometry and gains.
    bearings : of the beams, as `faintrack.sensors.array.SensorArray.delays` takes them; radians.
    replicas : of unit energy, one for each Doppler shift.
    sample_rate : Hz.

    Returns
    -------
    For every beam the output at each sample from which a whole replica lies in the samples.

    Examples
    --------
    >>> from faintrack.sensors.array import line_array
    >>> replica = sweep(100.0, 0.1).samples(1000.0)
    >>> x = np.zeros((300, 2))
    >>> x[50:150] = 6 * replica.real[:, None]
    >>> (output,) = matched(x, line_array(2, 0.1), np.array([np.pi / 2]), [replica], 1000.0)
    >>> output.shape, int(abs(output[0]).argmax()), round(float(abs(output[0]).max()), 3)
    ((1, 201), 50, 3.0)
    """
    used = np.flatnonzero(array.gains)
    count = scipy.fft.next_fast_len(len(samples) + max(map(len, replicas)))
    spectra = np.fft.fft(samples[:, used] * array.gains[used], count, axis=0)
    filters = np.conj(np.stack([np.fft.fft(replica, count) for replica in replicas]))
    level = np.abs(filters).max(axis=0)
    bins = np.flatnonzero(level > NEGLIGIBLE * level.max())
    frequency = np.fft.fftfreq(count, 1 / sample_rate)[bins]
    spectra, filters = spectra[bins], filters[:, bins]
    last = len(samples) - max(map(len, replicas)) + 1
    for bearing in bearings:
        vectors = steering(array, frequency, np.array([bearing]))[:, 0, used]
        beam = np.sum(np.conj(vectors) * spectra, axis=1) / len(used)
        whole = np.zeros((len(replicas), count), complex)
        whole[:, bins] = filters * beam
        yield np.fft.ifft(whole, axis=1)[:, :last]


def split_window(
    power: Float[np.ndarray, "*beams delay"], guard: int, window: int
) -> Float[np.ndarray, "*beams delay"]:
    """Power over the mean of `window` cells on both sides, beyond `guard`; at the ends over those that there are.

    Parameters
    ----------
    power : of the cells, along the last axis.
    guard, window : cells on either side.

    Examples
    --------
    >>> split_window(np.array([1.0, 1.0, 9.0, 3.0, 3.0]), guard=0, window=2).round(3).tolist()
    [0.2, 0.231, 4.5, 0.692, 0.5]
    """
    total, cells = split_sums(power, guard, window)
    return power * cells / np.maximum(total, np.finfo(float).tiny)


def split_sums(
    power: Float[np.ndarray, "*beams delay"], guard: int, window: int
) -> tuple[Float[np.ndarray, "*beams delay"], Float[np.ndarray, " delay"]]:
    """Sums of a split window, as of `split_window`, and over how many cells each is.

    Examples
    --------
    >>> [part.tolist() for part in split_sums(np.array([1.0, 1.0, 9.0, 3.0, 3.0]), guard=0, window=2)]
    [[10.0, 13.0, 8.0, 13.0, 12.0], [2.0, 3.0, 4.0, 3.0, 2.0]]
    """
    count = power.shape[-1]
    sums = np.concatenate([np.zeros((*power.shape[:-1], 1)), np.cumsum(power, axis=-1)], axis=-1)
    cell = np.arange(count)
    ends = ((cell - guard - window, cell - guard), (cell + guard + 1, cell + guard + window + 1))
    total, cells = np.zeros(power.shape), np.zeros(count)
    for first, last in ends:
        first, last = np.clip(first, 0, count), np.clip(last, 0, count)
        total, cells = total + sums[..., last] - sums[..., first], cells + last - first
    return total, cells
