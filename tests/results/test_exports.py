"""Each export is read back by the library of its program where that is installed, and held to its format elsewhere."""

import csv
import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr
from scipy.io import loadmat

import faintrack as ft
from faintrack.results.exports import FORMATS, export
from faintrack.results.exports.ellipse import SIGMAS, outline
from faintrack.results.result import Result
from faintrack.results.schema import estimated, planar
from faintrack.targets.states import PlanarState
from tests.cli.calling import call
from tests.kinds.small import result

KML = {"k": "http://www.opengis.net/kml/2.2", "gx": "http://www.google.com/kml/ext/2.2"}


def made(label: np.ndarray, start: str = "2020-05-01T00:00:00Z", longitude: float = -5.0) -> Result:
    """Result on earth: two slots, four scans 2 s apart, a deviation of 30 m to the east and 10 m to the north."""
    count = np.arange(4.0)[:, None] * np.ones(2)
    state = PlanarState(*(jnp.asarray(values) for values in (100 * count, 50 * count, 0 * count + 50, 0 * count + 25)))
    say = SimpleNamespace(
        existence=np.full((4, 2), 0.9),
        label=label,
        track_existence=np.full((4, 2), 0.9),
        mean=state,
        covariance=np.tile(np.diag([900.0, 100.0, 4.0, 1.0]), (4, 2, 1, 1)),
    )
    data = estimated(2.0 * np.arange(4), say, planar())
    data["latitude"] = ("time", "slot"), 36 + 1e-3 * count, {"units": "degree"}
    data["longitude"] = ("time", "slot"), (longitude + 2e-3 * count + 180) % 360 - 180, {"units": "degree"}
    data = data.assign_attrs(source="test", start_time=start, first_scan_time=0.0, scan_interval=2.0)
    return Result(data, SimpleNamespace(), SimpleNamespace(name="records"), 1.0)


TWO = np.array([[1, 0], [1, 0], [1, 0], [0, 2]])
UTC = [f"2020-05-01T00:00:0{second}.000Z" for second in (0, 2, 4)]


@pytest.fixture(scope="module")
def on_earth() -> Result:
    """A track of three scans, and one of the last scan alone."""
    return made(TWO)


def test_kml_has_times_places_and_ellipses(on_earth: Result, tmp_path: Path) -> None:
    root = ElementTree.parse(export(on_earth, tmp_path / "a.kml")).getroot()
    ways = root.findall(".//gx:Track", KML)
    assert [[when.text for when in way.findall("k:when", KML)] for way in ways] == [UTC, ["2020-05-01T00:00:06.000Z"]]
    assert [coord.text for coord in ways[0].findall("gx:coord", KML)][1] == "-4.9980000 36.0010000 0"
    rings = root.findall(".//k:Polygon//k:coordinates", KML)
    assert len(rings) == 4
    ring = np.array([point.split(",") for point in rings[0].text.split()], float)
    assert ring[0].tolist() == ring[-1].tolist()


def test_kml_is_read_by_fastkml(on_earth: Result, tmp_path: Path) -> None:
    fastkml = pytest.importorskip("fastkml")
    read = fastkml.KML.parse(export(on_earth, tmp_path / "a.kml"))
    (document,) = read.features
    assert [folder.name for folder in document.features] == ["track 1", "track 2"]
    ellipses = next(one for one in document.features[0].features if isinstance(one, fastkml.Folder))
    assert len(ellipses.features) == 3
    middle = np.mean(ellipses.features[0].geometry.exterior.coords[:-1], axis=0)
    np.testing.assert_allclose(middle, [-5, 36], atol=1e-6)
    assert ellipses.features[1].times.timestamp.dt.isoformat() == "2020-05-01T00:00:02+00:00"


def test_without_utc_kml_has_a_line_and_a_point(tmp_path: Path) -> None:
    root = ElementTree.parse(export(made(TWO, start=""), tmp_path / "a.kml")).getroot()
    assert root.find(".//gx:Track", KML) is None
    line = root.find(".//k:LineString/k:coordinates", KML)
    assert line.text.split()[2] == "-4.9960000,36.0020000"
    assert root.find(".//k:Placemark/k:Point/k:coordinates", KML).text == "-4.9940000,36.0030000"


