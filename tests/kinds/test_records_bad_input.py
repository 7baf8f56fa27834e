"""Records and scenarios that do not fit: one sentence that names file and field, nothing written."""

from pathlib import Path

import numpy as np
import pytest

import faintrack as ft
from faintrack.data.sequence import from_frames
from faintrack.io.write_recordings import write_recording
from faintrack.kinds.records.data import from_records
from tests.kinds.refusing import refuse
from tests.stations import BEARINGS, energies, records, scenario, tables

TIMES = np.arange(60.0)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Folder with good records and a good scenario."""
    for number, name in enumerate(("west", "east")):
        np.savez(tmp_path / f"{name}.npz", energy=energies(number, TIMES), time=TIMES, bearing=BEARINGS)
    scenario().save(tmp_path / "stations.toml")
    return tmp_path


def refuse_stations(folder: Path, names: tuple[str, ...]) -> None:
    refuse(folder, [folder / "west.npz", folder / "east.npz"], folder / "stations.toml", names)


def test_files_that_are_no_records_of_the_stations(folder: Path) -> None:
    west, what = folder / "west.npz", folder / "stations.toml"
    refuse(folder, west, what, ("1 files for 2 stations (west, east)", "one for each"))
    refuse(folder, [west, folder / "no.npz"], what, ("no.npz does not exist",))
    write_recording(folder / "a.wav", [np.zeros((100, 2))], 100.0)
    refuse(folder, [west, folder / "a.wav"], what, ("a.wav is no record; expected array", "of station east"))
    (folder / "a.csv").write_text("time_s,0,60,120\n0,1,2,3\n1,1,2,3\n", encoding="utf-8")
    refuse(folder, folder / "a.csv", None, ("stations is missing", "a.csv was taken for records"))


@pytest.mark.parametrize(
    ("given", "names"),
    [
        ((), ("there are no records",)),
        ((np.zeros((9, 61)),), ("record 0 is a ndarray; expected a Sequence",)),
        ((from_frames(np.zeros((9, 61))),), ("record 0 has the axes range; expected bearing alone",)),
    ],
)
def test_data_in_memory_that_are_no_records(given: tuple, names: tuple[str, ...]) -> None:
    with pytest.raises(ft.InputError) as caught:
        from_records(given)
    for name in names:
        assert name in str(caught.value)


def test_records_in_memory_that_are_not_the_stations() -> None:
    with pytest.raises(ft.InputError, match=r"1 records for 2 stations \(west, east\); expected one for each"):
        ft.track(from_records(records()[:1]), scenario())
    samples = ft.from_samples(np.zeros((100, 2)), 100.0)
    with pytest.raises(ft.InputError, match="is a recording; expected array with the channels of station east"):
        ft.track(from_records([records()[0], samples]), scenario())


@pytest.mark.parametrize(
    ("changes", "names"),
    [
        ({}, ("no [simulation]",)),
        (
            {"simulation": {"scans": 9, "sources": [{"bearing_deg": 3.0}]}},
            ("simulation.sources", "targets in a region"),
        ),
        (
            {"simulation": {"scans": 9, "targets": [{"x": 0.0, "y": 500.0, "start": 5.0, "end": 4.0}]}},
            ("simulation.targets[0]", "end is 4 s: expected more than start, 5 s"),
        ),
        (
            {
                "simulation": {"scans": 9},
                "stations": [{"name": "a", "x": 0.0, "y": 0.0, "heading_deg": 90.0, "beams_deg": [0.0, 90.0]}],
            },
            ("station a has beams_deg",),
        ),
    ],
)
def test_simulations_that_cannot_be_drawn(changes: dict, names: tuple[str, ...]) -> None:
    with pytest.raises(ft.InputError) as caught:
        ft.simulate(tables(**changes))
    for name in names:
        assert name in str(caught.value)


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
    refuse_stations(folder, names)


@pytest.mark.parametrize(
    ("old", "new", "names"),
    [
        ("cell = 50.0", "cell = -1.0", ("stations.toml: region.cell is -1.0",)),
        ("cell = 50.0", "cell = 0.05", ("west.npz and", "2 detectors of", "expected a larger cell")),
        ("speed = 6.0", "speed = 6000.0", ("region: targets move up to 6e+03 m between two scans",)),
        ("clock_offset = 0.0", "clock_offset = 100.0", ("others together", "records that overlap")),
        ('name = "west"', 'name = "west", start_time = "2016-01-12"', ("tells its start in UTC and", "start_time")),
        ('name = "west"', 'name = "west", beams_deg = [0.0, 180.0]', ("west.npz: the file tells its bearings",)),
        ('name = "west"', 'name = "west", file = "south.npz"', ("station west has the file south.npz",)),
    ],
)
def test_scenario_that_is_wrong(folder: Path, old: str, new: str, names: tuple[str, ...]) -> None:
    text = (folder / "stations.toml").read_text(encoding="utf-8")
    assert old in text
    (folder / "stations.toml").write_text(text.replace(old, new, 1), encoding="utf-8")
    refuse_stations(folder, names)


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
    what.save(folder / "stations.toml")
    if text is not None:
        (folder / "path.csv").write_text(text, encoding="utf-8")
    refuse_stations(folder, names)
