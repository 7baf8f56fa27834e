"""Several sources that one array hears, from its record to files and report, and what does not fit."""

import csv
import shutil
from pathlib import Path

import numpy as np
import pytest

import faintrack as ft
from faintrack.errors import InputError
from faintrack.results.tables import to_stonesoup
from tests.kinds.refusing import refuse

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
    (folder / "ring.toml").write_text(SCENARIO, encoding="utf-8")
    ft.track(folder / "ring.npz", folder / "ring.toml", out=folder / "out")
    return folder


@pytest.fixture(scope="module")
def result(folder: Path) -> ft.Result:
    return ft.read_result(folder / "out")


@pytest.mark.parametrize("label", PATHS)
def test_each_source_is_one_track_to_the_end(result: ft.Result, label: int) -> None:
    """Through the place where both cross, and through north. Within a beam."""
    assert len(result.tracks) == 2
    track = result.track(label)
    assert APPEARS[label] < track.start_s < APPEARS[label] + 20
    assert track.end_s == TIMES[-1]
    off = (track.mean["bearing"] - np.interp(track.time, TIMES, PATHS[label]) + 180) % 360 - 180
    assert np.abs(off).max() < 6


def test_a_track_turns_the_shorter_way(result: ft.Result) -> None:
    """From 330 degrees through north: 0.6 degrees a second."""
    first = result.track(1)
    # Bearings from north are -180 to 180, also where beams are counted from 0 to 360.
    assert -60 < first.mean["bearing"][0] < 0
    assert 0 < first.mean["bearing"][-1] < 40
    assert abs(first.speed - 0.6) < 0.1


def test_every_variable_has_a_unit_and_a_name(result: ft.Result) -> None:
    for name, variable in result.data.data_vars.items():
        assert {"units", "long_name"} <= set(variable.attrs), name
    assert result.data.bearing.dims == result.data.bearing_rate.dims == ("time", "slot")
    assert result.data.covariance.shape == (80, 3, 2, 2)
    assert result.data.component.values.tolist() == ["bearing", "bearing_rate"]
    assert result.data.bearing.attrs["reference"] == "clockwise from north"


def test_files(folder: Path, result: ft.Result) -> None:
    assert {path.name for path in (folder / "out").iterdir()} == {
        *("result.zarr", "tracks.csv", "states.csv", "scenario.toml", "about.json", "report.html")
    }
    with (folder / "out" / "states.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == (result.data.label > 0).sum()
    assert list(rows[0]) == [
        *("time_s", "label", "existence"),
        *("bearing_deg", "bearing_deg_std", "bearing_rate_deg_s", "bearing_rate_deg_s_std"),
    ]
    text = (folder / "out" / "report.html").read_text(encoding="utf-8")
    assert "of 240 x 7 cells, up to 1 degrees a second" in text


def test_tracks_of_stone_soup_are_in_radians(result: ft.Result) -> None:
    pytest.importorskip("stonesoup")
    first = result.track(1)
    track, _ = to_stonesoup(result.tracks)
    means = [first.mean["bearing"][-1], first.mean["bearing_rate"][-1]]
    np.testing.assert_allclose(np.asarray(track.states[-1].state_vector, float).ravel(), np.radians(means), rtol=1e-6)


def test_a_single_file_and_a_rate_that_fits(folder: Path) -> None:
    ring = folder / "ring.npz"
    refuse(folder, [ring, ring], folder / "ring.toml", names=("there are 2 files for 1 stations (ring)",))
    (folder / "fast.toml").write_text(
        SCENARIO.replace("bearing_rate_deg = 1.0", "bearing_rate_deg = 200.0"), encoding="utf-8"
    )
    names = ("ring.npz: target.bearing_rate_deg: targets turn up to 200 degrees between two scans", "180 degrees")
    refuse(folder, ring, folder / "fast.toml", names=names)


def test_results_that_are_damaged(folder: Path, tmp_path: Path) -> None:
    shutil.copytree(folder / "out", tmp_path / "out")
    shutil.rmtree(tmp_path / "out" / "result.zarr" / "bearing")
    with pytest.raises(InputError, match=r"out is damaged or incomplete \(bearing is missing in result.zarr\)"):
        ft.read_result(tmp_path / "out")
    (tmp_path / "out" / "about.json").write_text("{", encoding="utf-8")
    with pytest.raises(InputError, match="out is damaged or incomplete"):
        ft.read_result(tmp_path / "out")


def test_sources_are_drawn_from_the_model() -> None:
    """The beam of a source, and no other, has the mean of one: 4 standard errors of 400 and of 23600 values."""
    sections = {
        "stations": [{"name": "ring", "line": False}],
        "energies": {"present": [3.5, 1.0]},
        "simulation": {"scans": 400, "beam_deg": 6.0, "sources": [{"bearing_deg": 90.0}]},
    }
    (record,) = ft.simulate(sections).records
    energy = record.read(0, 400)
    assert abs(energy[:, 15].mean() - 3.5) < 4 / np.sqrt(400)
    assert abs(np.delete(energy, 15, axis=1).mean()) < 4 / np.sqrt(400 * 59)
    with pytest.raises(InputError, match=r"simulation.targets are of a region, and there is none"):
        ft.simulate(sections, simulation={"targets": [{"x": 3.0, "y": 3.0}]})
