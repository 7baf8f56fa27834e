"""What users' data are like: what is told, left out, refused; most of it is known before a run.

Each is of a kind of fault in docs/validation.md. Readers have tests of their own in tests/io.
"""

import csv
import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
import tifffile
from PIL import Image

import faintrack as ft
from faintrack.beliefs.axis import Axis
from faintrack.errors import InputError
from faintrack.io.ais import read_ships
from faintrack.io.bearings import read_bearings
from faintrack.kinds.kind import Plan
from faintrack.kinds.recording.plan import plan as plan_recording
from faintrack.kinds.records.plan import plan as plan_records
from faintrack.kinds.records.sections import RecordsScenario
from faintrack.results.folder import require_place
from faintrack.results.tables import write_geojson
from tests.stations import record, records, scenario

RATE, SPEED = 1000.0, 1500.0
EAST = np.stack([0.75 * np.arange(8), np.zeros(8)], axis=1)
NOISE = np.random.default_rng(0).normal(size=(6000, 8))


def planned(samples: np.ndarray = NOISE, positions: np.ndarray = EAST, **sections: Any) -> Plan:
    what = ft.Scenario(kind="recording", array=ft.sensor_array(positions, SPEED), **sections)
    return plan_recording(ft.from_samples(samples, RATE), what)


@pytest.fixture
def wav(tmp_path: Path) -> Path:
    soundfile.write(tmp_path / "a.wav", NOISE / 8, int(RATE), subtype="FLOAT")
    return tmp_path / "a.wav"


class TestArrays:
    """Set-ups that tell little say so before the run."""

    @pytest.mark.parametrize("off", [1e-5, 1e-3, 1e-2])
    def test_a_line_that_is_not_quite_straight_is_a_line(self, off: float) -> None:
        plan = planned(positions=EAST + off * np.random.default_rng(1).normal(size=EAST.shape))
        assert any("its two sides cannot be told apart" in check for check in plan.checks)
        bearing = plan.step.beamformer.grid.bearing  # type: ignore[attr-defined]
        assert (bearing.min(), bearing.max()) == pytest.approx((0, np.pi))

    def test_an_array_that_bends_by_more_is_none(self) -> None:
        bent = EAST + np.stack([np.zeros(8), 0.4 * np.arange(8) % 1.2], axis=1)
        assert not any("two sides" in check for check in planned(positions=bent).checks)

    @pytest.mark.parametrize(
        ("unit", "said"),
        [(1e-5, "hardly tells a bearing"), pytest.param(1e4, "hardly any beam", marks=pytest.mark.slow)],
    )
    def test_positions_in_another_unit(self, unit: float, said: str) -> None:
        ring = 3 * np.stack([np.sin(np.arange(8.0)), np.cos(np.arange(8.0))], axis=1)
        assert not any(said in check for check in planned(positions=ring).checks)
        assert any(said in check for check in planned(positions=unit * ring).checks)

    def test_info_tells_them_and_why_a_scenario_does_not_fit(self, wav: Path) -> None:
        near = {"channels": [{"name": str(n), "x": 1e-5 * n, "y": 1e-5 * n * n} for n in range(8)]}
        remarks = ft.info(wav, array=near).remarks
        assert any("hardly tells a bearing" in remark for remark in remarks)
        assert any("1500 m/s was taken" in remark for remark in remarks)
        (remark,) = ft.info(wav, array={"line": {"count": 3, "spacing": 1.0}}).remarks
        assert remark == f"{wav} has 8 channels; the array has 3."
        assert ft.info(wav).remarks == ()

    @pytest.mark.parametrize(("factor", "told"), [(100.0, "40 dB louder"), (1e-2, "40 dB quieter"), (-1.0, None)])
    def test_a_channel_that_differs(self, factor: float, told: str | None) -> None:
        """An inverted channel is as loud as the others."""
        samples = NOISE.copy()
        samples[:, 4] *= factor
        checks = [check for check in planned(samples).checks if "Channel 4" in check]
        assert [told in check for check in checks if told] == ([] if told is None else [True])


@pytest.mark.slow
def test_remarks_are_told_once_and_before_the_run(wav: Path) -> None:
    said: list[str] = []
    sections = {"analysis": {"frame": 0.5}, "filter": {"particles": 60, "births": 30}}
    told_at: list[int] = []
    result = ft.track(
        wav,
        array={"line": {"count": 8, "spacing": 0.75}},
        tell=said.append,
        progress=lambda scans, total: told_at.append(len(said)),
        **sections,
    )
    assert said == ["The array does not tell the sound speed; 1500 m/s was taken."]
    assert set(told_at) == {1}
    assert result.remarks == tuple(said)