def test_the_ellipse_holds_95_percent_and_is_as_large_as_pyproj_measures(on_earth: Result) -> None:
    """Of a Gaussian 95 % lie where the squared distance is below -2 ln 0.05, in units of the deviation."""
    pyproj = pytest.importorskip("pyproj")
    ring = outline(on_earth.tracks[0], 0)
    geod = pyproj.Geod(ellps="WGS84")
    _, _, away = geod.inv(np.full(37, -5.0), np.full(37, 36.0), *ring.T)
    # Metres become degrees by the curvature in the middle: good to a millionth of the size at some hundred metres.
    assert away.max() == pytest.approx(30 * SIGMAS, rel=1e-4)
    assert away.min() == pytest.approx(10 * SIGMAS, rel=1e-4)
    azimuth, _, _ = geod.inv(-5.0, 36.0, *ring[away.argmax()])
    assert abs(azimuth) == pytest.approx(90, abs=0.1)
    draws = np.random.default_rng(0).normal(size=(100_000, 2))
    share = np.mean(np.sum(draws**2, axis=1) < SIGMAS**2)
    assert share == pytest.approx(0.95, abs=5 * np.sqrt(0.95 * 0.05 / 1e5))  # five standard errors


def test_czml_moves_and_turns(on_earth: Result, tmp_path: Path) -> None:
    document, first, second = json.loads(export(on_earth, tmp_path / "a.czml").read_text())
    assert (document["id"], document["version"]) == ("document", "1.0")
    assert document["clock"]["interval"] == "2020-05-01T00:00:00.000Z/2020-05-01T00:00:06.000Z"
    assert first["position"]["epoch"] == "2020-05-01T00:00:00.000Z"
    places = np.reshape(first["position"]["cartographicDegrees"], (-1, 4))
    np.testing.assert_allclose(places, [[0, -5, 36, 0], [2, -4.998, 36.001, 0], [4, -4.996, 36.002, 0]], atol=1e-7)
    ellipse = {name: np.reshape(first["ellipse"][name]["number"], (-1, 2))[:, 1] for name in list(first["ellipse"])[:3]}
    np.testing.assert_allclose(ellipse["semiMajorAxis"], 30 * SIGMAS, rtol=1e-6)
    np.testing.assert_allclose(ellipse["semiMinorAxis"], 10 * SIGMAS, rtol=1e-6)
    # Counter-clockwise from north, an ellipse along east is turned by a right angle.
    np.testing.assert_allclose(np.sin(ellipse["rotation"]) ** 2, 1, atol=1e-6)
    assert second["availability"] == "2020-05-01T00:00:06.000Z/2020-05-01T00:00:06.000Z"


def test_geojson_is_cut_at_180_degrees(tmp_path: Path) -> None:
    one = made(np.array([[1, 0]] * 4), longitude=179.997)
    (feature,) = json.loads(export(one, tmp_path / "a.geojson").read_text())["features"]
    assert feature["geometry"]["type"] == "MultiLineString"
    west, east = feature["geometry"]["coordinates"]
    assert (west[-1][0], east[0][0]) == (180.0, -180.0)
    assert west[-1][1] == east[0][1] == pytest.approx(36.0015)


