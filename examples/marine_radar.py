"""Ships that move among fixed echoes: 18 sweeps of a navigation radar, the whole picture.

Tracks of the recording by `faintrack.track`, and what is declared when its sweeps are shuffled in time: they hold the
same echoes with the same fluctuations then, and nothing that moves steadily. Writes what `plot_marine_radar.py` and the
page of validation tell:

    python examples/marine_radar.py ../shared/data/marine_radar --out docs/validation_data/marine_radar.json
"""

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

import faintrack as ft
from faintrack.kinds.sweeps import from_sweeps

FILE = "navico_halo_lauwersoog_38km.npz"
SCENARIO = Path(__file__).parent / "scenario_marine_radar.toml"
SHUFFLES = 9


def polar(track: Any, sweeps: Any) -> dict[str, float]:
    """A track at its end, as the radar sees it: spoke, sample, way inbound."""
    x, y, vx, vy = (float(track.mean[name][-1]) for name in ("x", "y", "vx", "vy"))
    distance = float(np.hypot(x, y))
    return {
        "label": track.label,
        "declared_s": track.start_s,
        "existence": track.existence_max,
        "spoke": float(np.degrees(np.arctan2(x, y)) % 360) / 360 * sweeps.shape[0],
        "sample": distance / sweeps.spacing,
        "inbound_m_s": -(x * vx + y * vy) / distance,
    }


def main() -> None:
    """Track, shuffle, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    file = options.folder / FILE
    if not file.exists():
        parser.exit(0, f"{file}: no recording; nothing is measured.\n")
    sweeps = ft.read(file, scenario=SCENARIO)
    result = ft.track(sweeps, SCENARIO)
    found = [polar(track, sweeps) for track in result.tracks]
    print(f"{result.seconds:.0f} s", *found, sep="\n", flush=True)
    intensity = sweeps.read(0, sweeps.length)
    hold = result.scenario.tracker.hold
    # The first nine orders were seen while the defaults were chosen, the others were not.
    declared: dict[str, list[int]] = {"seen": [], "unseen": []}
    highest: dict[str, list[float]] = {"seen": [], "unseen": []}
    for name, seed in (("seen", 0), ("unseen", 1)):
        rng = np.random.default_rng(seed)
        for _ in range(SHUFFLES):
            order = rng.permutation(sweeps.length)
            shuffled = from_sweeps(intensity[order], sweeps.spacing, sweeps.times)
            other = ft.track(shuffled, SCENARIO)
            declared[name].append(len(other.tracks))
            highest[name].append(float(other.data.existence.sel(time=slice(hold, None)).max()))
            print(name, [polar(track, sweeps) for track in other.tracks], round(highest[name][-1], 3), flush=True)
    about = {
        "windows": int(result.data.windows.max()),
        "seconds": round(result.seconds, 1),
        "tracks": found,
        "shuffled_declared": declared,
        "shuffled_highest": highest,
    }
    options.out.write_text(json.dumps(about, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
