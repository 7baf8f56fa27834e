"""Initiation from detected bearings against track before detect, on a real recording.

Of every frame and band of the infrasound array the strongest beam is kept where it stands above a low threshold, the
median of the strongest beams of that band in the quiet parts of the recording: half of the detections there are, are
false by construction. Bands are observers at one place, with one bearing at most. Writes what
`plot_infrasound_bearings.py` draws:

    python examples/infrasound_bearings.py RECORDINGS.. --out docs/validation_data/infrasound_bearings.json
"""

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

import faintrack as ft
from faintrack.data.bearings import from_columns

ARRAY = ft.sensor_array(
    np.array([[-66.5, -44.5, 0.0], [-32.5, 77.8, 0.0], [88.2, -22.1, 0.0], [10.8, -11.1, 0.0]]), sound_speed=345.0
)
SOURCES = {
    "west, 575 to 805 s": (575.0, 805.0, -110.0),
    "northwest, 815 to 955 s": (815.0, 955.0, -38.0),
    "northwest, 425 to 435 s": (425.0, 435.0, -40.0),
    "north, 1115 to 1195 s": (1115.0, 1195.0, 0.0),
}
"""Start, end (s) and bearing (degrees) of what both the tracker and an independent beamformer find."""
QUIET = [(0.0, 120.0), (960.0, 1110.0)]
"""Seconds without a source."""
BAND, BANDS, FRAME = (0.5, 2.5), ((0.5, 1.0), (1.0, 1.5), (1.5, 2.0), (2.0, 2.5)), 10.0
WITHIN_DEG = 25.0

SCENARIO = {
    # Sources are far away and hardly move: the range is a stand-in, bearings are all that is told.
    "bearings": {
        "error_deg": 10.0,
        "detection_probability": 0.8,
        "false_per_scan": 0.5,
        "range": [1500.0, 2500.0],
        "speed": 2.0,
        "capacity": 1,
    },
    "target": {"arrival_rate": 0.001, "departure_rate": 0.005, "velocity_noise": 0.5},
    "filter": {"particles": 2000, "births": 1000},
}


def within(time: np.ndarray, spans: list[tuple[float, float]]) -> np.ndarray:
    """Whether each time lies in one of some spans."""
    return np.any([(time >= start) & (time <= end) for start, end in spans], axis=0)


def found(data: xr.Dataset, bearing_deg: np.ndarray) -> dict[str, Any]:
    """Share of the frames of each source with a track near it, when it is first declared, and tracks elsewhere."""
    time, label = data.time.values, data.label.values[:, 0]
    near_any = np.zeros(len(time), bool)
    told: dict[str, Any] = {"sources": {}}
    for name, (start, end, bearing) in SOURCES.items():
        there = (time >= start) & (time <= end)
        near = (label > 0) & (np.abs((bearing_deg - bearing + 180) % 360 - 180) < WITHIN_DEG)
        near_any |= near
        first = time[there & near]
        told["sources"][name] = {
            "frames": int(there.sum()),
            "followed": int((there & near).sum()),
            "declared_after_s": float(first[0] - start) if len(first) else None,
        }
    told["quiet_frames"] = int(within(time, QUIET).sum())
    told["quiet_frames_with_a_track"] = int((within(time, QUIET) & (label > 0)).sum())
    told["frames_with_a_track_elsewhere"] = int(((label > 0) & ~near_any).sum())
    return told


def main() -> None:
    """Detect, track both ways, and keep what was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recordings", nargs="+", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    recording = ft.read(*options.recordings)
    whole = ft.track(recording, array=ARRAY, analysis={"band": BAND, "frame": FRAME})
    rows: list[tuple[float, float, int]] = []
    for number, band in enumerate(BANDS):
        record = ft.track(recording, array=ARRAY, analysis={"band": band, "frame": FRAME}).data.record
        strongest = record.max("beam")
        threshold = float(np.median(strongest.values[within(record.time.values, QUIET)]))
        bearing = record.beam.values[record.argmax("beam").values]
        kept = np.where(strongest.values > threshold, bearing, np.nan)
        rows += [(float(time), float(each), number) for time, each in zip(record.time.values, kept, strict=True)]
    rows.sort(key=lambda row: (row[0], row[2]))
    time, bearing, observer = np.array(rows).T
    zero = np.zeros(len(time))
    columns = {"time_s": time, "bearing_deg": bearing, "observer_x_m": zero, "observer_y_m": zero, "observer": observer}
    result = ft.track(from_columns(columns), SCENARIO)
    data = result.data.assign_coords(time=result.data.time + time[0])
    direction = np.degrees(np.arctan2(data.x.values, data.y.values))[:, 0]
    methods = {
        "bearings": (data, direction, data.existence.values[:, 0]),
        "track_before_detect": (whole.data, whole.data.bearing.values[:, 0], whole.data.existence.values[:, 0]),
    }
    kept = {
        name: {
            **found(each, degrees),
            "time": each.time.values.round(1).tolist(),
            "existence": existence.astype(float).round(4).tolist(),
            "bearing_deg": np.where(each.label.values[:, 0] > 0, degrees, np.nan).astype(float).round(1).tolist(),
        }
        for name, (each, degrees, existence) in methods.items()
    }
    heard = {
        "time": data.time.values.round(1).tolist(),
        "bearing_deg": data.heard.values[..., 0].astype(float).round(1).tolist(),
        "association": data.association.values[..., 0].astype(float).round(3).tolist(),
    }
    told = {"bands": BANDS, "scenario": SCENARIO, "heard": heard, **kept}
    # Not a number has no place in JSON.
    options.out.write_text(json.dumps(told, indent=None).replace("NaN", "null") + "\n")
    for name in methods:
        print(name, {key: value for key, value in kept[name].items() if not isinstance(value, list)})


if __name__ == "__main__":
    main()
