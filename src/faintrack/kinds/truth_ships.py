"""Tracks of several targets against ships whose places are known, as AIS reports them.

Reports come every few seconds from a fast ship and every few minutes from a moored one, so that a ship is placed
between two of them on a straight line, if they are not too far apart in time, nor further than a ship can go. A track
belongs to a ship in a scan if none is nearer and it is within a few cells of the detectors; matched are all scans, by
time and place.
"""

from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import xarray as xr
from jaxtyping import Float

from faintrack.data.records import InStep
from faintrack.errors import InputError
from faintrack.scenario.build_stations import build_plane, build_region
from faintrack.scenario.model import Scenario

LONGEST_SILENCE = 600.0
"""Seconds between two reports at most; moored ships report every three minutes."""

FASTEST = 100.0
"""Metres a second between two reports at most; beyond, one of them is wrong."""

WITHIN_CELLS = 3.0
"""Cells of a detector from a ship within which a track is one of it."""


@dataclass(frozen=True)
class Ship:
    """Reports of one ship.

    Attributes
    ----------
    name : its MMSI or name.
    times : ascending; seconds since 1970 UTC, or on the clock of the records.
    utc : which of both.
    places : shape (report, 2); latitude and longitude in degrees, or east and north in metres.
    degrees : which of both.
    """

    name: str
    times: Float[np.ndarray, " report"]
    utc: bool
    places: Float[np.ndarray, "report 2"]
    degrees: bool


@dataclass(frozen=True)
class Sighting:
    """A ship, and what was found of it.

    Attributes
    ----------
    ship : its name.
    from_s, to_s : first and last scan in which it is in the region; seconds from the first scan.
    declared_s : first scan with a track of it; None where there is none.
    tracks : labels of its tracks.
    rmse_m : root mean square distance of these from it; None where there is none.
    followed : share of its scans in the region, from the declaration on, with a track of it.
    """

    ship: str
    from_s: float
    to_s: float
    declared_s: float | None
    tracks: tuple[int, ...]
    rmse_m: float | None
    followed: float

    def as_dict(self) -> dict[str, Any]:
        """Fields by name."""
        return asdict(self)


def ships_dataset(ships: list[Ship], together: InStep, scenario: Scenario, origin: str = "truth") -> xr.Dataset:
    """Places in every scan of the ships that are in the region at some time.

    Parameters
    ----------
    ships : that are known.
    together, scenario : what is tracked in; see `faintrack.kinds.session_stations.put_together`.
    origin : where the ships come from, for messages.

    Raises
    ------
    InputError : the ships are in UTC and the records do not tell when they start; they are in degrees and the scenario
        is in metres; none of them was in the region in time.
    """
    plane = build_plane(scenario)
    (west, east), (south, north) = build_region(scenario, plane)
    names, places = [], []
    for ship in ships:
        times = together.times
        if ship.utc:
            if together.start_time is None:
                raise InputError(
                    f"{origin} has times in UTC and the records do not tell when they start; expected start_time of "
                    "the stations."
                )
            times = times + float((together.start_time - np.datetime64(0, "ns")) / np.timedelta64(1, "ns")) / 1e9
        x, y = ship.places.T
        if ship.degrees:
            if plane is None:
                raise InputError(f"{origin} has latitude and longitude; expected the region in degrees too.")
            x, y = plane.metres(x, y)
        later = np.clip(np.searchsorted(ship.times, times), 1, max(len(ship.times) - 1, 1))
        known = (times >= ship.times[0]) & (times <= ship.times[-1])
        if len(ship.times) > 1:
            silence, way = np.diff(ship.times), np.hypot(np.diff(x), np.diff(y))
            known &= ((silence <= LONGEST_SILENCE) & (way <= FASTEST * silence))[later - 1]
        place = np.stack([np.interp(times, ship.times, values) for values in (x, y)], axis=-1)
        inside = (place[:, 0] >= west) & (place[:, 0] <= east) & (place[:, 1] >= south) & (place[:, 1] <= north)
        if (known & inside).any():
            names.append(ship.name)
            places.append(np.where((known & inside)[:, None], place, np.nan).astype(np.float32))
    if not names:
        raise InputError(f"{origin}: no ship was in the region during the records; expected at least one.")
    truth = np.stack(places, axis=1)
    return xr.Dataset(
        {
            "truth_x": (("time", "ship"), truth[..., 0], {"units": "m", "long_name": "true place east"}),
            "truth_y": (("time", "ship"), truth[..., 1], {"units": "m", "long_name": "true place north"}),
        },
        {"time": together.times - together.times[0], "ship": names},
    )


def beside(blocks: Iterable[xr.Dataset], truth: xr.Dataset) -> Iterator[xr.Dataset]:
    """Yield blocks of a result with the truth of their scans."""
    start = 0
    for block in blocks:
        stop = start + block.sizes["time"]
        part = truth.isel(time=slice(start, stop)).drop_vars("time")
        yield block.assign(part.data_vars).assign_coords(ship=truth.ship)
        start = stop


def sightings(data: xr.Dataset, cell: float) -> list[Sighting]:
    """What was found of each ship.

    Parameters
    ----------
    data : of a result of several arrays with truth.
    cell : side of a detector's cell; metres.
    """
    belongs, apart = _matched(data, cell)
    time, label = data.time.values, data.label.values
    found = []
    for number, name in enumerate(data.ship.values):
        there = np.isfinite(data.truth_x.values[:, number])
        mine = belongs == number
        scans = mine.any(axis=1)
        first, last = (float(time[there][end]) for end in (0, -1))
        if not scans.any():
            found.append(Sighting(str(name), first, last, None, (), None, 0.0))
            continue
        declared = time[scans][0]
        labels = tuple(int(value) for value in np.unique(label[mine]))
        rmse = float(np.sqrt(np.mean(apart[mine] ** 2)))
        followed = float(scans[there & (time >= declared)].mean())
        found.append(Sighting(str(name), first, last, float(declared), labels, rmse, followed))
    return found


def unexplained(data: xr.Dataset, cell: float) -> list[int]:
    """Labels of tracks that are never within a few cells of a ship; arguments as in `sightings`."""
    belongs, _ = _matched(data, cell)
    label = data.label.values
    return sorted(set(label[label > 0].tolist()) - set(label[belongs >= 0].tolist()))


def _matched(data: xr.Dataset, cell: float) -> tuple[np.ndarray, np.ndarray]:
    """Ship that the track in every slot belongs to, -1 for none, and its distance; shape (scan, slot)."""
    held = data.label.values > 0
    off = [data[axis].values[:, :, None] - data[f"truth_{axis}"].values[:, None, :] for axis in "xy"]
    apart = np.nan_to_num(np.hypot(*off), nan=np.inf)
    nearest = apart.argmin(axis=2)
    distance = np.take_along_axis(apart, nearest[..., None], axis=2)[..., 0]
    return np.where(held & (distance <= WITHIN_CELLS * cell), nearest, -1), distance
