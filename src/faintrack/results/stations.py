"""What came out of the records of several arrays, or of one, scan by scan, as named variables with units.

A target in hand occupies a slot, and slots are used again: a track is all entries with one label, in whatever slot they
stand. Where a slot holds no target its state is not a number; where its target is not declared yet, or is outside the
region, its label is 0. Targets that an array hears by itself have a bearing in place of a position.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr
from jaxtyping import Float

from faintrack.data.records import InStep
from faintrack.results.result import HALF
from faintrack.scenario.build_stations import Placed
from faintrack.scenario.model import Scenario
from faintrack.scenario.plane import Plane
from faintrack.sensors.stations import Fans
from faintrack.trackers.detectors import Detectors
from faintrack.trackers.several import SeveralEstimate

COMPONENTS = ("x", "y", "vx", "vy")
"""Of the state of a target in a region."""

BEARING = ("bearing", "bearing_rate")
"""Components that the detector of an array by itself has."""


def scans_dataset(
    part: slice,
    estimates: SeveralEstimate,
    energy: Float[np.ndarray, "scan array beam"],
    scenario: Scenario,
    together: InStep,
    placed: Placed,
    fans: Fans,
    detectors: Detectors,
    plane: Plane | None,
) -> xr.Dataset:
    """Estimates of consecutive scans as named variables with units.

    Parameters
    ----------
    part : which scans they are.
    estimates : of the tracker, stacked.
    energy : as the tracker read them; not a number where a beam was not measured.
    scenario, together, placed, fans, detectors, plane : what was run; see `faintrack.scenario.build_stations`.
    """
    alone = scenario.region is None
    unit = "1" if scenario.energies.absent is not None else "standard deviations above the median"
    variables: dict[str, Any] = {
        "detection": _of("detector", estimates.detection, "1", "probability of a target in the detector"),
        "label": _of("slot", estimates.label, "1", "track in the slot, 0 where there is none"),
        "existence": _of("slot", estimates.existence, "1", "probability that the target of the slot exists"),
        **(_bearings(estimates, fans) if alone else _places(estimates, placed, part, plane)),
        "joint": _of("slot", estimates.joint, "1", "whether the target was updated together with another"),
        "full": (
            "time",
            estimates.full,
            {"units": "1", "long_name": "whether a target was found and no slot was free"},
        ),
        "record": (
            ("time", "array", "beam"),
            np.clip(energy, -HALF, HALF).astype(np.float16),
            {"units": unit, "long_name": "energy of the beam as it was read"},
        ),
    }
    axes = dict(detectors.filter.grid.axes)
    since = together.times[part] - together.times[0]
    tables = scenario.stations or ()
    coordinates: dict[str, Any] = {
        "time": ("time", since, {"units": "s", "long_name": "time from the first scan"}),
        "array": ("array", [table.name for table in tables]),
        "line": ("array", list(fans.line), {"long_name": "whether the array is a line"}),
        "beam_bearing": (("array", "beam"), _beams(fans), {"units": "degree", "long_name": "bearing of the beam"}),
    }
    attributes: dict[str, Any] = {
        "source": " and ".join(record.source for record in together.records),
        "start_time": start_of_scans(together),
        "first_scan_time": float(together.times[0]),
        "scan_interval": together.interval,
        "cells": [axes[name].count for name in (BEARING if alone else COMPONENTS)],
    }
    if not alone:
        coordinates |= {
            "component": ("component", list(COMPONENTS)),
            "other": ("other", list(COMPONENTS)),
            "detector_x": ("detector", np.asarray(detectors.place.x), {"units": "m", "long_name": "west end"}),
            "detector_y": ("detector", np.asarray(detectors.place.y), {"units": "m", "long_name": "south end"}),
        }
        attributes |= {
            "detector_width": axes["x"].step * axes["x"].count,
            "detector_height": axes["y"].step * axes["y"].count,
        }
    if plane is not None:
        attributes |= {"latitude_of_origin": plane.latitude, "longitude_of_origin": plane.longitude}
    return xr.Dataset(variables, coordinates, attributes)


def _places(estimates: SeveralEstimate, placed: Placed, part: slice, plane: Plane | None) -> dict[str, Any]:
    """Variables of targets in a region, and of where the arrays are."""
    held = estimates.existence > 0
    state = {name: np.where(held, getattr(estimates.mean, name), np.nan) for name in COMPONENTS}
    covariance = np.where(held[..., None, None], estimates.covariance, np.nan)
    variables: dict[str, Any] = {
        "x": _of("slot", state["x"], "m", "mean position east"),
        "y": _of("slot", state["y"], "m", "mean position north"),
        "vx": _of("slot", state["vx"], "m/s", "mean velocity to the east"),
        "vy": _of("slot", state["vy"], "m/s", "mean velocity to the north"),
        "covariance": (
            ("time", "slot", "component", "other"),
            covariance.astype(np.float32),
            {"units": "m and m/s", "long_name": "covariance of x, y, vx and vy"},
        ),
        "station_x": _of("array", placed.x[part], "m", "east of the array"),
        "station_y": _of("array", placed.y[part], "m", "north of the array"),
        "station_heading": _of("array", np.degrees(placed.heading[part]), "degree", "direction of a line's axis"),
    }
    if plane is not None:
        places = zip(("latitude", "longitude"), plane.degrees(state["x"], state["y"]), strict=True)
        variables |= {name: _of("slot", np.where(held, place, np.nan), "degree", name) for name, place in places}
    return variables


def _bearings(estimates: SeveralEstimate, fans: Fans) -> dict[str, Any]:
    """Variables of targets that an array hears by itself; bearings begin where those of its beams do."""
    held = estimates.existence > 0
    first = fans.first[0] - fans.step[0] / 2
    bearing = estimates.mean.bearing if fans.line[0] else first + (estimates.mean.bearing - first) % (2 * np.pi)
    std = np.sqrt(estimates.covariance[..., 0, 0])
    told = {
        "bearing": (bearing, "degree", "mean bearing"),
        "bearing_std": (std, "degree", "standard deviation of the bearing"),
        "bearing_rate": (estimates.mean.bearing_rate, "degree/s", "mean bearing rate"),
    }
    return {
        name: _of("slot", np.where(held, np.degrees(values), np.nan), units, long_name)
        for name, (values, units, long_name) in told.items()
    }


def each_target(data: xr.Dataset, *names: str) -> Iterator[tuple[int, dict[str, np.ndarray]]]:
    """Labels of the tracks in ascending order, each with its times and some variables at these.

    Parameters
    ----------
    data : of a result of several arrays.
    names : of variables with one entry a scan and slot.
    """
    label = data.label.values
    values = {name: data[name].values for name in names}
    for number in np.unique(label[label > 0]):
        scans, slots = np.nonzero(label == number)
        yield int(number), {"time": data.time.values[scans]} | {name: of[scans, slots] for name, of in values.items()}


def start_of_scans(together: InStep) -> str:
    """Time of the first scan in UTC; empty where the records do not tell."""
    if together.start_time is None:
        return ""
    since = np.timedelta64(round(together.times[0] * 1e9), "ns")
    return f"{together.start_time + since}Z"


def _of(dim: str, values: Any, units: str, long_name: str) -> tuple[tuple[str, str], np.ndarray, dict[str, str]]:
    """A variable with one value a scan and detector, slot or array."""
    return ("time", dim), np.asarray(values), {"units": units, "long_name": long_name}


def _beams(fans: Fans) -> Float[np.ndarray, "array beam"]:
    """Bearings of all beams, degrees; not a number where an array has fewer than others."""
    bearing = np.full((fans.arrays, fans.most), np.nan)
    for number, (first, step, count) in enumerate(zip(fans.first, fans.step, fans.count, strict=True)):
        bearing[number, :count] = np.degrees(first + step * np.arange(count))
    return bearing
