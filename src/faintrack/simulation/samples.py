r"""Samples of an array: moving sources in noise, a block at a time.

Each source sends white Gaussian noise, or a sine, of variance :math:`a \sigma^2`, with a its signal to noise ratio and
:math:`\sigma^2` the variance of the noise in a channel (bosser2022, eq. 9 and 21). The waveform reaches each channel
delayed by `SensorArray.delays` at the bearing of the moment: segments are delayed in the frequency domain (eq. 13-15)
and faded into each other
with Hann windows, which sum to one. Blocks depend on seed and place alone, so memory does not grow with the duration.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.signal

from faintrack.sensors.array import SensorArray

TAPS = 255
"""Length of the filter that colours the noise; samples."""

GUARD = 128
"""Samples on both sides of a segment, beyond the longest delay, that keep its ends from being heard."""


@dataclass(frozen=True)
class Source:
    """A plane wave that appears, turns at a constant rate, and leaves.

    Attributes
    ----------
    snr_db : variance of its signal over variance of the noise at one channel; dB.
    bearing : at `start`; radians.
    bearing_rate : radians a second.
    start, end : seconds from the start of the recording.
    elevation : above the horizon; radians. A line array hears level waves only.
    tone : frequency of its sine, Hz; white noise where None.
    """

    snr_db: float
    bearing: float
    bearing_rate: float = 0.0
    start: float = 0.0
    end: float = math.inf
    elevation: float = 0.0
    tone: float | None = None

    def bearing_at(self, time: np.ndarray | float) -> np.ndarray:
        """Bearing at given times, in radians, not wrapped."""
        return np.asarray(self.bearing + self.bearing_rate * (np.asarray(time) - self.start))


def draw_samples(
    array: SensorArray,
    sources: Sequence[Source],
    duration: float,
    sample_rate: float,
    seed: int = 0,
    noise_power: float = 1.0,
    noise_slope_db: float = 0.0,
    heading: Callable[[float], float] | None = None,
) -> Iterator[np.ndarray]:
    """Yield blocks of samples, shape (time, channel), float32, until the duration is full.

    Parameters
    ----------
    array : geometry and sound speed. A dead channel is silent, a gain is undone, as the recorder would have it.
    sources : what is heard.
    duration : seconds.
    sample_rate : Hz.
    seed : the same seed gives the same samples.
    noise_power : variance of the noise in each channel, independent between channels.
    noise_slope_db : of the noise's spectrum, dB per octave; 0 for white noise.
    heading : of an array that turns, at a time; radians. Bearings of sources are then true, and the directions of the
        array those at heading 0, of a line that of its axis.

    Examples
    --------
    >>> from faintrack.sensors.array import line_array
    >>> blocks = list(draw_samples(line_array(4, 0.5), [Source(-10.0, 1.0)], duration=2.0, sample_rate=1000.0))
    >>> np.concatenate(blocks).shape
    (2000, 4)
    """
    total = round(duration * sample_rate)
    channels = len(array.gains)
    used = array.positions[array.alive]
    longest = np.linalg.norm(used, axis=1).max() / array.sound_speed
    hop = 2 ** math.ceil(math.log2(max(longest * sample_rate + GUARD, 0.05 * sample_rate)))
    frequency = np.fft.rfftfreq(4 * hop, 1 / sample_rate)
    window = scipy.signal.windows.hann(2 * hop, sym=False)[:, None]
    # What the recorder puts on a channel is what the array file takes off again.
    response = np.where(array.alive, 1 / np.where(array.alive, array.gains, 1), 0)
    taps = coloring_filter(noise_slope_db)

    def chunk(stream: int, number: int, width: int) -> np.ndarray:
        """`hop` samples of white noise that depend on seed, stream and number alone; numbers start at -2."""
        return np.random.default_rng([seed, stream, number + 2]).standard_normal((hop, width))

    def waveform(index: int, number: int) -> np.ndarray:
        source = sources[index]
        time = (number * hop + np.arange(hop)) / sample_rate
        heard = (time >= source.start) & (time < source.end)
        amplitude = math.sqrt(noise_power * 10 ** (source.snr_db / 10))
        if source.tone is not None:
            phase = 2 * math.pi * np.random.default_rng([seed, 1 + index]).random()
            return amplitude * heard * math.sqrt(2) * np.cos(2 * math.pi * source.tone * time + phase)
        return amplitude * heard * chunk(1 + index, number, 1)[:, 0]

    def segment(number: int) -> np.ndarray:
        """Sum of all sources over two hops from `number` on, at every channel."""
        heard = np.zeros((2 * hop, channels))
        middle = (number + 1) * hop / sample_rate
        for index, source in enumerate(sources):
            near = np.concatenate([waveform(index, number + i) for i in range(-1, 3)])
            if near.any():
                elevation = np.asarray(source.elevation) if source.elevation else None
                ahead = 0.0 if heading is None else heading(middle)
                delays = array.delays(np.asarray(source.bearing_at(middle) - ahead), elevation)
                spectrum = np.fft.rfft(near)[:, None] * np.exp(-2j * np.pi * frequency[:, None] * delays)
                heard += np.fft.irfft(spectrum, 4 * hop, axis=0)[hop : 3 * hop]
        return heard * window

    def noise(number: int) -> np.ndarray:
        fresh = chunk(0, number, channels)
        if noise_slope_db == 0:
            return fresh
        before = chunk(0, number - 1, channels)[-(len(taps) - 1) :]
        return scipy.signal.fftconvolve(np.concatenate([before, fresh]), taps[:, None], mode="valid", axes=0)

    fading = segment(-1)[hop:]
    for number in range(math.ceil(total / hop)):
        coming = segment(number)
        block = fading + coming[:hop] + math.sqrt(noise_power) * noise(number)
        fading = coming[hop:]
        yield (block * response)[: total - number * hop].astype(np.float32)


def coloring_filter(slope_db: float) -> np.ndarray:
    """Filter that gives white noise a spectrum of constant slope per octave and leaves its variance as it is.

    Below a hundredth of half the sample rate the spectrum is flat.

    Examples
    --------
    >>> taps = coloring_filter(-6.0)
    >>> round(float(np.sum(taps**2)), 6)
    1.0
    """
    frequency = np.concatenate([[0.0], np.geomspace(0.01, 1.0, 64)])
    amplitude = np.maximum(frequency, 0.01) ** (slope_db / (20 * math.log10(2)))
    taps = scipy.signal.firwin2(TAPS, frequency, amplitude)
    return taps / np.sqrt(np.sum(taps**2))
