"""Tracks of several arrays beside ships whose places are known."""

from pathlib import Path

import numpy as np
import pytest

import faintrack as ft
from faintrack.kinds.records.data import from_records
from faintrack.results.truth import findings, unexplained
from tests.stations import distance, place, records, scenario, tables

TIMES = np.arange(-10.0, 80.0, 7.0)
HEAD = "time_s,name,x_m,y_m"


def write_ships(path: Path, *rows: tuple[str, float, np.ndarray], head: str = HEAD) -> Path:
    """File of reports: name, time, place."""
    lines = [f"{time},{name},{x},{y}" for name, time, (x, y) in rows]
    path.write_text("\n".join([head, *lines]) + "\n", encoding="utf-8")
    return path


def reports(name: str, away: tuple[float, float] = (0.0, 0.0)) -> list[tuple[str, float, np.ndarray]]:
    """Of a ship that goes as the target does, so far away."""
    return [(name, float(time), where + np.array(away)) for time, where in zip(TIMES, place(TIMES), strict=True)]


def tracked(path: Path) -> ft.Result:
    return ft.track(from_records(records()), scenario(), truth=path)


def test_a_track_belongs_to_the_ship_that_is_near(tmp_path: Path) -> None:
    ships = (*reports("target"), *reports("another", (300.0, 100.0)), *reports("elsewhere", (9000.0, 0.0)))
    result = tracked(write_ships(tmp_path / "ais.csv", *ships))
    data = result.data
    by_name = {one.name: one for one in findings(data)}
    found, missed = by_name["target"], by_name["another"]
    np.testing.assert_allclose(
        data.truth_x.sel(known="target") if "known" in data.indexes else data.truth_x[:, 0],
        place(np.arange(60.0))[:, 0],
        rtol=1e-6,
    )
    assert (found.tracks, found.from_s, found.to_s) == ((1,), 0.0, 59.0)
    assert found.declared_s == result.tracks[0].start_s
    assert found.rmse == pytest.approx(np.sqrt(np.mean(distance(data) ** 2)), rel=1e-4)
    assert found.followed == 1.0
    assert (missed.declared_s, missed.tracks, missed.followed) == (None, (), 0.0)
    # Outside the region it is not looked for.
    assert np.isnan(by_name["elsewhere"].from_s)
    assert data.attrs["truth_within"] == 150.0
    assert unexplained(data) == []
    assert unexplained(data.assign(truth_x=data.truth_x + 500)) == [1]
    result.plot()


def test_ships_are_not_invented_between_reports_far_apart(tmp_path: Path) -> None:
    rows = [("moored", time, np.array([0.0, 500.0])) for time in (0.0, 20.0, 900.0)]
    data = tracked(write_ships(tmp_path / "ais.csv", *rows)).data
    np.testing.assert_array_equal(np.isfinite(data.truth_x.values[:, 0]), np.arange(60) <= 20)


def test_the_targets_of_a_simulation_are_a_truth() -> None:
    target = {"x": -300.0, "y": 500.0, "vx": 4.0, "vy": 2.0, "start": 10.0}
    what = scenario(simulation={"scans": 60, "beam_deg": 3.0, "targets": [target]})
    data = ft.track(ft.simulate(what), what, truth=what).data
    (found,) = findings(data)
    assert (found.from_s, found.to_s) == (10.0, 59.0)
    assert found.tracks
    assert unexplained(data) == []


@pytest.mark.slow
def test_a_region_in_degrees_has_tracks_on_earth(tmp_path: Path) -> None:
    """Places of targets are from its middle, and ships are where they are reported."""
    pytest.importorskip("pyproj")
    stations = [
        {"name": name, "latitude": 50.7, "longitude": longitude, "heading_deg": 90.0, "start_time": "2016-01-12T13:02Z"}
        for name, longitude in (("west", -1.205), ("east", -1.195))
    ]
    region = {"x": None, "y": None, "latitude": [50.703, 50.709], "longitude": [-1.207, -1.193]}
    target = {"x": -200.0, "y": -50.0, "vx": 4.0, "vy": 1.0}
    sections = tables(stations=stations, region=region, simulation={"scans": 60, "beam_deg": 3.0, "targets": [target]})
    what = ft.Scenario(**sections)
    head, path = "time,name,latitude,longitude", tmp_path / "ais.csv"
    path.write_text(f"{head}\n2016-01-12T13:02:00Z,a,50.706,-1.2\n2016-01-12T13:03:00Z,a,50.706,-1.2\n")
    result = ft.track(ft.simulate(what), what, truth=path, out=tmp_path / "out")
    assert result.tracks
    # A degree is 111.25 km along the meridian there, and 70.6 km along the parallel; 0.2 m and 0.4 m.
    for track in result.tracks:
        np.testing.assert_allclose(track.earth["latitude"], 50.706 + track.mean["y"] / 111250, atol=2e-6)
        np.testing.assert_allclose(track.earth["longitude"], -1.2 + track.mean["x"] / 70600, atol=5e-6)
    np.testing.assert_allclose(result.data.truth_x, 0, atol=0.1)
    assert result.data.attrs["start_time"].startswith("2016-01-12T13:02:00")
    assert (tmp_path / "out" / "tracks.geojson").exists()


@pytest.mark.parametrize(
    ("head", "row", "expected"),
    [
        ("time,mmsi,latitude,longitude", "2016-01-12,1,50,-1", "ais.csv has times in UTC"),
        ("time_s,mmsi,latitude,longitude", "0,1,50,-1", "ais.csv has latitude and longitude"),
        (HEAD, "0,a,9e9,0", "ais.csv: no target was where tracks are looked for"),
    ],
)
def test_ships_that_cannot_be_laid_over(tmp_path: Path, head: str, row: str, expected: str) -> None:
    (tmp_path / "ais.csv").write_text(f"{head}\n{row}\n", encoding="utf-8")
    with pytest.raises(ft.InputError) as caught:
        tracked(tmp_path / "ais.csv")
    assert expected in str(caught.value)
