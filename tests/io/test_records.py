"""Records are read as they were written, whatever holds them; what cannot be read is said in one sentence."""

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

from faintrack.io.records import holds_record, read_record
from tests.io.test_bad_input import sentence_about

TIMES = np.array([10.0, 11.0, 14.0])
BEARINGS = np.array([-30.0, 0.0, 30.0, 60.0])
ENERGIES = np.array([[0.5, 1.5, -2.0, 3.25], [1.0, np.nan, 0.0, 7.5], [2.0, 2.5, 3.0, np.nan]])


def write_npz(path: Path, **arrays: object) -> None:
    np.savez(path, **{"energy": ENERGIES, "time": TIMES, "bearing": BEARINGS} | arrays)


def write_hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file.update({"energy": ENERGIES, "time": TIMES, "bearing": BEARINGS})


def write_zarr(path: Path) -> None:
    data = xr.Dataset({"energy": (("time", "bearing"), ENERGIES)}, {"time": TIMES, "bearing": BEARINGS})
    data.to_zarr(path, zarr_format=2)


def write_transposed(path: Path) -> None:
    """Axes that the file names may be in any order, bearings may descend."""
    data = xr.Dataset({"level": (("bearing", "time"), ENERGIES.T)}, {"time": TIMES, "bearing": BEARINGS})
    data.isel(bearing=slice(None, None, -1)).to_zarr(path, zarr_format=2)


def write_csv(path: Path) -> None:
    rows = [["time_s", *BEARINGS], *np.column_stack([TIMES, ENERGIES]).tolist()]
    path.write_text("\n".join(",".join(map(str, row)) for row in rows).replace("nan", "") + "\n")


def write_csv_of_a_spreadsheet(path: Path) -> None:
    write_csv(path)
    text = path.read_text().replace(",", " , ").replace("\n", "\r\n") + ",,,,\r\n\r\n"
    path.write_bytes(b"\xef\xbb\xbf" + text.encode())


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("a.npz", write_npz),
        ("A.NPZ", lambda path: write_npz(path.with_suffix(".npz")) or path.with_suffix(".npz").rename(path)),
        ("a.npz", lambda path: write_npz(path, bearing=BEARINGS[::-1], energy=ENERGIES[:, ::-1])),
        ("a.npz", lambda path: write_npz(path, map=np.zeros((20, 20)))),
        ("a.h5", write_hdf5),
        ("a.hdf5", write_hdf5),
        ("a.zarr", write_zarr),
        ("a.zarr", write_transposed),
        ("a.csv", write_csv),
        ("a.CSV", write_csv_of_a_spreadsheet),
    ],
)
def test_every_kind_of_file_gives_the_same_record(tmp_path: Path, name: str, write: Callable[[Path], object]) -> None:
    path = tmp_path / name
    write(path)
    assert holds_record(path)
    record = read_record(str(path))
    np.testing.assert_array_equal(record.times, TIMES)
    ((axis_name, axis),) = record.axes
    assert axis_name == "bearing"
    np.testing.assert_array_equal(axis.values, BEARINGS)
    np.testing.assert_array_equal(record.read(0, 3), ENERGIES)
    np.testing.assert_array_equal(record.read(1, 2), ENERGIES[1:2])
    assert record.start_time is None


@pytest.mark.parametrize("ends", [(-30.0, 60.0), (60.0, -30.0)])
def test_bearings_that_the_file_does_not_tell(tmp_path: Path, ends: tuple[float, float]) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, beam_power=ENERGIES, time=TIMES)
    record = read_record(path, ends)
    np.testing.assert_array_equal(dict(record.axes)["bearing"].values, BEARINGS)
    np.testing.assert_array_equal(record.read(0, 3), ENERGIES if ends[0] < ends[1] else ENERGIES[:, ::-1])


def test_time_in_utc_is_kept(tmp_path: Path) -> None:
    moments = np.datetime64("2016-01-12T13:00:00", "ns") + (TIMES * 1e9).astype("timedelta64[ns]")
    data = xr.Dataset({"energy": (("time", "bearing"), ENERGIES)}, {"time": moments, "bearing": BEARINGS})
    data.to_zarr(tmp_path / "a.zarr", zarr_format=2)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.update({"energy": ENERGIES, "time": TIMES / 60, "bearing": BEARINGS})
        file["time"].attrs["units"] = "minutes since 2016-01-12 13:00:00"
    for name in ("a.zarr", "a.h5"):
        record = read_record(tmp_path / name)
        assert record.start_time is not None
        found = record.start_time + (record.times * 1e9).round().astype("timedelta64[ns]")
        np.testing.assert_array_equal(found, moments)


