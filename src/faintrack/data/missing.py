r"""Which samples are missing: one gate for values, before any likelihood sees them.

Recorders and file formats mark what they did not measure in many ways, and a mark that is taken for a sample is a loud
event, or not a number to the end of a run. `gate` looks at a block and makes every such sample NaN. It goes by these
reasons, in this order; a sample is counted once, by the first that holds:

================  =====================================================================================================
`masked`          `numpy.ma` says so
`not finite`      NaN or infinity
`fill value`      equals one that the format tells, netCDF's 9.96921e36, or 1e20 of numpy.ma and CF, in single precision
`sentinel`        one of `SENTINELS` (-9999, -12345, the ends of 16, 24 and 32 bits, ...), `SENTINEL_RUN` times on end
`too large`       more than `LARGEST` times the level of the block: its square is beyond single precision
`constant`        the same value for `CONSTANT_RUN` samples of a channel: a sensor that hangs, silence, padding
================  =====================================================================================================

Samples that stand at full scale three times on end are *clipped*: they are counted and stay, since something was
measured.

Levels have no meaning before they are scaled: the same samples in other units have to give the same answer. `level` is
the power of two that samples are divided by before they are squared; a division by a power of two is exact.

.. code-block:: python

    scale = level(first_block)
    samples, missing = gate(block, level=scale)     # NaN where missing
    scan = frame_of(samples / scale)                # squares within single precision from 1e-30 to 1e30
    total = total + missing                         # counts and stretches of time, block after block

Runs that a border of blocks cuts in two are seen whole by `Gated`, which reads a little more on both sides.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float, Int

from faintrack.data.recording import Recording

REASONS = ("masked", "not finite", "fill value", "sentinel", "too large", "constant")

FILL_VALUES = (9.969209968386869e36, 1e20)
"""Missing wherever they stand, as single or double precision: netCDF's for floats, numpy.ma's and CF's."""

SENTINELS = (
    *(-999.0, -9999.0, -99999.0, -999999.0, -12345.0, 99999.0, 999999.0),
    *(-32768.0, 32767.0, -8388608.0, 8388607.0, -2147483648.0, 2147483647.0, -2147483647.0),
)
"""Missing where they stand `SENTINEL_RUN` times on end; alone they may be samples."""

SENTINEL_RUN = 4
CONSTANT_RUN = 64
CLIPPED_RUN = 3

FULL_SCALE = (
    *(1.0, -1.0, 1 - 2.0**-7, 1 - 2.0**-15, 1 - 2.0**-23, 1 - 2.0**-31),
    *(32767.0, -32768.0, 8388607.0, -8388608.0, 2147483647.0, -2147483648.0, 255.0, 4095.0, 16383.0, 65535.0),
)
"""Ends of the scales of converters, as whole numbers and as parts of one."""

LARGEST = 1e15
"""Times the level: the sum of a hundred million squares of it is still a number in single precision."""

MOST_SPANS = 1000
"""Stretches that are kept; counts go on."""


@dataclass(frozen=True)
class Span:
    """A stretch of time in which samples are missing.

    Attributes
    ----------
    reason : one of `REASONS`.
    channel : number of the channel; None for frames, of which some cells are meant.
    start, stop : first sample or frame, and the one after the last.
    """

    reason: str
    channel: int | None
    start: int
    stop: int


