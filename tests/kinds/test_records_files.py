"""Records, recordings and paths of the stations of a scenario, each from its file."""

from pathlib import Path

import numpy as np
import pytest

import faintrack as ft
from faintrack.data.recording import Recording
from faintrack.errors import InputError
from faintrack.io.write_recordings import write_recording
from faintrack.kinds.records.read import read, read_path
from faintrack.kinds.records.together import arrays_of, paths_of, put_together
from tests.stations import BEARINGS, energies, scenario

MIXED = [
    {"name": "towed", "path": "towed.csv", "array": {"line": {"count": 4, "spacing": 1.5, "heading_deg": 30.0}}},
    {"name": "east", "x": 400.0, "y": 0.0, "heading_deg": 90.0},
]
PATH = "x_m,time_s,y_m,heading_deg\n0,0,5,90\n100,60,5,95\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    np.savez(tmp_path / "east.npz", energy=energies(1, np.arange(5.0)), time=np.arange(5.0), bearing=BEARINGS)
    samples = np.random.default_rng(0).normal(size=(5000, 4)).astype(np.float32)
    write_recording(tmp_path / "towed.wav", [samples], 1000.0)
    (tmp_path / "towed.csv").write_text(PATH, encoding="utf-8")
    return tmp_path


def test_a_recording_beside_a_record(folder: Path) -> None:
    stations = [MIXED[0] | {"path": str(folder / "towed.csv")}, MIXED[1]]
    what = scenario(stations=stations, analysis={"frame": 0.5, "band": [50.0, 400.0]})
    data = read((folder / "towed.wav", folder / "east.npz"), what)
    arrays, _ = arrays_of(data, what)
    towed, east = put_together(data, what, arrays).records
    np.testing.assert_allclose(towed.times, 0.25 + 0.5 * np.arange(10))
    # Noise without direction has the mean 1; 350 bins and ten frames know it to a few hundredths.
    assert abs(float(towed.read(0, 10).mean()) - 1) < 0.1
    np.testing.assert_array_equal(east.times, np.arange(5.0))
    assert set(arrays) == {"towed"}
    assert np.degrees(np.arctan2(*arrays["towed"].axis[:2])) == pytest.approx(30.0)
    assert {name: values.tolist() for name, values in paths_of(data, what)["towed"].items()} == {
        "x_m": [0.0, 100.0],
        "time_s": [0.0, 60.0],
        "y_m": [5.0, 5.0],
        "heading_deg": [90.0, 95.0],
    }


def test_files_in_another_order_are_named(folder: Path) -> None:
    named = [MIXED[0] | {"file": "towed.wav"}, MIXED[1] | {"file": "east.npz"}]
    data = read((folder / "east.npz", folder / "towed.wav"), scenario(stations=named))
    assert [Path(record.source).name for record in data.records] == ["towed.wav", "east.npz"]
    assert isinstance(data.records[0], Recording)


def test_channels_that_are_not_the_arrays(folder: Path) -> None:
    files = (folder / "towed.wav", folder / "east.npz")
    wrong = scenario(stations=[MIXED[0] | {"array": {"line": {"count": 5, "spacing": 1.5}}}, MIXED[1]])
    with pytest.raises(InputError, match=r"towed.wav.* 4 channels"):
        arrays_of(read(files, wrong), wrong)
    stations = [MIXED[0], MIXED[1] | {"heading_deg": None, "array": {"line": {"count": 5, "spacing": 1.5}}}]
    with pytest.raises(InputError, match=r"east.npz is a record; expected a recording for station east"):
        read(files, scenario(stations=stations))


def test_a_path_in_degrees(tmp_path: Path) -> None:
    path = tmp_path / "path.csv"
    path.write_text("time_s,latitude_deg,longitude_deg\n0,50.7,-1.2\n", encoding="utf-8")
    assert read_path(path, degrees=True)["latitude_deg"].tolist() == [50.7]
    with pytest.raises(InputError, match="there is no column x_m"):
        read_path(path)


def test_paths_are_relative_to_the_scenario(folder: Path) -> None:
    scenario(stations=MIXED).save(folder / "stations.toml")
    assert ft.Scenario.read(folder / "stations.toml").stations[0].path == str((folder / "towed.csv").resolve())


def test_records_are_known_by_what_is_in_them(folder: Path) -> None:
    """CSV whose columns are bearings, npz with an axis of them."""
    (folder / "a.csv").write_text("time_s,0,60,120\n0,1,2,3\n1,1,2,3\n", encoding="utf-8")
    told = ft.info(folder / "a.csv")
    assert told.kind == "records"
    assert "3 beams from 0 to 120 degrees" in str(told)
    assert ft.info(folder / "east.npz").facts["holds"] == "records of one array"
