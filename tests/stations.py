"""A small scene of two arrays and one target that several tests share."""

import copy
import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from faintrack.beliefs.axis import Axis
from faintrack.data.sequence import Sequence
from faintrack.kinds.records.sections import RecordsScenario
from faintrack.sensors.stations import Fans, Stations
from faintrack.targets.states import PlanarState

LOUD = 3.0
"""Standard deviations by which a target raises a beam: declared within a few scans."""

STEP_DEG = 3.0
BEARINGS = np.arange(0.0, 181.0, STEP_DEG)
START, VELOCITY = np.array([-300.0, 500.0]), np.array([4.0, 2.0])

TABLES: dict[str, Any] = {
    "stations": [
        {"name": "west", "x": -200.0, "y": 0.0, "heading_deg": 90.0},
        {"name": "east", "x": 400.0, "y": 0.0, "heading_deg": 90.0},
    ],
    "region": {
        "x": [-600.0, 600.0],
        "y": [200.0, 1000.0],
        "cell": 50.0,
        "detectors": [2, 1],
        "speed": 6.0,
        "speeds": 3,
    },
    "energies": {"present": [LOUD, 1.0]},
    "several": {"slots": 3, "hold": 3, "particles": 512},
}


def tables(**changes: Any) -> dict[str, Any]:
    """Sections of the scenario; those that are named get other fields, or another value."""
    sections = copy.deepcopy(TABLES)
    for name, change in changes.items():
        sections[name] = sections.get(name, {}) | change if isinstance(change, dict) else change
    return sections


def scenario(**changes: Any) -> RecordsScenario:
    return RecordsScenario(**tables(**changes))


def place(time: np.ndarray) -> np.ndarray:
    """Where the target is; shape (time, 2)."""
    return START + VELOCITY * np.asarray(time, float)[:, None]


def energies(station: int, times: np.ndarray, seed: int = 0, loud: float = LOUD) -> np.ndarray:
    """Record of one array: unit noise, and the target in the beam that it falls in."""
    table = TABLES["stations"][station]
    step = math.radians(STEP_DEG)
    fans = Fans((0.0,), (step,), (len(BEARINGS),), (True,))
    stations = Stations(*(jnp.array([value]) for value in (table["x"], table["y"], math.pi / 2)))
    x, y = jnp.asarray(place(times).T, jnp.float32)
    beams = np.asarray(fans.beams(stations, PlanarState(x, y, 0 * x, 0 * y)))[0]
    values = np.random.default_rng([seed, station]).normal(size=(len(times), len(BEARINGS)))
    there = np.flatnonzero(beams >= 0)
    values[there, beams[there]] += loud
    return values.astype(np.float32)


def record(
    values: np.ndarray,
    times: np.ndarray,
    source: str = "a.npz",
    start_time: str | None = None,
    axis: Axis = Axis(0.0, STEP_DEG, len(BEARINGS)),  # noqa: B008
) -> Sequence:
    since = None if start_time is None else np.datetime64(start_time, "ns")
    return Sequence(
        lambda start, stop: values[start:stop], np.asarray(times, float), (("bearing", axis),), source, since
    )


def records(count: int = 60, loud: float = LOUD) -> tuple[Sequence, Sequence]:
    """Records of both arrays."""
    times = np.arange(float(count))
    west, east = (energies(station, times, loud=loud) for station in range(2))
    return record(west, times, "west.npz"), record(east, times, "east.npz")


def distance(data: Any) -> np.ndarray:
    """From the declared track to the target, in every scan with exactly one; metres."""
    label = data.label.values
    scans, slots = np.nonzero((label > 0) & ((label > 0).sum(axis=1) == 1)[:, None])
    found = np.stack([data[name].values[scans, slots] for name in ("x", "y")], axis=-1)
    return np.linalg.norm(found - place(data.time.values[scans]), axis=-1)


def tree_equal(first: Any, second: Any) -> bool:
    return bool(jax.tree.all(jax.tree.map(lambda a, b: np.array_equal(a, b, equal_nan=True), first, second)))
