"""miniSEED files: records of a few seconds each, of one channel or of several in turn.

Opening a file reads only the headers of its records, a piece of the file at a time, and notes where each
unbroken stretch of samples belongs. A block is then made of the stretches that reach into it. Samples that no
record holds are NaN. Channels that start or end at different times are cut to the time that they share.
"""

import io
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from faintrack.data.recording import Recording
from faintrack.errors import InputError
from faintrack.io.checks import explained, require_file, samples_between
from faintrack.io.seismic import obspy_module, utc_of

# Bytes that are decoded at a time: small against memory, large against the cost of one call of ObsPy (1 ms).
# Records are a power of two long and no longer than this, so a piece ends where a record ends.
_PIECE = 2**18


@dataclass(frozen=True)
class _Stretch:
    """Unbroken samples of one channel, the `order`-th trace that ObsPy finds in one piece of the file."""

    piece: int
    order: int
    channel: str
    start: int  # sample number, counted from the first sample of the file
    stop: int


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
        with explained(f"{path} cannot be read as miniSEED"), warnings.catch_warnings():
            # ObsPy warns of bytes that it skips; they are counted, and refused, below.
            warnings.simplefilter("ignore")
            with path.open("rb") as file:
                file.seek(piece * _PIECE)
                content = file.read(_PIECE)
            found = list(decode(io.BytesIO(content), format="MSEED", headonly=headonly))
        used = sum(t.stats.mseed.number_of_records * t.stats.mseed.record_length for t in found)
        if used != len(content):
            place = f"{used} of the {len(content)} bytes from byte {piece * _PIECE}"
            raise InputError(f"{path} is damaged or cut short: only {place} are records.")
        return found

    pieces = range(-(-size // _PIECE))
    stretches, rate, start_time = _index(path, pieces, lambda piece: traces(piece, True))
    channels = tuple(dict.fromkeys(stretch.channel for stretch in stretches))
    begin = max(min(s.start for s in stretches if s.channel == name) for name in channels)
    end = min(max(s.stop for s in stretches if s.channel == name) for name in channels)
    if end <= begin:
        raise InputError(f"{path}: the channels {', '.join(channels)} have no time in common.")

    def read_samples(start: int, stop: int) -> np.ndarray:
        start, stop = start + begin, min(stop + begin, end)
        samples = np.full((stop - start, len(channels)), np.nan, np.float32)
        wanted = [s for s in stretches if s.start < stop and s.stop > start]
        for piece in sorted({s.piece for s in wanted}):
            found = traces(piece, False)
            for s in (s for s in wanted if s.piece == piece):
                low, high = max(start, s.start), min(stop, s.stop)
                values = found[s.order].data[low - s.start : high - s.start]
                samples[low - start : high - start, channels.index(s.channel)] = values
        return samples

    first_sample = start_time + np.timedelta64(round(begin / rate * 1e9), "ns")
    return Recording(read_samples, end - begin, rate, channels, first_sample, str(path))


def _index(
    path: Path, pieces: range, headers: Callable[[int], Sequence[Any]]
) -> tuple[list[_Stretch], float, np.datetime64]:
    """Where every stretch belongs, the rate of all, and the time of the first sample of the file."""
    stretches: list[_Stretch] = []
    # For each channel, where its next sample belongs and when it is due.
    due: dict[str, tuple[int, np.datetime64]] = {}
    rate: float = 0.0
    first: np.datetime64 = np.datetime64("NaT", "ns")
    for piece in pieces:
        for order, trace in enumerate(headers(piece)):
            stats = trace.stats
            if not stats.sampling_rate or stats.mseed.encoding == "ASCII":
                continue  # a log, not a signal
            time = utc_of(stats.starttime)
            if not stretches:
                rate, first = float(stats.sampling_rate), time
            if stats.sampling_rate != rate:
                raise InputError(
                    f"{path}: {trace.id} has {stats.sampling_rate} Hz and "
                    f"{stretches[0].channel} {rate} Hz; expected one sample rate."
                )
            start, expected = due.get(trace.id, (0, np.datetime64("NaT", "ns")))
            # Clocks drift and time stamps are rounded: within half a sample a record follows on the last.
            if not abs((time - expected) / np.timedelta64(1, "s")) * rate < 0.5:
                start = samples_between(first, time, rate, f"{path}: {trace.id}")
            stop = start + int(stats.npts)
            due[trace.id] = stop, time + np.timedelta64(round(stats.npts / rate * 1e9), "ns")
            stretches.append(_Stretch(piece, order, trace.id, start, stop))
    if not stretches:
        raise InputError(f"{path} holds no samples.")
    return stretches, rate, first
