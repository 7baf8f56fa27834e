"""miniSEED files: records of a few seconds each, of one channel or of several in turn.

Opening a file reads only the headers of its records, a piece of the file at a time, and notes where each unbroken run
of samples lies. A block is then made of the runs that reach into it. Samples that no record holds are NaN: in gaps,
before a channel starts, after it has ended.

Time stamps rule. Records follow on each other as long as their stamps agree with the count of samples within half a
sample; where stamps drift against the nominal rate over such a run, its samples are taken at the times that the stamps
tell (`faintrack.io.clocks`), and where a run begins between two samples of the others too.
"""

import io
import warnings
from array import array
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from faintrack.data.recording import Recording
from faintrack.errors import InputError
from faintrack.io import limits
from faintrack.io.checks import reader, require_channels, require_file, require_rate
from faintrack.io.clocks import Places, interpolated, places
from faintrack.io.seed import Record, records
from faintrack.io.seismic import obspy_module

# Bytes that are decoded at a time: small against memory, large against the cost of one call of ObsPy (1 ms).
_PIECE = 2**17
# A rate that is further off than this is another rate, not a clock that runs fast.
_OFF_RATE = 1e-3
# Time stamps of miniSEED have this resolution where no microseconds are told; seconds.
_RESOLUTION = 1e-4


@dataclass
class _Run:
    """Unbroken samples of one channel: records one after the other, which need not be neighbours in the file."""

    channel: str
    rate: float
    begins: array = field(default_factory=lambda: array("q"))  # of each record, in samples of the run
    stamps: array = field(default_factory=lambda: array("q"))  # of each record; nanoseconds since 1970
    at: array = field(default_factory=lambda: array("q"))  # place of each record in the file; bytes
    sizes: array = field(default_factory=lambda: array("q"))
    length: int = 0
    places: Places = field(init=False)

    @property
    def due(self) -> float:
        """When the next sample is due, as the last stamp and the nominal rate tell; nanoseconds."""
        return self.stamps[-1] + (self.length - self.begins[-1]) / self.rate * 1e9

    def append(self, record: Record) -> None:
        """Add the record that follows."""
        self.begins.append(self.length)
        self.stamps.append(record.time)
        self.at.append(record.place)
        self.sizes.append(record.length)
        self.length += record.samples


@reader("miniSEED")
def open_miniseed(path: Path) -> Recording:
    """Recording of a miniSEED file; float32 samples in the file's own unit, often raw counts.

    Raises
    ------
    InputError : no such file, damaged, channels without common rate or time, or no ObsPy.
    """
    require_file(path)
    decode = obspy_module("obspy", path).read
    runs, rate = _index(path)
    channels = tuple(dict.fromkeys(run.channel for run in runs))
    require_channels(len(channels), path)
    first = min(run.stamps[0] for run in runs)
    for run in runs:
        stamps = (np.array(run.stamps) - first) * (rate / 1e9)
        run.places = places(np.array(run.begins), stamps, run.length, rate / run.rate, _RESOLUTION * rate)
    begin = min(run.places.start for run in runs)
    end = max(run.places.stop for run in runs)
    held = sum(run.length for run in runs)
    if end - begin > min(1000 * held, limits.MOST_SAMPLES):
        raise InputError(
            f"{path} reaches over {(end - begin) / rate:.6g} s, of which {held} samples are there; expected fewer gaps."
        )
    _require_common_time(path, runs, channels)

    def read_samples(start: int, stop: int) -> np.ndarray:
        start, stop = start + begin, stop + begin
        samples = np.full((stop - start, len(channels)), np.nan, np.float32)
        # In the order of the file: of samples that stand there twice the later count.
        for run in runs:
            low, high = max(start, run.places.start), min(stop, run.places.stop)
            if low >= high:
                continue

            def own(first: int, last: int, run: _Run = run) -> np.ndarray:
                return _samples(path, run, first, last, decode)

            if run.places.plain:
                values = own(low - run.places.start, high - run.places.start)
            else:
                values = interpolated(own, run.length, run.places.own(np.arange(low, high, dtype=float)))
            samples[low - start : high - start, channels.index(run.channel)] = values
        return samples

    start_time = np.datetime64(first, "ns") + np.timedelta64(round(begin / rate * 1e9), "ns")
    remarks = _remarks(runs, channels, rate, begin, end)
    return Recording(read_samples, end - begin, rate, channels, start_time, str(path), remarks)


