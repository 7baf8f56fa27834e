"""Records, recordings and paths of the stations of a scenario, each from its file."""

from pathlib import Path

import numpy as np
import pytest

from faintrack.errors import InputError
from faintrack.io import write_recording
from faintrack.io.stations import open_stations, read_path
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
    (tmp_path / "towed.csv").write_text(PATH)
    return tmp_path


def test_a_recording_beside_a_record(folder: Path) -> None:
    what = scenario(stations=MIXED, analysis={"frame": 0.5, "band": [50.0, 400.0]})
    inputs = open_stations([folder / "towed.wav", folder / "east.npz"], what, folder)
    towed, east = inputs.records
    np.testing.assert_allclose(towed.times, 0.25 + 0.5 * np.arange(10))
    # Noise without direction has the mean 1; 350 bins and ten frames know it to a few hundredths.
    assert abs(float(towed.read(0, 10).mean()) - 1) < 0.1
    np.testing.assert_array_equal(east.times, np.arange(5.0))
    assert set(inputs.arrays) == {"towed"}
    assert np.degrees(np.arctan2(*inputs.arrays["towed"].axis[:2])) == pytest.approx(30.0)
    assert {name: values.tolist() for name, values in inputs.paths["towed"].items()} == {
        "x_m": [0.0, 100.0],
        "time_s": [0.0, 60.0],
        "y_m": [5.0, 5.0],
        "heading_deg": [90.0, 95.0],
    }


def test_files_in_another_order_are_named(folder: Path) -> None:
    named = [MIXED[0] | {"file": "towed.wav"}, MIXED[1] | {"file": "east.npz"}]
    inputs = open_stations([folder / "east.npz", folder / "towed.wav"], scenario(stations=named), folder)
    assert [Path(record.source).name for record in inputs.records] == ["towed.wav", "east.npz"]


def test_channels_that_are_not_the_arrays(folder: Path) -> None:
    stations = [MIXED[0] | {"array": {"line": {"count": 5, "spacing": 1.5}}}, MIXED[1]]
    with pytest.raises(InputError, match=r"towed.wav.* 4 channels"):
        open_stations([folder / "towed.wav", folder / "east.npz"], scenario(stations=stations), folder)
    stations = [MIXED[0], MIXED[1] | {"heading_deg": None, "array": {"line": {"count": 5, "spacing": 1.5}}}]
    with pytest.raises(InputError, match=r"east.npz is a record; expected a recording for station east"):
        open_stations([folder / "towed.wav", folder / "east.npz"], scenario(stations=stations), folder)


def test_a_path_in_degrees(tmp_path: Path) -> None:
    path = tmp_path / "path.csv"
    path.write_text("time_s,latitude_deg,longitude_deg\n0,50.7,-1.2\n")
    assert read_path(path, degrees=True)["latitude_deg"].tolist() == [50.7]
    with pytest.raises(InputError, match="there is no column x_m"):
        read_path(path)