def test_geoparquet_by_its_specification(on_earth: Result, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    table = parquet.read_table(export(on_earth, tmp_path / "a.parquet"))
    geo = json.loads(table.schema.metadata[b"geo"])
    assert (geo["version"], geo["primary_column"]) == ("1.1.0", "geometry")
    assert geo["columns"]["geometry"] == {"encoding": "WKB", "geometry_types": ["Point"]}
    assert str(table.schema.field("utc").type) == "timestamp[ms, tz=UTC]"
    assert table.column("label").to_pylist() == [1, 1, 1, 2]


def test_geoparquet_is_read_by_geopandas(on_earth: Result, tmp_path: Path) -> None:
    geopandas = pytest.importorskip("geopandas")
    pytest.importorskip("pyarrow")
    table = geopandas.read_parquet(export(on_earth, tmp_path / "a.parquet"))
    assert table.crs.to_string() == "OGC:CRS84"
    np.testing.assert_allclose([table.geometry.x, table.geometry.y], [table.longitude_deg, table.latitude_deg])
    assert table.utc.iloc[1].isoformat() == "2020-05-01T00:00:02+00:00"


def test_netcdf_is_a_ragged_array_of_trajectories(on_earth: Result, tmp_path: Path) -> None:
    with xr.open_dataset(export(on_earth, tmp_path / "a.nc")) as data:
        assert (data.attrs["Conventions"], data.attrs["featureType"]) == ("CF-1.11", "trajectory")
        assert data.trajectory.attrs["cf_role"] == "trajectory_id"
        assert data.row_size.attrs["sample_dimension"] == "obs"
        assert data.row_size.values.tolist() == [3, 1]
        # xarray decodes time by the conventions.
        assert [f"{text}Z" for text in np.datetime_as_string(data.time.values[:3], unit="ms")] == UTC
        assert (data.latitude.attrs["units"], data.longitude.attrs["units"]) == ("degrees_north", "degrees_east")
        assert set(data.x.coords) == {"time", "latitude", "longitude"}
        np.testing.assert_allclose(data.x_std, 30)


def test_netcdf_is_read_by_the_library_of_unidata(on_earth: Result, tmp_path: Path) -> None:
    library = pytest.importorskip("netCDF4")
    with library.Dataset(export(on_earth, tmp_path / "a.nc")) as file:
        time = file["time"]
        moments = library.num2date(time[:], time.units, time.calendar)
        assert [moment.isoformat() for moment in moments] == [f"2020-05-01T00:00:0{second}" for second in (0, 2, 4, 6)]
        assert "_FillValue" not in time.ncattrs()
        assert file["x"].coordinates == "time latitude longitude"


def test_matlab_has_the_fields_of_an_object_track(on_earth: Result, tmp_path: Path) -> None:
    tracks = loadmat(export(on_earth, tmp_path / "a.mat"), squeeze_me=False)["tracks"]
    assert tracks.shape == (1, 2)
    first, second = tracks[0]
    assert [str(name[0]) for name in first["Components"][0]] == ["x", "vx", "y", "vy"]
    assert [str(name[0]) for name in first["Units"][0]] == ["m", "m/s", "m", "m/s"]
    np.testing.assert_array_equal(first["State"], [[0, 100, 200], [50, 50, 50], [0, 50, 100], [25, 25, 25]])
    assert first["StateCovariance"].shape == (4, 4, 3)
    np.testing.assert_array_equal(first["StateCovariance"][:, :, 1], np.diag([900, 4, 100, 1]))
    assert first["UpdateTime"].tolist() == [[0, 2, 4]]
    assert str(first["StartTime"][0]) == "2020-05-01T00:00:00.000Z"
    assert second["State"].shape == (4, 1)
    np.testing.assert_allclose(second["Longitude"], -4.994)


def test_audacity_labels_are_the_track(tmp_path: Path) -> None:
    one = _with_band()
    lines = export(one, tmp_path / "a.labels.txt").read_text().splitlines()
    (track,) = one.tracks
    start, end, said = lines[0].split("\t")
    assert (float(start), float(end)) == (pytest.approx(track.start_s - 0.1), pytest.approx(track.end_s + 0.1))
    assert said == f"track 1, bearing {track.average('bearing'):.1f} degree"
    assert lines[1].split("\t") == ["\\", "20.000000", "200.000000"]
    assert len(lines) == 2


def test_sound_without_a_band_has_no_frequencies(tmp_path: Path) -> None:
    one = result("recording")
    (label,) = export(one, tmp_path / "a.txt", "audacity").read_text().splitlines()
    assert label.count("\t") == 2
    head = export(one, tmp_path / "a.txt", "raven").read_text().splitlines()[0].split("\t")
    assert "Low Freq (Hz)" not in head


def test_raven_selections_are_the_track(tmp_path: Path) -> None:
    one = _with_band()
    with export(one, tmp_path / "a.selections.txt").open() as file:
        (row,) = csv.DictReader(file, delimiter="\t")
    (track,) = one.tracks
    assert (row["Selection"], row["View"], row["Channel"]) == ("1", "Spectrogram 1", "1")
    assert float(row["Begin Time (s)"]) == pytest.approx(track.start_s - 0.1)
    assert (row["Low Freq (Hz)"], row["High Freq (Hz)"]) == ("20.000", "200.000")
    assert float(row["bearing_deg_end"]) == pytest.approx(float(track.mean["bearing"][-1]), abs=1e-4)


def test_sound_is_read_by_crowsetta(tmp_path: Path) -> None:
    formats = pytest.importorskip("crowsetta").formats
    one = _with_band()
    (track,) = one.tracks
    table = formats.bbox.Raven.from_file(export(one, tmp_path / "a.selections.txt"), annot_col="Annotation")
    (box,) = table.to_bbox()
    assert (box.low_freq, box.high_freq, box.label) == (20, 200, "track 1")
    labels = formats.seq.AudSeq.from_file(export(result("recording"), tmp_path / "a.labels.txt"))
    (segment,) = labels.to_seq().segments
    assert segment.onset_s == pytest.approx(track.start_s - 0.1)


def test_napari_takes_frames_and_pixels(tmp_path: Path) -> None:
    one = result("frames")
    rows = np.load(export(one, tmp_path / "a.npy"))
    (track,) = one.tracks
    np.testing.assert_allclose(rows[:, 1], track.time)  # frames are 1 s apart
    np.testing.assert_allclose(rows[:, 2:], np.stack([track.mean["y"], track.mean["x"]], axis=1), rtol=1e-6)
    assert set(rows[:, 0]) == {1}
    layers = pytest.importorskip("napari.layers")
    assert layers.Tracks(rows).data.shape == rows.shape


def test_motchallenge_counts_from_one(tmp_path: Path) -> None:
    one = result("frames")
    rows = np.loadtxt(export(one, tmp_path / "a.mot.txt"), delimiter=",", ndmin=2)
    (track,) = one.tracks
    assert rows.shape == (len(track.time), 10)
    np.testing.assert_allclose(rows[:, 0], track.time + 1)
    np.testing.assert_allclose(rows[:, 2] + rows[:, 4] / 2, track.mean["x"] + 1, atol=2e-3)
    np.testing.assert_allclose(rows[:, 3] + rows[:, 5] / 2, track.mean["y"] + 1, atol=2e-3)
    assert (rows[:, 7:] == -1).all()


def test_motchallenge_is_read_by_its_metrics(tmp_path: Path) -> None:
    motmetrics = pytest.importorskip("motmetrics")
    table = motmetrics.io.loadtxt(export(result("frames"), tmp_path / "a.mot.txt"), fmt="mot15-2D")
    assert table.index.names == ["FrameId", "Id"]
    assert len(table) == len(result("frames").tracks[0].time)


@pytest.mark.parametrize("name", [name for name in FORMATS if name != "netcdf"])
def test_a_result_without_a_track_is_a_file(name: str, tmp_path: Path) -> None:
    if name == "geoparquet":
        pytest.importorskip("pyarrow")
    none: Any = made(np.zeros((4, 2), int))
    if name in ("napari", "mot", "raven", "audacity"):
        kind = "frames" if name in ("napari", "mot") else "recording"
        full = result(kind)
        none = Result(full.data.assign(label=full.data.label * 0), full.scenario, full.kind, 1.0)
    assert export(none, tmp_path / "a", name).exists()
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("kml", "has no latitude and longitude; KML needs places on earth"),
        ("czml", "has no latitude and longitude; CZML needs"),
        ("geojson", "has no latitude and longitude; GeoJSON needs"),
        ("geoparquet", "has no latitude and longitude; GeoParquet needs"),
        ("netcdf", "has no latitude and longitude; NetCDF"),
        ("napari", "tells bearing in degree; napari needs x and y in pixels"),
        ("mot", "tells bearing in degree; MOTChallenge needs x and y in pixels"),
    ],
)
def test_what_a_result_cannot_fill_is_a_sentence(name: str, sentence: str, tmp_path: Path) -> None:
    with pytest.raises(ft.InputError, match=sentence):
        result("recording").export(tmp_path / "a", name)
    assert not list(tmp_path.iterdir())


