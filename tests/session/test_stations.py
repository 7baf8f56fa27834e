"""Records of several arrays through detectors and trackers to a result, its files, and tracks of other programs."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from faintrack.data.recording import from_samples
from faintrack.data.records import in_step
from faintrack.errors import InputError
from faintrack.io.results import read_result, result_folder, write_result
from faintrack.io.tracks import to_stonesoup, write_geojson
from faintrack.kinds.session_stations import beamformed, track_record_blocks, track_records
from faintrack.kinds.truth_ships import Ship, beside, ships_dataset, sightings, unexplained
from faintrack.plots.report import report
from faintrack.results.result import Result
from faintrack.results.stations import each_target
from faintrack.scenario.model import Scenario
from faintrack.sensors.array import line_array
from tests.stations import distance, place, record, records, scenario, tree_equal


@pytest.fixture(scope="module")
def result() -> Result:
    return track_records(records(), scenario())


def test_the_target_is_found_where_it_is(result: Result) -> None:
    (track,) = result.tracks
    assert track.label == 1
    assert track.end_s == 59.0
    # Beams of 3 degrees are 30 m wide there, and many scans are better than one.
    assert np.sqrt(np.mean(distance(result.data)[-20:] ** 2)) < 20
    assert result.kind == "records"
    assert result.summary()["scans"] == 60
    assert result.summary()["full_scans"] == 0


def test_every_variable_has_a_unit_and_a_name(result: Result) -> None:
    for name, variable in result.data.data_vars.items():
        assert {"units", "long_name"} <= set(variable.attrs), name
    assert result.data.detection.dims == ("time", "detector")
    assert result.data.covariance.dims == ("time", "slot", "component", "other")
    np.testing.assert_array_equal(result.data.time, np.arange(60.0))


def test_covariance_tells_how_far_off_it_is(result: Result) -> None:
    ((_, mine),) = each_target(result.data, "x", "y", "covariance")
    off = np.stack([mine["x"], mine["y"]], axis=-1) - place(mine["time"])
    squared = np.einsum("ti,tij,tj->t", off, np.linalg.inv(mine["covariance"][:, :2, :2]), off)
    # Two degrees of freedom: a mean of 2. Scans of one track are dependent, so that only gross errors are seen.
    assert squared.mean() < 10


def test_slots_without_a_target_say_nothing(result: Result) -> None:
    free = result.data.existence.values == 0
    assert free.any()
    assert np.isnan(result.data.x.values[free]).all()
    assert (result.data.label.values[free] == 0).all()


def test_blocks_of_any_size_say_the_same(result: Result) -> None:
    """A last block that is not full, and records that end within a block."""
    west, east = (record(one.read(0, 45), one.times[:45], one.source) for one in records())
    short = track_records((west, east), scenario())
    for name in ("existence", "label", "x", "detection"):
        np.testing.assert_array_equal(short.data[name], result.data[name][:45])


def test_silent_arrays_are_scans_that_say_nothing(result: Result) -> None:
    west, east = records()
    there = np.r_[0:20, 40:60]
    some = record(east.read(0, 60)[there], east.times[there], "east.npz")
    values = west.read(0, 60).copy()
    values[25:30] = np.nan
    gaps = track_records((record(values, west.times, "west.npz"), some), scenario())
    missing = gaps.data.record.isnull().all("beam").values
    assert missing[20:40, 1].all()
    assert missing[25:30, 0].all()
    assert missing.sum() == 25
    # When both arrays are silent what is known of the detectors hardly changes; the target is there afterwards.
    assert np.abs(np.diff(gaps.data.detection.values[26:30], axis=0)).max() < 0.05
    assert np.sqrt(np.mean(distance(gaps.data)[-10:] ** 2)) < 30


def test_result_folder_and_report(result: Result, tmp_path: Path) -> None:
    what = scenario()
    with result_folder(tmp_path / "out") as folder:
        write_result(folder, track_record_blocks(records(), what, {}, {}), what, None)
    back = read_result(tmp_path / "out")
    assert back.scenario == what
    assert back.kind == "records"
    assert [track.as_dict() for track in back.tracks] == [track.as_dict() for track in result.tracks]
    with (tmp_path / "out" / "positions.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == int((result.data.label > 0).sum())
    ((_, mine),) = each_target(result.data, "x", "covariance")
    np.testing.assert_allclose([float(row["x_m"]) for row in rows], mine["x"], rtol=1e-6)
    np.testing.assert_allclose([float(row["y_std_m"]) ** 2 for row in rows], mine["covariance"][:, 1, 1], rtol=1e-5)
    assert not (tmp_path / "out" / "tracks.geojson").exists()
    page = report(back)
    for told in ("Map, records, detection", "west.npz and east.npz", "2 of 14 x 16 x 3 x 3 cells", "1 track"):
        assert told in page


def test_geojson_of_tracks(result: Result, tmp_path: Path) -> None:
    x, y = (result.data[name].astype(float) for name in ("x", "y"))
    degrees = {"latitude": 50 + y / 111e3, "longitude": -1 + x / 71e3}
    data = result.data.assign(degrees).assign_attrs(start_time="2016-01-12T13:02:11.500000000Z")
    write_geojson(tmp_path / "tracks.geojson", data)
    content = json.loads((tmp_path / "tracks.geojson").read_text())
    (feature,) = content["features"]
    (track,) = result.tracks
    assert feature["geometry"]["type"] == "LineString"
    longitude, latitude = feature["geometry"]["coordinates"][-1]
    assert (longitude, latitude) == pytest.approx((-1 + track.end["x"] / 71e3, 50 + track.end["y"] / 111e3), abs=1e-6)
    assert feature["properties"]["coordTimes"][-1] == "2016-01-12T13:03:10.500Z"
    assert len(feature["properties"]["coordTimes"]) == len(feature["geometry"]["coordinates"])
    assert feature["properties"]["label"] == 1


def test_tracks_of_stone_soup(result: Result) -> None:
    pytest.importorskip("stonesoup")
    (track,) = to_stonesoup(result)
    ((_, mine),) = each_target(result.data, "x", "vx", "y", "vy", "covariance")
    state = track.states[-1]
    np.testing.assert_allclose(state.state_vector.ravel(), [mine[name][-1] for name in ("x", "vx", "y", "vy")])
    np.testing.assert_allclose(state.covar[0, 2], mine["covariance"][-1, 0, 1])
    np.testing.assert_allclose(state.covar[1, 1], mine["covariance"][-1, 2, 2])
    assert (track.states[-1].timestamp - track.states[0].timestamp).total_seconds() == mine["time"][-1] - mine["time"][
        0
    ]
    assert track.id == "1"


class TestShips:
    TIMES = np.arange(-10.0, 80.0, 7.0)

    def ships(self) -> list[Ship]:
        there = place(self.TIMES)
        return [
            Ship("target", self.TIMES, False, there, False),
            Ship("another", self.TIMES, False, there + np.array([300.0, 100.0]), False),
            Ship("elsewhere", self.TIMES, False, there + np.array([9000.0, 0.0]), False),
        ]

    def test_a_track_belongs_to_the_ship_that_is_near(self, result: Result) -> None:
        truth = ships_dataset(self.ships(), in_step(records()), scenario())
        assert truth.ship.values.tolist() == ["target", "another"]
        np.testing.assert_allclose(truth.truth_x.values[:, 0], place(np.arange(60.0))[:, 0], rtol=1e-6)
        parts = [result.data.isel(time=slice(0, 32)), result.data.isel(time=slice(32, 60))]
        data = xr.concat(list(beside(parts, truth)), "time", data_vars="minimal")
        found, missed = sightings(data, 50.0)
        assert (found.ship, found.tracks, found.from_s, found.to_s) == ("target", (1,), 0.0, 59.0)
        assert found.declared_s == result.tracks[0].start_s
        assert found.rmse_m == pytest.approx(np.sqrt(np.mean(distance(result.data) ** 2)), rel=1e-4)
        assert found.followed == 1.0
        assert (missed.declared_s, missed.tracks, missed.followed) == (None, (), 0.0)
        assert unexplained(data, 50.0) == []
        assert unexplained(data.assign(truth_x=data.truth_x + 500), 50.0) == [1]
        page = report(Result(data, result.tracks, result.scenario, None, 1.0))
        assert "Ships known to have been there" in page
        assert "never within 150 m of a ship: none" in page

    def test_ships_are_not_invented_between_reports_far_apart(self) -> None:
        ship = Ship("moored", np.array([0.0, 20.0, 900.0]), False, np.tile([0.0, 500.0], (3, 1)), False)
        truth = ships_dataset([ship], in_step(records()), scenario())
        np.testing.assert_array_equal(np.isfinite(truth.truth_x.values[:, 0]), np.arange(60) <= 20)

    def test_a_report_where_no_ship_could_be_is_passed_over(self) -> None:
        places = np.array([[0.0, 500.0], [0.0, 500.0], [9e6, 500.0], [0.0, 500.0], [0.0, 500.0]])
        ship = Ship("moored", np.arange(0.0, 75.0, 15.0), False, places, False)
        truth = ships_dataset([ship], in_step(records()), scenario())
        there = np.isfinite(truth.truth_x.values[:, 0])
        np.testing.assert_array_equal(there, (np.arange(60) <= 15) | (np.arange(60) > 45))

    @pytest.mark.parametrize(
        ("changes", "expected"),
        [
            ({"utc": True}, "ais.csv has times in UTC and the records do not tell when they start"),
            ({"degrees": True}, "ais.csv has latitude and longitude; expected the region in degrees too"),
            ({"places": np.zeros((2, 2))}, "ais.csv: no ship was in the region during the records"),
        ],
    )
    def test_ships_that_cannot_be_laid_over(self, changes: dict, expected: str) -> None:
        fields = {"utc": False, "degrees": False, "places": np.full((2, 2), 500.0)} | changes
        ship = Ship("ship", np.array([0.0, 60.0]), **fields)
        with pytest.raises(InputError) as caught:
            ships_dataset([ship], in_step(records()), scenario(), "ais.csv")
        assert expected in str(caught.value)


def test_recordings_become_records() -> None:
    """What comes from broadside is loudest there; blocks are pieces of the whole; frames with gaps are not measured."""
    rate, count = 1000.0, 40
    rng, length = np.random.default_rng(0), int(rate) * count // 10
    samples = (rng.normal(size=(length, 1)) + 0.1 * rng.normal(size=(length, 8))).astype(np.float32)
    samples[250] = np.nan
    what = Scenario.model_validate({"analysis": {"frame": 0.1, "band": [200.0, 400.0], "beams": 19}})
    beams = beamformed(from_samples(samples, rate), line_array(8, 2.0), what)
    np.testing.assert_allclose(beams.times, 0.05 + 0.1 * np.arange(count))
    whole = beams.read(0, count)
    assert np.isnan(whole[2]).all()
    assert set(np.delete(whole, 2, axis=0).argmax(axis=1)) == {9}
    np.testing.assert_array_equal(np.concatenate([beams.read(0, 33), beams.read(33, 40)]), whole)
    assert tree_equal(beams.read(5, 7), whole[5:7])