class TestPython:
    """What Python users pass."""

    def test_files_in_a_list(self, wav: Path) -> None:
        other = wav.with_name("b.wav")
        soundfile.write(other, NOISE[::-1] / 8, int(RATE), subtype="FLOAT")
        assert ft.read([wav, str(other)]).channels == 16
        with pytest.raises(InputError, match=r"a.wav is given twice"):
            ft.read([wav, wav])

    @pytest.mark.parametrize(
        ("positions", "speed", "said"),
        [
            (EAST, "fast", "sound_speed is 'fast'; expected a number."),
            (EAST, [1500.0, 1500.0], "sound_speed is '[1500.0, 1500.0]'; expected a number."),
            (EAST, None, "sound_speed is nan; expected a number above 0 m/s."),
            ([["a", "b"]], 1500.0, "positions is"),
        ],
    )
    def test_arrays_that_are_none(self, positions: Any, speed: Any, said: str) -> None:
        with pytest.raises(InputError) as error:
            ft.sensor_array.__wrapped__(positions, speed)  # type: ignore[attr-defined]
        assert said in str(error.value)

    def test_lists_that_are_no_arrays_and_places_that_are_none(self, tmp_path: Path) -> None:
        with pytest.raises(InputError, match="samples have rows of different lengths; expected an array"):
            ft.from_samples([[1, 2], [3]], RATE)
        columns = {"time_s": [0, 1], "bearing_deg": ["north", 3], "observer_x_m": [0, 0], "observer_y_m": [0, 0]}
        with pytest.raises(InputError, match="bearings in memory: bearing_deg holds something else than numbers"):
            ft.from_bearings(columns)
        with pytest.raises(InputError, match="out is a int; expected the path of a folder"):
            require_place(3)
        assert require_place(str(tmp_path / "out")) == tmp_path / "out"

    def test_numbers_of_numpy(self) -> None:
        band = np.array([100, 400])
        assert planned(analysis={"band": band, "frame": np.float32(1)}).length == 6


class TestFrames:
    """Frames that lack something."""

    def test_pixels_that_are_no_numbers_are_missing(self, tmp_path: Path) -> None:
        frames = np.random.default_rng(0).normal(size=(8, 12, 10)).astype(np.float32)
        frames[3, 2, 2] = np.nan
        tifffile.imwrite(tmp_path / "a.tif", frames)
        result = ft.track(tmp_path / "a.tif")
        assert result.remarks == ("Frames: 1 cells from 3 s to 4 s are missing (not finite).",)
        assert np.isfinite(result.data.existence).all()

    def test_a_channel_is_picked_by_the_scenario(self, tmp_path: Path) -> None:
        frames = np.random.default_rng(0).normal(size=(5, 2, 12, 10)).astype(np.float32)
        tifffile.imwrite(tmp_path / "a.tif", frames, imagej=True, metadata={"axes": "TCYX"})
        with pytest.raises(InputError, match=r"a.tif: frames has 2 places along its axis channel; expected select"):
            ft.read(tmp_path / "a.tif")
        read = ft.read(tmp_path / "a.tif", frames={"select": {"channel": 1}})
        np.testing.assert_array_equal(read.read(0, 5), frames[:, 1])

    @pytest.mark.slow
    def test_numbers_stay_times_where_the_interval_is_told(self, tmp_path: Path) -> None:
        for number in (0, 1, 2, 4, 7):
            Image.fromarray(np.full((8, 9), number, np.uint8)).save(tmp_path / f"frame_{number:03}.png")
        result = ft.track(tmp_path, frames={"frame_interval": 0.5})
        assert result.data.time.values.tolist() == [0, 0.5, 1, 2, 3.5]
        memory = ft.from_frames(np.random.default_rng(0).normal(size=(5, 8, 9)))
        assert ft.track(memory, frames={"frame_interval": 0.5}).data.time.values.tolist() == [0, 0.5, 1, 1.5, 2]


class TestRecords:
    """Records of arrays: the same gates, the same remarks."""

    def test_fill_values_are_missing(self) -> None:
        west, east = records(20)
        values = np.array(west.read(0, 20))
        values[5, 7] = 9.969209968386869e36
        plan = plan_records(ft.from_records((record(values, west.times, "west.npz"), east)), scenario())
        energy = plan.read(0, 20)[1]
        assert np.isnan(energy[5, 0, 7])
        assert np.isnan(energy).sum() == 1
        assert plan.remarks() == ("west.npz: Frames: 1 cells from 5 s to 6 s are missing (fill value).",)

    def test_a_beam_that_stands_twice_is_refused(self) -> None:
        closed = ft.from_frames(np.ones((9, 25)), axes=(("bearing", Axis(0.0, 15.0, 25)),))
        alone = RecordsScenario(stations=[{"name": "ring", "line": False}])
        with pytest.raises(InputError, match="bearings from 0 to 360 degrees; expected at most a full circle"):
            plan_records(ft.from_records(closed), alone)

    def test_rows_outside_the_common_time_are_told(self) -> None:
        west, east = records(20)
        late = record(np.array(east.read(0, 20)), east.times + 6, "east.npz")
        checks = plan_records(ft.from_records((west, late)), scenario()).checks
        assert checks == tuple(
            f"{name}: 6 of 20 rows lie outside the time that two records share; they were left out."
            for name in ("west.npz", "east.npz")
        )

    def test_recordings_are_looked_at_and_sections_say_that_they_become_records(self, wav: Path) -> None:
        """`[[stations]]` are of records alone, and a WAV can become one."""
        samples = NOISE / 8
        samples[:, 3] *= 100
        soundfile.write(wav, samples, int(RATE), subtype="FLOAT")
        line = {"sound_speed": SPEED, "line": {"count": 8, "spacing": 0.75}}
        remarks = ft.info(wav, stations=[{"name": "line", "array": line}]).remarks
        (said,) = (remark for remark in remarks if "Channel 3" in remark)
        assert said.startswith(f"{wav}: Channel 3 is 40 dB louder than the others")
        with pytest.raises(InputError, match="holds recording, of which a scenario has no section frames"):
            ft.track(wav, frames={"background": "none"})


