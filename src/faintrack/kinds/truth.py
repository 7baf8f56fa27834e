"""Where targets really were, laid beside the tracks of a result.

Truth comes from a file, or from the scenario of a simulation. A CSV file has a row for every moment: `time_s`, on the
clock of the result, or `time` in UTC; `name` or `mmsi`; and the place by the names in `states.csv` (`bearing_deg`,
`x_m` and `y_m`, `range_m` ...) or, where the kind has places on earth, `latitude` and `longitude`. Reports of ships
(AIS, as CSV or NMEA) are such files. Between two reports a target is on a straight line, if they are not too far apart
in time, nor further than a ship can go.
"""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from jaxtyping import Float

from faintrack.data.ships import Ship
from faintrack.errors import InputError
from faintrack.io.ais import read_ships
from faintrack.kinds import kind_named
from faintrack.kinds.kind import Plan
from faintrack.kinds.scenario import Scenario
from faintrack.results.schema import places, units
from faintrack.results.truth import Known, Places, place_columns, with_truth

LONGEST_SILENCE = 600.0
"""Seconds between two reports at most; moored ships report every three minutes."""

FASTEST = 100.0
"""Metres a second between two reports at most; beyond, one of them is wrong."""


def laid_beside(blocks: Iterable[xr.Dataset], truth: Any, plan: Plan) -> Iterator[xr.Dataset]:
    """Yield blocks of a result with the truth of their scans.

    Parameters
    ----------
    blocks : of the result.
    truth : path of a file, or a scenario with the targets of a simulation, or the path of one (.toml).
    plan : of the data.

    Raises
    ------
    InputError : the file cannot be read or does not fit the result; no target was where the plan looks, or there is no
        simulation.
    """
    known: list[Known] | None = None
    seen = False
    for block in blocks:
        if "time" in block.sizes:
            known = _known(truth, plan, block) if known is None else known
            block = with_truth(block, known, plan.within)
            seen = seen or bool(np.isfinite(block[f"truth_{places(block)[0]}"].values).any())
        yield block
    if not seen:
        raise InputError(f"{_name(truth)}: no target was where tracks are looked for; expected one during the data.")


def _name(truth: Any) -> str:
    return "the simulation" if isinstance(truth, Scenario) else str(truth)


def _known(truth: Any, plan: Plan, block: xr.Dataset) -> list[Known]:
    if isinstance(truth, Scenario):
        known: list[Known] = kind_named(truth.kind).targets(truth)
        return known
    path = Path(truth)
    if path.suffix.lower() == ".toml":
        return _known(Scenario.read(path), plan, block)
    start = block.attrs.get("start_time") or None
    start_time = None if start is None else np.datetime64(start.removesuffix("Z"), "ns")
    shift = float(block.attrs["first_scan_time"])
    return [
        Known(ship.name, _places_of(ship, path, plan, start_time, shift, block))
        for ship in read_ships(path, place_columns(block))
    ]


def _places_of(
    ship: Ship, path: Path, plan: Plan, start_time: np.datetime64 | None, shift: float, block: xr.Dataset
) -> Any:
    """Function of times to the places of a ship."""
    names = places(block)
    reported = ship.times
    if ship.utc:
        if start_time is None:
            raise InputError(
                f"{path} has times in UTC and the data do not tell when they start; expected start_time of the data."
            )
        reported = reported - float((start_time - np.datetime64(0, "ns")) / np.timedelta64(1, "ns")) / 1e9
    else:
        reported = reported - shift
    values = list(ship.places.T)
    if ship.degrees:
        if plan.plane is None:
            raise InputError(f"{path} has latitude and longitude; expected a scenario in degrees too.")
        values = list(plan.plane.metres(*values))
    of = units(block)
    values = [np.unwrap(v, period=360) if of[name] == "degree" else v for name, v in zip(names, values, strict=True)]

    def at(times: Float[np.ndarray, " time"]) -> Places:
        later = np.clip(np.searchsorted(reported, times), 1, max(len(reported) - 1, 1))
        known = (times >= reported[0]) & (times <= reported[-1])
        if len(reported) > 1:
            silence, way = np.diff(reported), np.sqrt(np.sum(np.square([np.diff(of) for of in values]), axis=0))
            known &= (silence <= LONGEST_SILENCE)[later - 1]
            if ship.degrees:
                known &= (way <= FASTEST * silence)[later - 1]
        place = {name: np.interp(times, reported, along) for name, along in zip(names, values, strict=True)}
        if plan.limits is not None:
            for name, (low, high) in plan.limits.items():
                known &= (place[name] >= low) & (place[name] <= high)
        return {name: np.where(known, along, np.nan) for name, along in place.items()}

    return at