def test_recordings_are_no_records(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["time_data"] = np.zeros((10, 2))
    assert not holds_record(tmp_path / "a.h5")
    assert not holds_record(tmp_path / "a.wav")


@pytest.mark.parametrize(
    ("arrays", "ends", "expected"),
    [
        ({"time": None}, None, "there is no array time; expected the seconds of every row"),
        ({"bearing": None}, None, "there is no array bearing; expected degrees, or beams_deg of the station"),
        ({}, (0.0, 90.0), "the file tells its bearings; expected no beams_deg"),
        ({"bearing": None}, (0.0, 0.0), "beams_deg is uneven"),
        ({"time": TIMES[:2]}, None, "time has shape (2,); expected (3,)"),
        ({"time": TIMES[::-1]}, None, "the time of frame 1 is not after the one before"),
        ({"time": np.array([0.0, np.nan, 2.0])}, None, "time holds NaN or infinity at index 1"),
        ({"bearing": np.array([0.0, 1.0, 2.0, 30.0])}, None, "bearing is uneven at index 3, 30 after 2"),
        ({"bearing": BEARINGS[:3]}, None, "bearing has shape (3,); expected (4,)"),
        ({"energy": ENERGIES.astype(complex)}, None, "energy holds complex128; expected real values"),
        ({"energy": ENERGIES[None]}, None, "energy has shape (1, 3, 4); expected the axes time, bearing"),
        ({"energy": None, "a": ENERGIES, "b": ENERGIES}, None, "a, b can each be the frames"),
        ({"energy": None}, None, "there is no numeric array with 2 to 4 axes"),
    ],
)
def test_npz_that_holds_no_record(
    tmp_path: Path, arrays: dict[str, np.ndarray | None], ends: tuple[float, float] | None, expected: str
) -> None:
    path = tmp_path / "a.npz"
    content = {"energy": ENERGIES, "time": TIMES, "bearing": BEARINGS} | arrays
    np.savez(path, **{name: values for name, values in content.items() if values is not None})
    assert expected in sentence_about(path, lambda: read_record(path, ends))


def test_infinity_is_refused_where_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    write_npz(path, energy=np.where(ENERGIES == 7.5, np.inf, ENERGIES))
    record = read_record(path)
    record.read(0, 1)
    assert "frame 1 of energy holds infinity" in sentence_about(path, lambda: record.read(0, 3))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "is empty"),
        ("bearing,0,1\n0,1,2\n", "the first column is 'bearing'; expected time_s"),
        ("time_s,0\n0,1\n", "there are 1 beams"),
        ("time_s,0,north\n0,1,2\n", "row 1: a bearing is 'north'; expected a number"),
        ("time_s,0,1,2,9\n0,1,2,3,4\n", "the bearing is uneven at index 3, 9 after 2"),
        ("time_s,0,1\n", "there are no frames"),
        ("time_s,0,1\n0,1,2\n1,1\n", "row 3: 2 values; expected 3"),
        ("time_s,0,1\n0,1,loud\n", "row 2: the beam at 1 is 'loud'; expected a number"),
        ("time_s,0,1\n0,1,inf\n", "row 2: the beam at 1 is 'inf'; expected a number"),
        ("time_s,0,1\n,1,2\n", "row 2: time_s is ''; expected a number"),
        ("time_s,0,1\n5,1,2\n4,1,2\n", "the time of frame 1 is not after the one before"),
    ],
)
def test_csv_that_holds_no_record(tmp_path: Path, text: str, expected: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(text)
    assert expected in sentence_about(path, lambda: read_record(path))


@pytest.mark.parametrize("name", ["a.npz", "a.h5", "a.zarr", "a.csv"])
def test_files_that_are_missing(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    assert "does not exist" in sentence_about(path, lambda: read_record(path))


def test_unknown_and_damaged_files(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    assert "expected .csv, .npz, .h5, .hdf5, .zarr" in sentence_about(path, lambda: read_record(path))
    for name, what in (("a.npz", "npz"), ("a.h5", "HDF5")):
        path = tmp_path / name
        path.write_text("nothing of the kind")
        assert f"cannot be read as {what}" in sentence_about(path, lambda path=path: read_record(path))
