"""A small archive: two stations whose files follow each other, a source each, and the scenario that tracks them."""

from pathlib import Path
from typing import Any

import numpy as np

import faintrack as ft
from faintrack.archive.cut import Cut
from faintrack.io.write_recordings import write_recording

RATE = 250.0
BEGIN = np.datetime64("2026-01-01T23:58:00", "ns")
"""Two minutes before midnight: an archive of four minutes has two days."""

SECONDS, FILE = 240, 20
CUT = Cut(segment=30, chain=120, burn_in=30)
PATTERN = "{station}/%Y%m%d_%H%M%S"

SCENARIO: dict[str, Any] = {
    "kind": "recording",
    "array": {"sound_speed": 1500.0, "line": {"count": 4, "spacing": 6.0}},
    "analysis": {"frame": 0.5, "beams": 36},
    "filter": {"particles": 200, "births": 100},
    "tracker": {"targets": 2},
}


def sources(station: str) -> list[dict[str, float]]:
    """What is heard at a station: one source over midnight, another that comes and goes."""
    bearings = (60.0, 120.0) if station == "north" else (100.0, 40.0)
    return [
        {"snr_db": -4.0, "bearing_deg": bearings[0], "bearing_rate_deg": 0.05, "start": 20.0},
        {"snr_db": -4.0, "bearing_deg": bearings[1], "start": 70.0, "end": 170.0},
    ]


def make(folder: Path, stations: tuple[str, ...] = ("north", "south")) -> Path:
    """Write the recordings, and `scenario.toml` beside them."""
    folder.mkdir(parents=True, exist_ok=True)
    ft.Scenario(**SCENARIO).save(folder / "scenario.toml")
    for number, station in enumerate(stations):
        simulation = {"duration": SECONDS, "sample_rate": RATE, "sources": sources(station), "seed": number}
        recording = ft.simulate(SCENARIO | {"simulation": simulation})
        (folder / station).mkdir(exist_ok=True)
        size = round(FILE * RATE)
        for first, block in zip(range(0, recording.length, size), recording.blocks(size), strict=True):
            write_recording(file_at(folder, station, first / RATE), [block], RATE)
    return folder


def file_at(folder: Path, station: str, seconds: float) -> Path:
    """Path of the file that begins so many seconds after the archive does."""
    begun = BEGIN + np.timedelta64(round(seconds), "s")
    name = np.datetime_as_string(begun, unit="s").replace("-", "").replace(":", "").replace("T", "_")
    return folder / station / f"{name}.wav"