def test_sound_and_time_are_needed(tmp_path: Path) -> None:
    for name in ("audacity", "raven"):
        with pytest.raises(ft.InputError, match="is of no recording"):
            result("frames").export(tmp_path / "a", name)
    for name in ("czml", "netcdf"):
        with pytest.raises(ft.InputError, match="does not tell its time in UTC"):
            export(made(TWO, start=""), tmp_path / "a", name)
    with pytest.raises(ft.InputError, match="has no track"):
        export(made(0 * TWO), tmp_path / "a.nc")


def test_the_command_writes_and_refuses(tmp_path: Path) -> None:
    folder = result("frames").save(tmp_path / "night")
    done = call("export", folder, "--to", "mot")
    assert (done.status, done.out) == (0, f"written    {tmp_path / 'night.mot.txt'}\n")
    assert call("export", folder, "--out", tmp_path / "a.npy").status == 0
    for arguments, sentence in (
        ((folder,), "expected --to FORMAT, one of csv, geojson"),
        ((folder, "--to", "kmz"), "there is no format kmz; did you mean kml?"),
        ((folder, "--out", tmp_path / "a.txt"), "the name tells no format; expected one of .csv"),
        ((folder, "--out", tmp_path / "none" / "a.npy"), "cannot be written"),
        ((folder, "--to", "csv", "--out", tmp_path), "cannot be written: it is no file"),
        ((tmp_path / "nothing", "--to", "csv"), "is not a folder"),
    ):
        done = call("export", *arguments)
        assert done.status == 2
        assert sentence in done.err
        assert done.err.count("\n") == 1


def _with_band() -> Result:
    """A result of a recording in a band."""
    one = result("recording")
    analysis = one.scenario.analysis.model_copy(update={"band": (20.0, 200.0)})
    return Result(one.data, one.scenario.model_copy(update={"analysis": analysis}), one.kind, one.seconds)
