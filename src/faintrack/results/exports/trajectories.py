"""NetCDF by the CF conventions: trajectories as a contiguous ragged array (CF-1.11, H.4.3).

`obs` counts the scans of all tracks one after the other, `row_size` how many of them each track has. The file is
classic NetCDF, which every reader knows.
"""

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from faintrack.errors import InputError
from faintrack.results.exports import require_earth, require_utc
from faintrack.results.result import Result
from faintrack.results.schema import units

_EARTH = {
    "latitude": {"standard_name": "latitude", "units": "degrees_north", "axis": "Y"},
    "longitude": {"standard_name": "longitude", "units": "degrees_east", "axis": "X"},
}


def write_netcdf(path: Path, result: Result) -> None:
    """Write NetCDF.

    Raises
    ------
    InputError : the result has no place on earth, does not know UTC, or has no track.
    """
    require_earth(result, "NetCDF of trajectories")
    require_utc(result, "NetCDF of trajectories")
    tracks = result.tracks
    if not tracks:
        raise InputError(f"the result of {result.data.attrs['source']} has no track; NetCDF needs one.")

    def joined(parts: list[np.ndarray]) -> np.ndarray:
        return np.concatenate([np.asarray(part, float) for part in parts])

    start = str(result.data.attrs["start_time"]).removesuffix("Z").replace("T", " ")
    coordinates: dict[str, Any] = {
        "time": (
            "obs",
            joined([track.time for track in tracks]),
            {"standard_name": "time", "units": f"seconds since {start}", "calendar": "standard", "axis": "T"},
        ),
        **{
            name: ("obs", joined([track.earth[name] for track in tracks]), attributes)
            for name, attributes in _EARTH.items()
        },
        "trajectory": (
            "trajectory",
            np.array([track.label for track in tracks], np.int32),
            {"cf_role": "trajectory_id", "long_name": "label of the track"},
        ),
    }
    variables: dict[str, Any] = {
        "row_size": (
            "trajectory",
            np.array([len(track.time) for track in tracks], np.int32),
            {"long_name": "number of scans of the track", "sample_dimension": "obs"},
        ),
        "existence": (
            "obs",
            joined([track.existence for track in tracks]),
            {"units": "1", "long_name": "probability that the track's target exists"},
        ),
    }
    for name, unit in units(result.data).items():
        said = unit.replace("degree/s", "degree s-1").replace("m/s", "m s-1")
        mean, std = (joined([getattr(track, part)[name] for track in tracks]) for part in ("mean", "std"))
        variables[name] = (
            "obs",
            mean,
            {"units": said, "long_name": f"mean {name}", "ancillary_variables": f"{name}_std"},
        )
        variables[f"{name}_std"] = "obs", std, {"units": said, "long_name": f"standard deviation of {name}"}
    attributes = {
        "Conventions": "CF-1.11",
        "featureType": "trajectory",
        "title": f"tracks in {result.data.attrs['source']}",
        "source": "faintrack",
    }
    data = xr.Dataset(variables, coordinates, attributes)
    # CF allows no missing values in coordinates.
    encoding: dict[str, Any] = {str(name): {"_FillValue": None} for name in data.variables}
    for name in ("existence", *variables):
        if name != "row_size":
            data[name].encoding["coordinates"] = "time latitude longitude"
    data.to_netcdf(path, format="NETCDF3_64BIT", engine="scipy", encoding=encoding)
