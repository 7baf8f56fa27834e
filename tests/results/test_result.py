"""A result says the same as a table, a file, a report, and to other libraries."""

import csv
import json
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

import faintrack as ft
from faintrack.results.report import track_rows
from faintrack.results.schema import estimated, planar
from faintrack.results.tables import state_columns, state_rows, to_stonesoup, track_columns, write_geojson
from faintrack.results.track import tracks_of
from faintrack.targets.states import PlanarState
from tests.kinds.small import EVERY, SCANS, SCENARIOS, data, result

SMALL = pytest.mark.parametrize("kind", EVERY)


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Folder of the result of each kind."""
    folder = tmp_path_factory.mktemp("saved")
    return {kind: result(kind).save(folder / kind) for kind in SCENARIOS}


@SMALL
def test_saved_and_read_it_is_the_same(kind: str, saved: dict[str, Path]) -> None:
    one, folder = result(kind), saved[kind]
    again = ft.read_result(folder)
    xr.testing.assert_identical(again.data.load(), one.data)
    assert (again.kind, again.scenario, again.seconds, again.remarks, again.misfits) == (
        one.kind,
        one.scenario,
        one.seconds,
        one.remarks,
        one.misfits,
    )
    assert again.summary() == one.summary()
    assert (folder / "report.html").exists()


@SMALL
def test_existence_is_not_shown_as_certain_where_the_model_does_not_fit(kind: str, tmp_path: Path) -> None:
    one = replace(result(kind), misfits=("Noise has <spikes>.",))
    text = one.report(tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<li>Noise has &lt;spikes&gt;.</li>" in text
    assert "<td>unsure</td>" in text
    (row,) = track_rows(one)
    assert row[-1] == "unsure"
    assert one.summary()["misfits"] == ["Noise has <spikes>."]
    assert track_rows(result(kind))[0][-1] == f"{one.tracks[0].existence_max:.4f}"


@SMALL
def test_the_table_is_that_of_the_file(kind: str, saved: dict[str, Path]) -> None:
    """Ten digits are written: single precision has seven."""
    one = result(kind)
    table = one.to_dataframe()
    with (saved[kind] / "states.csv").open(encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    assert header == list(table)
    np.testing.assert_allclose(np.array(rows, float), table.to_numpy(float), rtol=1e-9)
    (track,) = one.tracks
    assert table.time_s.tolist() == track.time.tolist()
    assert set(table.label) == {track.label}


@SMALL
def test_a_track_is_asked_for_by_its_label(kind: str) -> None:
    one = result(kind)
    assert one.track(1) is one.tracks[0]
    with pytest.raises(KeyError, match=r"there is no track 7; labels are \[1\]"):
        one.track(7)


@SMALL
def test_report_picture_and_notebook(kind: str, tmp_path: Path) -> None:
    one = result(kind)
    text = one.report(tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<h1>1 track in " in text
    assert "data:image/png;base64," in text
    assert isinstance(one.plot(), Figure)
    assert one._repr_html_().startswith(f"<h4>{one.kind.title}: {one.data.attrs['source']}</h4><table>")
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]


@SMALL
def test_the_summary_is_plain_and_counts(kind: str) -> None:
    one = result(kind)
    summary = json.loads(json.dumps(one.summary()))
    assert (summary["kind"], summary["scans"], summary["remarks"]) == (kind, SCANS, [])
    assert summary["scan_interval"] * SCANS / summary["seconds"] == pytest.approx(summary["realtime_factor"])
    assert [row["label"] for row in summary["tracks"]] == [1]


@SMALL
def test_without_what_only_pictures_read_the_numbers_are_the_same(kind: str) -> None:
    one = ft.track(data(kind), SCENARIOS[kind], pictures=False)
    assert one.to_dataframe().equals(result(kind).to_dataframe())
    assert not {"record", "surface", "frame"} & set(one.data)


@SMALL
def test_tracks_of_stone_soup(kind: str) -> None:
    """Components beside their rates, angles in radians: the same means and covariances, in another order and unit."""
    pytest.importorskip("stonesoup")
    (track,) = result(kind).tracks
    (theirs,) = to_stonesoup([track])
    assert theirs.id == "1"
    assert len(theirs.states) == len(track.time)
    plane = ("x", "vx", "y", "vy")
    order = {
        "recording": ("bearing", "bearing_rate", "snr_db"),
        "frames": plane,
        "returns": plane,
        "bearings": plane,
        "records": ("bearing", "bearing_rate"),
    }[kind]
    scale = np.array([np.radians(1) if track.units[name].startswith("degree") else 1.0 for name in order])
    for scan, state in enumerate(theirs.states):
        mean = np.array([track.mean[name][scan] for name in order]) * scale
        np.testing.assert_allclose(np.ravel(state.state_vector).astype(float), mean)
        std = np.array([track.std[name][scan] for name in order]) * scale
        np.testing.assert_allclose(np.sqrt(np.diag(state.covar).astype(float)), std, rtol=1e-6)
        seconds = (state.timestamp - theirs.states[0].timestamp).total_seconds()
        assert seconds == pytest.approx(track.time[scan] - track.time[0], abs=1e-6)


@pytest.fixture(scope="module")
def on_earth() -> xr.Dataset:
    """Two targets of four scans on earth: one in the first three, the other in the last alone."""
    count = np.arange(4.0)[:, None] * np.ones(2)
    state = PlanarState(*(jnp.asarray(values) for values in (100 * count, 50 * count, 0 * count + 50, 0 * count + 25)))
    label = np.array([[1, 0], [1, 0], [1, 0], [0, 2]])
    say = SimpleNamespace(
        existence=np.full((4, 2), 0.9),
        label=label,
        track_existence=np.full((4, 2), 0.9),
        mean=state,
        covariance=np.tile(np.eye(4), (4, 2, 1, 1)),
    )
    dataset = estimated(2.0 * np.arange(4), say, planar())
    dataset["latitude"] = ("time", "slot"), 36 + 1e-3 * count, {"units": "degree"}
    dataset["longitude"] = ("time", "slot"), -5 + 2e-3 * count, {"units": "degree"}
    return dataset.assign_attrs(
        source="test", start_time="2020-05-01T00:00:00Z", first_scan_time=0.0, scan_interval=2.0
    )


def test_tracks_as_geojson(on_earth: xr.Dataset, tmp_path: Path) -> None:
    write_geojson(tmp_path / "tracks.geojson", on_earth)
    collection = json.loads((tmp_path / "tracks.geojson").read_text(encoding="utf-8"))
    line, point = collection["features"]
    assert collection["type"] == "FeatureCollection"
    assert line["geometry"] == {
        "type": "LineString",
        "coordinates": [[-5.0, 36.0], [-4.998, 36.001], [-4.996, 36.002]],
    }
    assert point["geometry"] == {"type": "Point", "coordinates": [-4.994, 36.003]}
    said = line["properties"]
    assert (said["label"], said["start_s"], said["end_s"]) == (1, 0.0, 4.0)
    assert said["speed_m_s"] == pytest.approx(np.hypot(200, 100) / 4)
    assert said["coordTimes"] == [f"2020-05-01T00:00:0{second}.000Z" for second in (0, 2, 4)]


def test_places_on_earth_and_utc_are_columns(on_earth: xr.Dataset) -> None:
    columns = state_columns(on_earth)
    assert columns[:2] == ["time_s", "utc"]
    assert columns[-2:] == ["latitude_deg", "longitude_deg"]
    last = dict(zip(columns, list(state_rows(on_earth))[-1], strict=True))
    assert (last["label"], last["utc"], last["latitude_deg"]) == (2, "2020-05-01T00:00:06.000Z", pytest.approx(36.003))
    assert [set(track_columns(on_earth)) - set(track.summary()) for track in tracks_of(on_earth)] == [set(), set()]


def test_stone_soup_has_the_time_of_day(on_earth: xr.Dataset) -> None:
    pytest.importorskip("stonesoup")
    first, second = to_stonesoup(tracks_of(on_earth))
    assert str(first.states[0].timestamp) == "2020-05-01 00:00:00"
    assert str(second.states[0].timestamp) == "2020-05-01 00:00:06"


def test_a_damaged_folder_is_named(saved: dict[str, Path], tmp_path: Path) -> None:
    folder = Path(shutil.copytree(saved["frames"], tmp_path / "result"))
    (folder / "about.json").write_text("[]", encoding="utf-8")
    with pytest.raises(ft.InputError, match="result is damaged or incomplete"):
        ft.read_result(folder)
    with pytest.raises(ft.InputError, match="none is not a folder; expected the result"):
        ft.read_result(tmp_path / "none")
