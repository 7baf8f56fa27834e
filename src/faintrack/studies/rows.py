"""Rows of a study: a number read off its runs, how sure it is, and the paper's number beside it.

A share has the exact interval of a count, a median that of a quantile, whatever else is asked for one by bootstrap over
the runs (`faintrack.metrics.intervals`). No run, no number; one run, a number without an interval. What the paper says
stands in `faintrack.studies.printed` and is put beside the rows at the end, by their keys.
"""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import jax
import numpy as np
from numpy.typing import ArrayLike

from faintrack.metrics.intervals import binomial_interval, bootstrap_interval, quantile_interval
from faintrack.studies.study import Row

BOOTSTRAPS = 400
"""Draws of runs for an interval."""


def row(
    key: str, name: str, unit: str, ours: float | None, interval: tuple[float | None, float | None] = (None, None)
) -> Row:
    """Row without the paper's number, which `beside` adds."""
    return Row(key, name, unit, None, ours, interval)


def share(key: str, name: str, hits: int, runs: int) -> Row:
    """So many of so many runs.

    Examples
    --------
    >>> share("found", "share of runs that find it", 5, 10).interval[1] > 0.5
    True
    """
    if not runs:
        return row(key, name, "1", None)
    low, high = binomial_interval(hits, runs)
    return row(key, name, "1", hits / runs, (float(low), float(high)))


def median(key: str, name: str, unit: str, runs: ArrayLike) -> Row:
    """Median of runs, one number each, which may be infinite."""
    return row(key, name, unit, float(np.median(np.asarray(runs, float))), quantile_interval(runs, 0.5))


def bootstrapped(
    key: str, name: str, unit: str, statistic: Callable[..., ArrayLike], runs: np.ndarray | tuple[np.ndarray, ...]
) -> Row:
    """A function of runs.

    Parameters
    ----------
    key, name, unit : of the row.
    statistic : takes each array of `runs` and gives a number.
    runs : array whose first axis is runs; or a tuple of them, in which the same runs are drawn from each.
    """
    arrays = runs if isinstance(runs, tuple) else (runs,)
    if not len(arrays[0]):
        return row(key, name, unit, None)
    ours = float(np.asarray(statistic(*arrays)))
    if len(arrays[0]) < 2:
        return row(key, name, unit, ours)
    # Runs in which something never happened are infinite.
    with np.errstate(invalid="ignore"):
        low, high = bootstrap_interval(statistic, arrays, BOOTSTRAPS)
    return row(key, name, unit, ours, (float(low), float(high)))


def mean(key: str, name: str, unit: str, runs: Sequence[float] | np.ndarray) -> Row:
    """Mean over runs."""
    return bootstrapped(key, name, unit, np.mean, np.asarray(runs))


def beside(printed: Mapping[str, float], rows: Iterable[Row]) -> list[Row]:
    """Rows with the paper's numbers, by their keys."""
    return [replace(ours, paper=printed.get(ours.key)) for ours in rows]


def seconds(call: Callable[[], Any]) -> float:
    """Seconds that a call takes, until its result is there."""
    start = time.perf_counter()
    jax.block_until_ready(call())
    return time.perf_counter() - start
