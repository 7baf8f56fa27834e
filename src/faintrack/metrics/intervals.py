r"""How sure a number from so many runs is.

A share, a mean or a threshold from a Monte Carlo study is itself a random number. An interval with confidence 0.95
covers the true value in at least 95 of 100 such studies. Three cases, each without assuming a normal distribution:

- a share of runs (detections, false tracks): `binomial_interval`, from the binomial distribution itself. It is right
  for 0 of 1000 too, where mean plus and minus two standard errors gives no width at all;
- a quantile of runs (the threshold that noise passes once in a hundred runs): `quantile_interval`. How many of n
  independent values lie below the quantile :math:`x_p` is binomial, whatever their distribution, so

.. math:: P\left(x_{(l)} \le x_p \le x_{(u)}\right) \ge \sum_{k=l}^{u-1} \binom{n}{k} p^k (1 - p)^{n - k} ;

- anything else (a root mean square error, a ratio of two means): `bootstrap_interval`, which draws the runs anew. It is
  approximate, a little too narrow for few runs.

In all of them the runs are independent. Frames of one run are not: reduce each run to a number first.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike
from scipy.special import bdtr, betaincinv

from faintrack.errors import InputError

Bounds = tuple[Float[np.ndarray, "..."], Float[np.ndarray, "..."]]
"""Lower and upper end of an interval."""


def tail(confidence: float) -> float:
    """Probability of lying above an interval, and as much of lying below.

    Raises
    ------
    InputError : not between 0 and 1.

    Examples
    --------
    >>> tail(0.5)
    0.25
    """
    if not 0 < confidence < 1:
        raise InputError(f"confidence is {confidence:g}; expected a number between 0 and 1.")
    return (1 - confidence) / 2


def binomial_interval(successes: ArrayLike, trials: ArrayLike, confidence: float = 0.95) -> Bounds:
    r"""Interval of a probability from a count, exact (Clopper and Pearson 1934).

    Parameters
    ----------
    successes, trials : counts that broadcast, 0 <= successes <= trials.
    confidence : that both ends enclose the probability; at least this, whatever the probability is.

    Returns
    -------
    Lower and upper end; 0 and 1 where there were no trials.

    Raises
    ------
    InputError : shapes that do not broadcast; counts or confidence out of range.

    Notes
    -----
    The lower end is the probability at which as many successes or more have the probability (1 - confidence) / 2, the
    upper end that at which as many or fewer have it; both are quantiles of Beta distributions.
    Check: without successes the upper end u solves :math:`(1 - u)^n = (1 - \text{confidence}) / 2`.

    Examples
    --------
    >>> low, high = binomial_interval([0, 5, 10], 10)
    >>> low.round(4).tolist(), high.round(4).tolist()
    ([0.0, 0.1871, 0.6915], [0.3085, 0.8129, 1.0])
    """
    outside = tail(confidence)
    successes, trials = np.asarray(successes, float), np.asarray(trials, float)
    try:
        successes, trials = np.broadcast_arrays(successes, trials)
    except ValueError:
        raise InputError(
            f"successes and trials have shapes {successes.shape} and {trials.shape}; expected shapes that broadcast."
        ) from None
    whole = (successes == np.floor(successes)) & (trials == np.floor(trials)) & np.isfinite(trials)
    if not np.all(whole & (successes >= 0) & (successes <= trials)):
        raise InputError("successes and trials are out of range; expected whole numbers, 0 <= successes <= trials.")
    failures = trials - successes
    low = np.where(successes == 0, 0.0, betaincinv(np.maximum(successes, 1), failures + 1, outside))
    high = np.where(failures == 0, 1.0, betaincinv(successes + 1, np.maximum(failures, 1), 1 - outside))
    return low, high


def quantile_interval(values: ArrayLike, probability: float, confidence: float = 0.95) -> tuple[float, float]:
    """Interval of a quantile, between two of the values in their order.

    Parameters
    ----------
    values : shape (run,); may hold infinities, such as a time at which nothing had happened yet.
    probability : of a value below the quantile; between 0 and 1.
    confidence : that both ends enclose the quantile; at least this, whatever the distribution is.

    Returns
    -------
    Lower and upper end. Where so few values cannot bound the quantile the end is -inf or +inf: 100 runs say nothing of
    how high the value of one in a thousand may be.

    Raises
    ------
    InputError : no values, more than one axis, or NaN; probability or confidence out of range.

    Notes
    -----
    The module's equation, with as much left out at either end. Check: for an end above the quantile p, confidence 0.95
    needs n runs with p^n <= 0.025: 72 for p = 0.95.

    Examples
    --------
    >>> quantile_interval(np.arange(1.0, 101.0), 0.9)
    (84.0, 96.0)
    >>> quantile_interval(np.arange(1.0, 101.0), 0.99)
    (97.0, inf)
    """
    outside = tail(confidence)
    runs = np.asarray(values, float)
    if runs.ndim != 1 or not runs.size or np.isnan(runs).any():
        raise InputError(f"values has shape {runs.shape} or holds NaN; expected one number for each run.")
    if not 0 < probability < 1:
        raise InputError(f"probability is {probability:g}; expected a number between 0 and 1.")
    count = len(runs)
    at_most = bdtr(np.arange(count + 1.0), count, probability)
    ends = np.concatenate([[-np.inf], np.sort(runs), [np.inf]])
    lower, upper = np.searchsorted(at_most, [outside, 1 - outside])
    return float(ends[lower]), float(ends[upper + 1])


def bootstrap_interval(
    statistic: Callable[..., ArrayLike],
    samples: ArrayLike | tuple[ArrayLike, ...],
    count: int = 1000,
    confidence: float = 0.95,
    seed: int = 0,
) -> Bounds:
    """Interval of a function of runs, from runs drawn anew with replacement (percentiles; Efron 1979).

    Parameters
    ----------
    statistic : takes each array of `samples` and gives a number, or an array of numbers.
    samples : array whose first axis is runs; or a tuple of them, in which the same runs are drawn from each.
    count : how often the runs are drawn.
    confidence : that both ends enclose what the statistic of infinitely many runs would be; approximate.
    seed : of the draws; the same gives the same interval.

    Returns
    -------
    Lower and upper end, of the shape of the statistic.

    Raises
    ------
    InputError : no runs, or arrays with different numbers of them; count or confidence out of range.

    Notes
    -----
    Check: for the mean of many runs the ends are the mean plus and minus 1.96 standard errors.

    Examples
    --------
    >>> errors = np.array([0.9, -1.2, 0.3, 1.5, -0.4, -0.8])
    >>> low, high = bootstrap_interval(lambda errors: np.sqrt(np.mean(errors**2)), errors)
    >>> bool(low < np.sqrt(np.mean(errors**2)) < high)
    True
    """
    outside = tail(confidence)
    arrays = [np.asarray(values) for values in (samples if isinstance(samples, tuple) else (samples,))]
    lengths = [len(values) if values.ndim else 0 for values in arrays]
    if not lengths or min(lengths) < 1 or len(set(lengths)) > 1:
        raise InputError(
            f"samples has {lengths} runs along the first axis; expected as many in each array, at least 1."
        )
    if count < 1:
        raise InputError(f"count is {count}; expected at least 1.")
    draws = np.random.default_rng(seed).integers(lengths[0], size=(count, lengths[0]))
    drawn = np.array([statistic(*(values[draw] for values in arrays)) for draw in draws], float)
    low, high = np.quantile(drawn, [outside, 1 - outside], axis=0)
    return np.asarray(low), np.asarray(high)
