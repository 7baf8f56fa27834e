r"""False tracks an hour: a bound from the model, and a count from data without a target.

**From the model.** Between scans the odds :math:`O = q/(1-q)` of a Bernoulli filter follow arrivals :math:`\lambda` and
departures :math:`\mu`,

.. math:: \dot O = (\lambda - \mu O)(1 + O) \le c ,

with :math:`c = \lambda` where :math:`\mu \ge \lambda`, else :math:`(\lambda + \mu)^2 / 4\mu`. A scan multiplies them by
its mean ratio, whose mean under the background is 1 (Wald 1945). So :math:`O_t - ct` is a supermartingale under the
background. Every false track takes the odds of the threshold, :math:`O_d = d/(1-d)`, from it, and by optional stopping

.. math:: E_0[\text{false tracks within } T] \le \frac{O_0 + c T}{O_d} .

With :math:`O_0 = 0` that is the bound of Shiryaev's and Roberts's procedure on the mean time between false alarms. A
rate r is kept by :math:`d = c / (c + r)`. Overshoot and departures make the true rate smaller, some times over.

By the same argument (Doob) the odds rise from b/2 to b at most :math:`2cT/b + 1` times in the mean.

**From data.** Existence rises above the threshold and falls below that at which a track ends: one false track. So each
excursion counts with its peak, and :math:`N(O)/T` peaks an hour are above O. Beyond what is counted, peaks of the log
odds are continued exponentially, as the bound has them with a scale of 1:

.. math:: r(\log O) = r_u e^{-(\log O - u)/\sigma} .

With n peaks above u, in time T, whose excesses add up to S, r_u has the distribution :math:`\Gamma(n + 1/2)/T`
(Jeffreys), and :math:`\sigma` that of :math:`(S + 1)/\Gamma(n + 1)`: one excess of the model's beside those counted.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.special import expit, gammaincinv, logit, pdtrik

from faintrack.errors import InputError
from faintrack.metrics.intervals import tail
from faintrack.metrics.thresholds import Threshold

HOUR = 3600.0
"""Seconds."""

COUNTED = 10
"""False tracks promised within the data from which on they are counted; fewer are extrapolated."""

HIGHEST = 50
"""Peaks that are continued, at most: lower ones say little of the highest."""

DRAWS = 20_000
"""Of the rate and the scale, for an interval."""

LARGEST = 1 - 1e-6
"""Threshold at most: beyond it single precision tells existence by steps."""


def odds_rate(arrival_rate: float, departure_rate: float) -> float:
    """What the odds of existence gain in a second at most, without evidence (the module's c).

    Parameters
    ----------
    arrival_rate, departure_rate : of targets; per second.

    Examples
    --------
    >>> odds_rate(0.001, 0.005), odds_rate(0.004, 0.001)
    (0.001, 0.00625)
    """
    if departure_rate >= arrival_rate:
        return arrival_rate
    return (arrival_rate + departure_rate) ** 2 / (4 * departure_rate)


def bounded_threshold(rate: float, gained: float) -> float:
    """Existence that noise passes at most at a rate, by the module's bound.

    Parameters
    ----------
    rate : false tracks a second.
    gained : see `odds_rate`.

    Examples
    --------
    >>> round(bounded_threshold(1 / HOUR, 0.001), 4)
    0.7826
    """
    return gained / (gained + rate)


def bounded_rate(threshold: float, gained: float) -> float:
    """False tracks a second at most at a threshold, the inverse of `bounded_threshold`.

    Examples
    --------
    >>> round(bounded_rate(0.97, 0.001) * HOUR, 4)
    0.1113
    """
    return gained * (1 - threshold) / threshold


def peaks(log_odds: Float[np.ndarray, " scan"], low: float) -> Float[np.ndarray, " excursion"]:
    """Highest value of each stretch of scans at `low` or above.

    Parameters
    ----------
    log_odds : natural log of the odds of existence.
    low : level below which an excursion ends.

    Examples
    --------
    >>> peaks(np.array([-1.0, 1.0, 3.0, -2.0, 0.5, -1.0, 2.0]), 0.0).tolist()
    [3.0, 0.5, 2.0]
    """
    above = np.asarray(log_odds) >= low
    starts = np.flatnonzero(above & ~np.concatenate([[False], above[:-1]]))
    ends = np.flatnonzero(above & ~np.concatenate([above[1:], [False]]))
    highest = [np.max(log_odds[start : end + 1]) for start, end in zip(starts, ends, strict=True)]
    return np.array(highest, float)


def rises(log_odds: Float[np.ndarray, " scan"], low: float, high: float) -> int:
    """How often values rise from below `low` to `high` or above.

    Examples
    --------
    >>> rises(np.array([0.0, 3.0, 1.5, 3.0, 0.0, 2.0]), 1.0, 2.0)
    2
    """
    return int((peaks(log_odds, low) >= high).sum())


@dataclass(frozen=True)
class Kept:
    """A threshold that keeps a rate on data without a target.

    Attributes
    ----------
    threshold : on existence, with its interval.
    rate : false tracks a second at the threshold's value.
    low, high : interval of the rate.
    extrapolated : whether the data are too short to count so few.
    """

    threshold: Threshold
    rate: float
    low: float
    high: float
    extrapolated: bool


@dataclass(frozen=True)
class Exceedances:
    """Peaks of existence in data without a target.

    Attributes
    ----------
    peaks : natural log of the odds, ascending.
    seconds : of data.
    low : level above which an excursion was counted; natural log of the odds.
    """

    peaks: Float[np.ndarray, " excursion"]
    seconds: float
    low: float

    def count(self, threshold: float) -> int:
        """Excursions that pass a threshold on existence."""
        return int((self.peaks >= logit(threshold)).sum())

    def kept(self, rate: float, least: float, confidence: float = 0.95, seed: int = 0) -> Kept:
        """Threshold that is passed at a rate (the module's last equation where it is not counted).

        Parameters
        ----------
        rate : false tracks a second.
        least : threshold at least.
        confidence : of the intervals.
        seed : of the draws that an extrapolated interval is made of.

        Raises
        ------
        InputError : no threshold is passed so seldom.

        Examples
        --------
        >>> highest = np.sort(np.random.default_rng(0).exponential(size=100))
        >>> kept = Exceedances(highest, 10 * HOUR, 0.0).kept(1 / HOUR, 0.5)
        >>> round(kept.threshold.value, 2), kept.extrapolated
        (0.95, False)
        """
        outside = tail(confidence)
        if rate * self.seconds >= COUNTED:
            expected = rate * self.seconds
            level, low, high = map(self._passed, (expected, pdtrik(1 - outside, expected), pdtrik(outside, expected)))
            level = self._allowed(level, rate, least)
            counted = int((self.peaks >= level).sum())
            rates = gammaincinv(counted + 0.5, [outside, 1 - outside]) / self.seconds
            threshold = Threshold(*(float(expit(max(one, logit(least)))) for one in (level, low, high)))
            return Kept(threshold, counted / self.seconds, float(rates[0]), float(rates[1]), False)
        highest = self.peaks[-HIGHEST:]
        start = self.low if len(self.peaks) <= HIGHEST else float(self.peaks[-HIGHEST - 1])
        count, excess = len(highest), float((highest - start).sum())
        rng = np.random.default_rng(seed)
        starts = np.append((count + 0.5) / self.seconds, rng.gamma(count + 0.5, size=DRAWS) / self.seconds)
        scales = (excess + 1) / np.append(count + 1, rng.gamma(count + 1, size=DRAWS))
        levels = np.maximum(start + scales * np.log(starts / rate), logit(least))
        level = self._allowed(float(levels[0]), rate, least)
        rates = starts * np.exp(-np.maximum(level - start, 0) / scales)
        ends = [outside, 1 - outside]
        threshold = Threshold(float(expit(level)), *map(float, expit(np.quantile(levels[1:], ends))))
        fewest, most = map(float, np.quantile(rates[1:], ends))
        return Kept(threshold, float(rates[0]), fewest, most, True)

    def _passed(self, count: float) -> float:
        """Level between the peak that is the last of so many and the next lower one."""
        number = int(count)
        if number >= len(self.peaks):
            return self.low
        below = len(self.peaks) - 1 - number
        return float(self.peaks[below : below + 2].mean())

    def _allowed(self, level: float, rate: float, least: float) -> float:
        level = max(level, float(logit(least)))
        if level > logit(LARGEST):
            highest = f", up to {expit(self.peaks[-1]):.6g}" if len(self.peaks) else ""
            raise InputError(
                f"no threshold keeps {rate * HOUR:.3g} false tracks an hour: existence has {len(self.peaks)} peaks"
                f"{highest}, in {self.seconds / HOUR:.3g} h without a target; give more data, or stretches that are "
                "quieter. Where existence stays high in all of them, their background is not the model's."
            )
        return level


def exceedances(runs: Iterable[Float[np.ndarray, "_"]], seconds: float, low: float) -> Exceedances:
    """Peaks of existence in several runs.

    Parameters
    ----------
    runs : natural log of the odds of existence after every scan, of each run.
    seconds : of all runs together.
    low : existence below which an excursion ends.
    """
    level = float(logit(low))
    found = [peaks(run, level) for run in runs]
    return Exceedances(np.sort(np.concatenate([*found, np.zeros(0)])), seconds, level)
