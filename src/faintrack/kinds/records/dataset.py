"""What came out of the records of several arrays, or of one, in the schema of results.

Beside the schema there is what finds targets (`detection`), what the arrays reported (`record`) and where they were.
Targets that an array hears by itself have a bearing in place of a position. A track that is outside the region for a
while has no label there.
"""

from typing import Any

import numpy as np
import xarray as xr
from jaxtyping import Float

from faintrack.data.records import InStep
from faintrack.kinds.records.build import Placed
from faintrack.kinds.records.sections import RecordsScenario
from faintrack.results.schema import AXIS, HALF, NORTH, bearing, estimated, planar
from faintrack.scenario.plane import Plane
from faintrack.sensors.stations import Fans
from faintrack.trackers.detectors import Detectors
from faintrack.trackers.several import SeveralEstimate

REGION, ALONE = ("x", "y", "vx", "vy"), ("bearing", "bearing_rate")
"""Axes of a detector in a region, and of that of an array by itself."""


def scans_dataset(
    part: slice,
    estimates: SeveralEstimate,
    energy: Float[np.ndarray, "scan array beam"],
    scenario: RecordsScenario,
    together: InStep,
    placed: Placed,
    fans: Fans,
    detectors: Detectors,
    plane: Plane | None,
) -> xr.Dataset:
    """Estimates of consecutive scans in the schema, with what only this kind knows.

    Parameters
    ----------
    part : which scans they are.
    estimates : of the tracker, stacked.
    energy : as the tracker read them; not a number where a beam was not measured.
    scenario, together, placed, fans, detectors, plane : what was run; see `faintrack.kinds.records.build`.
    """
    times = together.times[part] - together.times[0]
    alone = scenario.region is None
    if alone:
        data = estimated(times, estimates, bearing(reference(fans.line[0]), level=False))
    else:
        data = estimated(times, estimates, planar()).assign(_places_of_arrays(placed, part))
    unit = "1" if scenario.energies.absent is not None else "standard deviations above the median"
    data = data.assign(
        detection=_of("detector", estimates.detection, "1", "probability of a target in the detector"),
        joint=_of("slot", estimates.joint, "1", "whether the target was updated together with another"),
        undecided=_of(
            "slot", estimates.undecided, "1", "whether a target can be neither declared nor given up; see existence"
        ),
        record=(
            ("time", "array", "beam"),
            np.clip(energy, -HALF, HALF).astype(np.float16),
            {"units": unit, "long_name": "energy of the beam as it was read"},
        ),
    )
    if plane is not None:
        data = data.assign(_degrees(data, plane))
    data = data.assign_coords(
        array=("array", [table.name for table in scenario.stations]),
        line=("array", list(fans.line), {"long_name": "whether the array is a line"}),
        beam_bearing=(("array", "beam"), _beams(fans), {"units": "degree", "long_name": "bearing of the beam"}),
    )
    axes = dict(detectors.filter.grid.axes)
    if not alone:
        data = data.assign_coords(
            detector_x=("detector", np.asarray(detectors.place.x), {"units": "m", "long_name": "west end"}),
            detector_y=("detector", np.asarray(detectors.place.y), {"units": "m", "long_name": "south end"}),
        ).assign_attrs(
            detector_width=axes["x"].step * axes["x"].count, detector_height=axes["y"].step * axes["y"].count
        )
    return data.assign_attrs(
        kind="records",
        source=" and ".join(record.source for record in together.records),
        start_time=start_of_scans(together),
        first_scan_time=float(together.times[0]),
        scan_interval=together.interval,
        cells=[axes[name].count for name in (ALONE if alone else REGION)],
    )


def reference(line: bool) -> str:
    """What bearings of an array are counted from."""
    return AXIS if line else NORTH


def start_of_scans(together: InStep) -> str:
    """Time of the first scan in UTC; empty where the records do not tell."""
    if together.start_time is None:
        return ""
    since = np.timedelta64(round(together.times[0] * 1e9), "ns")
    return f"{together.start_time + since}Z"


def _places_of_arrays(placed: Placed, part: slice) -> dict[str, Any]:
    """Variables of where the arrays are."""
    return {
        "station_x": _of("array", placed.x[part], "m", "east of the array"),
        "station_y": _of("array", placed.y[part], "m", "north of the array"),
        "station_heading": _of("array", np.degrees(placed.heading[part]), "degree", "direction of a line's axis"),
    }


def _degrees(data: xr.Dataset, plane: Plane) -> dict[str, Any]:
    """Variables of where targets are on earth."""
    places = zip(("latitude", "longitude"), plane.degrees(data.x.values, data.y.values), strict=True)
    held = np.isfinite(data.x.values)
    return {name: _of("slot", np.where(held, place, np.nan), "degree", name) for name, place in places}


def _of(dim: str, values: Any, units: str, long_name: str) -> tuple[tuple[str, str], np.ndarray, dict[str, str]]:
    """A variable with one value a scan and detector, slot or array."""
    return ("time", dim), np.asarray(values), {"units": units, "long_name": long_name}


def _beams(fans: Fans) -> Float[np.ndarray, "array beam"]:
    """Bearings of all beams, degrees; not a number where an array has fewer than others."""
    bearings = np.full((fans.arrays, fans.most), np.nan)
    for number, (first, step, count) in enumerate(zip(fans.first, fans.step, fans.count, strict=True)):
        bearings[number, :count] = np.degrees(first + step * np.arange(count))
    return bearings
