"""Two targets that cross among false contacts, and false contacts alone: labels held, tracks of nothing, errors.

Forty pings, twenty seconds apart, of a sonar with errors of 20 m and 1.5 degrees out to 10 km, in three settings: few
false contacts, many of them with a lower detection probability, and these with their number learnt from the data.
Writes what the validation tells:

    python examples/contacts.py --first 1 --out docs/validation_data/contacts.json
"""

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

import faintrack as ft

TARGETS = {"x": -4000.0, "y": 3000.0, "vx": 6.0, "vy": -3.0}, {"x": -4000.0, "y": 600.0, "vx": 6.0, "vy": 3.0}
SONAR = {
    "range": (200.0, 10e3),
    "range_std": 20.0,
    "bearing_std_deg": 1.5,
    "source": (0.0, 0.0),
    "receiver": (0.0, 0.0),
    "x": (-10e3, 10e3),
    "y": (-10e3, 10e3),
    "speed": 10.0,
}
FEW = {"detection_probability": 0.8, "false_per_ping": 5.0}
MANY = {"detection_probability": 0.7, "false_per_ping": 20.0}
SETTINGS = {"few": (FEW, False), "many": (MANY, False), "many, learnt": (MANY, True)}
PINGS, INTERVAL = 40, 20.0
NEAR_M = 400.0
"""Root mean square distance from a target up to which a track is its own."""


def followed(settings: dict[str, float], learnt: bool, seed: int, present: bool) -> dict[str, Any]:
    """What came out of one run.

    Parameters
    ----------
    settings : of the detector.
    learnt : whether the number of false contacts is.
    seed : of the contacts and of the filter.
    present : whether the targets are there.
    """
    targets = list(TARGETS) if present else []
    simulation = {"pings": PINGS, "interval": INTERVAL, "seed": seed, "targets": targets}
    contacts = ft.simulate({"contacts": SONAR | settings, "simulation": simulation})
    read = {name: value for name, value in settings.items() if not (learnt and name == "false_per_ping")}
    result = ft.track(contacts, {"contacts": SONAR | read, "filter": {"seed": seed}})
    own: list[list[Any]] = [[] for _ in targets]
    extra = 0
    for track in result.tracks:
        away = [
            np.hypot(*(track.mean[name] - (each[name] + each[f"v{name}"] * track.time) for name in "xy"))
            for each in targets
        ]
        deviations = [float(np.sqrt(np.mean(each**2))) for each in away]
        if not targets or min(deviations) > NEAR_M:
            extra += 1
            continue
        number = int(np.argmin(deviations))
        # At the end it must still be the target's that it began with.
        last = [float(each[-1]) for each in away]
        stays = track.end_s == (PINGS - 1) * INTERVAL and last[number] == min(last) < NEAR_M
        own[number].append((float(track.start_s), deviations[number], bool(stays)))
    return {
        "seed": seed,
        "found": sum(bool(each) for each in own),
        "labels_held": sum(len(each) == 1 and each[0][2] for each in own),
        "extra_tracks": extra + sum(max(0, len(each) - 1) for each in own),
        "declared_after_s": [min(each)[0] for each in own if each],
        "rmse_m": [min(each)[1] for each in own if each],
        "seconds": result.seconds,
        "misfits": len(result.misfits),
    }


def main() -> None:
    """Run all settings, with targets and without."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--first", type=int, required=True, help="seed of the first run")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    numbers: dict[str, Any] = {}
    for name, (settings, learnt) in SETTINGS.items():
        for present in (True, False):
            seeds = range(options.first, options.first + options.runs)
            runs = [followed(settings, learnt, seed, present) for seed in seeds]
            called = name if present else f"{name}, no target"
            numbers[called] = runs
            found, held, extra = (sum(run[key] for run in runs) for key in ("found", "labels_held", "extra_tracks"))
            print(f"{called}: {found} found, {held} labels held, {extra} other tracks in {len(runs)} runs", flush=True)
    options.out.write_text(json.dumps(numbers, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
