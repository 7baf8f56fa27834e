"""Sets of bearings: a target is found and followed, by one observer or two, from a file to the report."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from faintrack.data.bearings import Bearings, to_columns
from faintrack.errors import InputError
from faintrack.io import read_bearings, write_bearings
from faintrack.io.results import read_result
from faintrack.kinds.session_bearings import track_bearing_blocks, track_bearings
from faintrack.plots.bearings import draw_bearings
from faintrack.results.result import Result, joined
from tests.bearings import APPEARS, SCANS, SCENARIO, START, columns, drawn, scenario, target
from tests.cli.calling import call


@pytest.fixture(scope="module")
def followed() -> Result:
    return track_bearings(drawn(), scenario())


def test_a_target_is_found_and_its_bearings_told(followed: Result) -> None:
    (track,) = followed.tracks
    data = followed.data
    # Its bearing tells 4 nats a scan where it is known.
    assert APPEARS <= track.start_s <= APPEARS + 8
    assert track.end_s == SCANS - 1
    held = np.flatnonzero(data.label.values > 0)
    east, north = (target()[held] - np.stack([10.0 * held, 0.0 * held], axis=-1)).T
    true = np.degrees(np.arctan2(east, north)) % 360
    bearing, chance = data.heard.values[held, 0], data.association.values[held, 0]
    off = np.abs((bearing - true[:, None] + 180) % 360 - 180)
    near, far = chance[off < 3], chance[off > 10]
    assert near.mean() > 0.9
    assert far.mean() < 0.05


def test_two_observers_know_where_it_is() -> None:
    result = track_bearings(drawn(observers=2), scenario(target={"velocity_noise": 0.5}))
    (track,) = result.tracks
    assert track.start_s <= APPEARS + 4
    held = result.data.label.values > 0
    error = np.hypot(result.data.x_mean - target()[:, 0], result.data.y_mean - target()[:, 1]).values[held]
    # A degree at a kilometre is 17 m.
    assert np.sqrt(np.mean(error[5:] ** 2)) < 1.5 * 17
    draw_bearings(result)


def test_noise_gives_no_track() -> None:
    assert track_bearings(drawn(present=False, seed=3), scenario()).tracks == []


def test_what_is_kept_agrees_with_itself(followed: Result) -> None:
    data = followed.data
    assert data.sizes == {"time": SCANS, "observer": 1, "entry": 24}
    assert all("units" in data[name].attrs for name in data.variables)
    assert data.attrs["first_scan_time"] == START
    there = np.isfinite(data.heard)
    np.testing.assert_array_equal(there.sum(("observer", "entry")), np.bincount(drawn().scan, minlength=SCANS))
    np.testing.assert_array_equal(there, np.isfinite(data.association))
    # At most one bearing is the target's, and only if there is one.
    assert np.all(data.association.sum(("observer", "entry")) <= data.existence + 1e-3)
    assert np.all(np.abs(data.xy_covariance) <= data.x_std * data.y_std * 1.001)


def test_blocks_of_any_size_give_the_same(followed: Result) -> None:
    pieces = joined(track_bearing_blocks(drawn(), scenario(), 23))
    xr.testing.assert_allclose(followed.data, pieces, rtol=1e-3, atol=1e-3)


def test_births_over_a_region_find_it_too() -> None:
    region = {"range": None, "x": [-500.0, 2000.0], "y": [-500.0, 2000.0]}
    result = track_bearings(drawn(observers=2), scenario(bearings=region))
    assert len(result.tracks) == 1


def test_from_a_file_to_the_report(followed: Result, tmp_path: Path) -> None:
    write_bearings(tmp_path / "bearings.csv", drawn())
    (tmp_path / "scenario.toml").write_text(SCENARIO)
    done = call("track", tmp_path / "bearings.csv", "--scenario", tmp_path / "scenario.toml", "--out", tmp_path / "out")
    assert done.status == 0, done.err
    assert f"1 tracks in {SCANS} scans" in done.out
    header, row = (tmp_path / "out" / "tracks.csv").read_text().splitlines()
    assert header == "label,start_s,end_s,x_start,y_start,x_end,y_end,speed,existence_max"
    result = read_result(tmp_path / "out")
    xr.testing.assert_allclose(followed.data, result.data.load(), rtol=1e-3, atol=1e-2)
    text = (tmp_path / "out" / "report.html").read_text()
    for told in ("1 track in bearings.csv", "60, 1 s apart", "error 1 degrees", "500 s; times"):
        assert told in text
    # The scenario in the result runs again.
    again = call("track", tmp_path / "bearings.csv", "--scenario", tmp_path / "out" / "scenario.toml", "--json")
    printed = json.loads(again.out)
    assert printed["scans"] == SCANS
    assert ",".join(map(str, printed["tracks"][0].values())) == row


def test_zarr_holds_the_same(tmp_path: Path) -> None:
    write_bearings(tmp_path / "bearings.zarr", drawn(observers=2))
    back = read_bearings(tmp_path / "bearings.zarr")
    for name, column in to_columns(drawn(observers=2)).items():
        np.testing.assert_allclose(to_columns(back)[name], column, rtol=1e-12)


@pytest.mark.parametrize(
    ("bearings", "tables", "says"),
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
def test_what_does_not_fit_is_refused(bearings: Bearings, tables: dict[str, Any], says: str) -> None:
    with pytest.raises(InputError, match=f"bearings in memory.*{says}"):
        track_bearings(bearings, scenario(**tables))
