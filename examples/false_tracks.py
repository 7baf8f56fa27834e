"""False tracks promised and counted: white noise and isotropic noise of six hydrophones, with the background learnt.

Thresholds for 10 and 1 false tracks an hour come from the model, from quiet noise, and from surrogates of noise
with a source in it; each then tracks in noise of other seeds, in recordings of five hours:

    python examples/false_tracks.py --out docs/validation_data/false_tracks.json
"""

import argparse
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import gammaincinv

import faintrack as ft
from faintrack.signal.array_background import isotropic

RATE, HOURS, RUNS = 500.0, 5.0, 1
ARRAY = ft.line_array(6, spacing=3.0, sound_speed=1500.0)
SCENARIO = {
    "array": ARRAY,
    "analysis": {"frame": 5.0, "beams": 36, "band": [50.0, 240.0]},
    "target": {"arrival_rate": 0.01, "departure_rate": 0.01},
}
"""Targets come as often as every 100 s, so that thresholds lie high and 10 false tracks an hour can be kept at all."""

SHARES = {"white": 0.0, "isotropic": 0.5}
"""Share of the noise that arrives from all directions alike."""

BLOCK = 2**17
"""Samples that are drawn together."""


def noise(share: float, hours: float, seed: int) -> np.ndarray:
    """Samples of noise of power 1 in each channel; shape (time, channel)."""
    rng = np.random.default_rng(seed)
    length = round(hours * 3600 * RATE)
    if not share:
        return rng.normal(size=(length, 6)).astype(np.float32)
    frequency = np.fft.rfftfreq(BLOCK, 1 / RATE)
    coarse = np.linspace(0, RATE / 2, 257)
    matrix = (1 - share) * np.eye(6) + share * isotropic(ARRAY, coarse) + 1e-9 * np.eye(6)
    roots = np.linalg.cholesky(matrix)[np.searchsorted(coarse, frequency)]
    blocks = []
    for _ in range(-(-length // BLOCK)):
        white = np.fft.rfft(rng.normal(size=(BLOCK, 6)), axis=0)
        blocks.append(np.fft.irfft(np.einsum("fij,fj->fi", roots, white), BLOCK, axis=0).astype(np.float32))
    return np.concatenate(blocks)[:length]


def source(hours: float, seed: int) -> np.ndarray:
    """Samples of a source at 50 degrees, of the power of the noise at -10 dB, heard all the time."""
    length = round(hours * 3600 * RATE)
    frequency = np.fft.rfftfreq(length, 1 / RATE)
    sound = np.fft.rfft(np.random.default_rng(seed).normal(size=length))
    late = np.asarray(ARRAY.delays(np.radians(50.0)))
    return np.stack([np.fft.irfft(sound * np.exp(-2j * np.pi * frequency * one), length) for one in late], axis=1)


def thresholds(share: float) -> Iterator[dict[str, Any]]:
    """How each is found, for which rate, and the section of the tracker that it makes."""
    rates = "10/h", "1/h"
    for rate in rates:
        yield {"by": "model", "rate": rate, "tracker": {"false_tracks": rate}}
    quiet = ft.from_samples(noise(share, HOURS, 1000), RATE)
    for rate in rates:
        calibrated = ft.calibrate_on(quiet, SCENARIO, false_tracks=rate, quiet=[(0, quiet.duration)])
        yield {"by": "quiet noise", "rate": rate, "tracker": calibrated.scenario.tracker.model_dump()}
    heard = ft.from_samples(noise(share, HOURS, 1001) + 10**-0.5 * source(HOURS, 1002), RATE)
    calibrated = ft.calibrate_on(heard, SCENARIO, false_tracks="1/h", draws=1)
    yield {"by": "surrogates", "rate": "1/h", "tracker": calibrated.scenario.tracker.model_dump()}


def counted(share: float, tracker: dict[str, Any]) -> tuple[int, int, dict[str, Any]]:
    """False tracks in all runs, runs that say that the model does not fit, and what the last one promises."""
    tracks = remarks = 0
    for run in range(RUNS):
        recording = ft.from_samples(noise(share, HOURS, run), RATE)
        result = ft.track(recording, SCENARIO, tracker=tracker, pictures=False)
        tracks += len(result.tracks)
        remarks += any("Existence rose" in misfit for misfit in result.misfits)
        promise = {**result.summary()["false_tracks"], "declare": result.scenario.tracker.declare}
    return tracks, remarks, promise


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    out = parser.parse_args().out
    rows = []
    for name, share in SHARES.items():
        for row in thresholds(share):
            tracks, remarks, promise = counted(share, row["tracker"])
            hours = RUNS * HOURS
            low, high = gammaincinv([max(tracks, 1e-9), tracks + 1], [0.025, 0.975]) / hours
            rows.append(
                {
                    "noise": name,
                    "by": row["by"],
                    "promised": row["rate"],
                    "declare": promise["declare"],
                    "per_hour": promise["per_hour"],
                    "interval": promise["interval"],
                    "extrapolated": promise["extrapolated"],
                    "tracks": tracks,
                    "hours": hours,
                    "counted_per_hour": tracks / hours,
                    "counted_interval": [low if tracks else 0.0, high],
                    "said_not_to_fit": remarks,
                    "runs": RUNS,
                }
            )
            print(rows[-1], flush=True)
            out.write_text(json.dumps({"seeds": [0, RUNS - 1], "rows": rows}, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
