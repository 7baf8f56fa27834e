"""A small scenario of each kind with a simulation, its data, and its result, made once a process."""

from functools import cache
from typing import Any

import pytest

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
            "shape": (16, 20),
            "targets": [{"level": 12.0, "place": (3.0, 4.0), "velocity": (0.0, 1.0), "start": 2.0}],
        },
    },
    "returns": {
        "kind": "returns",
        "sonar": {
            "pulse": {"frequency": 2000.0, "duration": 1.0, "bandwidth": 4.0},
            "delay": [2.0, 16.0],
            "delay_step": 0.2,
            "beams": 12,
            "beam_width_deg": 30.0,
            "source": [0, 0],
            "receiver": [0, 0],
            "threshold_db": 9.0,
            "snr_db": 20.0,
        },
        "grid": {"x": [-12e3, 12e3], "y": [-12e3, 12e3], "cells": [8, 8], "speed": 9.0, "speeds": 3},
        "simulation": {
            "pings": 12,
            "interval": 60.0,
            "targets": [{"x": 4500.0, "y": 4500.0, "vx": 1.0, "start": 120.0}],
        },
    },
    "bearings": {
        "kind": "bearings",
        "bearings": {
            "error_deg": 2.0,
            "detection_probability": 0.98,
            "false_per_scan": 0.5,
            "speed": 10.0,
            "range": [100.0, 2000.0],
        },
        "filter": {"particles": 300, "births": 150},
        "simulation": {
            "scans": 12,
            "observers": [{"path": [[0.0, 0.0, 0.0]]}, {"path": [[0.0, 1500.0, 0.0], [12.0, 1500.0, 60.0]]}],
            "targets": [{"x": 500.0, "y": 800.0, "start": 2.0}],
        },
    },
    "records": {
        "kind": "records",
        "stations": [{"name": "alone"}],
        "energies": {"absent": [0.0, 1.0], "present": [6.0, 1.0]},
        "several": {"slots": 2, "particles": 64, "hold": 2},
        "simulation": {"scans": 12, "beam_deg": 6.0, "sources": [{"bearing_deg": 60.0, "start": 2.0}]},
    },
}
"""Twelve scans each, in the third of which a loud target appears."""

FILES = {
    "recording": "small.h5",
    "frames": "small.npz",
    "returns": "small.csv",
    "bearings": "small.csv",
    "records": "small.npz",
}
"""File of each kind that tells by itself what it holds."""

SCANS = 12

COMPILED_LONG = ("returns", "bearings", "records")
"""Kinds whose programs take long to compile: they run through these laws with the slow tests, and their own files."""

EVERY = [pytest.param(kind, marks=pytest.mark.slow if kind in COMPILED_LONG else ()) for kind in SCENARIOS]


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