@dataclass(frozen=True)
class Missing:
    """What a gate left out; reports of consecutive blocks add up.

    Attributes
    ----------
    length : samples of each channel, or frames, that were looked at.
    counts : by reason, for each channel or cell; reasons that do not occur are left out.
    clipped : samples at full scale, for each channel or cell; they are not missing.
    spans : stretches of time, `MOST_SPANS` at most.
    unlisted : number of stretches beyond those.
    """

    length: int
    counts: Mapping[str, Int[np.ndarray, "..."]]
    clipped: Int[np.ndarray, "..."]
    spans: tuple[Span, ...] = ()
    unlisted: int = 0

    @property
    def total(self) -> Int[np.ndarray, "..."]:
        """Missing samples of each channel or cell, whatever the reason."""
        return sum(self.counts.values(), np.zeros_like(self.clipped))

    def __add__(self, later: "Missing") -> "Missing":
        counts = dict(self.counts)
        for reason, count in later.counts.items():
            counts[reason] = counts[reason] + count if reason in counts else count
        moved = [Span(s.reason, s.channel, s.start + self.length, s.stop + self.length) for s in later.spans]
        # A stretch that goes on over the border is one.
        reaching = {(s.reason, s.channel): s for s in self.spans if s.stop == self.length}
        joined = {
            reaching[s.reason, s.channel]: s
            for s in moved
            if s.start == self.length and (s.reason, s.channel) in reaching
        }
        spans = [Span(s.reason, s.channel, s.start, joined[s].stop) if s in joined else s for s in self.spans]
        spans += [s for s in moved if s not in joined.values()]
        unlisted = self.unlisted + later.unlisted + max(len(spans) - MOST_SPANS, 0)
        length = self.length + later.length
        return Missing(length, counts, self.clipped + later.clipped, tuple(spans[:MOST_SPANS]), unlisted)

    def sentences(self, names: Sequence[str] = (), sample_rate: float = 1.0) -> tuple[str, ...]:
        """What a reader is told: one sentence for each reason and channel, with its time.

        Parameters
        ----------
        names : of the channels; none for frames.
        sample_rate : samples or frames a second; Hz.

        Examples
        --------
        >>> samples = np.random.default_rng(0).normal(size=(1000, 2))
        >>> samples[200:250, 1] = 1e20
        >>> gate(samples)[1].sentences(("a", "b"), 100.0)
        ('Channel b: 50 samples from 2 s to 2.5 s are missing (fill value).',)
        """
        said = []
        for reason, count in self.counts.items():
            for number in range(len(names)) if names else (None,):
                amount = int(count.sum() if number is None else count[number])
                if not amount:
                    continue
                where = "Frames" if number is None else f"Channel {names[number]}"
                spans = [s for s in self.spans if s.reason == reason and s.channel == number]
                when = ""
                if spans:
                    first, last = min(s.start for s in spans), max(s.stop for s in spans)
                    often = f" in {len(spans)} stretches" if len(spans) > 1 else ""
                    when = f"{often} from {first / sample_rate:.6g} s to {last / sample_rate:.6g} s"
                what = "cells" if number is None else "samples"
                said.append(f"{where}: {amount} {what}{when} are missing ({reason}).")
        for number, name in enumerate(names):
            if self.clipped[number]:
                said.append(f"Channel {name}: {self.clipped[number]} samples stand at full scale; they were used.")
        return tuple(said)


