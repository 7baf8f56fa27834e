"""Tracks beside targets that are known to have been there.

A result may hold where targets really were: variables `truth_x` and so on with one entry a scan and known target, not a
number where it was not there, the names in the coordinate `known`, and in the attribute `truth_within` how near a track
must be to be one of a target, in the unit of the place. A track belongs to the nearest target in a scan.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from jaxtyping import Float, Int

from faintrack.results.schema import column, on_the_circle, places, units

Places = dict[str, Float[np.ndarray, " time"]]


@dataclass(frozen=True)
class Known:
    """A target that is known to have been there.

    Attributes
    ----------
    name : of it.
    at : function of times, in seconds as those of the result, to its place by component, in the units of the result;
        not a number where it was not there.
    """

    name: str
    at: Callable[[Float[np.ndarray, " time"]], Places]


@dataclass(frozen=True)
class Finding:
    """A known target, and what was found of it.

    Attributes
    ----------
    name : of the target.
    from_s, to_s : first and last scan in which it was there; seconds. Not numbers where there is none.
    declared_s : first scan with a track of it; None where there is none.
    tracks : labels of its tracks.
    rmse : root mean square distance of these from it, in the unit of the place; None where there is none.
    followed : share of its scans, from the declaration on, with a track of it.
    """

    name: str
    from_s: float
    to_s: float
    declared_s: float | None
    tracks: tuple[int, ...]
    rmse: float | None
    followed: float


def with_truth(block: xr.Dataset, known: Sequence[Known], within: float) -> xr.Dataset:
    """Block of a result with the truth of its scans."""
    times = np.asarray(block.time.values, float)
    at = [target.at(times) for target in known]
    of = units(block)
    variables = {
        f"truth_{name}": (
            ("time", "known"),
            on_the_circle(np.stack([place[name] for place in at], axis=1), block[name].attrs).astype(np.float32),
            {"units": of[name], "long_name": f"true {name}"},
        )
        for name in places(block)
    }
    return (
        block.assign(variables).assign_coords(known=[target.name for target in known]).assign_attrs(truth_within=within)
    )


def findings(data: xr.Dataset) -> list[Finding]:
    """What was found of each known target in the data of a result."""
    belongs, apart = _matched(data)
    time, label = data.time.values, data.label.values
    found = []
    for number, name in enumerate(data.known.values):
        there = _there(data)[:, number]
        if not there.any():
            found.append(Finding(str(name), math.nan, math.nan, None, (), None, 0.0))
            continue
        mine = belongs == number
        scans = mine.any(axis=1)
        first, last = (float(time[there][end]) for end in (0, -1))
        if not scans.any():
            found.append(Finding(str(name), first, last, None, (), None, 0.0))
            continue
        declared = float(time[scans][0])
        labels = tuple(int(value) for value in np.unique(label[mine]))
        rmse = float(np.sqrt(np.mean(apart[mine] ** 2)))
        followed = float(scans[there & (time >= declared)].mean())
        found.append(Finding(str(name), first, last, declared, labels, rmse, followed))
    return found


def unexplained(data: xr.Dataset) -> list[int]:
    """Labels of tracks that are never near a known target."""
    belongs, _ = _matched(data)
    label = data.label.values
    return sorted(set(label[label > 0].tolist()) - set(label[belongs >= 0].tolist()))


def finding_table(data: xr.Dataset) -> tuple[list[str], list[list[str]]]:
    """Headings and rows of a table of what was found."""
    unit = units(data)[places(data)[0]].replace("degree", "deg")
    headings = ["target", "from s", "to s", "declared s", "tracks", f"rmse {unit}", "followed"]
    rows = []
    for one in findings(data):
        declared = "never" if one.declared_s is None else f"{one.declared_s:.5g}"
        rmse = "" if one.rmse is None else f"{one.rmse:.3g}"
        labels = " ".join(map(str, one.tracks))
        rows.append(
            [one.name, f"{one.from_s:.5g}", f"{one.to_s:.5g}", declared, labels, rmse, f"{100 * one.followed:.0f} %"]
        )
    return headings, rows


def place_columns(data: xr.Dataset) -> list[str]:
    """Columns of a file of truth that tell where a target is, by the names in `states.csv`."""
    of = units(data)
    return [column(name, of[name]) for name in places(data)]


def _there(data: xr.Dataset) -> np.ndarray:
    return np.isfinite(data[f"truth_{places(data)[0]}"].values)


def _matched(data: xr.Dataset) -> tuple[Int[np.ndarray, "scan slot"], Float[np.ndarray, "scan slot"]]:
    """Known target that the track in every slot belongs to, -1 for none, and its distance."""
    held = data.label.values > 0
    of = units(data)
    off = []
    for name in places(data):
        away = data[name].values[:, :, None] - data[f"truth_{name}"].values[:, None, :]
        off.append((away + 180) % 360 - 180 if of[name] == "degree" else away)
    apart = np.nan_to_num(np.sqrt(np.sum(np.square(off), axis=0)), nan=np.inf)
    nearest = apart.argmin(axis=2)
    distance = np.take_along_axis(apart, nearest[..., None], axis=2)[..., 0]
    return np.where(held & (distance <= float(data.attrs["truth_within"])), nearest, -1), distance
