"""Several sources that one array hears, through the command line: files, report, and what does not fit."""

import csv
import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from faintrack.errors import InputError
from faintrack.io.results import read_result
from faintrack.io.tracks import to_stonesoup
from faintrack.results.result import Result
from faintrack.results.stations import each_target
from tests.cli.calling import call
from tests.cli.test_bad_input import refuse

TIMES, BEARINGS = np.arange(80.0), np.arange(0.0, 360.0, 6.0)
PATHS = {1: 330 + 0.6 * TIMES, 2: 30 - 0.3 * TIMES}
"""Of two sources, by the label of their tracks; they cross north at the same time, the second is heard later."""
APPEARS = {1: 0, 2: 25}
SCENARIO = """
stations = [{name = "ring", line = false}]
[energies]
present = [3.5, 1.0]
[target]
bearing_rate_deg = 1.0
bearing_rate_noise_deg = 0.02
[several]
slots = 3
particles = 256
hold = 5
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with a record, its scenario and its result."""
    folder = tmp_path_factory.mktemp("alone")
    energy = np.random.default_rng(3).normal(size=(len(TIMES), len(BEARINGS)))
    for label, path in PATHS.items():
        scan = np.arange(APPEARS[label], len(TIMES))
        energy[scan, np.rint(path / 6).astype(int)[scan] % 60] += 3.5
    np.savez(folder / "ring.npz", energy=energy, time=TIMES, bearing=BEARINGS)
    (folder / "ring.toml").write_text(SCENARIO)
    done = call("track", folder / "ring.npz", "--scenario", folder / "ring.toml", "--out", folder / "out")
    assert done.status == 0, done.err
    assert "2 tracks in 80 scans" in done.out
    return folder


@pytest.fixture(scope="module")
def result(folder: Path) -> Result:
    return read_result(folder / "out")


def off(data: xr.Dataset, label: int) -> np.ndarray:
    """Errors of a track; degrees."""
    mine = dict(each_target(data, "bearing"))[label]
    return (mine["bearing"] - np.interp(mine["time"], TIMES, PATHS[label]) + 180) % 360 - 180


@pytest.mark.parametrize("label", PATHS)
def test_each_source_is_one_track_to_the_end(result: Result, label: int) -> None:
    """Through the place where both cross, and through north. Within a beam."""
    track = {track.label: track for track in result.tracks}[label]
    assert APPEARS[label] < track.start_s < APPEARS[label] + 20
    assert track.end_s == TIMES[-1]
    assert np.abs(off(result.data, label)).max() < 6


def test_a_track_turns_the_shorter_way(result: Result) -> None:
    """From 330 degrees through north: 0.6 degrees a second."""
    (first,) = (track for track in result.tracks if track.label == 1)
    assert first.start["bearing"] > 300
    assert first.end["bearing"] < 40
    assert abs(first.speed - 0.6) < 0.1


def test_every_variable_has_a_unit_and_a_name(result: Result) -> None:
    for name, variable in result.data.data_vars.items():
        assert {"units", "long_name"} <= set(variable.attrs), name
    assert result.data.bearing.dims == result.data.bearing_std.dims == ("time", "slot")
    assert result.bearing.notnull().sum() == (result.data.label > 0).sum()


def test_files(folder: Path, result: Result) -> None:
    assert {path.name for path in (folder / "out").iterdir()} == {
        *("result.zarr", "tracks.csv", "positions.csv", "scenario.toml", "versions.json", "report.html")
    }
    with (folder / "out" / "positions.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == (result.data.label > 0).sum()
    assert list(rows[0]) == ["label", "time_s", "bearing_deg", "bearing_std_deg", "bearing_rate_deg", "existence"]
    text = (folder / "out" / "report.html").read_text()
    assert "Record, detection" in text
    assert "of 240 x 7 cells, up to 1 degrees a second" in text
    assert call("report", folder / "out", "--out", folder / "again.html").status == 0


def test_what_needs_a_region_is_refused(folder: Path, result: Result) -> None:
    with pytest.raises(InputError, match="the result is of an array by itself; expected one of the records of several"):
        to_stonesoup(result)
    (folder / "ships.csv").write_text("time_s,name,x_m,y_m\n0,a,0,0\n")
    track = ("track", folder / "ring.npz", "--scenario", folder / "ring.toml")
    refuse(folder, *track, "--truth", folder / "ships.csv", names=("ring.toml has no [region]", "--truth"))
    refuse(folder, *track[:2], folder / "ring.npz", *track[2:], names=("there are 2 files for 1 stations (ring)",))
    (folder / "fast.toml").write_text(SCENARIO.replace("bearing_rate_deg = 1.0", "bearing_rate_deg = 200.0"))
    names = ("ring.npz: target.bearing_rate_deg: targets turn up to 200 degrees between two scans", "180 degrees")
    refuse(folder, *track[:3], folder / "fast.toml", names=names)


def test_results_that_are_damaged(folder: Path, tmp_path: Path) -> None:
    shutil.copytree(folder / "out", tmp_path / "out")
    shutil.rmtree(tmp_path / "out" / "result.zarr" / "bearing")
    again = ("report", tmp_path / "out", "--out", tmp_path / "again.html")
    refuse(tmp_path, *again, names=("out is damaged or incomplete (bearing is missing in result.zarr)",))
    (tmp_path / "out" / "versions.json").write_text("{")
    refuse(tmp_path, *again, names=("out is damaged or incomplete",))
