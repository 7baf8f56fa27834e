"""Stretches of data: what was recorded between two times, seconds from the first scan."""

from dataclasses import replace
from typing import TypeVar

import numpy as np
from jaxtyping import Float

from faintrack.data.bearings import Bearings
from faintrack.data.contacts import Contacts
from faintrack.data.recording import Recording
from faintrack.data.returns import Returns
from faintrack.data.sequence import Sequence
from faintrack.errors import InputError

Measured = TypeVar("Measured", Returns, Contacts)
"""What was measured in pings."""


def part_of(times: Float[np.ndarray, " scan"], start: float, stop: float, source: str) -> slice:
    """Numbers of the scans from one time to another.

    Parameters
    ----------
    times : of the scans, ascending; seconds.
    start, stop : seconds from the first scan.
    source : of the data, for messages.

    Raises
    ------
    InputError : the stretch ends before it begins, lies outside the data, or holds no scan.

    Examples
    --------
    >>> part_of(np.array([5.0, 6.0, 7.0, 8.0]), 1.0, 3.0, "frames")
    slice(1, 3, None)
    """
    length = len(times)
    interval = float(np.median(np.diff(times))) if length > 1 else 1.0
    _require_within(start, stop, float(times[-1] - times[0]) + interval, source)
    first, last = np.searchsorted(times - times[0], [start, stop])
    if first == last:
        raise InputError(f"{source}: there is no scan from {start:g} to {stop:g} s; expected a longer stretch.")
    return slice(int(first), int(last))


def _require_within(start: float, stop: float, duration: float, source: str) -> None:
    # A recording may end a fraction of a sample before the second that its user counts.
    if not 0 <= start < stop <= duration * (1 + 1e-6):
        raise InputError(
            f"{source}: the stretch from {start:g} to {stop:g} s does not lie in the data; expected a start and a "
            f"later end between 0 and {duration:.6g} s."
        )


def of_recording(recording: Recording, start: float, stop: float) -> Recording:
    """Samples between two times; see `part_of`.

    Examples
    --------
    >>> from faintrack.data.recording import from_samples
    >>> of_recording(from_samples(np.zeros((100, 2)), 10.0), 2.0, 5.0).length
    30
    """
    _require_within(start, stop, recording.duration, recording.source)
    first, last = round(start * recording.sample_rate), min(round(stop * recording.sample_rate), recording.length)
    begun = recording.start_time
    if begun is not None:
        begun = begun + np.timedelta64(round(1e9 * first / recording.sample_rate), "ns")
    return replace(
        recording,
        read=lambda low, high: recording.read(first + low, min(first + high, last)),
        length=last - first,
        start_time=begun,
        source=f"{recording.source} from {start:g} to {stop:g} s",
    )


def of_sequence(sequence: Sequence, start: float, stop: float) -> Sequence:
    """Frames between two times; see `part_of`.

    Examples
    --------
    >>> from faintrack.data.sequence import from_frames
    >>> of_sequence(from_frames(np.zeros((9, 4, 4))), 2.0, 5.0).times.tolist()
    [2.0, 3.0, 4.0]
    """
    part = part_of(sequence.times, start, stop, sequence.source)
    return replace(
        sequence,
        read=lambda low, high: sequence.read(part.start + low, min(part.start + high, part.stop)),
        times=sequence.times[part],
        source=f"{sequence.source} from {start:g} to {stop:g} s",
    )


def of_returns(returns: Measured, start: float, stop: float) -> Measured:
    """Pings between two times, of returns or contacts; see `part_of`."""
    part = part_of(returns.times, start, stop, returns.origin)
    mine = (returns.ping >= part.start) & (returns.ping < part.stop)
    return returns.taken(
        mine,
        times=returns.times[part],
        ping=returns.ping[mine] - part.start,
        source=None if returns.source is None else returns.source[part],
        receiver=None if returns.receiver is None else returns.receiver[part],
        reported=None if returns.reported is None else returns.reported[part],
        origin=f"{returns.origin} from {start:g} to {stop:g} s",
    )


def of_bearings(bearings: Bearings, start: float, stop: float) -> Bearings:
    """Scans between two times; see `part_of`."""
    part = part_of(bearings.times, start, stop, bearings.origin)
    mine = (bearings.scan >= part.start) & (bearings.scan < part.stop)
    return replace(
        bearings,
        times=bearings.times[part],
        heard=bearings.heard[part],
        place=bearings.place[part],
        scan=bearings.scan[mine] - part.start,
        observer=bearings.observer[mine],
        bearing=bearings.bearing[mine],
        rows=bearings.rows[mine],
        origin=f"{bearings.origin} from {start:g} to {stop:g} s",
    )
