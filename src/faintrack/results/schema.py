"""The variables that every result has, whatever was tracked in.

A result is a dataset with one entry a scan and slot; a tracker of one target has one slot. A track is all entries with
one label, in whatever slot they stand.

===================  ===========================  =========================================================
`existence`          time, slot                   probability that the target of the slot exists
`label`              time, slot                   number of the track in the slot, 0 where there is none
`track_existence`    time, slot                   probability that the track's own target exists
`x`, `bearing`, ...  time, slot                   mean of each component of the state; not a number in a free slot
`covariance`         time, slot, component x 2    of the components, in the order of `component`, in their units
`observable`         time, slot                   probability that a target that exists shows in scans, where it may not
`full`               time                         whether a target was found and no slot was free, of several
`log_evidence`       time                         log of the mean likelihood ratio of the scan, where it is known
===================  ===========================  =========================================================

Attributes: `kind`, `source`, `scan_interval` in seconds, `first_scan_time` on the clock of the data, `start_time`, what
`time` 0 is in UTC, where it is known. Along `component` stand `unit`, `rate`, the name of a component's rate, and
`place`, whether it tells where a target is. Kinds add variables; one that has the attribute `counted` tells in how many
scans something happened that a user must know.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import xarray as xr

HALF = float(np.finfo(np.float16).max)
"""Largest number in the half precision of pictures."""

SUFFIXES = {
    "degree": "_deg",
    "degree/s": "_deg_s",
    "m": "_m",
    "m/s": "_m_s",
    "dB": "_db",
    "Hz": "_hz",
    "s": "_s",
}
"""What a unit adds to the name of a column; units of cells add nothing."""

NORTH, AXIS = "clockwise from north", "from the array axis"
"""What bearings are counted from: -180 to 180 degrees, or 0 to 180 of a line."""


@dataclass(frozen=True)
class Component:
    """A component of the state of targets, as results tell it.

    Attributes
    ----------
    name : in the state.
    unit : in results.
    scale : of a value in results over that in the state.
    place : whether it tells where a target is.
    rate : name of the component that is its rate, if there is one.
    attributes : of its variable, beside the unit.
    """

    name: str
    unit: str
    scale: float = 1.0
    place: bool = False
    rate: str | None = None
    attributes: Mapping[str, str] | None = None


def planar(unit: str = "m") -> tuple[Component, ...]:
    """Components of position and velocity in a plane."""
    rates = {"x": "vx", "y": "vy"}
    return (
        *(Component(name, unit, place=True, rate=rate) for name, rate in rates.items()),
        *(Component(rate, f"{unit}/s") for rate in rates.values()),
    )


def bearing(reference: str, level: bool = True) -> tuple[Component, ...]:
    """Components of a direction, its rate and, unless left out, the level of the source.

    Parameters
    ----------
    reference : what bearings are counted from, `NORTH` or `AXIS`.
    level : whether the SNR is told.
    """
    degrees = float(np.degrees(1))
    components = (
        Component("bearing", "degree", degrees, True, "bearing_rate", {"reference": reference}),
        Component("bearing_rate", "degree/s", degrees),
        Component("snr_db", "dB"),
    )
    return components if level else components[:2]


def covered_seconds(data: xr.Dataset) -> float:
    """Time that the scans of a result cover; seconds."""
    return data.sizes["time"] * float(data.attrs["scan_interval"])


def column(name: str, unit: str) -> str:
    """Name of a component in a table, with its unit.

    Examples
    --------
    >>> column("bearing", "degree"), column("snr_db", "dB"), column("x", "pixel"), column("vx", "m/s")
    ('bearing_deg', 'snr_db', 'x', 'vx_m_s')
    """
    suffix = SUFFIXES.get(unit, "")
    return name if name.endswith(suffix) else name + suffix


def estimated(times: np.ndarray, estimates: Any, components: tuple[Component, ...]) -> xr.Dataset:
    """What a tracker says of consecutive scans, in the schema.

    Parameters
    ----------
    times : of the scans, from the first one; seconds.
    estimates : `faintrack.trackers.single.Estimate` or `faintrack.trackers.several.SeveralEstimate`, stacked.
    components : of the state that are told, in any order.
    """
    alone = np.ndim(estimates.existence) == 1

    def slots(values: Any) -> np.ndarray:
        return np.asarray(values)[:, None] if alone else np.asarray(values)

    existence, label = slots(estimates.existence), slots(estimates.label)
    own = slots(estimates.track_existence) if alone else existence
    held = (existence > 0) | (label > 0)
    number = {field.name: number for number, field in enumerate(fields(estimates.mean))}
    order = [number[component.name] for component in components]
    scale = np.array([component.scale for component in components])
    covariance = slots(estimates.covariance)[..., order, :][..., order] * np.outer(scale, scale)
    variables: dict[str, Any] = {
        "existence": _of_slots(existence, "1", "probability that the target of the slot exists"),
        "label": _of_slots(label, "1", "track in the slot, 0 where there is none"),
        "track_existence": _of_slots(np.where(label > 0, own, 0), "1", "probability that the track's target exists"),
    }
    for component in components:
        attributes = component.attributes or {}
        values = np.where(held, slots(getattr(estimates.mean, component.name)) * component.scale, np.nan)
        values = on_the_circle(values, attributes)
        long_name = f"mean {component.name.replace('_', ' ')}"
        variables[component.name] = _of_slots(values.astype(np.float32), component.unit, long_name, **attributes)
    variables["covariance"] = (
        ("time", "slot", "component", "other"),
        np.where(held[..., None, None], covariance, np.nan).astype(np.float32),
        {"units": "products of the components' units", "long_name": "covariance of the components"},
    )
    if hasattr(estimates, "observable"):
        observable = np.where(held, slots(estimates.observable), np.nan).astype(np.float32)
        variables["observable"] = _of_slots(observable, "1", "probability that the target is observable, if it exists")
    if hasattr(estimates, "full"):
        full = "whether a target was found and no slot was free"
        variables["full"] = of_scans(estimates.full, "1", full, counted="full_scans")
    if hasattr(estimates, "log_evidence"):
        variables["log_evidence"] = of_scans(estimates.log_evidence, "1", "log of the mean likelihood ratio")
    names = [component.name for component in components]
    coordinates: dict[str, Any] = {
        "time": ("time", times, {"units": "s", "long_name": "time from the first scan"}),
        "component": ("component", names),
        "other": ("other", names),
        "unit": ("component", [component.unit for component in components]),
        "rate": ("component", [component.rate or "" for component in components]),
        "place": ("component", [component.place for component in components]),
    }
    return xr.Dataset(variables, coordinates)


def on_the_circle(values: np.ndarray, attributes: Mapping[Any, Any]) -> np.ndarray:
    """Values of a component as they are told: bearings from north lie in -180 to 180 degrees.

    Examples
    --------
    >>> on_the_circle(np.array([-185.0, 330.0]), {"reference": NORTH}).tolist()
    [175.0, -30.0]
    """
    return (values + 180) % 360 - 180 if attributes.get("reference") == NORTH else values


def of_scans(values: Any, units: str, long_name: str, **attributes: str) -> tuple[str, np.ndarray, dict[str, str]]:
    """A variable with one value a scan."""
    return "time", np.asarray(values), {"units": units, "long_name": long_name, **attributes}


def places(data: xr.Dataset) -> list[str]:
    """Components that tell where a target is."""
    return [str(name) for name, place in zip(data.component.values, data.place.values, strict=True) if place]


def units(data: xr.Dataset) -> dict[str, str]:
    """Unit of every component."""
    return {str(name): str(unit) for name, unit in zip(data.component.values, data.unit.values, strict=True)}


def rates(data: xr.Dataset) -> dict[str, str]:
    """Name of the rate of every component that has one."""
    return {str(name): str(rate) for name, rate in zip(data.component.values, data.rate.values, strict=True) if rate}


def deviations(data: xr.Dataset) -> dict[str, xr.DataArray]:
    """Standard deviation of every component, one value a scan and slot."""
    roots = {}
    for number, name in enumerate(data.component.values):
        variance = data.covariance.isel(component=number, other=number, drop=True)
        roots[str(name)] = np.sqrt(variance)
    return roots


def joined(blocks: list[xr.Dataset]) -> xr.Dataset:
    """Consecutive blocks as one; what has no time axis is added as it is."""
    timed = xr.concat(
        [block for block in blocks if "time" in block.sizes],
        "time",
        data_vars="minimal",
        coords="minimal",
        compat="override",
        combine_attrs="override",
    )
    return xr.merge(
        [timed, *(block for block in blocks if "time" not in block.sizes)], combine_attrs="override", compat="override"
    )


def _of_slots(
    values: np.ndarray, units: str, long_name: str, **attributes: str
) -> tuple[tuple[str, str], np.ndarray, dict[str, str]]:
    """A variable with one value a scan and slot."""
    return ("time", "slot"), values, {"units": units, "long_name": long_name, **attributes}
