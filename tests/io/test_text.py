"""Tables in the dialects of other programs: read as they are meant, and what was taken is told."""

import numpy as np
import pytest

from faintrack.errors import InputError
from faintrack.io import read_bearings, read_record, read_returns
from faintrack.io.ais import read_ships

PLAIN = "time_s,delay_s,bearing_deg,snr_db\n0,9.5,90,13.25\n0,12.5,10,14\n180,,,\n"


def saved(tmp_path, text, name="a.csv", encoding="utf-8"):
    (tmp_path / name).write_text(text, encoding=encoding)
    return tmp_path / name


@pytest.mark.parametrize(
    ("text", "remarks"),
    [
        (PLAIN, ()),
        (PLAIN.replace(",", ";"), ("Values are parted by semicolons.",)),
        (PLAIN.replace(",", "\t"), ("Values are parted by tabs.",)),
        (
            PLAIN.replace(",", ";").replace(".", ","),
            ("Values are parted by semicolons and numbers have decimal commas.",),
        ),
        (PLAIN.replace("\n", "\r\n"), ()),
        (PLAIN.replace("time_s", "time"), ()),
        (
            PLAIN.replace("\n0,", "\n2024-02-29T23:59:00Z,").replace("\n180,", "\n2024-03-01 00:02:00,"),
            ("Times are taken as UTC; second 0 is 2024-02-29T23:59:00.000.",),
        ),
    ],
)
def test_returns_in_other_dialects(tmp_path, text, remarks):
    path = saved(tmp_path, text, encoding="utf-8-sig")
    found, plain = read_returns(path), read_returns(saved(tmp_path, PLAIN, "b.csv"))
    for name in ("times", "delay", "bearing", "power", "ping", "rows"):
        np.testing.assert_array_equal(getattr(found, name), getattr(plain, name))
    assert found.remarks == remarks


def test_rows_that_stand_twice_count_once(tmp_path):
    found = read_returns(saved(tmp_path, PLAIN.replace("0,12.5", "0,9.5,90,13.25\n0,12.5")))
    assert found.counts.tolist() == [2, 0]
    assert found.remarks == ("1 rows stand in the file twice; each counts once.",)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("time_s;delay_s;bearing_deg;snr_db\n0;9,5;90;13.25\n", "expected decimal commas or points, not both"),
        ("time_s,delay_s,bearing_deg,snr_db\n0,1.234.5,90,13\n", "expected a number"),
        (
            "time_s,delay_s,bearing_deg,snr_db\n0,1,90,13\n2024-02-29,1,90,13\n",
            "expected seconds, as in the rows before",
        ),
        (
            "time_s,delay_s,bearing_deg,snr_db\n2024-02-29,1,90,13\n0,1,90,13\n",
            "expected a date, as in the rows before",
        ),
        ("time_s,delay_s,bearing_deg,snr_db\n02/29/2024,1,90,13\n", "expected a number"),
        ("\n", "the first row is empty"),
        ("a," * 30_000 + "\n", "columns; expected at most"),
    ],
)
def test_what_could_be_read_in_two_ways_is_refused(tmp_path, text, expected):
    with pytest.raises(InputError, match=expected):
        read_returns(saved(tmp_path, text))


def test_records_and_bearings_and_ships(tmp_path):
    record = read_record(saved(tmp_path, "time;0;90;180\n2024-02-29 12:00;1,5;2;0\n2024-02-29 12:01;0;;0,5\n"))
    assert record.times.tolist() == [0, 60]
    assert str(record.start_time) == "2024-02-29T12:00:00.000000000"
    np.testing.assert_array_equal(record.read(0, 2), [[1.5, 2, 0], [0, np.nan, 0.5]])
    assert len(record.remarks) == 2
    bearings = read_bearings(saved(tmp_path, "time_s;bearing_deg;observer_x_m;observer_y_m\n0;41,2;0;0\n1;;10;0\n"))
    np.testing.assert_allclose(np.degrees(bearings.bearing), [48.8])
    assert bearings.remarks == ("Values are parted by semicolons and numbers have decimal commas.",)
    (ship,) = read_ships(saved(tmp_path, "Time;MMSI;Lat;Lon\n2016-01-12 13:02:11.5;235;50,77;-1,09\n"))
    assert ship.places.tolist() == [[50.77, -1.09]]
