r"""LOFAR: the spectrum of a recording over time, each frequency over what is around it, and its lines.

Machinery sounds at steady frequencies, in lines that stand above the broad noise of sea and flow. Powers of overlapping
windows are averaged over an interval and over channels, so that a row of the record is

.. math:: P_f(t) = \frac{1}{K C} \sum_{k, c} \frac{|\sum_n w_n x_{c, n + k h} e^{-2 \pi i f n / N}|^2}{\sum_n w_n^2}

with w a Hann window of N samples, h half of it, K windows and C channels: in white noise its variance. A level is the
ratio of it to a background that a **split window** along frequency tells: the mean of the bins on both sides, beyond a
guard that the main lobe of a line does not pass. Lines within the window would raise it for their neighbours: bins that
noise hardly reaches above the mean are replaced by it, and the mean is taken again.

**Lines** are maxima of the mean of all rows that noise passes with a small probability, each row over its background,
so that one in which something was loud counts as any other. In noise the mean of K windows is a gamma variable, and its
ratio to the mean of B bins has the F distribution of 2 K and 2 K B degrees of freedom. A line stands above either side:
on a slope of the spectrum, and within a guard of the ends of the band, there is none.
Windows that overlap by a half, with w that of Hann, correlate by 1/6 in amplitude: K of them are
:math:`K / (1 + 2 / 36)` independent ones (Welch, *The use of fast Fourier transform for the estimation of power
spectra*, 1967). Channels are not counted as independent, since low noise is common to them. Lines at whole multiples of
one frequency are harmonics of a shaft, a blade or an engine and are listed together.

What modulates noise shows in the spectrum of its envelope instead (`faintrack.signal.demon`).
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from scipy.stats import f as fisher
from scipy.stats import gamma

from faintrack.data.recording import Recording
from faintrack.errors import InputError, naming
from faintrack.signal.matched_filter import split_sums

BINS = 2000
"""Of frequency, that are chosen where no resolution is given."""

ROWS = 600
"""Of the record, that are chosen where no interval is given; also windows of a row at least one."""

GUARD, WINDOW = 4, 24
"""Bins on either side of one that its background leaves out, and averages beyond them."""

LOUD, PASSES = 0.01, 4
"""Probability that noise reaches what is no background; times that the mean is taken."""

OVERLAP = 1 + 2 / 36
"""Windows over independent ones: those of Hann that overlap by a half, whose powers correlate by 1/36."""

CHANCE = 1e-2
"""Probability that noise alone shows any line in a record."""

ROUNDED = 1e-15
"""Share of the power of a spectrum that rounding leaves in a bin."""

HARMONICS, FEWEST = 40, 3
"""Of one fundamental: highest number that is looked for, and lines that make a series."""


class Row(NamedTuple):
    """A row of a record.

    Attributes
    ----------
    time : of its middle; s.
    power : of each bin, over the noise's variance in a sample; shape (frequency,).
    windows : that were averaged.
    """

    time: float
    power: Float[np.ndarray, " frequency"]
    windows: int


@dataclass(frozen=True)
class Line:
    """A line of a spectrum.

    Attributes
    ----------
    frequency : Hz.
    level_db : power of its bin over the background's.
    fundamental : of the series that it belongs to, Hz; None where it stands alone.
    harmonic : its number in the series; 0 where it stands alone.
    """

    frequency: float
    level_db: float
    fundamental: float | None = None
    harmonic: int = 0


@dataclass(frozen=True)
class Lofargram:
    """A record of levels, and the lines of its mean.

    Attributes
    ----------
    times : of the rows; s from the first sample.
    frequency : of the bins; Hz.
    level_db : over the background, shape (time, frequency).
    mean_db : that of the mean of all rows.
    threshold_db : that lines pass.
    lines : by frequency.
    remarks : what was missing; one sentence each.
    """

    times: Float[np.ndarray, " time"]
    frequency: Float[np.ndarray, " frequency"]
    level_db: Float[np.ndarray, "time frequency"]
    mean_db: Float[np.ndarray, " frequency"]
    threshold_db: float
    lines: tuple[Line, ...]
    remarks: tuple[str, ...] = ()


def window_samples(sample_rate: float, band: tuple[float, float], resolution: float | None) -> int:
    """Samples of a window: one over the resolution, or `BINS` bins of a band; even.

    Examples
    --------
    >>> window_samples(4000.0, (0.0, 2000.0), 0.5), window_samples(4000.0, (0.0, 1000.0), None)
    (8000, 8000)
    """
    step = (band[1] - band[0]) / BINS if resolution is None else resolution
    return 2 * max(8, round(sample_rate / step / 2))


def rows_of(blocks: Iterable[np.ndarray], sample_rate: float, window: int, windows: int) -> Iterator[Row]:
    """Rows of mean power, as samples come; never more than a block and a window of them is held.

    Parameters
    ----------
    blocks : consecutive samples (time, channel), of any lengths.
    sample_rate : Hz.
    window : samples of a window, even; from one to the next is half of it.
    windows : of a row; the last may have fewer.
    """
    shape = np.hanning(window + 1)[:-1]
    energy, hop = float(np.sum(shape**2)), window // 2
    held: np.ndarray | None = None
    power, count, done = np.zeros(hop + 1), 0, 0

    def row() -> Row:
        first, last = done - count, done - 1
        time = ((first + last) / 2 * hop + window / 2) / sample_rate
        assert held is not None
        return Row(time, power / (count * held.shape[1]), count)

    for block in blocks:
        samples = np.asarray(block, float)
        held = samples if held is None else np.concatenate([held, samples])
        start = 0
        while len(held) - start >= window:
            spectrum = np.fft.rfft(held[start : start + window] * shape[:, None], axis=0)
            power = power + np.sum(spectrum.real**2 + spectrum.imag**2, axis=1) / energy
            start, count, done = start + hop, count + 1, done + 1
            if count == windows:
                yield row()
                power, count = np.zeros(hop + 1), 0
        held = held[start:]
    if count:
        yield row()


def background(power: Float[np.ndarray, "*row frequency"], windows: float) -> Float[np.ndarray, "*row frequency"]:
    """Power of each bin without a line: the mean of a split window, of bins that are no lines.

    Parameters
    ----------
    power : mean over some windows.
    windows : that are as good as independent.

    Examples
    --------
    >>> power = np.ones(100)
    >>> power[[40, 52]] = 500.0, 9.0
    >>> background(power, 50.0).round(3).tolist() == [1.0] * 100
    True
    """
    limit, level = gamma.isf(LOUD, windows) / windows, power
    for _ in range(PASSES):
        total, cells = split_sums(level, GUARD, WINDOW)
        mean = total / np.maximum(cells, 1)
        level = np.where(power > limit * mean, mean, power)
    return np.asarray(mean)


def higher_side(power: Float[np.ndarray, " frequency"], windows: float) -> Float[np.ndarray, " frequency"]:
    """Power of the louder side of every bin; infinite where one has no `GUARD` bins, and a slope may be a line.

    By the median, which a line among them does not move, and which takes nothing from a slope.

    Parameters
    ----------
    power : mean over some windows.
    windows : that are as good as independent.

    Examples
    --------
    >>> higher_side(np.arange(1.0, 21.0), 1e6)[[0, 7, 8, 19]].round(2).tolist()
    [inf, inf, 17.0, inf]
    """
    count, sides = len(power), []
    padded = np.pad(power, GUARD + WINDOW, constant_values=np.nan)
    around = np.lib.stride_tricks.sliding_window_view(padded, WINDOW)
    for first in (0, 2 * GUARD + WINDOW + 1):
        side = around[first : first + count]
        enough = np.isfinite(side).sum(axis=1) >= GUARD
        middle = np.nanmedian(np.where(enough[:, None], side, 0.0), axis=1)
        sides.append(np.where(enough, middle, np.inf))
    return np.maximum(*sides) * windows / gamma.median(windows)


def lofar(
    recording: Recording,
    band: tuple[float, float] | None = None,
    resolution: float | None = None,
    interval: float | None = None,
    channels: Sequence[int] | None = None,
) -> Lofargram:
    """Record of the spectrum of a recording, and its lines; a stretch of the recording is held at a time.

    Parameters
    ----------
    recording : any.
    band : lowest and highest frequency; Hz. From 0 to half the sample rate where not given.
    resolution : of a window, one over its length; Hz. Where not given, a `BINS`-th of the band.
    interval : from row to row; s. Where not given, so that there are `ROWS` at most.
    channels : numbers of those that are averaged; all where not given.

    Raises
    ------
    InputError : a band that is none or goes beyond half the sample rate, a recording that is shorter than a window;
        steps that are not above 0, a channel that there is not.

    Examples
    --------
    >>> from faintrack.data.recording import from_samples
    >>> time = np.arange(20_000) / 1000.0
    >>> noise = np.random.default_rng(0).normal(size=20_000)
    >>> record = lofar(from_samples((noise + 0.2 * np.sin(2 * np.pi * 123.4 * time))[:, None], 1000.0), resolution=1.0)
    >>> [(round(line.frequency, 1), round(line.level_db)) for line in record.lines]
    [(123.4, 8)]
    """
    rate = recording.sample_rate
    band = (0.0, rate / 2) if band is None else band
    if not 0 <= band[0] < band[1] <= rate / 2:
        raise InputError(
            f"{recording.source}: the band goes from {band[0]:g} to {band[1]:g} Hz; expected the lower end first, "
            f"from 0 to half the sample rate, {rate / 2:g} Hz."
        )
    require_steps(recording, resolution, interval)
    window = window_samples(rate, band, resolution)
    require_window(recording, window / rate)
    with naming(recording.source):
        samples = Chosen(recording, channels)
        record = record_of(samples.blocks(max(window, round(rate))), rate, recording.duration, window, band, interval)
    return replace(record, remarks=samples.remarks())


class Chosen:
    """Samples of some channels as they come, and how many of them were missing.

    Parameters
    ----------
    recording : any.
    channels : numbers of those that are taken; all where None.

    Raises
    ------
    InputError : there is no such channel.
    """

    def __init__(self, recording: Recording, channels: Sequence[int] | None) -> None:
        wrong = [number for number in channels or () if not 0 <= number < recording.channels]
        if wrong:
            raise InputError(f"there is no channel {wrong[0]}; expected 0 to {recording.channels - 1}.")
        self.recording, self.channels = recording, channels
        self.count, self.missing = 0, 0

    def blocks(self, length: int) -> Iterator[Float[np.ndarray, "sample channel"]]:
        """Consecutive samples, so many at a time; those that are missing are 0."""
        for block in self.recording.blocks(length):
            samples = np.asarray(block if self.channels is None else block[:, list(self.channels)], float)
            there = np.isfinite(samples)
            self.count, self.missing = self.count + samples.size, self.missing + int(samples.size - there.sum())
            yield np.where(there, samples, 0.0)

    def remarks(self) -> tuple[str, ...]:
        """What was missing of the samples that have come; one sentence."""
        if not self.missing:
            return ()
        share = 100 * self.missing / self.count
        return (f"{self.missing} of {self.count} samples ({share:.3g} %) are missing and were taken for silence.",)


def require_steps(recording: Recording, resolution: float | None, interval: float | None) -> None:
    """Refuse steps of a record that are none.

    Raises
    ------
    InputError : resolution or interval is not above 0.
    """
    for name, unit, value in (("resolution", "Hz", resolution), ("interval", "s", interval)):
        if value is not None and not 0 < value < np.inf:
            raise InputError(f"{recording.source}: {name} is {value:g} {unit}; expected more than 0.")


def require_window(recording: Recording, seconds: float) -> None:
    """Refuse a recording that is shorter than a window.

    Raises
    ------
    InputError : it is.
    """
    if recording.duration < seconds:
        raise InputError(
            f"{recording.source} lasts {recording.duration:.4g} s; expected a window of {seconds:.4g} s at "
            "least, or a coarser resolution."
        )


def record_of(
    blocks: Iterable[np.ndarray],
    sample_rate: float,
    duration: float,
    window: int,
    band: tuple[float, float],
    interval: float | None = None,
) -> Lofargram:
    """Record of consecutive samples, and its lines.

    Parameters
    ----------
    blocks, sample_rate, window : as of `rows_of`.
    duration : of all samples; s.
    band, interval : as of `lofar`.

    Raises
    ------
    InputError : the band holds too few bins to tell a line from its background.
    """
    step = duration / ROWS if interval is None else interval
    windows = max(1, round(step * sample_rate / (window // 2)))
    frequency = np.arange(window // 2 + 1) * sample_rate / window
    # Neither the constant nor half the sample rate is a frequency like others.
    kept = np.flatnonzero((frequency >= band[0]) & (frequency <= band[1]))
    kept = kept[(kept > 1) & (kept < window // 2 - 1)]
    if len(kept) <= GUARD + WINDOW:
        raise InputError(
            f"the band from {band[0]:g} to {band[1]:g} Hz holds {len(kept)} bins of {sample_rate / window:.4g} Hz; "
            f"expected {GUARD + WINDOW + 1} to tell a line from what is around it: a wider band or a finer resolution."
        )
    times, powers, weights = [], [], []
    for row in rows_of(blocks, sample_rate, window, windows):
        times.append(row.time)
        # Below it there is nothing but rounding: a constant has no lines.
        powers.append(np.maximum(row.power[kept], ROUNDED * row.power.sum()).astype(np.float32))
        weights.append(row.windows)
    power, weight = np.asarray(powers, float), np.asarray(weights, float)
    tiny = np.finfo(float).tiny
    level = power / np.maximum(background(power, max(windows / OVERLAP, 1.0)), tiny)
    total = max(weight.sum() / OVERLAP, 1.0)
    # Of levels, not of powers: a row in which something was loud counts as any other.
    mean = weight @ level / weight.sum()
    mean_level = mean / np.maximum(background(mean, total), tiny)
    threshold = float(fisher.isf(CHANCE / len(kept), 2 * total, 2 * total * 2 * WINDOW))
    above = mean > threshold * higher_side(mean, total)
    found = harmonics(lines_of(mean_level, frequency[kept], threshold, above), sample_rate / window)
    return Lofargram(
        np.asarray(times),
        frequency[kept],
        _db(level),
        _db(mean_level),
        10 * float(np.log10(threshold)),
        found,
    )


def lines_of(
    level: Float[np.ndarray, " frequency"],
    frequency: Float[np.ndarray, " frequency"],
    threshold: float,
    above: Bool[np.ndarray, " frequency"],
) -> tuple[Line, ...]:
    """Maxima of a level above a threshold, no two in one main lobe; the frequency from a parabola through three bins.

    Parameters
    ----------
    level : power over the background; linear.
    frequency : of the bins, evenly spaced; Hz.
    threshold : linear.
    above : bins that are lines whichever side they are compared with.
    """
    lines, log = [], np.log(np.maximum(level, 1e-30))
    for bin_ in np.flatnonzero((level > threshold) & above):
        around = log[max(bin_ - 2, 0) : bin_ + 3]
        if log[bin_] < around.max():
            continue
        off = 0.0
        if 0 < bin_ < len(log) - 1:
            before, here, after = log[bin_ - 1 : bin_ + 2]
            curved = before - 2 * here + after
            off = 0.5 * (before - after) / curved if curved < 0 else 0.0
        place = frequency[bin_] + off * (frequency[1] - frequency[0])
        lines.append(Line(float(place), 10 * float(np.log10(level[bin_]))))
    return tuple(lines)


def harmonics(lines: Sequence[Line], resolution: float) -> tuple[Line, ...]:
    """Lines with the series that they belong to, by frequency.

    A fundamental is one of the lines over a whole number. It takes the lines that lie within half a bin of its
    multiples; of all fundamentals the one that takes most beyond chance comes first, the highest where several do.

    Parameters
    ----------
    lines : any.
    resolution : Hz.

    Examples
    --------
    >>> found = harmonics([Line(each, 10.0) for each in (7.0, 14.02, 21.0, 28.0, 50.0)], 0.2)
    >>> [(line.harmonic, line.fundamental and round(line.fundamental, 2)) for line in found]
    [(1, 7.0), (2, 7.0), (3, 7.0), (4, 7.0), (0, None)]
    """
    left, told = list(lines), []
    while True:
        best: tuple[float, float, list[int]] | None = None
        places = np.array([line.frequency for line in left])
        for place in places:
            for number in range(1, 9):
                base = place / number
                within = min(resolution / 2, base / 4)
                if base < 2 * resolution:
                    break
                multiple = np.round(places / base)
                mine = (np.abs(places - multiple * base) <= within) & (multiple >= 1) & (multiple <= HARMONICS)
                if mine.sum() < FEWEST or len(set(multiple[mine])) < FEWEST:
                    continue
                # So many of the others would lie there by chance.
                beyond = float(mine.sum() - 1 - (len(places) - 1) * 2 * within / base)
                if beyond >= FEWEST - 1.5 and (best is None or (round(beyond, 6), base) > best[:2]):
                    best = round(beyond, 6), float(base), np.flatnonzero(mine).tolist()
        if best is None:
            break
        _, base, mine_ = best
        multiple = np.round(places[mine_] / base)
        base = float(multiple @ places[mine_] / (multiple @ multiple))
        told += [replace(left[place], fundamental=base, harmonic=round(places[place] / base)) for place in mine_]
        left = [line for place, line in enumerate(left) if place not in mine_]
    return tuple(sorted([*told, *left], key=lambda line: line.frequency))


def _db(values: np.ndarray) -> np.ndarray:
    return np.asarray(10 * np.log10(np.maximum(values, 1e-12)), np.float32)
