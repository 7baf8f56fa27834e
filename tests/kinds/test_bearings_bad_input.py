"""Bearings and scenarios that do not fit: one sentence that names file and field, nothing written."""

from pathlib import Path

import pytest

from tests.bearings import SCENARIO
from tests.kinds.refusing import refuse

BEARINGS = "time_s,bearing_deg,observer_x_m,observer_y_m\n0,90,0,0\n1,90,10,0\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Folder with good bearings and a good scenario."""
    (tmp_path / "bearings.csv").write_text(BEARINGS, encoding="utf-8")
    (tmp_path / "scenario.toml").write_text(SCENARIO, encoding="utf-8")
    return tmp_path


def refuse_bearings(folder: Path, names: tuple[str, ...]) -> None:
    refuse(folder, folder / "bearings.csv", folder / "scenario.toml", names)


@pytest.mark.parametrize(
    ("old", "new", "names"),
    [
        ("error_deg = 1.0", "error_deg = 0.0", ("bearings.error_deg is 0.0",)),
        ("error_deg = 1.0", "", ("bearings.error_deg is missing",)),
        ("detection_probability = 0.9", "detection_probability = 1.5", ("bearings.detection_probability is 1.5",)),
        ("false_per_scan = 3.0", "false_per_scan = 0.0", ("bearings.false_per_scan is 0.0",)),
        ("capacity = 24", "capacity = 0", ("bearings.capacity is 0",)),
        ("capacity = 24", "sector_deg = [30.0, 390.0]", ("sector_deg goes from 30 to 390 degrees",)),
        ("capacity = 24", "sector_deg = [30.0, 30.0]", ("sector_deg goes from 30 to 30 degrees",)),
        ("capacity = 24", "clutter = 3", ("no field bearings.clutter",)),
        ("range = [200.0, 3000.0]", "", ("either range, or x and y",)),
        ("range = [200.0, 3000.0]", "x = [0.0, 1.0]", ("either range, or x and y",)),
        ("range = [200.0, 3000.0]", "range = [3000.0, 200.0]", ("range goes from 3000 to 200 m",)),
        ("range = [200.0, 3000.0]", "range = [-5.0, 200.0]", ("range begins at -5 m",)),
        ("[filter]", '[filter]\nkind = "grid"', ("no field filter.kind", "particles")),
        ("[filter]", '[tracker]\nmethod = "cfar"\n[filter]', ("no field tracker.method",)),
        ("[filter]", "[frames]\n[filter]", ("[bearings] is of bearings", "[frames] of frames")),
        ("[target]", "[target]\nspeed = 3.0", ("no field target.speed",)),
        ("[filter]", "[simulation]\nscans = 9\n[filter]", ("simulation.observers is missing",)),
        ("[filter]", "[simulation]\nscans = 9\nobservers = []\n[filter]", ("simulation.observers", "1 or more")),
        (
            "[filter]",
            "[simulation]\nscans = 9\nobservers = [{path = [[5, 0, 0], [5, 9, 9]]}]\n[filter]",
            ("simulation.observers[0]", "5 s after one at 5 s", "ascending"),
        ),
    ],
)
def test_scenario_that_is_wrong(folder: Path, old: str, new: str, names: tuple[str, ...]) -> None:
    assert old in SCENARIO
    (folder / "scenario.toml").write_text(SCENARIO.replace(old, new), encoding="utf-8")
    refuse_bearings(folder, ("scenario.toml", *names))


@pytest.mark.parametrize(
    ("rows", "names"),
    [
        ("0.5,90,20,0\n", ("row 4: time_s is 0.5", "ascending")),
        ("2,ninety,20,0\n", ("row 4: bearing_deg is 'ninety'",)),
        (
            "".join(f"2,{bearing},0,0\n" for bearing in range(25)),
            ("time_s 2 has 25 bearings of one observer", "bearings.capacity, 24"),
        ),
    ],
)
def test_bearings_that_are_wrong(folder: Path, rows: str, names: tuple[str, ...]) -> None:
    (folder / "bearings.csv").write_text(BEARINGS + rows, encoding="utf-8")
    refuse_bearings(folder, ("bearings.csv", *names))


def test_bearings_without_what_they_need(folder: Path) -> None:
    path = folder / "bearings.csv"
    refuse(folder, path, None, ("bearings.csv", "--scenario", "[bearings]"))
    refuse(folder, [path, path], folder / "scenario.toml", ("2 files", "one file"))
