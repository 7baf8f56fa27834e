"""Seismic and infrasound files: what SAC and miniSEED share, and the SAC reader.

Both know their channels by network, station, location and channel code. A reader names its channels by all
four, "YJ.BRP1..EDF"; `station_names` shortens the names once all channels of a recording are known.

A SAC file holds one channel: a header of 632 bytes, then float32 samples of either byte order.
"""

import importlib
import warnings
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from faintrack.data.recording import Recording
from faintrack.errors import InputError
from faintrack.io import limits
from faintrack.io.checks import as_float, reader, require_file, require_rate

_SAC_HEADER_BYTES = 632
# Which of network, station, location and channel code are tried, shortest first.
_NAME_FIELDS = ((1,), (1, 3), (1, 2, 3), (0, 1, 2, 3))


def obspy_module(name: str, path: Path) -> ModuleType:
    """Module of ObsPy, which is installed only where seismic files are read.

    Raises
    ------
    InputError : ObsPy is not installed; the sentence says how to install it.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise InputError(f'{path} needs ObsPy, which is not installed: pip install "faintrack[seismic]".') from error


def utc_of(moment: Any) -> np.datetime64:
    """Time of an ObsPy UTCDateTime, to the nanosecond."""
    return np.datetime64(moment.ns, "ns")


def station_names(identifiers: Sequence[str]) -> tuple[str, ...]:
    """Names as short as tells the channels apart: the station, more codes only where stations repeat.

    Parameters
    ----------
    identifiers : "network.station.location.channel" of each channel; codes may be empty.

    Examples
    --------
    >>> station_names(["YJ.BRP1..EDF", "YJ.BRP2..EDF"])
    ('BRP1', 'BRP2')
    >>> station_names(["YJ.BRP1..BHE", "YJ.BRP1..BHN"])
    ('BRP1.BHE', 'BRP1.BHN')
    """
    codes = [identifier.split(".") for identifier in identifiers]
    for fields in _NAME_FIELDS:
        names = tuple(".".join(code[i] for i in fields if code[i]) for code in codes)
        if all(names) and len(set(names)) == len(names):
            break
    return names


@reader("SAC")
def open_sac(path: Path) -> Recording:
    """Recording of one SAC file; samples in the file's own unit, often raw counts; -12345 on end is none.

    Raises
    ------
    InputError : no such file, not evenly sampled SAC, fewer samples than its header promises, or no ObsPy.
    """
    require_file(path)
    sac = obspy_module("obspy.io.sac", path)
    if path.stat().st_size < _SAC_HEADER_BYTES:
        raise InputError(f"{path} is shorter than the header of a SAC file.")
    with warnings.catch_warnings():
        # ObsPy warns of values that the checks below refuse.
        warnings.simplefilter("ignore")
        header = sac.SACTrace.read(str(path), headonly=True)
        if not header.leven or header.iftype != "itime":
            raise InputError(f"{path} is a SAC file of kind {header.iftype}; expected an evenly sampled time series.")
        length = int(header.npts)
        rate = require_rate(_sample_rate(header.delta) if header.delta else 0.0, path)
        codes = (header.knetwk, header.kstnm, header.khole, header.kcmpnm)
        start = None if header.nzyear is None else _start(path, header)
        sample_type = np.dtype(np.float32).newbyteorder(header.byteorder)
    held, rest = divmod(path.stat().st_size - _SAC_HEADER_BYTES, sample_type.itemsize)
    if held < length:
        raise InputError(f"{path} holds {held} of the {length} samples that its header promises.")
    remarks = []
    if held > length or rest:
        remarks.append(
            f"The file holds {held} samples, {held - length} more than its header tells; those are left out."
        )
    scale = header.scale
    if scale is not None and scale not in (0.0, 1.0):
        remarks.append(f"The header tells a scale of {scale:g}; samples are used as they stand.")

    def read_samples(begin: int, end: int) -> np.ndarray:
        samples = np.memmap(path, sample_type, "r", _SAC_HEADER_BYTES, shape=(length, 1))
        return as_float(samples[begin:end].copy())

    identifier = ".".join((code or "").strip() for code in codes)
    return Recording(read_samples, length, rate, (identifier,), start, str(path), tuple(remarks))


def _start(path: Path, header: Any) -> np.datetime64:
    """Time of the first sample."""
    moment = header.reftime + float(header.b or 0.0)
    if not limits.FIRST_YEAR <= moment.year <= limits.LAST_YEAR:
        raise InputError(f"{path} has samples of the year {moment.year}.")
    return utc_of(moment)


def _sample_rate(spacing: float) -> float:
    """Sample rate that a spacing in seconds, kept as float32, was meant to say; Hz.

    A whole rate if it has this spacing, otherwise that of the shortest decimal number: 1 / spacing itself comes
    out as 100.00000223.

    Examples
    --------
    >>> _sample_rate(float(np.float32(1 / 300))), _sample_rate(float(np.float32(0.4)))
    (300.0, 2.5)
    """
    kept = np.float32(spacing)
    whole = max(1, round(1 / spacing))
    return float(whole) if np.float32(1 / whole) == kept else 1 / float(str(kept))
