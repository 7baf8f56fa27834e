r"""DEMON: what modulates noise, the spectrum of its envelope.

A propeller's noise is broad, and louder each time that a blade passes: no line stands in its spectrum, and lines of
shaft and blades stand in that of its power. A band is passed, squared, smoothed and thinned to twice the highest rate
of interest and a little more,

.. math:: e_n = \left[ g * (h * x)^2 \right]_{n D}, \qquad (1 + m \cos \Omega t)^2 \sigma^2
    = \sigma^2 \left( 1 + \tfrac{m^2}{2} + 2 m \cos \Omega t + \tfrac{m^2}{2} \cos 2 \Omega t \right)

with h the band pass, g the smoothing and D the thinning: noise whose amplitude is modulated by m has a line of
:math:`2 m` over its mean power, and one of :math:`m^2 / 2` at twice the rate. The mean so far is divided by and taken
off, and the rest is a recording of its own whose lines `faintrack.signal.lofar` finds. Filters carry their state from
block to block, so that the cut of a recording into blocks changes nothing.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from faintrack.data.recording import Recording
from faintrack.errors import InputError, naming
from faintrack.signal.lofar import Chosen, Lofargram, record_of, require_steps, require_window, window_samples

HIGHEST = 100.0
"""Rate up to which lines are looked for, where none is given; Hz."""

ORDER = 6
"""Of the band pass and the smoothing, both of Butterworth."""

MARGIN = 1.25
"""Half the rate of the envelope over the highest rate of interest."""

BLOCK = 1.0
"""Of samples that are read at once; s."""


def envelope(
    blocks: Iterable[np.ndarray], sample_rate: float, band: tuple[float, float], every: int
) -> Iterator[np.ndarray]:
    """Power in a band, smoothed and thinned, as samples come.

    Parameters
    ----------
    blocks : consecutive samples (time, channel), of any lengths.
    sample_rate : Hz.
    band : lowest and highest frequency that pass; Hz.
    every : samples of the recording to one of the envelope, at least 2.

    Examples
    --------
    >>> samples = np.random.default_rng(0).normal(size=(4000, 1))
    >>> whole = np.concatenate(list(envelope([samples], 1000.0, (200.0, 400.0), 5)))
    >>> parts = np.concatenate(list(envelope([samples[:1234], samples[1234:]], 1000.0, (200.0, 400.0), 5)))
    >>> whole.shape, bool(np.allclose(whole, parts))
    ((800, 1), True)
    """
    from scipy.signal import butter, sosfilt

    passing = butter(ORDER, band, "bandpass", fs=sample_rate, output="sos")
    smoothing = butter(ORDER, 0.8 * sample_rate / (2 * every), fs=sample_rate, output="sos")
    states: list[np.ndarray] | None = None
    phase = 0
    for block in blocks:
        samples = np.asarray(block, float)
        if states is None:
            states = [np.zeros((len(each), 2, samples.shape[1])) for each in (passing, smoothing)]
        passed, states[0] = sosfilt(passing, samples, axis=0, zi=states[0])
        power, states[1] = sosfilt(smoothing, passed**2, axis=0, zi=states[1])
        thinned = power[phase::every]
        phase = (phase - len(power)) % every
        yield thinned


def demon(
    recording: Recording,
    band: tuple[float, float] | None = None,
    highest: float = HIGHEST,
    resolution: float | None = None,
    interval: float | None = None,
    channels: Sequence[int] | None = None,
) -> Lofargram:
    """Record of the spectrum of the envelope of a recording, and its lines; a stretch of it is held at a time.

    Parameters
    ----------
    recording : any.
    band : that is passed; Hz. From a quarter to nine tenths of half the sample rate where not given.
    highest : rate of modulation that is looked for; Hz.
    resolution, interval, channels : as of `faintrack.signal.lofar.lofar`; the resolution where not given is a 500th of
        `highest`.

    Raises
    ------
    InputError : a band that is none, or too narrow or too low for the highest rate; a recording that is too short.

    Examples
    --------
    >>> from faintrack.data.recording import from_samples
    >>> time = np.arange(120_000) / 2000.0
    >>> noise = np.random.default_rng(0).normal(size=120_000) * (1 + 0.3 * np.cos(2 * np.pi * 7.3 * time))
    >>> record = demon(from_samples(noise[:, None], 2000.0), highest=50.0)
    >>> [round(line.frequency, 1) for line in record.lines]
    [7.3]
    """
    rate = recording.sample_rate
    band = (rate / 8, 0.45 * rate) if band is None else band
    if not 0 < band[0] < band[1] < rate / 2:
        raise InputError(
            f"{recording.source}: the band goes from {band[0]:g} to {band[1]:g} Hz; expected the lower end first, "
            f"above 0 and below half the sample rate, {rate / 2:g} Hz."
        )
    if not 0 < highest <= min(band[1] - band[0], band[0]):
        raise InputError(
            f"{recording.source}: rates up to {highest:g} Hz are looked for in a band from {band[0]:g} to {band[1]:g} "
            "Hz; expected a band that is as wide and begins as high at least."
        )
    require_steps(recording, resolution, interval)
    every = max(2, int(rate / (2 * MARGIN * highest)))
    slow = rate / every
    window = window_samples(slow, (0.0, highest), highest / 500 if resolution is None else resolution)
    require_window(recording, window / slow)
    with naming(recording.source):
        samples = Chosen(recording, channels)
        powers = _modulation(
            envelope(samples.blocks(max(1, round(BLOCK * rate))), rate, band, every), max(1, round(slow))
        )
        record = record_of(powers, slow, recording.duration, window, (0.0, highest), interval)
    return replace(record, remarks=samples.remarks())


def _modulation(powers: Iterable[np.ndarray], settled: int) -> Iterator[np.ndarray]:
    """Power over its mean so far, less 1; nothing while the filters settle."""
    total, count = 0.0, 0
    for power in powers:
        count += len(power)
        total = total + power.sum(axis=0)
        mean = np.maximum(total / max(count, 1), np.finfo(float).tiny)
        yield power / mean - 1 if count > settled else np.zeros_like(power)
