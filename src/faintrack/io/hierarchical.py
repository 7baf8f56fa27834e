"""HDF5 files in Acoular's layout and Zarr folders that follow it.

Both hold one array `time_data` of shape (time, channel) in any real type:

========================  ==============================  =============================
what                      HDF5, attribute of `time_data`  Zarr, attribute of the group
========================  ==============================  =============================
sample rate in Hz         `sample_freq`                   `sample_rate`
names of the channels     `channel_names` (may lack)      `channel_names` (may lack)
first sample, ISO, UTC    `start_time` (may lack)         `start_time` (may lack)
========================  ==============================  =============================

A chunk that a Zarr folder lacks reads as the array's fill value; ours is NaN, a gap.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from faintrack.data.recording import Recording
from faintrack.errors import InputError
from faintrack.io.checks import as_float, explained, require_file, require_numeric, utc

HDF5_RATE = "sample_freq"
ZARR_RATE = "sample_rate"


def open_hdf5(path: Path) -> Recording:
    """Recording of an HDF5 file as Acoular writes it.

    Raises
    ------
    InputError : no such file, damaged, or not in the layout above.
    """
    import h5py

    require_file(path)
    complaint = f"{path} cannot be read as HDF5"

    def read_samples(start: int, stop: int) -> np.ndarray:
        with explained(complaint), h5py.File(path) as file:
            return as_float(file["time_data"][start:stop])

    with explained(complaint), h5py.File(path) as file:
        samples = file.get("time_data")
        if not isinstance(samples, h5py.Dataset):
            raise InputError(f"{path} has no dataset time_data; it holds {_listed(file)}.")
        return _recording(path, samples, samples.attrs, HDF5_RATE, read_samples)


def open_zarr(path: Path) -> Recording:
    """Recording of a Zarr folder.

    Raises
    ------
    InputError : no such folder, damaged, or not in the layout above.
    """
    import zarr

    if not path.is_dir():
        raise InputError(f"{path} {'is a file; expected a Zarr folder' if path.exists() else 'does not exist'}.")
    complaint = f"{path} cannot be read as a Zarr folder"
    with explained(complaint):
        group = zarr.open_group(path, mode="r")
        samples = group.get("time_data")
        if not isinstance(samples, zarr.Array):
            raise InputError(f"{path} has no array time_data; it holds {_listed(group)}.")

        def read_samples(start: int, stop: int) -> np.ndarray:
            with explained(complaint):
                return as_float(np.asarray(samples[start:stop]))

        return _recording(path, samples, group.attrs.asdict(), ZARR_RATE, read_samples)


def _listed(group: Any) -> str:
    return ", ".join(group.keys()) or "nothing"


def _recording(
    path: Path,
    samples: Any,
    attributes: Mapping[str, Any],
    rate_field: str,
    read_samples: Callable[[int, int], np.ndarray],
) -> Recording:
    require_numeric(samples.dtype, f"{path}: time_data")
    if len(samples.shape) != 2:
        raise InputError(f"{path}: time_data has shape {samples.shape}; expected two axes, (time, channel).")
    length, channels = samples.shape
    start = attributes.get("start_time")
    return Recording(
        read_samples,
        int(length),
        _sample_rate(path, rate_field, attributes.get(rate_field)),
        _channel_names(path, attributes.get("channel_names"), int(channels)),
        None if start is None else utc(_text(start), f"{path}: start_time"),
        str(path),
    )


def _sample_rate(path: Path, field: str, value: Any) -> float:
    if value is None:
        raise InputError(f"{path}: time_data has no attribute {field}; expected the sample rate in Hz.")
    number = np.asarray(value)
    if number.size != 1 or number.dtype.kind not in "iuf":
        raise InputError(f"{path}: {field} is {value!r}; expected one number in Hz.")
    return float(number.item())


def _channel_names(path: Path, value: Any, channels: int) -> tuple[str, ...]:
    if value is None:
        return tuple(str(i) for i in range(channels))
    names = tuple(_text(name) for name in np.atleast_1d(value))
    if len(names) != channels:
        raise InputError(f"{path}: channel_names has {len(names)} names; time_data has {channels} channels.")
    return names


def _text(value: Any) -> str:
    return value.decode() if isinstance(value, bytes) else str(value)
