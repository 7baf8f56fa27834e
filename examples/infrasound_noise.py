"""How much added noise a source survives: track before detect against detect and track, on a real recording.

White noise is added to the recording of the infrasound array in steps of 3 dB. Both methods have the threshold on
existence that one draw in twenty passes in the quiet parts of the recording. Writes the counts that
`plot_infrasound_noise.py` draws:

    python examples/infrasound_noise.py RECORDINGS.. --out docs/validation_data/infrasound_noise.json
"""

import argparse
import json
from pathlib import Path

import numpy as np

import faintrack as ft

ARRAY = ft.sensor_array(
    np.array([[-66.5, -44.5, 0.0], [-32.5, 77.8, 0.0], [88.2, -22.1, 0.0], [10.8, -11.1, 0.0]]), sound_speed=345.0
)
SOURCES = {
    "west, 575 to 805 s": (575.0, 805.0, -110.0),
    "northwest, 815 to 955 s": (815.0, 955.0, -38.0),
    "northwest, 425 to 435 s": (425.0, 435.0, -40.0),
    "north, 1115 to 1195 s": (1115.0, 1195.0, 0.0),
}
"""Start, end (s) and bearing (degrees) of what both the tracker and an independent beamformer find without noise."""
QUIET = [(0.0, 120.0), (960.0, 1110.0)]
"""Seconds without a source."""
STEPS_DB = np.arange(-6, 28, 3)
"""Added noise over the recording's own in its quiet part, both in the band; dB."""
BAND, FRAME, FALSE_SHARE = (0.5, 2.5), 10.0, 0.05
WITHIN_DEG = 25.0


def band_power(samples: np.ndarray, sample_rate: float) -> float:
    """Mean power of a channel in the band."""
    spectrum = np.abs(np.fft.rfft(samples, axis=0)) ** 2
    frequency = np.fft.rfftfreq(len(samples), 1 / sample_rate)
    inside = (frequency >= BAND[0]) & (frequency <= BAND[1])
    return float(2 * spectrum[inside].sum(axis=0).mean() / len(samples) ** 2)


def main() -> None:
    """Count what is found at every step."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recordings", nargs="+", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--draws", type=int, default=12, help="of the noise at each step")
    options = parser.parse_args()
    recording: ft.Recording = ft.read(*options.recordings)
    samples, rate = recording.read(0, recording.length).astype(float), recording.sample_rate
    quiet = np.concatenate([samples[int(a * rate) : int(b * rate)] for a, b in QUIET])
    # White noise spreads over all frequencies; this share of it falls into the band.
    share = (BAND[1] - BAND[0]) / (rate / 2)
    analysis = {"band": BAND, "frame": FRAME}
    scenarios = {
        method: ft.Scenario(array=ARRAY, analysis=analysis, tracker={"method": method})
        for method in ("bernoulli", "cfar")
    }
    rng = np.random.default_rng(0)
    # Highest existence in the quiet parts, and near each source while it lasts: by method, place, step; one a draw.
    highest: dict[str, dict[str, list[list[float]]]] = {m: {n: [] for n in [*SOURCES, "quiet"]} for m in scenarios}
    for step_db in STEPS_DB.tolist():
        variance = band_power(quiet - quiet.mean(axis=0), rate) * 10 ** (step_db / 10) / share
        for places in highest.values():
            for steps in places.values():
                steps.append([])
        for _ in range(options.draws):
            noisy = ft.from_samples(samples + rng.normal(scale=variance**0.5, size=samples.shape), rate)
            for method, scenario in scenarios.items():
                data, places = ft.track(noisy, scenario).data.isel(slot=0), highest[method]
                for name, (start, end, bearing) in SOURCES.items():
                    there = data.sel(time=slice(start, end))
                    off = np.abs((there.bearing - bearing + 180) % 360 - 180)
                    places[name][-1].append(float(there.existence.where(off < WITHIN_DEG, 0).max()))
                places["quiet"][-1].append(max(float(data.existence.sel(time=slice(a, b)).max()) for a, b in QUIET))
        print(step_db, {m: {n: float(np.median(v[-1])) for n, v in p.items()} for m, p in highest.items()}, flush=True)
    used = {m: float(np.quantile(np.concatenate(p["quiet"]), 1 - FALSE_SHARE)) for m, p in highest.items()}
    counts = {
        method: {name: [int(np.sum(np.array(step) > used[method])) for step in steps] for name, steps in places.items()}
        for method, places in highest.items()
    }
    result = {"draws": options.draws, "added_db": STEPS_DB.tolist(), "thresholds": used, "found": counts}
    options.out.write_text(json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    main()