def level(samples: np.ndarray) -> float:
    """Power of two near the median magnitude of the samples that are numbers and not zero; 1 where there are none.

    The median is not moved by the few that are missing, however large they are.

    Examples
    --------
    >>> level(np.array([3e-30, -5e-30, np.nan, 0.0, 1e20])) == 2.0**-98
    True
    >>> level(np.zeros(4))
    1.0
    """
    values = np.ma.getdata(samples).ravel()
    values = values[:: max(1, values.size // 2**18)]
    magnitude = np.abs(values.astype(complex if values.dtype.kind == "c" else float))
    magnitude = magnitude[np.isfinite(magnitude) & (magnitude > 0)]
    if not magnitude.size:
        return 1.0
    middle = np.partition(magnitude, magnitude.size // 2)[magnitude.size // 2]
    return float(np.ldexp(1.0, int(np.frexp(middle)[1]) - 1))


def gate(
    samples: np.ndarray,
    fill_values: Sequence[float] = (),
    level: float | None = None,
    constant_run: int | None = CONSTANT_RUN,
) -> tuple[Float[np.ndarray, "time *channels"], Missing]:
    """Samples with NaN where they are missing, and what was left out.

    Parameters
    ----------
    samples : shape (time, channel); any real type, also masked.
    fill_values : that the format tells, besides `FILL_VALUES`.
    level : of the recording, see the function of that name; that of the block where not given.
    constant_run : equal samples on end that are no measurement; None to let them pass.

    Returns
    -------
    Samples in float64 where they were, float32 otherwise, and the report. The input is left as it is.

    Examples
    --------
    >>> samples = np.random.default_rng(1).normal(size=(200, 3))
    >>> samples[10, 0], samples[20:24, 1], samples[30, 2], samples[40, 2] = np.inf, -9999, 1e17, -9999
    >>> clean, missing = gate(samples)
    >>> {reason: count.tolist() for reason, count in missing.counts.items()}
    {'not finite': [1, 0, 0], 'sentinel': [0, 4, 0], 'too large': [0, 0, 1]}
    >>> np.flatnonzero(np.isnan(clean).any(axis=1)).tolist(), float(clean[40, 2])
    ([10, 20, 21, 22, 23, 30], -9999.0)
    """
    return _gate(samples, fill_values, level, (0,), constant_run)


def gate_frames(
    frames: np.ndarray, fill_values: Sequence[float] = (), level: float | None = None
) -> tuple[Float[np.ndarray, "time *cells"], Missing]:
    """The same for frames: sentinels stand side by side along any axis, and cells that do not change are cells.

    Parameters
    ----------
    frames : shape `(time, *cells)`.
    fill_values, level : as `gate`.

    Examples
    --------
    >>> frames = np.ones((3, 6, 6))
    >>> frames[1, 2, 1:5] = -9999
    >>> clean, missing = gate_frames(frames)
    >>> int(np.isnan(clean).sum()), missing.spans
    (4, (Span(reason='sentinel', channel=None, start=1, stop=2),))
    """
    return _gate(frames, fill_values, level, tuple(range(np.ndim(frames))), None)


@dataclass(frozen=True)
class Gated:
    """A recording read through the gate, so that blocks of any size make the same whole.

    Attributes
    ----------
    recording : whose samples are looked at.
    level : of the recording; `gated` finds it.
    """

    recording: Recording
    level: float
    fill_values: tuple[float, ...] = field(default=())

    def read(self, start: int, stop: int) -> tuple[Float[np.ndarray, "time channel"], Missing]:
        """Samples from `start` to before `stop`, NaN where missing, and what was left out of them."""
        low = max(start - CONSTANT_RUN, 0)
        high = min(stop + CONSTANT_RUN, self.recording.length)
        samples = self.recording.read(low, high)
        clean, reasons, clipped = _look(samples, self.fill_values, self.level, (0,), CONSTANT_RUN)
        part = slice(start - low, stop - low)
        return clean[part], _report({name: mask[part] for name, mask in reasons.items()}, clipped[part], True)


def gated(recording: Recording, fill_values: Sequence[float] = (), seconds: float = 10.0) -> Gated:
    """Recording behind the gate, its level that of its first seconds in which there is a sample that is not zero.

    Parameters
    ----------
    recording : as read.
    fill_values : as `gate`.
    seconds : looked at at a time; a minute of them at most.

    Examples
    --------
    >>> from faintrack.data.recording import from_samples
    >>> samples = np.random.default_rng(1).normal(size=(2000, 2)) * 1e-9
    >>> samples[300:500, 1] = 0.0
    >>> held = gated(from_samples(samples, 100.0))
    >>> held.read(400, 600)[1].spans
    (Span(reason='constant', channel=1, start=0, stop=100),)
    """
    size = int(np.clip(seconds * recording.sample_rate, 1024, max(2**22 // recording.channels, 1024)))
    found = 1.0
    for start in range(0, min(6 * size, recording.length), size):
        clean, _ = gate(recording.read(start, min(start + size, recording.length)), fill_values)
        found = level(clean)
        if np.nanmax(np.abs(clean), initial=0.0) > 0:
            break
    return Gated(recording, found, tuple(fill_values))


def run_lengths(values: np.ndarray, axis: int = 0) -> Int[np.ndarray, "..."]:
    """Length of the run of equal values along an axis that every value belongs to; NaN equals nothing.

    Examples
    --------
    >>> run_lengths(np.array([5, 5, 2, 7, 7, 7])).tolist()
    [2, 2, 1, 3, 3, 3]
    """
    moved = np.moveaxis(values, axis, -1)
    begins = np.ones(moved.shape, bool)
    begins[..., 1:] = moved[..., 1:] != moved[..., :-1]
    number = np.cumsum(begins.ravel()) - 1
    lengths = np.bincount(number)[number] if number.size else number
    return np.moveaxis(lengths.reshape(moved.shape), -1, axis)


def _gate(
    samples: np.ndarray,
    fill_values: Sequence[float],
    scale: float | None,
    axes: tuple[int, ...],
    constant_run: int | None,
) -> tuple[np.ndarray, Missing]:
    clean, reasons, clipped = _look(samples, fill_values, scale, axes, constant_run)
    return clean, _report(reasons, clipped, len(axes) == 1)


def _look(
    samples: np.ndarray,
    fill_values: Sequence[float],
    scale: float | None,
    axes: tuple[int, ...],
    constant_run: int | None,
) -> tuple[np.ndarray, dict[str, Bool[np.ndarray, "..."]], Bool[np.ndarray, "..."]]:
    """Samples with NaN where missing, where each reason holds first, and where samples are clipped."""
    given = np.ma.getdata(samples)
    double = given.dtype.kind == "f" and given.dtype.itemsize == 8
    # Whole numbers beyond 24 bits are compared before they are rounded.
    values: np.ndarray = given.astype(np.float64 if double or given.dtype.kind in "iu" else np.float32, copy=False)
    fills = {float(kind(fill)) for fill in (*FILL_VALUES, *fill_values) for kind in (np.float32, np.float64)}
    scale = level(samples) if scale is None else scale
    most = min(LARGEST * scale, float(np.finfo(values.dtype.name).max))
    # Nearly every block is like this, and three passes tell: then nothing is copied.
    if values.size and not np.ma.isMaskedArray(samples):
        largest = max(float(values.max()), -float(values.min()))
        if largest < min(most, *map(abs, fills)) and not _runs_matter(values, largest, axes, constant_run):
            return values.astype(np.float64 if double else np.float32, copy=False), {}, np.zeros(values.shape, bool)
    clean = values.astype(np.float64 if double else np.float32)
    left = np.ones(values.shape, bool)
    reasons: dict[str, np.ndarray] = {}

    def leave_out(reason: str, where: np.ndarray) -> None:
        where = where & left
        if where.any():
            reasons[reason] = where
            left[where] = False
            clean[where] = np.nan

    # Masks that hold nothing cost nothing.
    mask = np.ma.getmaskarray(samples) if np.ma.isMaskedArray(samples) else None
    if mask is not None:
        leave_out("masked", mask)
    leave_out("not finite", ~np.isfinite(values))
    leave_out("fill value", np.isin(values, list(fills)))
    lengths = _runs(values, axes)
    repeated = lengths >= SENTINEL_RUN
    if repeated.any():
        leave_out("sentinel", repeated & np.isin(values, [*SENTINELS, 2147483648.0]))  # 2^31 - 1 in single precision
    # Of numbers only: what is missing was looked at.
    leave_out("too large", np.abs(np.where(left, values, 0.0)) > most)
    if constant_run is not None:
        leave_out("constant", lengths >= constant_run)
    clipped = (lengths >= CLIPPED_RUN) & left
    if clipped.any():
        clipped &= np.isin(values.astype(np.float32), np.asarray(FULL_SCALE, np.float32))
        if clipped.any():
            extreme = np.abs(np.where(left, values, 0.0)).max(axis=0 if len(axes) == 1 else None)
            # The lower end of a converter is one step further away than the upper.
            clipped &= np.abs(values) >= extreme * (1 - 2.0**-7)
    return clean, reasons, clipped


def _runs_matter(values: np.ndarray, largest: float, axes: tuple[int, ...], constant_run: int | None) -> bool:
    """Whether runs of equal values are to be looked at: there are some, and they may be marks or a full scale."""
    if constant_run is None:
        full = largest <= max(FULL_SCALE) and bool(np.isin(np.float32(largest), np.asarray(FULL_SCALE, np.float32)))
        marks = largest >= abs(SENTINELS[0]) and bool(np.isin(values, [*SENTINELS, 2147483648.0]).any())
        if not (full or marks):
            return False
    return any(_has_runs(values, axis).any() for axis in axes)


def _has_runs(values: np.ndarray, axis: int) -> Bool[np.ndarray, "..."]:
    """Which columns along an axis hold three equal values on end."""
    moved = np.moveaxis(values, axis, 0)
    if len(moved) < CLIPPED_RUN:
        return np.zeros(moved.shape[1:], bool)
    equal = moved[1:] == moved[:-1]
    return (equal[1:] & equal[:-1]).any(axis=0)


def _runs(values: np.ndarray, axes: tuple[int, ...]) -> Int[np.ndarray, "..."]:
    """Longest run of equal values along any of the axes that every value belongs to; 0 in columns without one."""
    lengths = np.zeros(values.shape, np.int32)
    for axis in axes:
        columns = _has_runs(values, axis)
        moved, into = np.moveaxis(values, axis, 0), np.moveaxis(lengths, axis, 0)
        if columns.any():
            into[:, columns] = np.maximum(into[:, columns], run_lengths(moved[:, columns], 0))
    return lengths


def _report(reasons: Mapping[str, np.ndarray], clipped: np.ndarray, by_channel: bool) -> Missing:
    """Counts and stretches of masks of shape `(time, *cells)`."""
    counts = {reason: mask.sum(axis=0) for reason, mask in reasons.items() if mask.any()}
    spans: list[Span] = []
    unlisted = 0
    for reason, mask in reasons.items():
        columns: list[tuple[int | None, np.ndarray]]
        if by_channel and mask.ndim == 2:
            columns = [(int(number), mask[:, number]) for number in np.flatnonzero(mask.any(axis=0))]
        else:
            columns = [(None, np.asarray(mask.reshape(len(mask), -1).any(axis=1)))]
        for channel, column in columns:
            edges = np.flatnonzero(np.diff(np.concatenate([[False], column, [False]]).astype(np.int8)))
            stretches = edges.reshape(-1, 2)
            room = MOST_SPANS - len(spans)
            spans += [Span(reason, channel, int(start), int(stop)) for start, stop in stretches[:room]]
            unlisted += max(len(stretches) - room, 0)
    return Missing(len(clipped), counts, clipped.sum(axis=0), tuple(spans), unlisted)
