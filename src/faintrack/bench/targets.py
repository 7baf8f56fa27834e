"""Data with one target and with several, from values to tracks, with as many slots in all."""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from faintrack.bench.machine import Machine
from faintrack.bench.rows import Row, Timing, row, timed
from faintrack.bench.sizes import Sizes
from faintrack.data.contacts import Contacts
from faintrack.data.recording import Recording, from_samples
from faintrack.data.sequence import Sequence, from_frames
from faintrack.kinds.door import simulate, track
from faintrack.sensors.array import line_array
from faintrack.simulation.samples import Source, draw_samples

SLOTS = 16
"""Targets that are followed at once at most, in every row."""

CHANNELS, RATE, SNR_DB = 32, 1000.0, -10.0
"""Of the recording; its rate in Hz."""

LEVEL, WIDTH = 6.0, 1.0
"""Of a target in frames: deviations of the noise at its peak; pixels."""


Make = Callable[[int, Sizes], tuple[Any, dict[str, Any]]]
"""Data with so many targets, and sections of their scenario."""


def _recording(targets: int, sizes: Sizes) -> tuple[Recording, dict[str, Any]]:
    array = line_array(CHANNELS, 1.5)
    # Evenly in the cosine: lobes of a line are as wide everywhere along it.
    bearings = np.arccos((2 * np.arange(targets) + 1) / targets - 1)
    sources = [Source(SNR_DB, float(bearing)) for bearing in bearings]
    samples = np.concatenate(list(draw_samples(array, sources, float(sizes.target_scans), RATE)))
    return from_samples(samples, RATE), {"array": array}


def _frames(targets: int, sizes: Sizes) -> tuple[Sequence, dict[str, Any]]:
    side, count = sizes.target_pixels, sizes.target_scans
    frames = np.random.default_rng(0).standard_normal((count, side, side), dtype=np.float32)
    y, x = np.mgrid[:side, :side]
    rows = int(np.ceil(np.sqrt(targets)))
    for number in range(targets):
        place = (np.array(divmod(number, rows)) + 0.5) * side / rows - count / 4
        for frame in range(count):
            off = (y - place[0] - 0.5 * frame) ** 2 + (x - place[1] - 0.5 * frame) ** 2
            frames[frame] += LEVEL * np.exp(-off / (2 * WIDTH**2))
    return from_frames(frames), {"frames": {"background": "none"}, "cells": {"amplitude": "gaussian", "width": WIDTH}}


def _contacts(targets: int, sizes: Sizes) -> tuple[Contacts, dict[str, Any]]:
    around = 2 * np.pi * (np.arange(targets) + 0.5) / targets
    told: dict[str, Any] = {
        "contacts": {
            "range": (200.0, 10e3),
            "range_std": 20.0,
            "bearing_std_deg": 1.5,
            "detection_probability": 0.8,
            "false_per_ping": 5.0,
            "source": (0.0, 0.0),
            "receiver": (0.0, 0.0),
            "x": (-10e3, 10e3),
            "y": (-10e3, 10e3),
            "speed": 10.0,
        }
    }
    places = [{"x": 6e3 * float(np.sin(angle)), "y": 6e3 * float(np.cos(angle)), "vx": 5.0} for angle in around]
    simulation = {"pings": sizes.target_scans, "interval": 20.0, "targets": places}
    contacts: Contacts = simulate({**told, "simulation": simulation})
    return contacts, told


@functools.cache
def _timed(make: Make, targets: int, sizes: Sizes) -> Timing:
    data, sections = make(targets, sizes)
    sections = {**sections, "tracker": {"targets": SLOTS}}
    timing = timed(lambda: track(data, pictures=False, **sections), sizes.repeat_seconds)
    return timing.per(sizes.target_scans)


def _row(kind: str, make: Make, targets: int) -> Callable[[Machine, Sizes], Row]:
    def measured(machine: Machine, sizes: Sizes) -> Row:
        note = (
            f"one of {sizes.target_scans} scans with {targets} targets in {SLOTS} slots, from values in memory to "
            "tracks; peer: as many runs with one target each; no limit"
        )
        peer = None if targets == 1 else targets * _timed(make, 1, sizes).least
        return row(measured.__name__, "ms", _timed(make, targets, sizes), note, None, peer)

    measured.__name__ = f"{kind}_{targets}_target{'s' * (targets > 1)}"
    return measured


TARGET_ROWS = tuple(
    _row(kind, make, targets)
    for kind, make in {"recording": _recording, "frame": _frames, "contact": _contacts}.items()
    for targets in (1, 4, SLOTS)
)
"""A scan of each kind with one target, four, and as many as there are slots."""
