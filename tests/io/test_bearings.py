"""Bearings as files: what is read, and what a damaged file says."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from faintrack.data.bearings import from_columns
from faintrack.errors import InputError
from faintrack.io import read_bearings, write_bearings

HEAD = "time_s,bearing_deg,observer_x_m,observer_y_m\n"


def written(folder: Path, text: str, name: str = "bearings.csv") -> Path:
    (folder / name).write_text(text)
    return folder / name


def test_rows_of_a_time_are_a_scan(tmp_path: Path) -> None:
    path = written(tmp_path, HEAD + "0,90,1,2\n0,0,1,2\n\n2.5,,3,4\n4,-90,5,6\n")
    found = read_bearings(path)
    assert found.times.tolist() == [0.0, 2.5, 4.0]
    assert found.scan.tolist() == [0, 0, 2]
    assert found.rows.tolist() == [2, 3, 6]
    np.testing.assert_allclose(np.degrees(found.bearing), [0.0, 90.0, 180.0], atol=1e-12)
    assert found.place[:, 0].tolist() == [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]


def test_observers_have_rows_of_their_own(tmp_path: Path) -> None:
    text = "observer,bearing_deg,time_s,observer_y_m,observer_x_m\n7,90,0,0,0\n3,10,0,5,5\n7,91,1,0,0\n"
    found = read_bearings(written(tmp_path, text))
    assert found.observers.tolist() == [3, 7]
    assert found.heard.tolist() == [[True, True], [False, True]]
    write_bearings(tmp_path / "again.csv", found)
    again = read_bearings(tmp_path / "again.csv")
    np.testing.assert_allclose(np.sort(again.bearing), np.sort(found.bearing), atol=1e-9)
    np.testing.assert_array_equal(again.heard, found.heard)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "is empty"),
        (HEAD, "there is no scan"),
        ("time_s,bearing_deg,observer_x_m\n0,1,2\n", "there is no column observer_y_m; expected time_s, bearing_deg,"),
        (HEAD.replace("\n", ",snr_db\n") + "0,1,2,3,4\n", "there is a column 'snr_db'; expected none but time_s,"),
        ("time_s,time_s,bearing_deg,observer_x_m,observer_y_m\n", "there are two columns time_s"),
        (HEAD + "0,1,2\n", "row 2: 3 values; expected 4"),
        (HEAD + "0,nan,2,3\n", "row 2: bearing_deg is 'nan'; expected a number"),
        (HEAD + "0,east,2,3\n", "row 2: bearing_deg is 'east'; expected a number"),
        (HEAD + ",1,2,3\n", "row 2: time_s is missing; expected seconds"),
        (HEAD + "1,1,2,3\n0,1,2,3\n", "row 3: time_s is 0; expected ascending times"),
        (HEAD + "0,1,,3\n", "row 2: observer_x_m is missing; expected metres in every row"),
        (HEAD + "0,361,2,3\n", "row 2: bearing_deg is 361; expected -180 to 360 degrees"),
        (HEAD + "0,1,2,3\n0,5,2,4\n", "row 3: observer_y_m is 4; expected the same in all rows of an observer"),
        (
            HEAD + "0,1,2,3\n0,,2,3\n",
            "row 3: bearing_deg is missing; expected a bearing, where the observer has several",
        ),
        (HEAD.replace("\n", ",observer\n") + "0,1,2,3,0.5\n", "row 2: observer is 0.5; expected a whole number"),
    ],
)
def test_damaged_files_say_what_is_wrong(tmp_path: Path, text: str, says: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(InputError) as caught:
        read_bearings(path)
    assert str(path) in str(caught.value)
    assert says in str(caught.value)


def test_unknown_kinds_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"unknown kind of file; expected .csv or .zarr for bearings"):
        read_bearings(written(tmp_path, HEAD, "bearings.txt"))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"bearing_deg": [1.0, 2.0]}, r"bearing_deg has shape \(2,\); expected \(1,\)"),
        ({"time_s": [np.inf]}, "row 0: time_s is inf; expected seconds"),
    ],
)
def test_columns_that_do_not_fit(change: dict[str, Any], says: str) -> None:
    known = {"time_s": [0.0], "bearing_deg": [1.0], "observer_x_m": [0.0], "observer_y_m": [0.0]}
    with pytest.raises(InputError, match=says):
        from_columns(known | change)


def test_too_many_observers() -> None:
    many = np.arange(65.0)
    told = {"time_s": 0 * many, "bearing_deg": many, "observer_x_m": many, "observer_y_m": many, "observer": many}
    with pytest.raises(InputError, match="there are 65 observers; expected at most 64"):
        from_columns(told)
