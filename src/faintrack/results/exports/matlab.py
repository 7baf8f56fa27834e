"""MATLAB: a struct array `tracks` with the fields of an `objectTrack`, whose histories lie along the last dimension.

`State` is component by scan and `StateCovariance` component by component by scan; components stand with their rates,
(x, vx, y, vy), as the constant-velocity models of MATLAB want them, and `Components` and `Units` name them.
"""

from pathlib import Path

import numpy as np
from scipy.io import savemat

from faintrack.results.result import Result
from faintrack.results.track import Track

_FIELDS = [
    "TrackID",
    "UpdateTime",
    "State",
    "StateCovariance",
    "ExistenceProbability",
    "IsConfirmed",
    "Components",
    "Units",
    "Latitude",
    "Longitude",
    "StartTime",
]


def write_mat(path: Path, result: Result) -> None:
    """Write a MAT file of version 5; times are seconds from `StartTime`, UTC, which is empty where it is not known."""
    rows = np.empty((1, len(result.tracks)), [(name, object) for name in _FIELDS])
    for number, track in enumerate(result.tracks):
        rows[0, number] = tuple(_fields(track)[name] for name in _FIELDS)
    savemat(path, {"tracks": rows, "source": str(result.data.attrs["source"])}, long_field_names=True)


def _fields(track: Track) -> dict[str, object]:
    names = list(track.mean)
    order = track.with_rates
    index = [names.index(name) for name in order]
    covariance = np.asarray(track.covariance, float)[:, index][:, :, index]
    empty = np.zeros((1, 0))
    return {
        "TrackID": float(track.label),
        "UpdateTime": np.asarray(track.time, float)[None],
        "State": np.stack([np.asarray(track.mean[name], float) for name in order]),
        "StateCovariance": np.moveaxis(covariance, 0, -1),
        "ExistenceProbability": np.asarray(track.existence, float)[None],
        "IsConfirmed": True,
        "Components": np.array([order], object),
        "Units": np.array([[track.units[name] for name in order]], object),
        "Latitude": np.asarray(track.earth["latitude"], float)[None] if track.earth else empty,
        "Longitude": np.asarray(track.earth["longitude"], float)[None] if track.earth else empty,
        "StartTime": "" if track.start_time is None else f"{np.datetime_as_string(track.start_time, unit='ms')}Z",
    }
