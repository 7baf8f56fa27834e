"""Detections that Stone Soup reads stand for the places that bearings and echoes come from, and their errors."""

from datetime import datetime, timedelta

import numpy as np
import pytest

import faintrack as ft
from faintrack.io.returns import write_returns
from tests import bearings

pytest.importorskip("stonesoup")

from stonesoup.models.measurement.nonlinear import Cartesian2DToBearing
from stonesoup.types.detection import Detection
from stonesoup.types.state import State

from faintrack.stonesoup import BearingsReader, ReturnsReader, bearings_of

SPEED, SOURCE, RECEIVER = 1500.0, np.array([0.0, 0.0]), np.array([500.0, 1000.0])
TARGETS = np.array([[9e3, 4e3], [-7e3, 2e3], [3e3, -8e3]])
START = datetime(1970, 1, 1)


def way(target: np.ndarray, source: np.ndarray, receiver: np.ndarray) -> float:
    """From source over target to receiver; m."""
    return float(np.hypot(*(target - source)) + np.hypot(*(target - receiver)))


def echoes(**columns: list[float]) -> ft.Returns:
    """An echo of each target, one a ping."""
    east, north = (TARGETS - RECEIVER).T
    return ft.from_returns(
        {
            "time_s": 60.0 * np.arange(3),
            "delay_s": [way(target, SOURCE, RECEIVER) / SPEED for target in TARGETS],
            "bearing_deg": np.degrees(np.arctan2(east, north)),
            "snr_db": [10.0, 11.0, 12.0],
            **columns,
        }
    )


def test_an_echo_is_where_its_target_is(tmp_path) -> None:
    write_returns(tmp_path / "returns.csv", echoes())
    reader = ReturnsReader(tmp_path / "returns.csv", 1.0, 0.1, SOURCE, RECEIVER, SPEED)
    for number, (time, (detection,)) in enumerate(reader):
        assert time == START + timedelta(minutes=number)
        place = detection.measurement_model.inverse_function(detection)
        # Nine digits in the file, single precision for the range: a centimetre of ten kilometres.
        np.testing.assert_allclose(place[[0, 2], 0].astype(float), TARGETS[number], atol=0.01)
        assert round(detection.metadata["snr_db"], 6) == 10 + number


def test_errors_are_those_of_places_a_little_off() -> None:
    """Central differences of the geometry itself: bearing and way to the place, turned and drawn out."""
    error_deg, delay_error = 2.0, 0.05
    reader = ReturnsReader(echoes(), error_deg, delay_error, SOURCE, RECEIVER, SPEED)
    for target, (_, (detection,)) in zip(TARGETS, reader, strict=True):
        east, north = target - RECEIVER
        bearing, distance, small = np.arctan2(north, east), np.hypot(east, north), 1e-4

        def measured(bearing: float, distance: float) -> np.ndarray:
            there = RECEIVER + distance * np.array([np.cos(bearing), np.sin(bearing)])
            return np.array([bearing, way(there, SOURCE, RECEIVER) / SPEED])

        slopes = np.stack(
            [
                (measured(bearing + small, distance) - measured(bearing - small, distance)) / (2 * small),
                (measured(bearing, distance + 1) - measured(bearing, distance - 1)) / 2,
            ],
            axis=-1,
        )
        back = np.linalg.inv(slopes)
        expected = back @ np.diag([np.radians(error_deg) ** 2, delay_error**2]) @ back.T
        np.testing.assert_allclose(detection.measurement_model.covar().astype(float), expected, rtol=1e-4)


def test_platforms_of_the_file_move() -> None:
    moving = {"receiver_x_m": [500.0] * 3, "receiver_y_m": [1000.0] * 3, "receiver_vx": [2.0] * 3}
    moving |= {"receiver_vy": [0.0] * 3}
    reader = ReturnsReader(echoes(**moving), 1.0, 0.1, SOURCE, None, SPEED)
    for target, (_, (detection,)) in zip(TARGETS, reader, strict=True):
        place = detection.measurement_model.inverse_function(detection)
        np.testing.assert_allclose(place[[0, 2], 0].astype(float), target, atol=0.01)


def test_a_platform_that_nobody_knows_is_asked_for() -> None:
    with pytest.raises(ft.InputError, match="does not tell where the receiver is; expected receiver="):
        list(ReturnsReader(echoes(), 1.0, 0.1, SOURCE))


def test_several_pairs_are_refused() -> None:
    with pytest.raises(ft.InputError, match="holds 3 pairs"):
        list(ReturnsReader(echoes(receiver=["a", "b", "c"]), 1.0, 0.1, SOURCE, RECEIVER))


@pytest.mark.parametrize("observers", [1, 2])
def test_bearings_there_and_back(observers: int) -> None:
    """Each observer's detections to Stone Soup and back: the same sets, also those without a bearing."""
    data = bearings.drawn(present=True, observers=observers)
    scans = list(BearingsReader(data, error_deg=1.0))
    apart = [
        [(time, {one for one in found if one.metadata["observer"] == number}) for time, found in scans]
        for number in range(observers)
    ]
    back = bearings_of(*apart)
    np.testing.assert_array_equal(back.times, data.times)
    np.testing.assert_array_equal(back.heard, data.heard)
    np.testing.assert_allclose(back.place, data.place, atol=1e-6)

    def sets(some: ft.Bearings) -> list[list[float]]:
        order = np.lexsort((some.bearing % (2 * np.pi), some.observer, some.scan))
        return [(some.bearing[order] % (2 * np.pi)).tolist(), some.observer[order].tolist(), some.scan[order].tolist()]

    for mine, theirs in zip(sets(back), sets(data), strict=True):
        np.testing.assert_allclose(mine, theirs, atol=1e-9)
    assert bool(back.remarks) == bool((np.bincount(data.scan * observers + data.observer) == 0).any())


def test_bearings_of_sensors_that_are_turned() -> None:
    """Stone Soup's own model says what a turned sensor hears; the place is where it truly is."""
    rng = np.random.default_rng(3)
    scans, expected = [], []
    for number in range(8):
        place, target, turned = rng.normal(size=2), 100 * rng.normal(size=2), rng.uniform(-3, 3)
        model = Cartesian2DToBearing(
            ndim_state=4,
            mapping=(0, 2),
            noise_covar=np.eye(1),
            translation_offset=place[:, None],
            rotation_offset=np.array([[0.0], [0.0], [turned]]),
        )
        heard = model.function(State([[target[0]], [0.0], [target[1]], [0.0]]))
        time = START + timedelta(seconds=number)
        scans.append((time, {Detection(heard, timestamp=time, measurement_model=model)}))
        expected.append(np.arctan2(*(target - place)[::-1]))
    difference = bearings_of(scans).bearing - expected
    np.testing.assert_allclose(np.angle(np.exp(1j * difference)), 0, atol=1e-9)


def test_what_has_no_bearing_is_refused() -> None:
    without = Detection(np.zeros((2, 1)), timestamp=START)
    with pytest.raises(ft.InputError, match="has the measurement model NoneType"):
        bearings_of([(START, {without})])
    with pytest.raises(ft.InputError, match="observer 0 of Stone Soup has no detection"):
        bearings_of([(START, set())])
    with pytest.raises(ft.InputError, match="there are no detections"):
        bearings_of()
