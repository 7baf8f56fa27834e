"""A faint tone whose frequency nobody knows, two at one bearing, and noise alone: when each is declared, and how well.

A line of 32 hydrophones 0.375 m apart hears 100 to 1800 Hz, a source from the fifth second on. The same tone is tracked
among all frequencies, and by its power in a band of 40 Hz about it, which has to be known. Writes what the validation
tells:

    python examples/tones.py --first 1001 --out docs/validation_data/tones.json
"""

import argparse
import json
import math
from pathlib import Path
from typing import Any

import numpy as np

import faintrack as ft

ARRAY = {"sound_speed": 1500.0, "line": {"count": 32, "spacing": 0.375}}
BAND, RATE = (100.0, 1800.0), 4000.0
OF_NOISE_DB = 10 * math.log10((BAND[1] - BAND[0]) / (RATE / 2))
"""Noise in the band over that at all frequencies; dB."""

START = 5.0
TURNS = 0.2
"""Seconds; degrees a second."""

NEAR_HZ, NEAR_DEG = 1.0, 5.0
"""Root mean square error up to which a track is a source's own."""


def tone(frequency: float, bearing_deg: float, snr_db: float) -> dict[str, float]:
    """A source, of which the SNR is that in the band."""
    level = snr_db + OF_NOISE_DB
    return {"tone": frequency, "snr_db": level, "bearing_deg": bearing_deg, "bearing_rate_deg": TURNS, "start": START}


ONE = [tone(733.3, 70.0, -36.0)]
TWO = [tone(733.3, 70.0, -34.0), tone(736.3, 70.0, -34.0)]
SETTINGS: dict[str, tuple[list[dict[str, float]], tuple[float, float], str, float]] = {
    "place unknown": (ONE, BAND, "tone", 40.0),
    "band known": (ONE, (713.0, 753.0), "unknown_noise", 40.0),
    "two, 3 Hz apart": (TWO, BAND, "tone", 40.0),
    "none": ([], BAND, "tone", 60.0),
}


def followed(sources: list[dict[str, float]], band: tuple[float, float], kind: str, seconds: float, seed: int) -> Any:
    """What came out of one run.

    Parameters
    ----------
    sources : that are heard.
    band : that is looked at; Hz.
    kind : of likelihood.
    seconds : of the recording.
    seed : of the noise and of the filter.
    """
    simulation = {"duration": seconds, "sample_rate": RATE, "seed": seed, "sources": sources}
    scenario = {"array": ARRAY, "simulation": simulation}
    what = {"array": ARRAY, "analysis": {"band": band}, "likelihood": {"kind": kind}, "filter": {"seed": seed}}
    result = ft.track(ft.simulate(scenario), what)
    own: list[list[tuple[float, float, float]]] = [[] for _ in sources]
    others = 0
    for track in result.tracks:
        errors = []
        for source in sources:
            bearing = track.mean["bearing"] - source["bearing_deg"] - TURNS * (track.time - START)
            frequency = track.mean["frequency"] - source["tone"] if "frequency" in track.mean else np.zeros(1)
            errors.append(tuple(float(np.sqrt(np.mean(error**2))) for error in (frequency, bearing)))
        near = [number for number, (hertz, degrees) in enumerate(errors) if hertz < NEAR_HZ and degrees < NEAR_DEG]
        if near:
            own[near[0]].append((float(track.start_s) - START, *errors[near[0]]))
        others += not near
    firsts = [min(each) for each in own if each]
    return {
        "seed": seed,
        "found": len(firsts),
        "one_label_each": sum(len(each) == 1 for each in own),
        "other_tracks": others,
        "declared_after_s": [first[0] for first in firsts],
        "rmse_hz": [first[1] for first in firsts],
        "rmse_deg": [first[2] for first in firsts],
        "seconds": result.seconds,
    }


def main() -> None:
    """Run all settings."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--first", type=int, required=True, help="seed of the first run")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    numbers: dict[str, Any] = {}
    for name, setting in SETTINGS.items():
        runs = [followed(*setting, seed) for seed in range(options.first, options.first + options.runs)]
        numbers[name] = runs
        after = [value for run in runs for value in run["declared_after_s"]]
        middle = f"{np.mean(after):.1f} s, at most {max(after):.1f}" if after else "never"
        others, labels = (sum(run[key] for run in runs) for key in ("other_tracks", "one_label_each"))
        print(f"{name}: declared after {middle}; {labels} with one label, {others} other tracks, {len(runs)} runs")
    options.out.write_text(json.dumps(numbers, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