def _samples(path: Path, run: _Run, start: int, stop: int, decode: Callable[..., Sequence[Any]]) -> np.ndarray:
    """Samples of a run, decoded from its records."""
    number, last = bisect_right(run.begins, start) - 1, bisect_right(run.begins, stop - 1)
    parts: list[np.ndarray] = []
    with path.open("rb") as file:
        while number < last:
            first, content = number, b""
            while number < last and len(content) < _PIECE:
                file.seek(run.at[number])
                content += file.read(run.sizes[number])
                number += 1
            begin = run.begins[first]
            expected = (run.begins[number] if number < len(run.begins) else run.length) - begin
            values = _decoded(path, content, run.at[first], decode)
            if len(values) != expected:
                raise InputError(
                    f"{path} is damaged: {len(values)} of {expected} samples can be unpacked from byte {run.at[first]}."
                )
            parts.append(values[max(start - begin, 0) : max(stop - begin, 0)])
    return np.concatenate(parts) if parts else np.empty(0, np.float32)


def _decoded(path: Path, content: bytes, place: int, decode: Callable[..., Sequence[Any]]) -> np.ndarray:
    """Samples of records that follow on each other."""
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        found = sorted(decode(io.BytesIO(content), format="MSEED"), key=lambda trace: trace.stats.starttime.ns)
    # Steim keeps the last sample of a record twice.
    said = [str(warning.message) for warning in heard if "ntegrity" in str(warning.message)]
    if said:
        raise InputError(f"{path} is damaged: {len(said)} records from byte {place} on fail their check.")
    return np.concatenate([np.asarray(trace.data) for trace in found]).astype(np.float32)


def _index(path: Path) -> tuple[list[_Run], float]:
    """Every unbroken run of the file in the order of their first records, and the rate of all."""
    runs: list[_Run] = []
    latest: dict[str, _Run] = {}
    rate = 0.0
    for record in records(path):
        if not record.samples:
            continue  # a log, not a signal
        require_rate(record.rate, f"{path}: {record.channel}")
        rate = rate or record.rate
        if abs(record.rate - rate) > _OFF_RATE * rate:
            raise InputError(
                f"{path}: {record.channel} has {record.rate} Hz and {runs[0].channel} {rate} Hz; "
                "expected one sample rate."
            )
        run = latest.get(record.channel)
        # Within half a sample a record follows on the last: clocks drift and time stamps are rounded.
        if run is None or abs(record.time - run.due) * 1e-9 * rate >= 0.5 or record.rate != run.rate:
            run = latest[record.channel] = _Run(record.channel, record.rate)
            runs.append(run)
            if len(runs) > limits.MOST_FILES:
                raise InputError(f"{path} holds more than {limits.MOST_FILES} stretches; expected fewer gaps.")
        run.append(record)
    if not runs:
        raise InputError(f"{path} holds no samples.")
    return runs, rate


def _require_common_time(path: Path, runs: Sequence[_Run], channels: Sequence[str]) -> None:
    """Refuse channels of which no two are there at one time."""
    if len(channels) < 2:
        return
    spans = sorted((run.places.start, run.places.stop, run.channel) for run in runs)
    latest: dict[str, int] = {}
    for start, stop, channel in spans:
        if any(end > start for name, end in latest.items() if name != channel):
            return
        latest[channel] = max(stop, latest.get(channel, stop))
    raise InputError(f"{path}: the channels {', '.join(channels)} have no time in common.")


def _remarks(runs: Sequence[_Run], channels: Sequence[str], rate: float, begin: int, end: int) -> tuple[str, ...]:
    """What does not fit: gaps, overlaps, drift, channels that start late or end early."""
    said = []
    for name in channels:
        own = sorted((run for run in runs if run.channel == name), key=lambda run: run.places.start)
        reach, twice, gap, gaps = own[0].places.start, 0, 0, 0
        for number, run in enumerate(own):
            twice += max(min(reach, run.places.stop) - run.places.start, 0)
            if number and run.places.start > reach:
                gap, gaps = gap + run.places.start - reach, gaps + 1
            reach = max(reach, run.places.stop)
        if twice:
            said.append(
                f"Channel {name}: {twice} samples stand in the file more than once; those that come later in it count."
            )
        if gaps:
            said.append(f"Channel {name}: {gap / rate:.6g} s in {gaps} gaps are missing.")
        for count, place in ((own[0].places.start - begin, "beginning"), (end - reach, "end")):
            if count:
                said.append(f"Channel {name} has no samples in {count / rate:.6g} s at the {place}; they are missing.")
        moved = [run for run in own if not run.places.plain]
        if moved:
            longest = max(moved, key=lambda run: run.length)
            true = rate * (longest.length - 1) / (longest.places.at(longest.length - 1) - longest.places.at(0) or 1)
            said.append(
                f"Channel {name} runs at {true:.9g} Hz by its time stamps; its samples are taken at the times of "
                f"{rate:g} Hz."
            )
    return tuple(said)
