"""Sets of bearings: a target is found and followed, by one observer or two, from a file to the report."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import faintrack as ft
from faintrack.data.bearings import Bearings, to_columns
from faintrack.errors import InputError
from faintrack.io.bearings import read_bearings, write_bearings
from faintrack.kinds.bearings.plan import plan
from faintrack.kinds.bearings.simulate import silence
from faintrack.kinds.loop import datasets
from faintrack.results.result import Result
from faintrack.results.schema import joined
from tests.bearings import APPEARS, SCANS, SCENARIO, START, columns, drawn, scenario, target


@pytest.fixture(scope="module")
def followed() -> Result:
    return ft.track(drawn(), scenario())


def test_a_target_is_found_and_its_bearings_told(followed: Result) -> None:
    (track,) = followed.tracks
    data = followed.data
    # Its bearing tells 4 nats a scan where it is known.
    assert APPEARS <= track.start_s <= APPEARS + 8
    assert track.end_s == SCANS - 1
    held = np.flatnonzero(data.label.values[:, 0] > 0)
    east, north = (target()[held] - np.stack([10.0 * held, 0.0 * held], axis=-1)).T
    true = np.degrees(np.arctan2(east, north)) % 360
    bearing, chance = data.reported.values[held, 0], data.association.values[held, 0]
    off = np.abs((bearing - true[:, None] + 180) % 360 - 180)
    near, far = chance[off < 3], chance[off > 10]
    assert near.mean() > 0.9
    assert far.mean() < 0.05


@pytest.mark.slow
def test_two_observers_know_where_it_is() -> None:
    result = ft.track(drawn(observers=2), scenario(target={"velocity_noise": 0.5}))
    (track,) = result.tracks
    assert track.start_s <= APPEARS + 4
    held = result.data.label.values[:, 0] > 0
    error = np.hypot(result.data.x[:, 0] - target()[:, 0], result.data.y[:, 0] - target()[:, 1]).values[held]
    # A degree at a kilometre is 17 m.
    assert np.sqrt(np.mean(error[5:] ** 2)) < 1.5 * 17
    result.plot()


def test_noise_gives_no_track() -> None:
    assert ft.track(drawn(present=False, seed=3), scenario()).tracks == []


def test_what_is_kept_agrees_with_itself(followed: Result) -> None:
    data = followed.data
    assert data.reported.sizes == {"time": SCANS, "observer": 1, "entry": 24}
    assert data.existence.sizes == {"time": SCANS, "slot": 7}
    assert all("units" in data[name].attrs for name in data.data_vars)
    assert data.attrs["first_scan_time"] == START
    there = np.isfinite(data.reported)
    np.testing.assert_array_equal(there.sum(("observer", "entry")), np.bincount(drawn().scan, minlength=SCANS))
    np.testing.assert_array_equal(there, np.isfinite(data.association))
    # Of each target at most one bearing, and only if it exists.
    assert np.all(data.association.sum(("observer", "entry")) <= data.existence.sum("slot") + 1e-3)


@pytest.mark.slow
def test_blocks_of_any_size_give_the_same(followed: Result) -> None:
    pieces = joined(list(datasets(replace(plan(drawn(), scenario()), size=23))))
    xr.testing.assert_allclose(followed.data, pieces, rtol=1e-3, atol=1e-2)


@pytest.mark.slow
def test_births_over_a_region_find_it_too() -> None:
    region = {"range": None, "x": [-500.0, 2000.0], "y": [-500.0, 2000.0]}
    result = ft.track(drawn(observers=2), scenario(bearings=region))
    assert len(result.tracks) == 1


def test_from_a_file_to_the_report(followed: Result, tmp_path: Path) -> None:
    write_bearings(tmp_path / "bearings.csv", drawn())
    (tmp_path / "scenario.toml").write_text(SCENARIO, encoding="utf-8")
    result = ft.track(tmp_path / "bearings.csv", tmp_path / "scenario.toml", out=tmp_path / "out")
    header, row = (tmp_path / "out" / "tracks.csv").read_text(encoding="utf-8").splitlines()
    assert header.startswith("label,start_s,end_s,x_m,x_m_std,x_m_start,x_m_end,y_m,")
    assert header.endswith(",speed_m_s,existence_max")
    xr.testing.assert_allclose(followed.data, result.data.load(), rtol=1e-3, atol=1e-2)
    text = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    for fact in ("1 track in bearings.csv", "60, 1 s apart", "error 1 degrees", "500 s; times"):
        assert fact in text
    # The scenario in the result runs again.
    again = ft.track(tmp_path / "bearings.csv", tmp_path / "out" / "scenario.toml", out=tmp_path / "again")
    assert again.scenario == result.scenario
    assert (tmp_path / "again" / "tracks.csv").read_text(encoding="utf-8").splitlines()[1] == row


@pytest.mark.parametrize("suffix", [".csv", ".zarr"])
def test_a_file_tells_what_it_holds(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"night{suffix}"
    write_bearings(path, drawn(observers=2))
    info = ft.info(path)
    assert info.kind == "bearings"
    assert info.facts["holds"] == f"{SCANS} scans, 1 s apart on average"
    assert info.facts["observers"] == "2, with the numbers 0, 1"
    with pytest.raises(InputError, match=r"taken for bearings.*there is no \[bearings\]"):
        ft.track(path)


OBSERVERS = [{"path": [[0.0, 0.0, 0.0], [60.0, 600.0, 0.0]]}, {"path": [[0.0, 1500.0, -200.0]]}]


@pytest.mark.slow
def test_a_simulated_target_is_found() -> None:
    target = {"x": 780.0, "y": 760.0, "vx": -8.0, "vy": 4.0, "start": APPEARS, "end": 50.0}
    simulation = {"scans": SCANS, "observers": OBSERVERS, "targets": [target]}
    bearings = ft.simulate(scenario(simulation=simulation))
    # The first goes 10 m a second to the east.
    np.testing.assert_allclose(bearings.place[[0, 30], 0], [[0, 0], [300, 0]])
    (track,) = ft.track(bearings, scenario(target={"velocity_noise": 0.5})).tracks
    assert APPEARS <= track.start_s <= APPEARS + 4
    assert 49 <= track.end_s < SCANS - 1
    error = np.hypot(track.mean["x"] - 900 + 8 * track.time, track.mean["y"] - 700 - 4 * track.time)
    # A degree at a kilometre is 17 m.
    assert np.sqrt(np.mean(error[(track.time > APPEARS + 9) & (track.time < 50)] ** 2)) < 1.5 * 17


def test_two_targets_are_reported_apart() -> None:
    """Bearings so exact, and so few false ones, that each tells whose it is."""
    targets = [{"x": 0.0, "y": 1000.0}, {"x": 1000.0, "y": 0.0, "start": 500.0}]
    certain = {"error_deg": 0.1, "false_per_scan": 0.01, "detection_probability": 0.8}
    simulation = {"scans": 1000, "observers": [{"path": [[0.0, 0.0, 0.0]]}], "targets": targets}
    bearings = ft.simulate(scenario(bearings=certain, simulation=simulation))
    for degrees, scans in ((90, 1000), (0, 500)):
        detected = np.sum(np.abs(np.degrees(bearings.bearing) - degrees) < 1)
        # Binomial, five standard errors; a false one in 18,000 scans falls that near.
        assert abs(detected - 0.8 * scans) < 5 * np.sqrt(0.16 * scans)


def test_silence_has_as_many_bearings_as_are_false() -> None:
    what = scenario(simulation={"scans": 1000, "observers": OBSERVERS, "targets": [{"x": 0.0, "y": 900.0}]})
    bearings = silence(what, seed=5)
    # Poisson with mean 3 in each of 2000 sets; five standard errors of the mean.
    assert abs(len(bearings.bearing) / 2000 - 3) < 5 * np.sqrt(3 / 2000)


def test_zarr_holds_the_same(tmp_path: Path) -> None:
    write_bearings(tmp_path / "bearings.zarr", drawn(observers=2))
    back = read_bearings(tmp_path / "bearings.zarr")
    for name, column in to_columns(drawn(observers=2)).items():
        np.testing.assert_allclose(to_columns(back)[name], column, rtol=1e-12)


@pytest.mark.parametrize(
    ("bearings", "sections", "says"),
    [
        (
            columns(3, time_s=np.array([0.0, 1.0, 1.0])),
            {"bearings": {"capacity": 1}},
            "time_s 1 has 2 bearings of one observer; expected at most bearings.capacity, 1",
        ),
        (
            columns(3, bearing_deg=np.array([80.0, 90.0, 200.0])),
            {"bearings": {"sector_deg": [45.0, 135.0]}},
            "row 2: bearing_deg is 200; expected one of the sector, 45 to 135 degrees clockwise",
        ),
    ],
)
def test_what_does_not_fit_is_refused(bearings: Bearings, sections: dict[str, Any], says: str) -> None:
    with pytest.raises(InputError, match=f"bearings in memory.*{says}"):
        ft.track(bearings, scenario(**sections))
