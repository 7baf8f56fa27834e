"""HDF5 files in Acoular's layout and Zarr folders that follow it.

Both hold one array `time_data` of shape (time, channel) in any real type:

========================  ==============================  =============================
what                      HDF5, attribute of `time_data`  Zarr, attribute of the group
========================  ==============================  =============================
sample rate in Hz         `sample_freq`                   `sample_rate`
names of the channels     `channel_names` (may lack)      `channel_names` (may lack)
first sample, ISO, UTC    `start_time` (may lack)         `start_time` (may lack)
========================  ==============================  =============================

What is not there is NaN: chunks that were never written, values that the file marks as none (`faintrack.io.stored`).
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from faintrack.data.recording import Recording
from faintrack.errors import InputError
from faintrack.io import limits
from faintrack.io.checks import (
    as_float,
    reader,
    require_channels,
    require_file,
    require_folder,
    require_numeric,
    require_rate,
    utc,
)
from faintrack.io.stored import Slices, attributes_of, hdf5_values, zarr_values

HDF5_RATE = "sample_freq"
ZARR_RATE = "sample_rate"


@reader("HDF5")
def open_hdf5(path: Path) -> Recording:
    """Recording of an HDF5 file as Acoular writes it.

    Raises
    ------
    InputError : no such file, damaged, or not in the layout above.
    """
    import h5py

    require_file(path)
    with h5py.File(path, "r") as file:
        samples = file.get("time_data") if "time_data" in file else None
        if not isinstance(samples, h5py.Dataset):
            raise InputError(f"{path} has no dataset time_data; it holds {_listed(file)}.")
        _require_samples(path, samples)
        return _recording(path, samples, attributes_of(samples), HDF5_RATE, hdf5_values(path, samples))


@reader("a Zarr folder")
def open_zarr(path: Path) -> Recording:
    """Recording of a Zarr folder.

    Raises
    ------
    InputError : no such folder, damaged, or not in the layout above.
    """
    import zarr

    require_folder(path)
    group = zarr.open_group(path, mode="r")
    samples = group.get("time_data")
    if not isinstance(samples, zarr.Array):
        raise InputError(f"{path} has no array time_data; it holds {_listed(group)}.")
    _require_samples(path, samples)
    values, attributes = zarr_values(path, samples)
    return _recording(path, samples, attributes | group.attrs.asdict(), ZARR_RATE, values)


def _listed(group: Any) -> str:
    return ", ".join(sorted(group.keys())[:20]) or "nothing"


def _require_samples(path: Path, samples: Any) -> None:
    """Refuse an array that cannot be samples, from its shape and type alone."""
    if samples.dtype.kind == "c" or samples.dtype.names == ("r", "i"):
        raise InputError(
            f"{path}: time_data holds {samples.dtype}; expected real numbers. Complex samples of coherent receivers "
            "need a beamformer of both sides of the spectrum, which there is not yet."
        )
    require_numeric(samples.dtype, f"{path}: time_data")
    if samples.shape is None or len(samples.shape) != 2:
        raise InputError(f"{path}: time_data has shape {samples.shape}; expected two axes, (time, channel).")
    length, channels = samples.shape
    require_channels(int(channels), f"{path}: time_data")
    if length == 0 or channels == 0:
        raise InputError(f"{path}: there are no samples.")
    if length > limits.MOST_SAMPLES:
        raise InputError(f"{path}: time_data tells of {length} samples; expected at most {limits.MOST_SAMPLES}.")


def _recording(
    path: Path,
    samples: Any,
    attributes: Mapping[str, Any],
    rate_field: str,
    values: Callable[[Slices], np.ndarray],
) -> Recording:
    packed = attributes.keys() & {"scale_factor", "add_offset"}
    if packed:
        raise InputError(f"{path}: time_data is packed with {min(packed)}; expected plain values.")
    length, channels = samples.shape
    start = attributes.get("start_time")
    return Recording(
        lambda start, stop: as_float(values((slice(start, stop), slice(None)))),
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
        raise InputError(f"{path}: {field} is {str(value)[:80]!r}; expected one number in Hz.")
    return require_rate(float(number.item()), path)


def _channel_names(path: Path, value: Any, channels: int) -> tuple[str, ...]:
    if value is None:
        return tuple(str(i) for i in range(channels))
    listed = np.atleast_1d(np.asarray(value)).ravel()
    if len(listed) != channels:
        raise InputError(f"{path}: channel_names has {len(listed)} names; time_data has {channels} channels.")
    return tuple(_text(name)[:200] for name in listed)


def _text(value: Any) -> str:
    value = value.item() if isinstance(value, np.ndarray | np.generic) and np.size(value) == 1 else value
    return value.decode() if isinstance(value, bytes) else str(value)
