"""A small scenario of each kind with a simulation, its data, and its result, made once a process."""

from functools import cache
from typing import Any

import faintrack as ft
from faintrack.kinds import kind_named
from faintrack.kinds.kind import Plan

SCENARIOS: dict[str, dict[str, Any]] = {
    "recording": {
        "kind": "recording",
        "array": {"sound_speed": 1500.0, "line": {"count": 4, "spacing": 1.5}},
        "analysis": {"frame": 0.2, "beams": 24},
        "filter": {"particles": 60, "births": 30},
        "simulation": {
            "duration": 2.4,
            "sample_rate": 500.0,
            "sources": [{"snr_db": 3.0, "bearing_deg": 60.0, "start": 0.4}],
        },
    },
    "frames": {
        "kind": "frames",
        "simulation": {
            "frames": 12,
            "shape": (10, 12),
            "targets": [{"level": 9.0, "place": (3.0, 4.0), "velocity": (0.0, 0.3), "start": 2.0}],
        },
    },
}
"""Twelve scans each, in the third of which a loud target appears."""

FILES = {"recording": "small.h5", "frames": "small.npz"}
"""File of each kind that tells by itself what it holds."""

SCANS = 12


@cache
def data(kind: str) -> Any:
    return ft.simulate(SCENARIOS[kind])


@cache
def result(kind: str) -> ft.Result:
    return ft.track(data(kind), SCENARIOS[kind])


def plan(kind: str, **sections: Any) -> Plan:
    """A plan of its own for the data, as another process would make it."""
    scenario = ft.Scenario(**(SCENARIOS[kind] | sections))
    return kind_named(kind).plan(data(kind), scenario)
