"""From the sections of a scenario to what tracks several targets: where arrays stand, beams, detectors, trackers."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from faintrack.beliefs.axis import Axis, between
from faintrack.data.records import InStep
from faintrack.errors import InputError
from faintrack.kinds.records.data import Path
from faintrack.kinds.records.sections import RecordsScenario, SeveralSection, StationSection
from faintrack.likelihoods.beam_energies import ELSEWHERE, BeamEnergies
from faintrack.scenario.plane import Plane
from faintrack.scenario.section import Pair
from faintrack.sensors.array import SensorArray
from faintrack.sensors.stations import Fans, Stations
from faintrack.targets.motion import PlanarMotion
from faintrack.targets.states import PlanarState
from faintrack.targets.target import Target
from faintrack.trackers.detectors import Detectors, planar_detectors, surrounding_cells, surrounding_detector
from faintrack.trackers.several import SeveralTargetsTracker, assembled, bearing_tracker

NOISE_SHARE = 0.01
"""Density of the acceleration where the scenario does not say, over the region's largest speed; per root second."""

CELLS_A_BEAM, RATES = 4, 7
"""Of the detector of an array by itself: cells of bearing in a beam, and of the bearing rate."""

SLOWEST_DEG = 1e-3
"""Bearing rate up to which targets are sought at least; degrees a second."""

LARGEST_CELLS = 500_000_000
"""Cells of all detectors at most: each takes some twenty bytes."""

LOOKS = 33
"""Places along each side of the region, and times along each path, at which it is tried whether an array hears them."""


@dataclass(frozen=True)
class Placed:
    """Where arrays are in every scan.

    Attributes
    ----------
    x, y : east and north; metres.
    heading : of the axis of a line; radians clockwise from the plane's north. Zero for other arrays.
    lean : direction of true north, clockwise from the plane's; radians. What other arrays hear is turned by it.
    """

    x: Float[np.ndarray, "scan array"]
    y: Float[np.ndarray, "scan array"]
    heading: Float[np.ndarray, "scan array"]
    lean: Float[np.ndarray, " array"]

    def stations(self, part: slice) -> Stations:
        """Of some scans."""
        return Stations(*(jnp.asarray(values[part], jnp.float32) for values in (self.x, self.y, self.heading)))


def build_plane(scenario: RecordsScenario) -> Plane | None:
    """Plane about the middle of the region; None where the scenario is in metres, or has no region."""
    region = scenario.region
    if region is None or region.latitude is None or region.longitude is None:
        return None
    return Plane(float(np.mean(region.latitude)), float(np.mean(region.longitude)))


def build_region(scenario: RecordsScenario, plane: Plane | None) -> tuple[Pair, Pair]:
    """Ends of the region along x and y; metres. One in degrees is within them."""
    region = scenario.region
    assert region is not None, "stations have a region"
    if region.x is not None and region.y is not None:
        return region.x, region.y
    assert plane is not None
    assert region.latitude is not None
    assert region.longitude is not None
    edge = np.linspace(0, 1, LOOKS)
    north, east = (
        region.latitude[0] + edge * np.ptp(region.latitude),
        region.longitude[0] + edge * np.ptp(region.longitude),
    )
    x, y = plane.metres(*(part.ravel() for part in np.meshgrid(north, east)))
    return (float(x.min()), float(x.max())), (float(y.min()), float(y.max()))


def build_placed(
    scenario: RecordsScenario,
    together: InStep,
    paths: Mapping[str, Path],
    arrays: Mapping[str, SensorArray],
    plane: Plane | None,
) -> Placed:
    """Where the arrays of a scenario are in every scan; one by itself is wherever its bearings are told from.

    Parameters
    ----------
    scenario, together : what is run, and the records of its stations in their order.
    paths : of the stations that move, by name.
    arrays : channels of the stations whose records were made of recordings, by name.
    plane : see `build_plane`.

    Raises
    ------
    InputError : a path that does not last as long as the records, a line whose heading nobody tells or that stands
        upright.
    """
    if scenario.region is None:
        still = np.zeros((together.length, 1))
        return Placed(still, still, still, np.zeros(1))
    columns = []
    for table, shift in zip(scenario.stations, together.shifts, strict=True):
        path = paths.get(table.name) or _still(table)
        times = path["time_s"] + shift
        room = together.interval / 2
        if table.path is not None and (times[0] > together.times[0] + room or times[-1] < together.times[-1] - room):
            raise InputError(
                f"{table.path}: the path of {table.name} has the times {times[0]:.10g} to {times[-1]:.10g} s; expected "
                f"all of the records', {together.times[0]:.10g} to {together.times[-1]:.10g} s."
            )
        lean = np.zeros(len(times))
        if "x_m" in path:
            x, y = path["x_m"], path["y_m"]
        else:
            assert plane is not None, "latitude and longitude have a plane"
            where = path["latitude_deg"], path["longitude_deg"]
            (x, y), lean = plane.metres(*where), np.radians(plane.north_deg(*where))
        heading = np.unwrap(_heading(table, path, arrays.get(table.name)) + lean)
        columns.append([np.interp(together.times, times, values) for values in (x, y, heading)] + [np.mean(lean)])
    x, y, heading = (np.stack(values, axis=1) for values in list(zip(*columns, strict=True))[:3])
    return Placed(x, y, heading, np.array([column[3] for column in columns]))


