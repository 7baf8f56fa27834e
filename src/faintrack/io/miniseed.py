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
from faintrack.io.seed import require_sound
from faintrack.io.seismic import obspy_module, utc_of

# Bytes that are decoded at a time: small against memory, large against the cost of one call of ObsPy (1 ms).
# Records are a power of two long and no longer than this, so a piece ends where a record ends.
_PIECE = 2**18
# A rate that is further off than this is another rate, not a clock that runs fast.
_OFF_RATE = 1e-3
# Time stamps of miniSEED have this resolution where no microseconds are told; seconds.
_RESOLUTION = 1e-4


@dataclass
class _Run:
    """Unbroken samples of one channel: traces that ObsPy finds in pieces of the file, one after the other."""

    channel: str
    rate: float
    pieces: list[tuple[int, int]] = field(default_factory=list)  # piece, and number of the trace in it
    begins: list[int] = field(default_factory=list)  # of each trace, in samples of the run
    stamps: list[np.datetime64] = field(default_factory=list)
    length: int = 0
    places: Places = field(init=False)

    @property
    def due(self) -> np.datetime64:
        """When the next sample is due, as the last stamp and the nominal rate tell."""
        return self.stamps[-1] + np.timedelta64(round((self.length - self.begins[-1]) / self.rate * 1e9), "ns")


@reader("miniSEED")
def open_miniseed(path: Path) -> Recording:
    """Recording of a miniSEED file; float32 samples in the file's own unit, often raw counts.

    Raises
    ------
    InputError : no such file, damaged, channels without common rate or time, or no ObsPy.
    """
    require_file(path)
    decode = obspy_module("obspy", path).read
    size = path.stat().st_size

    def traces(piece: int, headonly: bool) -> Sequence[Any]:
        with path.open("rb") as file:
            file.seek(piece * _PIECE)
            content = file.read(_PIECE)
        require_sound(path, content, piece * _PIECE)
        with warnings.catch_warnings(record=True) as heard:
            warnings.simplefilter("always")
            found = list(decode(io.BytesIO(content), format="MSEED", headonly=headonly))
        used = sum(t.stats.mseed.number_of_records * t.stats.mseed.record_length for t in found)
        if used != len(content):
            place = f"{used} of the {len(content)} bytes from byte {piece * _PIECE}"
            raise InputError(f"{path} is damaged or cut short: only {place} are records.")
        said = [
            str(w.message) for w in heard if "integrity" in str(w.message).lower() or "steim" in str(w.message).lower()
        ]
        if said:
            raise InputError(f"{path} is damaged: {len(said)} records from byte {piece * _PIECE} on fail their check.")
        return found

    pieces = range(-(-size // _PIECE))
    runs, rate = _index(path, pieces, lambda piece: traces(piece, True))
    channels = tuple(dict.fromkeys(run.channel for run in runs))
    require_channels(len(channels), path)
    first = min(run.stamps[0] for run in runs)
    for run in runs:
        stamps = (np.array(run.stamps) - first) / np.timedelta64(1, "ns") * (rate / 1e9)
        run.places = places(np.array(run.begins), stamps, run.length, rate / run.rate, _RESOLUTION * rate)
    begin = min(run.places.start for run in runs)
    end = max(run.places.stop for run in runs)
    if end - begin > limits.MOST_SAMPLES:
        raise InputError(f"{path} reaches over {end - begin} samples; expected at most {limits.MOST_SAMPLES}.")
    if end - begin > 1000 * sum(run.length for run in runs):
        raise InputError(
            f"{path} reaches over {(end - begin) / rate:.6g} s, of which {sum(run.length for run in runs)} samples are "
            "there; expected fewer gaps."
        )
    _require_common_time(path, runs, channels)

    def read_samples(start: int, stop: int) -> np.ndarray:
        start, stop = start + begin, stop + begin
        samples = np.full((stop - start, len(channels)), np.nan, np.float32)
        decoded: dict[int, Sequence[Any]] = {}

        def of_piece(piece: int) -> Sequence[Any]:
            if piece not in decoded:
                if len(decoded) > 8:
                    decoded.pop(next(iter(decoded)))
                decoded[piece] = traces(piece, False)
            return decoded[piece]

        wanted = [run for run in runs if run.places.start < stop and run.places.stop > start]
        for run in sorted(wanted, key=lambda run: run.pieces[0]):
            low, high = max(start, run.places.start), min(stop, run.places.stop)

            def own(first: int, last: int, run: _Run = run) -> np.ndarray:
                return _samples(run, first, last, of_piece)

            if run.places.plain:
                values = own(low - run.places.start, high - run.places.start)
            else:
                values = interpolated(own, run.length, run.places.own(np.arange(low, high, dtype=float)))
            samples[low - start : high - start, channels.index(run.channel)] = values
        return samples

    start_time = first + np.timedelta64(round(begin / rate * 1e9), "ns")
    remarks = _remarks(runs, channels, rate, begin, end)
    return Recording(read_samples, end - begin, rate, channels, start_time, str(path), remarks)


def _samples(run: _Run, start: int, stop: int, traces: Callable[[int], Sequence[Any]]) -> np.ndarray:
    """Samples of a run, put together from its traces."""
    parts = []
    for number in range(bisect_right(run.begins, start) - 1, len(run.begins)):
        begin = run.begins[number]
        if begin >= stop:
            break
        piece, order = run.pieces[number]
        parts.append(np.asarray(traces(piece)[order].data[max(start - begin, 0) : stop - begin]))
    return np.concatenate(parts) if parts else np.empty(0, np.float32)


def _index(path: Path, pieces: range, headers: Callable[[int], Sequence[Any]]) -> tuple[list[_Run], float]:
    """Every unbroken run of the file, and the rate of all."""
    runs: list[_Run] = []
    latest: dict[str, _Run] = {}
    rate = 0.0
    for piece in pieces:
        for order, trace in enumerate(headers(piece)):
            stats = trace.stats
            if not stats.sampling_rate or stats.mseed.encoding == "ASCII" or not stats.npts:
                continue  # a log, not a signal
            time, own = utc_of(stats.starttime), require_rate(float(stats.sampling_rate), f"{path}: {trace.id}")
            if not limits.FIRST_YEAR <= stats.starttime.year <= limits.LAST_YEAR:
                raise InputError(f"{path}: {trace.id} has samples of the year {stats.starttime.year}.")
            rate = rate or own
            if abs(own - rate) > _OFF_RATE * rate:
                raise InputError(
                    f"{path}: {trace.id} has {own} Hz and {runs[0].channel} {rate} Hz; expected one sample rate."
                )
            run = latest.get(trace.id)
            # Within half a sample a record follows on the last: clocks drift and time stamps are rounded.
            if run is None or not abs((time - run.due) / np.timedelta64(1, "s")) * rate < 0.5 or own != run.rate:
                run = latest[trace.id] = _Run(trace.id, own)
                runs.append(run)
            run.pieces.append((piece, order))
            run.begins.append(run.length)
            run.stamps.append(time)
            run.length += int(stats.npts)
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
