r"""Bearing-time records of several arrays on one time axis.

A record is a `faintrack.data.sequence.Sequence` with one axis, `bearing`, in degrees: the energies of the beams of one
array, row by row. Arrays keep their own times: their rows come at different moments, at different rates, with gaps. A
tracker takes in scans at even times,

.. math:: t_k = t_0 + k T

T being the interval of the slowest record and :math:`t_0` the time of its rows. Every row belongs to the scan whose
time is nearest, so that arrays that are out of step by less than half an interval need nothing further; rows of a
faster record that belong to one scan are averaged, beam by beam. A scan in which an array has no row is one in which
this array says nothing.

The scans reach from the moment at which a second record begins to the one after which only one is left: of two records
the time that both have, of one all of it.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from faintrack.data.sequence import Sequence
from faintrack.errors import InputError

LONGEST_GAP = 100_000
"""Intervals between two rows of a record at most."""

ROWS = 4096
"""Rows of a record held at once."""


@dataclass(frozen=True)
class InStep:
    """Records of several arrays, read scan by scan.

    Attributes
    ----------
    records : of the arrays.
    times : of the scans; seconds on the clock that the records share.
    interval : between scans; seconds.
    scans : of every record the scan that each row belongs to; below 0 or from the number of scans on for none.
    shifts : seconds from the clock of every record to the one that they share.
    start_time : what second 0 of the shared clock is in UTC, None where the records do not tell.
    """

    records: tuple[Sequence, ...]
    times: Float[np.ndarray, " scan"]
    interval: float
    scans: tuple[Int[np.ndarray, "..."], ...]
    shifts: tuple[float, ...]
    start_time: np.datetime64 | None

    @property
    def length(self) -> int:
        """Number of scans."""
        return len(self.times)

    def read(self, start: int, stop: int) -> Float[np.ndarray, "scan array beam"]:
        """Energies of scans from `start` to before `stop`; not a number where a beam was not measured, or is none."""
        most = max(record.size for record in self.records)
        energy = np.full((stop - start, len(self.records), most), np.nan, np.float32)
        for number, (record, scans) in enumerate(zip(self.records, self.scans, strict=True)):
            energy[:, number, : record.size] = _means(record, scans, start, stop)
        return energy


def in_step(records: tuple[Sequence, ...], clock_offsets: tuple[float, ...] | None = None) -> InStep:
    """Put records on one time axis (the module's rule).

    Parameters
    ----------
    records : each with the axis `bearing`. Either all of them tell their start in UTC, or none; then their times are
        seconds on one clock.
    clock_offsets : by how much the clock of each array is ahead; seconds; 0 where not given.

    Raises
    ------
    InputError : a record with one row alone, or with a gap that is very long; records of which only some tell their
        start, or that have no time in common.

    Examples
    --------
    >>> from faintrack.beliefs.axis import Axis
    >>> def record(times, values):
    ...     values = np.repeat(np.array(values)[:, None], 2, axis=1)
    ...     bearing = (("bearing", Axis(0.0, 90.0, 2)),)
    ...     return Sequence(lambda start, stop: values[start:stop], np.array(times), bearing)
    >>> slow, fast = record([0.0, 2.0, 4.0], [1.0, 2.0, 3.0]), record([1.1, 2.1, 3.1, 4.1], [10.0, 20.0, 30.0, 40.0])
    >>> together = in_step((slow, fast))
    >>> together.times.tolist(), together.read(0, 2)[:, :, 0].tolist()
    ([2.0, 4.0], [[2.0, 15.0], [3.0, 35.0]])
    """
    clock_offsets = clock_offsets or (0.0,) * len(records)
    start_time, starts = _starts(records)
    shifts = tuple(start - offset for start, offset in zip(starts, clock_offsets, strict=True))
    times = [record.times + shift for record, shift in zip(records, shifts, strict=True)]
    intervals = [_interval(record) for record in records]
    interval = max(intervals)
    first, last = (sorted(own[end] for own in times) for end in (0, -1))
    begin, end = (first[0], last[0]) if len(records) == 1 else (first[1], last[-2])
    for record, own in zip(records, times, strict=True):
        if not (own[0] <= end and own[-1] >= begin):
            raise InputError(
                f"{record.source} has the times {own[0]:.10g} to {own[-1]:.10g} s, the others together {begin:.10g} to "
                f"{end:.10g} s; expected records that overlap."
            )
    slowest = times[intervals.index(interval)]
    # Rows come a little early or late: their mean place within an interval, on a circle.
    phase = np.angle(np.mean(np.exp(2j * np.pi * (slowest - begin) / interval))) / (2 * np.pi)
    origin = begin + interval * round(float(phase), 9)  # rounding errors are no place within an interval
    numbers = [np.floor((own - origin) / interval + 0.5).astype(np.int64) for own in times]
    lowest, highest = (int(np.floor((moment - origin) / interval + 0.5)) for moment in (begin, end))
    return InStep(
        records,
        origin + interval * np.arange(lowest, highest + 1),
        interval,
        tuple(number - lowest for number in numbers),
        shifts,
        start_time,
    )


def _starts(records: tuple[Sequence, ...]) -> tuple[np.datetime64 | None, list[float]]:
    """The earliest start, and the seconds from there to the start of each record."""
    told = [record.start_time for record in records if record.start_time is not None]
    if not told:
        return None, [0.0] * len(records)
    if len(told) < len(records):
        without, told_by = (next(r for r in records if (r.start_time is None) == lacks) for lacks in (True, False))
        raise InputError(
            f"{told_by.source} tells its start in UTC and {without.source} does not; expected both or none, or "
            "start_time of the station."
        )
    earliest = min(told)
    return earliest, [float((start - earliest) / np.timedelta64(1, "ns")) / 1e9 for start in told]


def _interval(record: Sequence) -> float:
    """Seconds from row to row, gaps left out."""
    if record.length < 2:
        raise InputError(
            f"{record.source}: there is one row; expected two or more, from which their interval is known."
        )
    steps = np.diff(record.times)
    # Times are rounded in files: the mean is nearer than the median.
    interval = float(np.mean(steps[steps < 1.5 * np.median(steps)]))
    if steps.max() > LONGEST_GAP * interval:
        row = int(np.argmax(steps)) + 1
        raise InputError(
            f"{record.source}: row {row}, at {record.times[row]:.10g} s, comes {steps[row - 1]:.6g} s after the one "
            f"before; expected at most {LONGEST_GAP:,} intervals of {interval:.6g} s."
        )
    return interval


def _means(record: Sequence, scans: Int[np.ndarray, " row"], start: int, stop: int) -> Float[np.ndarray, "scan beam"]:
    """Mean over the rows of each scan of what was measured."""
    total = np.zeros((stop - start, record.size))
    count = np.zeros((stop - start, record.size), int)
    first, last = map(int, np.searchsorted(scans, [start, stop]))
    for row in range(first, last, ROWS):
        until = min(row + ROWS, last)
        values = np.asarray(record.read(row, until), float)
        there = ~np.isnan(values)
        np.add.at(total, scans[row:until] - start, np.where(there, values, 0))
        np.add.at(count, scans[row:until] - start, there)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