@pytest.fixture
def crossing(tmp_path: Path) -> Path:
    """Result of a ring whose beams begin at -180 degrees, of a source that goes through south."""
    times, bearings = np.arange(40.0), np.arange(-180.0, 180.0, 15.0)
    energy = np.random.default_rng(3).normal(size=(40, 24))
    path = 165 + 0.75 * times
    energy[np.arange(40), np.rint((path + 180) / 15).astype(int) % 24] += 5
    np.savez(tmp_path / "ring.npz", energy=energy, time=times, bearing=bearings)
    with (tmp_path / "truth.csv").open("w", encoding="utf-8") as file:
        file.write(
            "name,time_s,bearing_deg\n" + "".join(f"one,{t:g},{b:g}\n" for t, b in zip(times, path, strict=True))
        )
    ft.track(
        tmp_path / "ring.npz",
        stations=[{"name": "ring", "line": False}],
        energies={"present": [5.0, 1.0]},
        target={"bearing_rate_deg": 1.5},
        several={"slots": 2, "particles": 256, "hold": 3},
        truth=tmp_path / "truth.csv",
        out=tmp_path / "out",
    )
    return tmp_path / "out"


@pytest.mark.slow
def test_bearings_in_files_lie_in_the_range_that_is_told(crossing: Path) -> None:
    with (crossing / "states.csv").open(encoding="utf-8") as file:
        bearing = np.array([float(row["bearing_deg"]) for row in csv.DictReader(file)])
    assert len(bearing) > 20
    assert bearing.min() < -150
    assert bearing.max() > 150
    result = ft.read_result(crossing)
    for values in (bearing, result.data.bearing.values, result.data.truth_bearing.values):
        assert np.nanmin(values) >= -180
        assert np.nanmax(values) <= 180
    (track,) = result.tracks
    assert abs(track.average("bearing")) > 150


@pytest.mark.slow
def test_a_line_over_180_degrees_is_cut_as_geojson_wants_it(tmp_path: Path) -> None:
    result = ft.track(ft.from_records(records(30)), scenario())
    data, (track,) = result.data, result.tracks
    east = 180 + (data.x.values - track.mean["x"].mean()) / 1e5
    data = data.assign(latitude=data.y / 1e5, longitude=(data.x.dims, (east + 180) % 360 - 180))
    write_geojson(tmp_path / "a.geojson", data)
    (feature,) = json.loads((tmp_path / "a.geojson").read_text(encoding="utf-8"))["features"]
    assert feature["geometry"]["type"] == "MultiLineString"
    before, after = feature["geometry"]["coordinates"]
    assert (before[-1][0], after[0][0]) == (180, -180)
    assert before[-1][1] == after[0][1]
    # Four metres a scan, in places of 1e-5 degrees a metre; no step goes around the world.
    assert all(abs(b[0] - a[0]) < 0.01 for line in (before, after) for a, b in pairwise(line))


class TestTables:
    """Tables that say something else than they seem to."""

    def test_rows_that_stand_twice_count_once(self, tmp_path: Path) -> None:
        path = tmp_path / "b.csv"
        rows = "time_s,bearing_deg,observer_x_m,observer_y_m\n0,41.2,0,0\n0,41.2,0,0\n0,43,0,0\n1,41.2,0,0\n"
        path.write_text(rows, encoding="utf-8")
        bearings = read_bearings(path)
        assert bearings.scan.tolist() == [0, 0, 1]
        assert bearings.remarks == ("1 rows stand in the file twice; each counts once.",)

    def test_digits_of_python_are_no_numbers(self, tmp_path: Path) -> None:
        path = tmp_path / "b.csv"
        path.write_text("time_s,bearing_deg,observer_x_m,observer_y_m\n1_0,41.2,0,0\n", encoding="utf-8")
        with pytest.raises(InputError, match=r"b.csv, row 2: time_s is '1_0'; expected a number"):
            read_bearings(path)

    def test_places_of_ships(self, tmp_path: Path) -> None:
        path = tmp_path / "a.csv"
        rows = "time,mmsi,lat,lon\n2024-02-29T12:00:00Z,1,50.7,-1.1\n2024-02-29T12:01:00Z,1,91,181\n"
        path.write_text(rows, encoding="utf-8")
        (ship,) = read_ships(path)
        assert ship.places.tolist() == [[50.7, -1.1]]
        path.write_text(rows.replace("50.7,-1.1", "151.2,-33.8"), encoding="utf-8")
        with pytest.raises(InputError, match=r"a.csv, row 2: latitude is 151.2; expected -90 to 90 degrees"):
            read_ships(path)
