"""A wave from above an array of microphones: taken for level, and with its elevation in the state.

Eight microphones within 150 m, infrasound from 1 to 8 Hz, 240 s of a source from -6 to 15 dB, anywhere around. Counts
tracks, their frames within 3 deviations of the bearing, and the runs whose report says that the wave is not level:

    python examples/elevation.py --runs 10 --out docs/validation_data/elevation.json
"""

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

import faintrack as ft
from faintrack.metrics.intervals import binomial_interval

CASES = ((60.0, True), (10.0, True), (60.0, False), (30.0, False), (10.0, False), (0.0, False))
"""Elevation of the source, degrees; whether the state has one."""
FIRST = 200
"""Seed of the first run."""


def array() -> ft.SensorArray:
    """Microphones, nearly on a circle."""
    rng, count = np.random.default_rng(77), 8
    around = np.arange(count) * 2 * np.pi / count + rng.uniform(-0.3, 0.3, count)
    x = 75 * rng.uniform(0.4, 1, count) * np.sin(around)
    return ft.sensor_array(np.c_[x, 75 * rng.uniform(0.4, 1, count) * np.cos(around)], sound_speed=340.0)


def run(seed: int, elevation: float, above: bool) -> dict[str, Any]:
    """How far off every track's bearing and elevation are, in their deviations, and whether waves are told of."""
    rng = np.random.default_rng([seed, 7])
    bearing, snr_db = float(rng.uniform(-180, 180)), float(rng.uniform(-6, 15))
    source = {"snr_db": snr_db, "bearing_deg": bearing, "elevation_deg": elevation}
    scenario = ft.Scenario(
        kind="recording",
        array=array(),
        analysis={"band": [1.0, 8.0], "frame": 10.0},
        target={"elevation_deg": [0, 80]} if above else {},
        simulation={"duration": 240.0, "sample_rate": 50.0, "seed": seed, "sources": [source]},
    )
    result = ft.track(ft.simulate(scenario), scenario)
    tracks = []
    for track in result.tracks:
        off = (track.mean["bearing"] - bearing + 180) % 360 - 180
        tracks.append({"bearing": (off / track.std["bearing"]).tolist()})
        if above:
            tracks[-1]["elevation"] = ((track.mean["elevation"] - elevation) / track.std["elevation"]).tolist()
    return {"tracks": tracks, "told": any("crosses the array" in remark for remark in result.misfits)}


def counted(runs: list[dict[str, Any]]) -> dict[str, Any]:
    """What is told of the runs of one case."""
    tracks = [track for run in runs for track in run["tracks"]]
    bearing = np.abs(np.concatenate([track["bearing"] for track in tracks]))
    alone = sum(len(run["tracks"]) == 1 and abs(run["tracks"][0]["bearing"][-1]) < 3 for run in runs)
    counts = {
        "runs": len(runs),
        "tracks": len(tracks),
        "frames": len(bearing),
        "within_3_deviations": int((bearing < 3).sum()),
        "one_track_at_its_bearing_at_the_end": alone,
        "interval": [round(float(end), 3) for end in binomial_interval(alone, len(runs))],
        "told_that_waves_are_not_level": sum(run["told"] for run in runs),
    }
    if "elevation" in tracks[0]:
        elevation = np.abs(np.concatenate([track["elevation"] for track in tracks]))
        counts["elevation_within_3_deviations"] = int((elevation < 3).sum())
    return counts


def main() -> None:
    """Draw the runs and write the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    found = {}
    for elevation, above in CASES:
        runs = [run(seed, elevation, above) for seed in range(FIRST, FIRST + options.runs)]
        found[f"{elevation:g} degrees, {'elevation in the state' if above else 'taken for level'}"] = counted(runs)
    options.out.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
