"""Scenarios of several arrays: what they build, in metres and in degrees, and what is refused in one sentence."""

from typing import Any

import numpy as np
import pytest

import faintrack as ft
from faintrack.beliefs.axis import Axis
from faintrack.data.records import in_step
from faintrack.errors import InputError
from faintrack.kinds.records.build import (
    build_detectors,
    build_fans,
    build_likelihood,
    build_placed,
    build_plane,
    build_region,
    require_heard,
)
from faintrack.scenario.plane import Plane
from faintrack.sensors.array import line_array
from tests.stations import record, records, scenario, tables

pytest.importorskip("pyproj")
GEO = {
    "stations": [
        {"name": "west", "latitude": 50.7, "longitude": -1.2, "heading_deg": 90.0},
        {"name": "east", "latitude": 50.7, "longitude": -1.1, "line": False},
    ],
    "region": {"x": None, "y": None, "latitude": [50.72, 50.78], "longitude": [-1.2, -1.1]},
}


def test_a_scenario_is_written_and_read_back(tmp_path) -> None:
    for what in (scenario(), scenario(**GEO)):
        what.save(tmp_path / "s.toml")
        assert ft.Scenario.read(tmp_path / "s.toml") == what


def test_detectors_cover_the_region_and_overlap() -> None:
    what = scenario(region={"detectors": [3, 2], "overlap": 0.2})
    region = build_region(what, None)
    detectors, outside = build_detectors(what, region, 1.0)
    assert outside is None
    axes = dict(detectors.filter.grid.axes)
    # 1200 m in three parts that share a fifth: 1200 / 2.6 = 461.5 m, 10 cells; 800 / 1.8 = 444.4 m, 9 cells.
    assert (axes["x"].count, axes["y"].count) == (10, 9)
    west = np.unique(detectors.place.x)
    np.testing.assert_allclose(west, [-600, -250, 100])
    assert west[-1] + 10 * 50 == 600
    assert np.unique(detectors.place.y).tolist() == [200, 550]
    np.testing.assert_allclose(axes["vx"].edges, [-6, -2, 2, 6])


def test_levels_are_known_or_in_standard_deviations() -> None:
    what = scenario(energies={"absent": [10.0, 2.0], "present": None})
    fans = build_fans(what, in_step(records(9)), {}, build_placed(what, in_step(records(9)), {}, {}, None))
    likelihood = build_likelihood(what, fans)
    assert (likelihood.absent_mean, likelihood.absent_std) == (10.0, 2.0)
    assert (likelihood.present_mean, likelihood.present_std) == (14.0, 2.0)
    assert scenario(energies={"present": None}).energies.levels == ((0.0, 1.0), (2.0, 1.0))


def test_an_array_that_moves_is_between_the_rows_of_its_path() -> None:
    what = scenario(stations=[{"name": "towed", "path": "path.csv"}])
    times = np.arange(11.0) + 100
    path = {
        "time_s": np.array([100.0, 110.0]),
        "x_m": np.array([0.0, 50.0]),
        "y_m": np.array([10.0, 10.0]),
        "heading_deg": np.array([350.0, 10.0]),
    }
    placed = build_placed(what, in_step((record(np.zeros((11, 61)), times),)), {"towed": path}, {}, None)
    np.testing.assert_allclose(placed.x[:, 0], 5 * np.arange(11.0))
    np.testing.assert_allclose(placed.y[:, 0], 10)
    # Through north, not around.
    np.testing.assert_allclose(np.degrees(placed.heading[:, 0]) % 360, (350 + 2 * np.arange(11.0)) % 360, atol=1e-9)


def test_paths_are_on_the_clock_of_their_record() -> None:
    stations = [{"name": "a", "path": "a.csv", "clock_offset": 5.0}, {"name": "b", "x": 0.0, "y": 0.0, "line": False}]
    times = np.arange(20.0)
    together = in_step((record(np.zeros((20, 61)), times + 5), record(np.zeros((20, 61)), times)), (5.0, 0.0))
    path = {name: np.array(values) for name, values in (("time_s", [5.0, 24.0]), ("x_m", [0.0, 19.0]))}
    path |= {"y_m": np.zeros(2), "heading_deg": np.zeros(2)}
    placed = build_placed(scenario(stations=stations), together, {"a": path}, {}, None)
    np.testing.assert_allclose(placed.x[:, 0], times)


