"""Sweeps of a scanning radar, read when they are asked for, and where and when each spoke looked.

A sweep is one turn of the antenna: spokes at even azimuths, each with samples at even ranges. Spoke k of n looks
towards the heading plus k/n of a turn, clockwise; sample j is j times the spacing away. Time, place and heading of the
antenna are given for each sweep or for each spoke.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from faintrack.errors import InputError


@dataclass(frozen=True)
class Look:
    """When and whence each spoke of some sweeps looked; arrays of shape (sweep, spoke).

    Attributes
    ----------
    time : seconds on the clock of the data; not a number where the spoke was not received.
    x, y : of the antenna, east and north; metres.
    heading : that spoke 0 looks to, clockwise from north; radians.
    """

    time: Float[np.ndarray, "sweep spoke"]
    x: Float[np.ndarray, "sweep spoke"]
    y: Float[np.ndarray, "sweep spoke"]
    heading: Float[np.ndarray, "sweep spoke"]


@dataclass(frozen=True)
class Sweeps:
    """Turns of a scanning radar.

    Attributes
    ----------
    read : function of (start, stop), numbers of sweeps, to an array (sweep, spoke, sample) of intensities.
    shape : numbers of spokes and samples.
    times : of each sweep's first spoke, or of each spoke, shape (sweep, spoke), not a number where one was not
        received; ascending; seconds.
    spacing : from sample to sample; metres.
    x, y : of the antenna, east and north, for each sweep or each spoke; metres; at 0 where not given.
    heading : clockwise from north, for each sweep or each spoke; radians; 0 where not given.
    source : where the sweeps come from, for messages.
    start_time : what time 0 is in UTC, or None where the source does not tell.
    remarks : what was assumed; one sentence each.
    """

    read: Callable[[int, int], np.ndarray]
    shape: tuple[int, int]
    times: np.ndarray
    spacing: float
    x: np.ndarray | None = None
    y: np.ndarray | None = None
    heading: np.ndarray | None = None
    source: str = "sweeps in memory"
    start_time: np.datetime64 | None = None
    remarks: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        if not 0 < self.spacing < np.inf:
            raise InputError(f"{self.source}: the sample spacing is {self.spacing:g}; expected metres above 0.")
        if self.shape[0] < LEAST_SPOKES or self.shape[1] < LEAST_SAMPLES:
            raise InputError(
                f"{self.source}: a sweep has {self.shape[0]} spokes of {self.shape[1]} samples; expected at least "
                f"{LEAST_SPOKES} of {LEAST_SAMPLES}."
            )
        if self.length < 1:
            raise InputError(f"{self.source}: there are no sweeps.")
        for name in ("times", "x", "y", "heading"):
            values = getattr(self, name)
            if values is None:
                continue
            if values.shape not in ((self.length,), (self.length, self.shape[0])):
                raise InputError(
                    f"{self.source}: {name} has shape {values.shape}; expected {(self.length,)} or "
                    f"{(self.length, self.shape[0])}, a value for each sweep or each spoke."
                )
            if name != "times" and not np.isfinite(values).all():
                raise InputError(f"{self.source}: {name} holds NaN or infinity; expected numbers.")
        first = self.times if self.times.ndim == 1 else _first_of(self.times)
        lacking = np.flatnonzero(~np.isfinite(first))
        if lacking.size:
            raise InputError(f"{self.source}: sweep {lacking[0]} has no time; expected one, or one for some spokes.")
        known = self.times[np.isfinite(self.times)]
        late = np.flatnonzero(~(np.diff(first) > 0))
        if late.size or np.any(np.diff(known) < 0):
            where = f"the time of sweep {late[0] + 1} is not after the one before" if late.size else "times go back"
            raise InputError(f"{self.source}: {where}; expected ascending times.")

    @property
    def length(self) -> int:
        """Number of sweeps."""
        return len(self.times)

    @property
    def interval(self) -> float:
        """Seconds from sweep to sweep, the median; 1 where there is one alone."""
        first = self.times if self.times.ndim == 1 else np.nanmax(self.times, axis=1)
        return float(np.median(np.diff(first))) if self.length > 1 else 1.0

    @property
    def middle(self) -> Float[np.ndarray, " sweep"]:
        """Time of the middle of each sweep; seconds."""
        if self.times.ndim == 1:
            return self.times + self.interval / 2
        return np.nanmax(self.times, axis=1) - self.interval / 2

    def look(self, start: int, stop: int) -> Look:
        """When and whence each spoke of some sweeps looked."""
        spokes, stop = self.shape[0], min(stop, self.length)

        def spread(values: np.ndarray | None) -> np.ndarray:
            if values is None:
                return np.zeros((stop - start, spokes))
            part = np.asarray(values[start:stop], float)
            return part if part.ndim == 2 else np.repeat(part[:, None], spokes, axis=1)

        time = spread(self.times)
        if self.times.ndim == 1:
            time = time + self.interval * np.arange(spokes) / spokes
        return Look(time, spread(self.x), spread(self.y), spread(self.heading))


LEAST_SPOKES, LEAST_SAMPLES = 32, 64
"""Of a sweep, so that windows fit into it."""


def from_sweeps(
    intensity: np.ndarray,
    spacing: float,
    times: np.ndarray | None = None,
    interval: float = 1.0,
    x: np.ndarray | None = None,
    y: np.ndarray | None = None,
    heading: np.ndarray | None = None,
) -> Sweeps:
    """Sweeps of an array in memory.

    Parameters
    ----------
    intensity : of shape (sweep, spoke, sample); echoes above 0, 0 where there is none.
    spacing : from sample to sample; metres.
    times : of each sweep or each spoke; seconds; sweeps `interval` apart where not given.
    interval : from sweep to sweep; seconds.
    x, y, heading : as `Sweeps`.

    Raises
    ------
    InputError : the array has other axes or holds NaN, or the others do not fit it.

    Examples
    --------
    >>> sweeps = from_sweeps(np.zeros((3, 64, 100), np.uint8), spacing=30.0, interval=2.5)
    >>> sweeps.length, sweeps.shape, sweeps.middle.tolist()
    (3, (64, 100), [1.25, 3.75, 6.25])
    """
    intensity = np.asarray(intensity)
    if intensity.ndim != 3:
        raise InputError(f"the intensity has shape {intensity.shape}; expected (sweep, spoke, sample).")
    times = interval * np.arange(len(intensity)) if times is None else np.asarray(times, float)
    if len(times) != len(intensity):
        raise InputError(f"times has shape {times.shape}; expected {len(intensity)} sweeps, as the intensity.")
    x, y, heading = (None if values is None else np.asarray(values, float) for values in (x, y, heading))
    return Sweeps(lambda start, stop: intensity[start:stop], intensity.shape[1:], times, spacing, x, y, heading)


def _first_of(times: Float[np.ndarray, "sweep spoke"]) -> Float[np.ndarray, " sweep"]:
    """First time of each sweep that is known."""
    known = np.isfinite(times)
    return np.where(known.any(axis=1), times[np.arange(len(times)), np.argmax(known, axis=1)], np.nan)
