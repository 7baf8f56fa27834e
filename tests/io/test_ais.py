"""Ships of AIS reports: a real file, tables of other names, sentences of a receiver; what cannot be read is said."""

from pathlib import Path

import numpy as np
import pytest

from faintrack.io.ais import read_ships
from tests.io.test_bad_input import sentence_about

SOLENT = Path(__file__).parents[3] / "shared/data/ais_solent/SolentAIS_20160112_130211.csv"


@pytest.mark.skipif(not SOLENT.exists(), reason="the AIS reports of the Solent are not here")
def test_the_ships_of_the_solent() -> None:
    ships = read_ships(SOLENT)
    assert len(ships) == 91
    assert sum(len(ship.times) for ship in ships) <= 18_623
    assert all(ship.utc and ship.degrees for ship in ships)
    assert all((np.diff(ship.times) > 0).all() for ship in ships)
    places = np.concatenate([ship.places for ship in ships])
    # One report of a moored ship has a longitude of 54.8 degrees; it is for those who read on to pass over.
    assert ((places > [50, -3]) & (places < [52, 0])).all(axis=1).sum() == len(places) - 1
    first = np.datetime64("2016-01-12T13:02:11.218", "ms")
    assert min(ship.times[0] for ship in ships) == pytest.approx(float(first.astype(int)) * 1e-3)


@pytest.mark.parametrize(
    ("text", "in_utc", "degrees"),
    [
        ("TIME,Name,LAT,lon\n1970-01-01 00:01,a,50,-1\n1970-01-01T00:00:30Z,a,51,-1\n", True, True),
        ("lon,lat,mmsi,time_s,speed\n-1,50,a,60,fast\n-1,51,a,30,\n-1,49,a,60,\n", False, True),
        ("time_s,name,x_m,y_m\n60,a,50,-1\n\n30,a,51,-1\n", False, False),
    ],
)
def test_reports_are_put_in_the_order_of_time(tmp_path: Path, text: str, in_utc: bool, degrees: bool) -> None:
    (tmp_path / "ais.csv").write_text(text)
    (ship,) = read_ships(tmp_path / "ais.csv")
    assert (ship.name, ship.utc, ship.degrees) == ("a", in_utc, degrees)
    assert ship.times.tolist() == [30.0, 60.0]
    np.testing.assert_array_equal(ship.places, [[51, -1], [50, -1]])


def tagged(seconds: float, message: dict) -> str:
    """Sentences of a message with its time in a tag block."""
    pyais = pytest.importorskip("pyais")
    content = f"c:{seconds:.0f}"
    check = 0
    for character in content.encode():
        check ^= character
    (sentence,) = pyais.encode_dict(message, talker_id="AI")
    return f"\\{content}*{check:02X}\\{sentence}\n"


def test_sentences_of_a_receiver(tmp_path: Path) -> None:
    report = {"msg_type": 1, "mmsi": "235013375", "lat": 50.7766, "lon": -1.1087, "speed": 19.8}
    nowhere = report | {"lat": 91.0, "lon": 181.0}
    path = tmp_path / "receiver.nmea"
    lines = [tagged(1452603731, report), tagged(1452603741, nowhere), tagged(1452603751, report | {"lat": 50.78})]
    path.write_text("".join(lines))
    (ship,) = read_ships(path)
    assert (ship.name, ship.utc, ship.degrees) == ("235013375", True, True)
    assert ship.times.tolist() == [1452603731, 1452603751]
    np.testing.assert_allclose(ship.places, [[50.7766, -1.1087], [50.78, -1.1087]], atol=1e-5)
    path.write_text(lines[0].split("\\")[-1])
    assert "no tag block with a time" in sentence_about(path, lambda: read_ships(path))


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("a.csv", "", "is empty"),
        ("a.csv", "time,mmsi,latitude,longitude\n", "there is no report of a position"),
        ("a.csv", "time,mmsi,lat\n2016-01-12,1,2\n", "there is no column longitude; expected time, mmsi"),
        ("a.csv", "time,lat,lon\n2016-01-12,1,2\n", "there is no column mmsi"),
        ("a.csv", "time,mmsi,lat,lon\n2016-01-12,1,2\n", "row 2: 3 values; expected 4"),
        ("a.csv", "time,mmsi,lat,lon\n12 January,1,2,3\n", "row 2: time is '12 January'; expected a UTC time"),
        ("a.csv", "time_s,mmsi,lat,lon\n0,1,north,3\n", "row 2: latitude is 'north'; expected a number"),
        ("a.txt", "no sentence\n", "there is no report of a position"),
        ("a.xls", "anything", "unknown kind of file; expected .csv, or .nmea"),
    ],
)
def test_files_that_hold_no_reports(tmp_path: Path, name: str, text: str, expected: str) -> None:
    path = tmp_path / name
    path.write_text(text)
    assert expected in sentence_about(path, lambda: read_ships(path))