def build_fans(scenario: RecordsScenario, together: InStep, arrays: Mapping[str, SensorArray], placed: Placed) -> Fans:
    """Beams of the arrays.

    Raises
    ------
    InputError : bearings beyond what a line, or any other array, can hear.
    """
    first, step, count, lines = [], [], [], []
    for table, record, lean in zip(scenario.stations, together.records, placed.lean, strict=True):
        axis: Axis = dict(record.axes)["bearing"]
        line = not arrays[table.name].circular if table.name in arrays else table.is_line
        low, high, span = (0.0, 180.0, 180.0) if line else (-360.0, 360.0, 360.0)
        room = axis.step / 2 + 1e-6
        # A beam at 0 and one at 360 degrees are the same evidence.
        span = span if line else span - room
        if axis.first < low - room or axis.last > high + room or axis.last - axis.first > span + 1e-6 * span:
            raise InputError(
                f"{record.source} has bearings from {axis.first:g} to {axis.last:g} degrees; expected "
                + ("0 to 180 from the axis of the line." if line else "at most a full circle, -360 to 360.")
            )
        first.append(math.radians(axis.first) + (0.0 if line else float(lean)))
        step.append(math.radians(axis.step))
        count.append(axis.count)
        lines.append(line)
    return Fans(tuple(first), tuple(step), tuple(count), tuple(lines))


def require_heard(scenario: RecordsScenario, fans: Fans, placed: Placed, region: tuple[Pair, Pair]) -> None:
    """Refuse arrays that hear nothing of the region.

    Raises
    ------
    InputError : at no time and no place of it does a bearing of an array fall into one of its beams.
    """
    x, y = np.meshgrid(*(np.linspace(*ends, LOOKS) for ends in region))
    states = PlanarState(*(jnp.asarray(values, jnp.float32) for values in (x, y, 0 * x, 0 * y)))
    heard = np.zeros(fans.arrays, bool)
    for scan in np.unique(np.linspace(0, len(placed.x) - 1, LOOKS).astype(int)):
        stations = Stations(*(jnp.asarray(v[scan], jnp.float32) for v in (placed.x, placed.y, placed.heading)))
        heard |= np.asarray(fans.beams(stations, states) >= 0).any(axis=(1, 2))
    if not heard.all():
        table = scenario.stations[int(np.argmin(heard))]
        raise InputError(
            f"station {table.name} hears nothing of the region: none of its beams reaches into it; expected another "
            "region, heading_deg or place."
        )


def build_detectors(
    scenario: RecordsScenario, region: tuple[Pair, Pair], interval: float
) -> tuple[Detectors, Detectors | None]:
    """Detectors of a scenario's region, and of its surroundings if there are any.

    Raises
    ------
    InputError : too many cells, or targets that pass a detector between two scans.
    """
    table, target = scenario.region, build_target(scenario)
    assert table is not None, "stations have a region"
    cells = tuple(
        _cells(ends, count, table.overlap, table.cell) for ends, count in zip(region, table.detectors, strict=True)
    )
    number = math.prod(table.detectors)
    total = number * math.prod(cells) * table.speeds**2
    if total > LARGEST_CELLS:
        raise InputError(
            f"region: {number} detectors of {cells[0]} x {cells[1]} cells with {table.speeds} x {table.speeds} "
            f"speeds are {total:,} cells, more than {LARGEST_CELLS:,}; expected a larger cell, or fewer speeds."
        )
    if table.speed * interval > min(cells) * table.cell / 2:
        raise InputError(
            f"region: targets move up to {table.speed * interval:.3g} m between two scans, more than half a detector, "
            f"{min(cells) * table.cell / 2:.3g} m; expected fewer detectors, or a lower speed."
        )
    speed = between(-table.speed, table.speed, table.speeds)
    watch = planar_detectors(*region, table.detectors, (cells[0], cells[1]), table.cell, speed, target, interval)
    if not table.surroundings:
        return watch, None
    (across, along), slow = surrounding_cells(watch, table.surroundings)
    total += across * along * slow**2
    if total > LARGEST_CELLS:
        raise InputError(
            f"region.surroundings: with {table.surroundings:g} m around the region there are {total:,} cells, more "
            f"than {LARGEST_CELLS:,}; expected less, a larger cell, or fewer speeds."
        )
    return watch, surrounding_detector(watch, table.surroundings, interval)


