"""Records of several arrays through detectors and trackers to a result, its files, and tracks of other programs."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

import faintrack as ft
from faintrack.data.recording import from_samples
from faintrack.kinds.door import read_result
from faintrack.kinds.records.data import from_records
from faintrack.kinds.records.sections import RecordsScenario
from faintrack.kinds.records.simulate import silence
from faintrack.kinds.records.together import beamformed
from faintrack.results.report import report
from faintrack.results.result import Result
from faintrack.results.tables import to_stonesoup, write_geojson
from faintrack.sensors.array import line_array
from tests.stations import distance, place, record, records, scenario, tables, tree_equal
from tests.tolerances import assert_mean


@pytest.fixture(scope="module")
def result() -> Result:
    return ft.track(from_records(records()), scenario())


def test_the_target_is_found_where_it_is(result: Result) -> None:
    (track,) = result.tracks
    assert track.label == 1
    assert track.end_s == 59.0
    # Beams of 3 degrees are 30 m wide there, and many scans are better than one.
    assert np.sqrt(np.mean(distance(result.data)[-20:] ** 2)) < 20
    assert result.kind.name == "records"
    assert result.summary()["scans"] == 60
    assert result.summary()["full_scans"] == 0


def test_every_variable_has_a_unit_and_a_name(result: Result) -> None:
    for name, variable in result.data.data_vars.items():
        assert {"units", "long_name"} <= set(variable.attrs), name
    assert result.data.detection.dims == ("time", "detector")
    assert result.data.covariance.dims == ("time", "slot", "component", "other")
    np.testing.assert_array_equal(result.data.time, np.arange(60.0))


def test_covariance_tells_how_far_off_it_is(result: Result) -> None:
    (track,) = result.tracks
    off = np.stack([track.mean["x"], track.mean["y"]], axis=-1) - place(track.time)
    squared = np.einsum("ti,tij,tj->t", off, np.linalg.inv(track.covariance[:, :2, :2]), off)
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
    short = ft.track(from_records((west, east)), scenario())
    for name in ("existence", "label", "x", "detection"):
        np.testing.assert_array_equal(short.data[name], result.data[name][:45])


def test_silent_arrays_are_scans_that_say_nothing(result: Result) -> None:
    west, east = records()
    there = np.r_[0:20, 40:60]
    some = record(east.read(0, 60)[there], east.times[there], "east.npz")
    values = west.read(0, 60).copy()
    values[25:30] = np.nan
    gaps = ft.track(from_records((record(values, west.times, "west.npz"), some)), scenario())
    missing = gaps.data.record.isnull().all("beam").values
    assert missing[20:40, 1].all()
    assert missing[25:30, 0].all()
    assert missing.sum() == 25
    # When both arrays are silent what is known of the detectors hardly changes; the target is there afterwards.
    assert np.abs(np.diff(gaps.data.detection.values[26:30], axis=0)).max() < 0.05
    assert np.sqrt(np.mean(distance(gaps.data)[-10:] ** 2)) < 30


def test_result_folder_and_report(result: Result, tmp_path: Path) -> None:
    back = read_result(result.save(tmp_path / "out"))
    assert back.scenario == result.scenario
    assert back.kind.name == "records"
    assert [track.summary() for track in back.tracks] == [track.summary() for track in result.tracks]
    with (tmp_path / "out" / "states.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == int((result.data.label > 0).sum())
    (track,) = result.tracks
    np.testing.assert_allclose([float(row["x_m"]) for row in rows], track.mean["x"], rtol=1e-6)
    np.testing.assert_allclose([float(row["y_m_std"]) ** 2 for row in rows], track.covariance[:, 1, 1], rtol=1e-5)
    assert not (tmp_path / "out" / "tracks.geojson").exists()
    page = report(back)
    for text in ("Map, records, detection", "west.npz and east.npz", "2 of 14 x 16 x 3 x 3 cells", "1 track"):
        assert text in page


def test_what_was_run_runs_again(result: Result) -> None:
    """What was chosen stands in the scenario, and choosing it again changes nothing."""
    assert result.scenario.target.velocity_noise == 0.06
    again = ft.track(from_records(records()), result.scenario)
    assert again.scenario == result.scenario
    for name in ("existence", "label", "x", "detection"):
        np.testing.assert_array_equal(again.data[name], result.data[name])


@pytest.mark.slow
def test_scan_by_scan_is_as_in_blocks(result: Result) -> None:
    moments = list(ft.follow(from_records(records()), scenario()))
    np.testing.assert_allclose(
        np.concatenate([moment.data.x for moment in moments]), result.data.x, rtol=1e-5, equal_nan=True
    )
    assert [track.label for track in moments[-1].tracks] == [1]


def test_simulated_targets_are_found(tmp_path: Path) -> None:
    """Drawn, written, read and tracked again as drawn; the clock of one array is ahead."""
    east = tables()["stations"][1] | {"clock_offset": 7.0}
    sections = tables(
        stations=[tables()["stations"][0], east],
        simulation={"scans": 60, "beam_deg": 3.0, "targets": [{"x": -300.0, "y": 500.0, "vx": 4.0, "vy": 2.0}]},
    )
    drawn = ft.simulate(sections, tmp_path / "sea.npz")
    assert [record.times[0] for record in drawn.records] == [0.0, 7.0]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["sea_east.npz", "sea_west.npz"]
    again = ft.track([tmp_path / "sea_west.npz", tmp_path / "sea_east.npz"], sections)
    np.testing.assert_array_equal(again.data.x, ft.track(drawn, sections).data.x)
    assert len(again.tracks) == 1
    # As the result above: beams of 30 m, many scans.
    assert np.sqrt(np.mean(distance(again.data)[-20:] ** 2)) < 20


@pytest.mark.parametrize("elsewhere", [0.0, 0.1])
def test_noise_is_without_a_target(elsewhere: float) -> None:
    """Mean and square of 60 x 2 x 61 values; sources from elsewhere, three deviations each, are geometric in number."""
    simulation = {"scans": 60, "beam_deg": 3.0, "targets": [{"x": -300.0, "y": 500.0}]}
    what = scenario(simulation=simulation, energies={"elsewhere": elsewhere})
    values = np.stack([record.read(0, 60) for record in silence(what, 1).records]).ravel()
    number, spread = elsewhere / (1 - elsewhere), elsewhere / (1 - elsewhere) ** 2
    assert_mean(values, 3 * number)
    assert_mean(values**2, 1 + 9 * spread + (3 * number) ** 2)


def test_geojson_of_tracks(result: Result, tmp_path: Path) -> None:
    x, y = (result.data[name].astype(float) for name in ("x", "y"))
    degrees = {"latitude": 50 + y / 111e3, "longitude": -1 + x / 71e3}
    data = result.data.assign(degrees).assign_attrs(start_time="2016-01-12T13:02:11.500000000Z")
    write_geojson(tmp_path / "tracks.geojson", data)
    content = json.loads((tmp_path / "tracks.geojson").read_text(encoding="utf-8"))
    (feature,) = content["features"]
    (track,) = result.tracks
    assert feature["geometry"]["type"] == "LineString"
    longitude, latitude = feature["geometry"]["coordinates"][-1]
    assert (longitude, latitude) == pytest.approx(
        (-1 + track.mean["x"][-1] / 71e3, 50 + track.mean["y"][-1] / 111e3), abs=1e-6
    )
    assert feature["properties"]["coordTimes"][-1] == "2016-01-12T13:03:10.500Z"
    assert len(feature["properties"]["coordTimes"]) == len(feature["geometry"]["coordinates"])
    assert feature["properties"]["label"] == 1


def test_tracks_of_stone_soup(result: Result) -> None:
    pytest.importorskip("stonesoup")
    (mine,) = result.tracks
    (track,) = to_stonesoup(result.tracks)
    state = track.states[-1]
    np.testing.assert_allclose(state.state_vector.ravel(), [mine.mean[name][-1] for name in ("x", "vx", "y", "vy")])
    np.testing.assert_allclose(state.covar[0, 2], mine.covariance[-1, 0, 1])
    np.testing.assert_allclose(state.covar[1, 1], mine.covariance[-1, 2, 2])
    assert (track.states[-1].timestamp - track.states[0].timestamp).total_seconds() == mine.end_s - mine.start_s
    assert track.id == "1"


def test_recordings_become_records() -> None:
    """What comes from broadside is loudest there; blocks are pieces of the whole; frames with gaps are not measured."""
    rate, count = 1000.0, 40
    rng, length = np.random.default_rng(0), int(rate) * count // 10
    samples = (rng.normal(size=(length, 1)) + 0.1 * rng.normal(size=(length, 8))).astype(np.float32)
    samples[250] = np.nan
    analysis = {"frame": 0.1, "band": [200.0, 400.0], "beams": 19}
    what = RecordsScenario(stations=[{"name": "line"}], analysis=analysis)
    beams = beamformed(from_samples(samples, rate), line_array(8, 2.0), what)
    np.testing.assert_allclose(beams.times, 0.05 + 0.1 * np.arange(count))
    whole = beams.read(0, count)
    assert np.isnan(whole[2]).all()
    assert set(np.delete(whole, 2, axis=0).argmax(axis=1)) == {9}
    np.testing.assert_array_equal(np.concatenate([beams.read(0, 33), beams.read(33, 40)]), whole)
    assert tree_equal(beams.read(5, 7), whole[5:7])


@pytest.mark.slow
def test_a_recording_in_memory_is_tracked_as_its_record() -> None:
    """The channels stand in the scenario, and in what was run they are written out."""
    rate, array = 1000.0, line_array(8, 2.0)
    samples = np.random.default_rng(0).normal(size=(4000, 8)).astype(np.float32)
    sections = {
        "stations": [{"name": "line", "array": array}],
        "analysis": {"frame": 0.1, "band": [200.0, 400.0], "beams": 19},
        "several": {"slots": 2, "particles": 64},
    }
    recording = from_samples(samples, rate)
    result = ft.track(from_records(recording), sections)
    assert len(result.scenario.stations[0].array.channels) == 8
    made = from_records(beamformed(recording, array, RecordsScenario(**sections)), arrays={"line": array})
    other = ft.track(made, sections)
    np.testing.assert_array_equal(other.data.detection, result.data.detection)