def test_the_axis_of_channels_is_the_heading_of_their_line() -> None:
    what = scenario(
        stations=[
            {"name": "a", "x": 0.0, "y": 0.0, "array": {"line": {"count": 4, "spacing": 1.0, "heading_deg": 70.0}}}
        ]
    )
    together = in_step((record(np.zeros((9, 61)), np.arange(9.0)),))
    placed = build_placed(what, together, {}, {"a": line_array(4, 1.0, heading=np.radians(70.0))}, None)
    np.testing.assert_allclose(np.degrees(placed.heading), 70.0)


class TestDegrees:
    def test_distance_along_the_meridian_and_the_parallel(self) -> None:
        """By the radii of curvature of WGS84 at 50 degrees."""
        a, e2 = 6378137.0, 0.00669437999014
        w = 1 - e2 * np.sin(np.radians(50)) ** 2
        meridian, parallel = a * (1 - e2) / w**1.5, a / np.sqrt(w) * np.cos(np.radians(50))
        x, y = Plane(50.0, 7.0).metres(np.array([50.001, 50.0]), np.array([7.0, 7.001]))
        np.testing.assert_allclose([x[0], y[0]], [0, meridian * np.radians(0.001)], atol=1e-3)
        np.testing.assert_allclose([x[1], y[1]], [parallel * np.radians(0.001), 0], atol=1e-3)

    def test_there_and_back(self) -> None:
        plane = Plane(50.75, -1.15)
        latitude, longitude = np.random.default_rng(0).uniform([[50], [-2]], [[51], [0]], (2, 50))
        back = plane.degrees(*plane.metres(latitude, longitude))
        np.testing.assert_allclose(back, (latitude, longitude), atol=1e-9)

    def test_north_leans_as_meridians_converge(self) -> None:
        """By the sine of the latitude times the difference in longitude, to first order."""
        plane = Plane(50.0, 0.0)
        assert float(plane.north_deg(50.0, 0.5)) == pytest.approx(-0.5 * np.sin(np.radians(50)), rel=1e-3)
        assert float(plane.north_deg(50.2, 0.0)) == pytest.approx(0.0, abs=1e-6)

    def test_headings_and_bearings_are_turned_by_it(self) -> None:
        what = scenario(**GEO)
        plane = build_plane(what)
        assert plane is not None
        together = in_step(records(9))
        placed = build_placed(what, together, {}, {}, plane)
        lean = plane.north_deg(np.array([50.7, 50.7]), np.array([-1.2, -1.1]))
        assert lean[0] > 0.03 > -0.03 > lean[1]
        np.testing.assert_allclose(np.degrees(placed.heading[0, 0]), 90 + lean[0])
        fans = build_fans(what, together, {}, placed)
        assert fans.line == (True, False)
        np.testing.assert_allclose(np.degrees(fans.first), [0.0, lean[1]], atol=1e-9)

    def test_a_region_in_degrees_is_within_its_ends(self) -> None:
        what = scenario(**GEO)
        plane = build_plane(what)
        assert plane is not None
        (west, east), (south, north) = build_region(what, plane)
        x, y = plane.metres(np.array([50.72, 50.72, 50.78, 50.78]), np.array([-1.2, -1.1, -1.2, -1.1]))
        assert west <= x.min() < x.max() <= east
        assert south <= y.min() < y.max() <= north
        assert east - west == pytest.approx(np.ptp(x), rel=1e-6)


def refused(**changes: Any) -> str:
    sections = {name: value for name, value in tables(**changes).items() if value is not None}
    with pytest.raises(InputError) as caught:
        ft.Scenario(kind="records", **sections)
    return str(caught.value)


