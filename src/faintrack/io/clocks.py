r"""Samples on one clock: where a recorder's own samples lie on the samples of a recording, and what they are there.

A recorder that tells the time of its samples now and then may run a little fast or slow, or have begun between two
samples of the others. Its sample :math:`n` lies at :math:`p(n)` samples of the common clock, a function that is known
at the time stamps: a straight line where one fits them, otherwise straight from stamp to stamp. What the recorder heard
at the common samples is found by band-limited interpolation, a sinc of `TAPS` samples to each side under a Kaiser
window, right to 0.1 % of the amplitude up to 0.8 of half the sample rate. Where samples lie within `NEAR` of the
common ones they are taken as they are.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

TAPS = 24
NEAR = 0.05
_BETA = 7.0


@dataclass(frozen=True)
class Places:
    """Where the samples of an unbroken run lie on the common clock.

    Attributes
    ----------
    numbers : of samples of the run that have a time stamp, ascending from 0.
    stamps : where they lie; samples of the common clock.
    length : number of samples in the run.
    slope : common samples between two of its own, before the first stamp and after the last.
    """

    numbers: Int[np.ndarray, " stamp"]
    stamps: Float[np.ndarray, " stamp"]
    length: int
    slope: float

    @property
    def plain(self) -> bool:
        """Whether every sample lies within `NEAR` of a whole number, counted on from the first."""
        ends = np.array([self.at(0), self.at(self.length - 1)])
        offsets = np.concatenate([self.stamps - self.numbers, ends - [0, self.length - 1]])
        return bool((np.abs(offsets - round(self.at(0))) <= NEAR).all())

    @property
    def start(self) -> int:
        """First common sample that the run reaches."""
        return round(self.at(0)) if self.plain else int(np.ceil(self.at(0) - NEAR))

    @property
    def stop(self) -> int:
        """Common sample after the last that it reaches."""
        last = self.at(self.length - 1)
        return (round(self.at(0)) + self.length) if self.plain else int(np.floor(last + NEAR)) + 1

    def at(self, number: float) -> float:
        """Where a sample of the run lies."""
        return float(_line(np.array([number], float), self.numbers, self.stamps, self.slope)[0])

    def own(self, places: Float[np.ndarray, " place"]) -> Float[np.ndarray, " place"]:
        """Number of the run's own sample, with its fraction, that lies at a place."""
        return _line(places, self.stamps, self.numbers, 1 / self.slope)


def _line(values: np.ndarray, knots: np.ndarray, images: np.ndarray, slope: float) -> np.ndarray:
    """Straight from knot to knot, and on with a slope beyond both ends."""
    inside = np.interp(values, knots, images)
    before, after = np.minimum(values - knots[0], 0), np.maximum(values - knots[-1], 0)
    return inside + slope * (before + after)


def places(numbers: np.ndarray, stamps: np.ndarray, length: int, slope: float, resolution: float) -> Places:
    """Places of a run from its time stamps.

    Parameters
    ----------
    numbers, stamps, length : as `Places`.
    slope : common samples between two of its own, as its header tells.
    resolution : of the stamps; common samples.

    Examples
    --------
    >>> run = places(np.array([0, 1000, 2000]), np.array([0.0, 1000.5, 2001.0]), 3000, 1.0, 0.1)
    >>> run.at(2999), run.plain, run.start, run.stop
    (3000.4995, False, 0, 3001)
    """
    numbers, stamps = np.asarray(numbers, np.int64), np.asarray(stamps, float)
    nominal = stamps[0] + slope * (numbers - numbers[0])
    off = stamps - nominal
    near = max(resolution, NEAR)
    if np.ptp(off) <= near:
        # As the header says; the mean is nearer than any of the stamps.
        fitted = Places(np.array([0]), np.array([stamps[0] - slope * numbers[0] + _middle(off)]), length, slope)
        return fitted
    centred = numbers - numbers.mean()
    rate = slope + float(centred @ (off - off.mean()) / (centred @ centred))
    line = stamps.mean() + rate * centred
    if np.abs(stamps - line).max() <= near:
        return Places(np.array([0]), np.array([line[0] - rate * numbers[0]]), length, rate)
    return Places(numbers, stamps, length, rate)


def _middle(off: np.ndarray) -> float:
    return float((off.min() + off.max()) / 2)


def interpolated(
    source: Callable[[int, int], Float[np.ndarray, " sample"]], length: int, wanted: Float[np.ndarray, " place"]
) -> Float[np.ndarray, " place"]:
    """Values between samples.

    Parameters
    ----------
    source : function of (start, stop) to samples.
    length : number of samples there are; what lies beyond is taken as the nearest one.
    wanted : numbers of samples, with fractions, ascending.

    Examples
    --------
    >>> wave = np.sin(0.6 * np.arange(400))
    >>> wanted = np.arange(100, 200) + 0.37
    >>> found = interpolated(lambda start, stop: wave[start:stop], 400, wanted)
    >>> bool(np.abs(found - np.sin(0.6 * wanted)).max() < 1e-3)
    True
    """
    if not len(wanted):
        return np.empty(0)
    low, high = int(np.floor(wanted[0])) - TAPS + 1, int(np.floor(wanted[-1])) + TAPS + 1
    inside = max(low, 0), min(high, length)
    samples = np.asarray(source(*inside), float)
    samples = np.pad(samples, (inside[0] - low, high - inside[1]), mode="edge")
    whole = np.floor(wanted).astype(np.int64)
    windows = np.lib.stride_tricks.sliding_window_view(samples, 2 * TAPS)[whole - TAPS + 1 - low]
    distance = (wanted - whole)[:, None] - np.arange(1 - TAPS, TAPS + 1)
    window = np.i0(_BETA * np.sqrt(np.maximum(1 - (distance / TAPS) ** 2, 0))) / np.i0(_BETA)
    weights = np.sinc(distance) * window
    return np.einsum("pt,pt->p", windows, weights / weights.sum(axis=1, keepdims=True))
