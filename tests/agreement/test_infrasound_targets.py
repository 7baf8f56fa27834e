"""Two sources of a real infrasound recording, each a target of its own that one array hears."""

from pathlib import Path

import numpy as np
import pytest

import faintrack as ft

DATA = Path(__file__).parents[2].parent / "shared" / "data" / "infrasound_array"
PLACES = ((-66.5, -44.5), (-32.5, 77.8), (88.2, -22.1), (10.8, -11.1))
BEAMS = 18
WIDTH = 360 / BEAMS
TABLES = {
    "stations": [
        {
            "name": "microphones",
            "array": {
                "channels": [{"name": str(number), "x": x, "y": y} for number, (x, y) in enumerate(PLACES)],
                "sound_speed": 345.0,
            },
        }
    ],
    "analysis": {"band": [0.5, 2.5], "frame": 10.0, "beams": BEAMS},
    "target": {"bearing_rate_deg": 0.3, "bearing_rate_noise_deg": 0.02},
    # Mean and deviation of a beam's energy in the quiet first 400 s, and roughly with a source.
    "energies": {"absent": [1.05, 0.25], "present": [2.2, 0.7]},
    # The array is a wavelength across: one source raises five beams.
    "several": {"slots": 4, "particles": 1024, "hold": 2, "margin": 2},
}

pytestmark = pytest.mark.skipif(not DATA.exists(), reason="the infrasound recording is not beside the project")


@pytest.fixture(scope="module")
def found() -> ft.Result:
    return ft.track(sorted(DATA.glob("*.SAC")), TABLES)


@pytest.mark.parametrize(
    ("label", "start", "end", "bearing"), [(1, 640, 800, -110), (2, 840, 930, -39)], ids=["west", "northwest"]
)
def test_each_source_is_one_target(found: ft.Result, label: int, start: float, end: float, bearing: float) -> None:
    """Held all the while that it is loud, on average within half a beam of the published bearing."""
    track = found.track(label)
    time = track.time + found.data.attrs["first_scan_time"]
    assert time[0] < start
    assert time[-1] > end
    held = (track.mean["bearing"] + 180) % 360 - 180
    print(f"{time[0]:.0f} to {time[-1]:.0f} s: {held.mean():.1f} degrees, standard deviation {held.std():.1f}")
    assert abs(held.mean() - bearing) < WIDTH / 2
    assert np.abs(held - bearing).max() < WIDTH


def test_nothing_else_is_declared(found: ft.Result) -> None:
    assert found.data.label.max() == 2