STATION = {"name": "a", "x": 0.0, "y": 0.0, "heading_deg": 0.0}


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"stations": []}, "stations: expected a list of 1 or more"),
        ({"stations": [STATION | {"y": None}]}, "a: expected both x and y"),
        (
            {"stations": [STATION | {"x": None, "y": None}]},
            "a: expected one of x and y, latitude and longitude, and path",
        ),
        ({"stations": [STATION | {"path": "p.csv"}]}, "found x and y and path"),
        ({"stations": [STATION | {"heading_deg": None}]}, "a: heading_deg is missing"),
        ({"stations": [STATION | {"latitude": 95.0}]}, "stations[0].latitude is 95.0"),
        ({"stations": [STATION | {"start_time": "yesterday"}]}, "start_time is 'yesterday': expected a UTC time"),
        ({"stations": [STATION | {"line": True, "array": {"line": {"count": 4, "spacing": 1.0}}}]}, "tells line"),
        ({"stations": [STATION, STATION]}, "two stations have the name 'a'"),
        ({"stations": [STATION | {"depth": 3.0}]}, "there is no field stations[0].depth"),
        ({"region": {"x": [600.0, -600.0]}}, "x goes from 600 to -600: expected the lower end first"),
        ({"region": {"y": None}}, "expected either x and y or latitude and longitude"),
        ({"region": {"latitude": [50.0, 51.0]}}, "found x and y and latitude and longitude"),
        ({"region": {"cell": 0.0}}, "region.cell is 0.0"),
        ({"region": None}, "there are 2 [[stations]] and no [region]: expected both"),
        ({"region": None, "stations": [STATION]}, "a has x and y and there is no [region]: expected both or neither"),
        (
            {"region": None, "stations": [{"name": "a", "heading_deg": 9.0}]},
            "a has heading_deg and there is no [region]",
        ),
        ({"stations": None}, "stations is missing"),
        (
            {"stations": [GEO["stations"][0]]},
            "west has latitude and longitude, and region has x and y: expected the same for both",
        ),
        ({"energies": {"present": [0.0, 1.0]}}, "present is 0 with standard deviation 1: expected above 0"),
        ({"energies": {"present": [3.0, 0.5]}}, "not below 1"),
        ({"energies": {"absent": [3.0, 0.0]}}, "absent has the standard deviation 0"),
        ({"several": {"drop": 0.995}}, "drop: expected less than declare"),
        ({"tracker": {"declare": 0.5}}, "there is no field tracker"),
        ({"filter": {"particles": 64}}, "there is no field filter.particles"),
        ({"target": {"speed": 3.0}}, "there is no field target.speed"),
        ({"simulation": {"scans": 9, "targets": [{"x": 3.0}]}}, "simulation.targets[0].y is missing"),
    ],
)
def test_scenarios_that_are_wrong(changes: dict[str, Any], expected: str) -> None:
    assert expected in refused(**changes)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"speeds": 99, "cell": 2.0}, "region: 2 detectors of 343 x 400 cells with 99 x 99 speeds are"),
        (
            {"speeds": 7, "surroundings": 1_000_000.0},
            "region.surroundings: with 1e+06 m around the region there are",
        ),
        ({"speed": 500.0}, "region: targets move up to 500 m between two scans, more than half a detector"),
    ],
)
def test_regions_that_no_memory_or_no_motion_fits(changes: dict[str, Any], expected: str) -> None:
    what = scenario(region=changes)
    with pytest.raises(InputError) as caught:
        build_detectors(what, build_region(what, None), 1.0)
    assert expected in str(caught.value)


def test_arrays_that_hear_nothing_of_the_region() -> None:
    """Beams from 0 to 30 degrees off an axis that points away from it."""
    what = scenario(stations=[STATION | {"name": "away", "heading_deg": 180.0}])
    together = in_step((record(np.zeros((9, 11)), np.arange(9.0), axis=Axis(0.0, 3.0, 11)),))
    placed = build_placed(what, together, {}, {}, None)
    fans = build_fans(what, together, {}, placed)
    with pytest.raises(InputError, match="station away hears nothing of the region"):
        require_heard(what, fans, placed, build_region(what, None))


def test_bearings_that_no_array_hears() -> None:
    what = scenario(stations=[STATION])
    together = in_step((record(np.zeros((9, 61)), np.arange(9.0), axis=Axis(-180.0, 6.0, 61)),))
    with pytest.raises(InputError, match=r"bearings from -180 to 180 degrees; expected 0 to 180 from the axis"):
        build_fans(what, together, {}, build_placed(what, together, {}, {}, None))


def test_a_path_that_ends_too_early() -> None:
    what = scenario(stations=[{"name": "towed", "path": "path.csv"}])
    path = {"time_s": np.array([0.0, 5.0]), "x_m": np.zeros(2), "y_m": np.zeros(2), "heading_deg": np.zeros(2)}
    together = in_step((record(np.zeros((11, 61)), np.arange(11.0)),))
    with pytest.raises(InputError, match=r"path.csv: the path of towed has the times 0 to 5 s; expected all"):
        build_placed(what, together, {"towed": path}, {}, None)
    del path["heading_deg"]
    with pytest.raises(InputError, match="station towed: the path has no heading_deg"):
        build_placed(what, in_step((record(np.zeros((5, 61)), np.arange(5.0)),)), {"towed": path}, {}, None)
