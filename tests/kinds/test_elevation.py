"""Waves from above the horizon: at their bearing where the state has an elevation, told of where it has none."""

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import faintrack as ft
from faintrack.results.report import track_headings

# Six microphones within 150 m, as they stand in a wood.
PLACES = np.array([[0.0, 0.0], [5.0, 71.0], [55.0, 38.0], [18.0, -66.0], [-38.0, -60.0], [-70.0, 4.0]])
MICROPHONES = ft.sensor_array(PLACES, 340.0)
ANALYSIS = {"band": [1.0, 5.0], "frame": 10.0}
ABOVE = {"elevation_deg": [0.0, 80.0]}


def scenario(
    *sources: dict[str, Any], array: Any = MICROPHONES, frames: int = 12, seed: int = 0, **sections: Any
) -> Any:
    simulation = {"duration": 10.0 * frames, "sample_rate": 50.0, "seed": seed, "sources": list(sources)}
    return ft.Scenario(kind="recording", array=array, analysis=ANALYSIS, simulation=simulation, **sections)


def source(elevation: float, snr_db: float = 0.0, bearing: float = 123.0) -> dict[str, float]:
    return {"snr_db": snr_db, "bearing_deg": bearing, "elevation_deg": elevation}


def tracked(what: Any) -> ft.Result:
    return ft.track(ft.simulate(what), what)


@pytest.mark.slow
@pytest.mark.parametrize("elevation", [60.0, 10.0])
def test_a_wave_from_above_is_at_its_bearing(elevation: float) -> None:
    """Frames of five runs within 3 deviations, but for one in fifty: those of a track are not independent."""
    inside: list[np.ndarray] = []
    for seed, level in zip(range(50, 55), (-4.0, 10.0, 0.0, 5.0, 20.0), strict=True):
        bearing = -170.0 + 77.0 * (seed - 50)
        result = tracked(scenario(source(elevation, level, bearing), seed=seed, target=ABOVE))
        (track,) = result.tracks
        assert not any("crosses the array" in remark for remark in result.misfits)
        off = (track.mean["bearing"] - bearing + 180) % 360 - 180
        above = track.mean["elevation"] - elevation
        inside += [np.abs(off) < 3 * track.std["bearing"], np.abs(above) < 3 * track.std["elevation"]]
        assert abs(np.median(track.mean["trace_velocity"]) * np.cos(np.radians(elevation)) / 340 - 1) < 0.1
    assert np.concatenate(inside).mean() >= 0.98


@pytest.mark.slow
def test_a_wave_from_above_that_is_taken_for_level_is_told() -> None:
    result = tracked(scenario(source(60.0)))
    (remark,) = [remark for remark in result.misfits if "crosses the array" in remark]
    assert "from 60 degrees above the horizon, where waves are taken for level" in remark
    assert "expected target.elevation_deg, as [0, 80]" in remark
    assert len(remark) < 300
    # Channels are not to blame.
    assert not any("Channel" in remark for remark in result.misfits)


def test_sound_that_is_slower_than_the_array_says_is_told() -> None:
    slow = scenario(source(0.0, 5.0), array=ft.sensor_array(PLACES, 290.0))
    result = ft.track(ft.simulate(slow), scenario())
    assert any("m/s, slower than sound, 340 m/s: expected another sound_speed" in remark for remark in result.misfits)


@pytest.mark.parametrize(
    "sources",
    [
        [source(0.0, 15.0), source(0.0, 5.0, -30.0)],
        *(pytest.param(one, marks=pytest.mark.slow) for one in ([], [source(0.0)], [source(10.0, 5.0)])),
    ],
)
def test_nothing_is_said_of_level_waves(sources: list[dict[str, float]]) -> None:
    for seed in range(3):
        result = tracked(scenario(*sources, seed=seed))
        assert not any("crosses" in remark or "Channel" in remark for remark in result.misfits)


def test_a_close_look_tells_of_waves_too(tmp_path: Path) -> None:
    file = tmp_path / "night.h5"
    what = scenario(source(60.0, 5.0))
    ft.simulate(what, file)
    sections = {"array": MICROPHONES, "analysis": ANALYSIS}
    assert any("crosses the array at" in remark for remark in ft.info(file, check=True, **sections).remarks)
    looked = ft.info(file, check=True, target=ABOVE, **sections).remarks
    assert looked[-1].startswith("Channels agree")


def test_tables_have_elevation_and_trace_velocity(tmp_path: Path) -> None:
    what = scenario(source(60.0, 5.0), target=ABOVE)
    result = ft.track(ft.simulate(what), what, out=tmp_path / "out")
    assert [heading for _, heading, _ in track_headings(result)][-4:-2] == ["elevation\ndeg", "trace velocity\nm/s"]
    with (tmp_path / "out" / "states.csv").open(encoding="utf-8") as file:
        row = list(csv.DictReader(file))[-1]
    assert abs(float(row["elevation_deg"]) - 60) < 4
    assert abs(float(row["trace_velocity_m_s"]) - 680) < 60
    assert 0 < float(row["elevation_deg_std"]) < 5
    assert 0 < float(row["trace_velocity_m_s_std"]) < 100


@pytest.mark.slow
def test_a_threshold_is_calibrated_with_targets_above_the_horizon() -> None:
    what = scenario(target=ABOVE, filter={"particles": 200, "births": 50})
    assert 0 < ft.calibrate(what, probability=0.2, duration=50.0, runs=4).threshold.value < 1


@pytest.mark.parametrize(
    ("sections", "says"),
    [
        ({"array": ft.line_array(6, 20.0, 340.0)}, "the array is a line, which hears every wave of a cone"),
        ({"likelihood": {"kind": "lobe_width"}}, 'likelihood.kind is "lobe_width", which hears level waves only'),
        ({"tracker": {"method": "cfar"}}, 'tracker.method is "cfar", which hears level waves only'),
        ({"target": {"elevation_deg": [50.0, 20.0]}}, "expected the lowest first"),
        ({"target": {"elevation_deg": [-20.0, 20.0]}}, "cannot tell above from below"),
    ],
)
def test_what_cannot_tell_elevations_says_so(sections: dict[str, Any], says: str) -> None:
    with pytest.raises(ft.InputError, match=says):
        tracked(scenario(source(0.0), **{"target": ABOVE} | sections))


def test_a_line_has_no_source_above_the_horizon() -> None:
    with pytest.raises(ft.InputError, match=r"sources\[0\].elevation_deg is 30, and the array is a line"):
        ft.simulate(scenario(source(30.0), array=ft.line_array(6, 20.0, 340.0)))
