"""What the benchmark reports, and how a call is timed.

The least of many repeats is reported: whatever else the machine does can only add to it. The first call also compiles;
what it takes beyond a later one stands apart.
"""

import dataclasses
import statistics
import time
from collections.abc import Callable
from typing import Any

import jax


@dataclasses.dataclass(frozen=True)
class Row:
    """One line of the benchmark; every time in `unit`, less is better.

    Attributes
    ----------
    name : of the row.
    unit : of `ours`, `peer`, `limit` and `target`.
    ours : least time of ours.
    peer : least time of what it is compared with; None where there is none, or where it is not installed.
    limit : what this machine would need at best, as `note` says; None where nothing sensible can be said.
    target : time at which the aim is met; None where it hangs on a peer that is missing.
    median : of the repeats of ours; far above `ours` on a busy machine.
    compile_seconds : that the first call took longer than a later one; None where nothing is compiled.
    note : what is timed on both sides, and what the limit is.
    """

    name: str
    unit: str
    ours: float
    peer: float | None
    limit: float | None
    target: float | None
    median: float
    compile_seconds: float | None
    note: str

    @property
    def ratio(self) -> float | None:
        """How many times faster ours is than the peer."""
        return None if self.peer is None else self.peer / self.ours

    def as_dict(self) -> dict[str, Any]:
        """Fields and ratio, as JSON wants them."""
        return {**dataclasses.asdict(self), "ratio": self.ratio}


@dataclasses.dataclass(frozen=True)
class Timing:
    """Seconds that a call took, at least and in the median, and how much longer the first time, where it compiles."""

    least: float
    median: float
    compile: float | None

    def per(self, count: int) -> "Timing":
        """Share of one among `count` that a call does; compiling is done once for all."""
        return Timing(self.least / count, self.median / count, self.compile)


def row(
    name: str,
    unit: str,
    timing: Timing,
    note: str,
    target: float | None,
    peer: float | None = None,
    limit: float | None = None,
) -> Row:
    """Row of a call.

    Parameters
    ----------
    name, unit, note, target : as in `Row`; the unit is s or ms.
    timing : of ours.
    peer, limit : seconds.
    """
    scale = {"s": 1.0, "ms": 1e3}[unit]
    peer, limit = (None if seconds is None else scale * seconds for seconds in (peer, limit))
    return Row(name, unit, scale * timing.least, peer, limit, target, scale * timing.median, timing.compile, note)


def timed(call: Callable[[], Any], seconds: float) -> Timing:
    """Repeat a call for about so many seconds, at least three times after the first.

    Parameters
    ----------
    call : its result is waited for, where it is computed in the background.
    seconds : of repeating.

    Examples
    --------
    >>> timing = timed(lambda: sum(range(1000)), seconds=0.0)
    >>> 0 < timing.least <= timing.median
    True
    """

    def once() -> float:
        start = time.perf_counter()
        jax.block_until_ready(call())
        return time.perf_counter() - start

    first = once()
    repeats = [once() for _ in range(3)]
    while sum(repeats) < seconds:
        repeats.append(once())
    least = min(repeats)
    return Timing(least, statistics.median(repeats), max(first - least, 0.0))
