"""Bearings of a target that crosses among false ones, and of nothing, with the scenario that tracks them."""

import tomllib
from functools import cache
from typing import Any

import numpy as np

from faintrack.data.bearings import Bearings, from_columns
from faintrack.kinds.scenario import Scenario

SCANS, START, APPEARS = 60, 500.0, 15
"""Scans, one a second; time of the first; the scan in which the target is first heard."""

SCENARIO = """
[bearings]
error_deg = 1.0
detection_probability = 0.9
false_per_scan = 3.0
range = [200.0, 3000.0]
speed = 15.0
capacity = 24

[target]
arrival_rate = 0.01
departure_rate = 0.01
velocity_noise = 0.2

[filter]
particles = 4000
births = 2000
"""


def scenario(**sections: dict[str, Any]) -> Any:
    """The scenario, some fields of its sections replaced."""
    content = tomllib.loads(SCENARIO)
    for name, fields in sections.items():
        content[name] = content.get(name, {}) | fields
    return Scenario(**content)


def target() -> np.ndarray:
    """Where the target is in every scan; m."""
    since = np.arange(SCANS, dtype=float)
    return np.stack([900 - 8 * since, 700 + 4 * since], axis=-1)


def places(observers: int) -> np.ndarray:
    """Where the observers are, shape (scan, observer, 2); the first goes to the east, the others stand apart; m."""
    since = np.arange(SCANS, dtype=float)
    placed = [np.stack([10 * since, 0 * since], axis=-1)]
    placed += [np.full((SCANS, 2), (1500.0 * number, -200.0)) for number in range(1, observers)]
    return np.stack(placed, axis=1)


@cache
def drawn(present: bool = True, observers: int = 1, seed: int = 0) -> Bearings:
    """Bearings of all scans; every observer hears the target nine times in ten."""
    rng, where, columns = np.random.default_rng(seed), places(observers), []
    for scan in range(SCANS):
        for number in range(observers):
            east, north = target()[scan] - where[scan, number]
            false = rng.uniform(0, 360, rng.poisson(3.0))
            heard = [np.degrees(np.arctan2(east, north)) + rng.normal()] if present and scan >= APPEARS else []
            heard = heard if rng.random() < 0.9 else []
            # Rounded, so that a file holds the very same numbers.
            bearings = np.round(np.concatenate([false, heard]) % 360, 3)
            bearings = bearings if len(bearings) else [np.nan]
            columns += [(START + scan, bearing, *where[scan, number], number) for bearing in bearings]
    names = ("time_s", "bearing_deg", "observer_x_m", "observer_y_m", "observer")
    table = dict(zip(names, np.array(columns).T, strict=True))
    return from_columns({name: table[name] for name in names[: 4 if observers == 1 else 5]})


def columns(scans: int = 3, **more: Any) -> Bearings:
    """Bearings with one from the east in every scan."""
    known = {"bearing_deg": np.full(scans, 90.0), "observer_x_m": np.zeros(scans), "observer_y_m": np.zeros(scans)}
    return from_columns({"time_s": np.arange(float(scans)), **known, **more})
