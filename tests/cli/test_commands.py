"""The whole, from scenario to report, through the command line."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from faintrack import read_result
from tests.cli.calling import SCENARIO, call


@pytest.fixture(scope="module")
def tracked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with a simulated recording, its array and its result."""
    folder = tmp_path_factory.mktemp("tracked")
    (folder / "scenario.toml").write_text(SCENARIO)
    assert call("simulate", folder / "scenario.toml", "--out", folder / "recording.h5").status == 0
    done = call("track", folder / "recording.h5", "--scenario", folder / "scenario.toml", "--out", folder / "result")
    assert done.status == 0, done.err
    (folder / "printed").write_text(done.out)
    return folder


RECORDING_COLUMNS = (
    "label,start_s,end_s,bearing_deg,bearing_deg_std,bearing_deg_start,bearing_deg_end,bearing_rate_deg_s,"
    "bearing_rate_deg_s_std,snr_db,snr_db_std,speed_deg_s,existence_max"
)
FRAMES_COLUMNS = (
    "label,start_s,end_s,range_m,range_m_std,range_m_start,range_m_end,range_rate_m_s,range_rate_m_s_std,speed_m_s,"
    "existence_max"
)


def test_result_folder_holds_what_it_should(tracked: Path) -> None:
    result = tracked / "result"
    assert sorted(path.name for path in result.iterdir()) == [
        "about.json",
        "report.html",
        "result.zarr",
        "scenario.toml",
        "states.csv",
        "tracks.csv",
    ]
    data = xr.open_zarr(result / "result.zarr", chunks=None)
    assert data.sizes == {"time": 40, "slot": 7, "component": 3, "other": 3, "beam": 180}
    assert all("units" in data[name].attrs for name in [*data.data_vars, "time", "beam"])
    assert data.bearing.attrs["reference"] == "from the array axis"
    about = json.loads((result / "about.json").read_text())
    assert set(about) >= {"faintrack", "jax", "python", "seconds", "kind", "remarks"}
    assert about["kind"] == "recording"


def test_the_source_is_found_and_nothing_else(tracked: Path) -> None:
    header, *rows = (tracked / "result" / "tracks.csv").read_text().splitlines()
    assert header == RECORDING_COLUMNS
    (row,) = (line.split(",") for line in rows)
    assert 10 < float(row[1]) < 25
    # The scene's main lobe is 14 degrees wide.
    assert abs(float(row[3]) - 60) < 14
    assert "1 tracks in 40 scans" in (tracked / "printed").read_text()


def test_the_scenario_in_the_result_runs_again_and_gives_the_same(tracked: Path) -> None:
    again = call(
        "track",
        tracked / "recording.h5",
        "--scenario",
        tracked / "result" / "scenario.toml",
        "--out",
        tracked / "again",
    )
    assert again.status == 0, again.err
    first, second = (read_result(tracked / name).data for name in ("result", "again"))
    np.testing.assert_array_equal(first.existence, second.existence)


def test_json_has_the_promised_fields(tracked: Path) -> None:
    done = call("track", tracked / "recording.h5", "--scenario", tracked / "scenario.toml", "--json")
    printed = json.loads(done.out)
    assert set(printed) >= {"kind", "tracks", "scans", "scan_interval", "seconds", "realtime_factor", "masked_scans"}
    assert (printed["kind"], printed["scans"], printed["scan_interval"]) == ("recording", 40, 1.0)
    (track,) = printed["tracks"]
    assert list(track) == RECORDING_COLUMNS.split(",")


@pytest.mark.slow
def test_band_and_frame_of_the_command_line_count(tracked: Path) -> None:
    out = tracked / "narrow"
    done = call(
        "track",
        tracked / "recording.h5",
        *("--scenario", tracked / "scenario.toml", "--band", "100", "300", "--frame", "2", "--out", out),
    )
    assert done.status == 0, done.err
    analysis = tomllib.loads((out / "scenario.toml").read_text())["analysis"]
    assert analysis["band"] == [100.0, 300.0]
    assert read_result(out).data.sizes["time"] == 20


def test_report_is_one_self_contained_file(tracked: Path) -> None:
    (tracked / "result" / "report.html").unlink()
    assert call("report", tracked / "result").status == 0
    text = (tracked / "result" / "report.html").read_text()
    assert "data:image/png;base64," in text
    assert "http" not in text.replace("http-equiv", "")
    assert "1 track in recording.h5" in text


def test_an_earlier_result_is_replaced(tracked: Path) -> None:
    out = tracked / "twice"
    for _ in range(2):
        assert (
            call("track", tracked / "recording.h5", "--scenario", tracked / "scenario.toml", "--out", out).status == 0
        )
    assert not list(tracked.glob("*.partial"))


def test_frames_are_tracked_and_reported(tmp_path: Path) -> None:
    power = np.random.default_rng(0).exponential(size=(30, 24)).astype(np.float32)
    power[np.arange(10, 30), 4 + np.arange(20) // 2] *= 40
    np.savez(tmp_path / "radar.npz", power=power, range=np.arange(24) * 15.0, time=np.arange(30) * 0.5)
    done = call("track", tmp_path / "radar.npz", "--out", tmp_path / "result")
    assert done.status == 0, done.err
    header, row = (tmp_path / "result" / "tracks.csv").read_text().splitlines()
    assert header == FRAMES_COLUMNS
    columns = dict(zip(header.split(","), row.split(","), strict=True))
    # The echo goes from 60 to 195 m, a cell of 15 m every second.
    assert 5 <= float(columns["start_s"]) < 9
    assert abs(float(columns["range_m_end"]) - 195) < 20
    names, units = done.out.splitlines()[:2]
    assert names.split() == ["start", "end", "range", "range", "std", "speed"]
    assert units.split() == ["track", "s", "s", "start", "m", "end", "m", "m", "m/s", "existence"]
    assert "1 tracks in 30 scans" in done.out
    again = call("track", tmp_path / "radar.npz", "--scenario", tmp_path / "result" / "scenario.toml", "--json")
    (track,) = json.loads(again.out)["tracks"]
    assert ",".join(f"{value:.10g}" for value in track.values()) == row
    (tmp_path / "result" / "report.html").unlink()
    assert call("report", tmp_path / "result").status == 0
    text = (tmp_path / "result" / "report.html").read_text()
    assert "1 track in radar.npz" in text
    assert "24 cells, 0 to 345 m" in text


@pytest.mark.parametrize("command", ["demo", "simulate", "track", "report", "info", "init", "calibrate", "bench"])
def test_help_shows_an_example(command: str) -> None:
    done = call(command, "--help")
    assert done.status == 0
    assert f"faintrack {command}" in done.out.split("Example")[1]


@pytest.mark.slow
def test_bench_measures_the_rows_that_are_named() -> None:
    done = call("bench", "speed")
    assert done.status == 2
    assert "no row 'speed'" in done.err
    assert "track_55ch_realtime" in done.err
    done = call("bench", "help_seconds", "--json")
    assert [row["name"] for row in json.loads(done.out)["rows"]] == ["help_seconds"]
