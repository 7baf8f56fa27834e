"""Several arrays through the command line, and what does not fit: one sentence that names file and field."""

import json
from pathlib import Path

import numpy as np
import pytest

from faintrack.io.write_recordings import write_recording
from faintrack.scenario.model import to_toml
from tests.cli.calling import call
from tests.cli.test_bad_input import refuse
from tests.stations import BEARINGS, energies, place, scenario

TIMES = np.arange(60.0)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Folder with good records and a good scenario."""
    for number, name in enumerate(("west", "east")):
        np.savez(tmp_path / f"{name}.npz", energy=energies(number, TIMES), time=TIMES, bearing=BEARINGS)
    (tmp_path / "stations.toml").write_text(to_toml(scenario()))
    return tmp_path


def track(folder: Path, *options: object) -> tuple[object, ...]:
    files = (folder / "west.npz", folder / "east.npz")
    return ("track", *files, "--scenario", folder / "stations.toml", *options)


def test_track_report_and_truth(folder: Path) -> None:
    ships = ["time_s,name,x_m,y_m", *(f"{t},target,{x},{y}" for t, (x, y) in zip(TIMES, place(TIMES), strict=True))]
    (folder / "ais.csv").write_text("\n".join(ships) + "\n")
    done = call(*track(folder, "--truth", folder / "ais.csv", "--out", folder / "out"))
    assert done.status == 0, done.err
    assert "1 tracks in 60 scans" in done.out
    assert "tracks of no ship: 0" in done.out
    assert {path.name for path in (folder / "out").iterdir()} == {
        *("result.zarr", "tracks.csv", "positions.csv", "scenario.toml", "versions.json", "report.html")
    }
    assert call("report", folder / "out", "--out", folder / "again.html").status == 0
    assert "Ships known to have been there" in (folder / "again.html").read_text()
    told = json.loads(call(*track(folder, "--json")).out)
    assert (told["scans"], told["full_scans"], len(told["tracks"])) == (60, 0, 1)


def refuse_stations(folder: Path, *options: object, names: tuple[str, ...]) -> None:
    refuse(folder, *track(folder, *options), names=names)


def test_files_that_are_no_records_of_the_stations(folder: Path) -> None:
    west, what = folder / "west.npz", folder / "stations.toml"
    refuse(folder, "track", west, "--scenario", what, names=("1 files for 2 stations (west, east)", "one for each"))
    refuse(folder, "track", west, folder / "no.npz", "--scenario", what, names=("no.npz does not exist",))
    refuse_stations(folder, "--band", 1, 2, names=("stations.toml has [stations]", "--band"))
    write_recording(folder / "a.wav", [np.zeros((100, 2))], 100.0)
    refuse(
        folder,
        *("track", west, folder / "a.wav", "--scenario", what),
        names=("a.wav is no record; expected array with the channels of station east",),
    )
    (folder / "a.csv").write_text("time_s,0,60,120\n0,1,2,3\n1,1,2,3\n")
    refuse(folder, "track", folder / "a.csv", names=("a.csv holds returns of a sonar or a record", "[[stations]]"))


@pytest.mark.parametrize(
    ("arrays", "names"),
    [
        ({"time": TIMES + 500}, ("west.npz has the times 0 to 59 s, the others together", "records that overlap")),
        ({"energy": np.full((60, 61), np.inf)}, ("east.npz: frame 0 of energy holds infinity",)),
        ({"energy": np.full((60, 61), 1e30)}, ("east.npz: energies lie beyond 1e+15",)),
        ({"bearing": BEARINGS - 90}, ("east.npz has bearings from -90 to 90 degrees", "0 to 180 from the axis")),
        ({"time": np.r_[TIMES[:59], 1e7]}, ("east.npz: row 59, at 10000000 s", "at most 100,000 intervals of 1 s")),
    ],
)
def test_records_that_are_wrong(folder: Path, arrays: dict[str, np.ndarray], names: tuple[str, ...]) -> None:
    content = {"energy": energies(1, TIMES), "time": TIMES, "bearing": BEARINGS} | arrays
    np.savez(folder / "east.npz", **content)
    refuse_stations(folder, names=names)


@pytest.mark.parametrize(
    ("old", "new", "names"),
    [
        ("cell = 50.0", "cell = -1.0", ("stations.toml: region.cell is -1.0",)),
        ("cell = 50.0", "cell = 0.05", ("west.npz and", "region: 2 detectors", "expected a larger cell")),
        ("speed = 6.0", "speed = 6000.0", ("region: targets move up to 6e+03 m between two scans",)),
        ("clock_offset = 0.0", "clock_offset = 100.0", ("others together", "records that overlap")),
        ('name = "west"', 'name = "west", start_time = "2016-01-12"', ("tells its start in UTC and", "start_time")),
        ('name = "west"', 'name = "west", beams_deg = [0.0, 180.0]', ("west.npz: the file tells its bearings",)),
        ('name = "west"', 'name = "west", file = "south.npz"', ("station west has the file south.npz",)),
    ],
)
def test_scenario_that_is_wrong(folder: Path, old: str, new: str, names: tuple[str, ...]) -> None:
    text = (folder / "stations.toml").read_text()
    assert old in text
    (folder / "stations.toml").write_text(text.replace(old, new, 1))
    refuse_stations(folder, names=names)


@pytest.mark.parametrize(
    ("text", "names"),
    [
        (None, ("path.csv does not exist",)),
        ("time_s,x_m,y_m\n0,1\n", ("path.csv, row 2: 2 values; expected 3",)),
        ("time_s,x_m\n0,1\n", ("path.csv: there is no column y_m",)),
        ("time_s,x_m,y_m,z_m\n0,1,2,3\n", ("path.csv: there is a column 'z_m' too many",)),
        ("time_s,x_m,y_m\n", ("path.csv: there is no row",)),
        ("time_s,x_m,y_m\n0,1,\n", ("path.csv, row 2: y_m is missing",)),
        ("time_s,x_m,y_m\n5,1,2\n5,1,2\n", ("path.csv, row 3: time_s is not after the row before",)),
        ("time_s,x_m,y_m\n0,1,2\n9,1,2\n", ("the path of west has the times 0 to 9 s; expected all",)),
        ("time_s,x_m,y_m\n0,1,2\n99,1,2\n", ("station west: the path has no heading_deg",)),
    ],
)
def test_paths_that_are_wrong(folder: Path, text: str | None, names: tuple[str, ...]) -> None:
    what = scenario(
        stations=[{"name": "west", "path": "path.csv"}, {"name": "east", "x": 0.0, "y": 0.0, "line": False}]
    )
    (folder / "stations.toml").write_text(to_toml(what))
    if text is not None:
        (folder / "path.csv").write_text(text)
    refuse_stations(folder, names=names)


@pytest.mark.parametrize(
    ("text", "names"),
    [
        (None, ("ais.csv does not exist",)),
        ("time,mmsi,latitude,longitude\n", ("ais.csv: there is no report",)),
        ("time,mmsi,latitude\n2016-01-12,1,50\n", ("ais.csv: there is no column longitude",)),
        ("mmsi,latitude,longitude\n1,50,-1\n", ("ais.csv: there is no column time_s",)),
        ("time,mmsi,latitude,longitude\nnoon,1,50,-1\n", ("ais.csv, row 2: time is 'noon'",)),
        ("time,mmsi,latitude,longitude\n2016-01-12,1,fifty,-1\n", ("ais.csv, row 2: latitude is 'fifty'",)),
        ("time,mmsi,latitude,longitude\n2016-01-12,1,50,-1\n", ("ais.csv has times in UTC", "start_time")),
        ("time_s,mmsi,latitude,longitude\n0,1,50,-1\n", ("ais.csv has latitude and longitude", "in degrees too")),
        ("time_s,name,x_m,y_m\n0,a,9e9,0\n", ("ais.csv: no ship was in the region",)),
    ],
)
def test_truth_that_is_wrong(folder: Path, text: str | None, names: tuple[str, ...]) -> None:
    if text is not None:
        (folder / "ais.csv").write_text(text)
    refuse_stations(folder, "--truth", folder / "ais.csv", names=names)


def test_truth_without_stations(folder: Path) -> None:
    (folder / "ais.csv").write_text("time_s,name,x_m,y_m\n0,a,0,0\n")
    refuse(
        folder,
        *("track", folder / "west.npz", "--truth", folder / "ais.csv"),
        names=("--truth", "ais.csv", "[[stations]]"),
    )