def velocity_noise(scenario: RecordsScenario) -> float:
    """Density of the acceleration of targets in a region; m/s per root second."""
    given, region = scenario.target.velocity_noise, scenario.region
    assert region is not None, "stations have a region"
    return NOISE_SHARE * region.speed if given is None else given


def build_target(scenario: RecordsScenario) -> Target:
    """Target of a scenario; where it appears is the detectors' matter."""
    table = scenario.target
    return Target(None, PlanarMotion(velocity_noise(scenario)), table.arrival_rate, table.departure_rate)


def elsewhere(scenario: RecordsScenario) -> float:
    """Probability that a beam holds a source that is no target."""
    given = scenario.energies.elsewhere
    if given is not None:
        return given
    return ELSEWHERE if len(scenario.stations) > 1 else 0.0


def build_likelihood(scenario: RecordsScenario, fans: Fans) -> BeamEnergies:
    """Likelihood of a scenario's energies."""
    (absent_mean, absent_std), (present_mean, present_std) = scenario.energies.levels
    return BeamEnergies(fans, absent_mean, absent_std, present_mean, present_std, elsewhere(scenario))


def build_several(
    scenario: RecordsScenario, fans: Fans, placed: Placed, plane: Plane | None, interval: float
) -> SeveralTargetsTracker:
    """Tracker of a scenario for the energies of several arrays, or of one by itself.

    Raises
    ------
    InputError : see `require_heard` and `build_detectors`; targets that turn too far between two scans.
    """
    if scenario.region is None:
        return _alone(scenario, fans, interval)
    table, region = scenario.several, build_region(scenario, plane)
    require_heard(scenario, fans, placed, region)
    watch, outside = build_detectors(scenario, region, interval)
    target, likelihood = build_target(scenario), build_likelihood(scenario, fans)
    return assembled(watch, outside, target, likelihood, table.slots, particles_of(table), **_decisions(table))


def _alone(scenario: RecordsScenario, fans: Fans, interval: float) -> SeveralTargetsTracker:
    """Tracker of a scenario for the energies of an array by itself, in all bearings that its kind has."""
    target, table = scenario.target, scenario.several
    low, high = (0.0, math.pi) if fans.line[0] else (-math.pi, math.pi)
    turn, most = target.bearing_rate_deg * interval, math.degrees(high - low) / 2
    if turn > most:
        raise InputError(
            f"target.bearing_rate_deg: targets turn up to {turn:.3g} degrees between two scans, more than half of what "
            f"the array hears, {most:g} degrees; expected less."
        )
    fastest = math.radians(max(target.bearing_rate_deg, SLOWEST_DEG))
    return bearing_tracker(
        build_likelihood(scenario, fans),
        between(low, high, math.ceil(CELLS_A_BEAM * (high - low) / fans.step[0] - 1e-6)),
        between(-fastest, fastest, RATES),
        math.radians(target.bearing_rate_noise_deg),
        interval,
        target.arrival_rate,
        target.departure_rate,
        table.slots,
        particles_of(table),
        **_decisions(table),
    )


def particles_of(table: SeveralSection) -> int:
    """Particles that follow a target, a power of two."""
    return int(2 ** math.ceil(math.log2(table.particles)))


def _decisions(table: SeveralSection) -> dict[str, Any]:
    """When a tracker hands over, declares and drops."""
    return {name: getattr(table, name) for name in ("detect", "declare", "drop", "hold", "margin")}


def _cells(ends: Pair, count: int, overlap: float, cell: float) -> int:
    """Cells of one of `count` detectors that overlap and cover an interval together."""
    return max(math.ceil((ends[1] - ends[0]) / (count - (count - 1) * overlap) / cell - 1e-9), 2)


def _still(table: StationSection) -> Path:
    """Path of an array that does not move."""
    names = {"x_m": table.x, "y_m": table.y, "latitude_deg": table.latitude, "longitude_deg": table.longitude}
    return {"time_s": np.zeros(1)} | {name: np.array([value]) for name, value in names.items() if value is not None}


def _heading(table: StationSection, path: Path, array: SensorArray | None) -> np.ndarray:
    """Direction of the axis of a line in every row of a path, clockwise from true north; radians."""
    if "heading_deg" in path:
        return np.radians(path["heading_deg"])
    rows = len(path["time_s"])
    if table.heading_deg is not None:
        return np.full(rows, math.radians(table.heading_deg))
    if array is not None and array.axis is not None:
        east, north, up = array.axis
        if abs(up) > math.hypot(east, north):
            raise InputError(f"station {table.name}: the channels stand upright; expected a line that lies.")
        return np.full(rows, math.atan2(east, north))
    if table.is_line and array is None:
        raise InputError(f"station {table.name}: the path has no heading_deg; expected it there or in the scenario.")
    return np.zeros(rows)
