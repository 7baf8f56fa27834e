"""Returns are read as they were written, into the nearest bin; what cannot be read is said in one sentence."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from faintrack.data.returns import from_columns, to_columns
from faintrack.errors import InputError
from faintrack.io import read_returns, write_returns
from faintrack.kinds.returns.build import build_sonar
from faintrack.signal.pings import from_pings, in_bins
from tests.io.test_bad_input import sentence_about
from tests.returns import columns, scenario

HEADER = "time_s,delay_s,bearing_deg,snr_db"
MOVING = ("source_x_m", "source_y_m", "source_vx", "source_vy")
COLUMNS = {
    "time_s": np.array([10.0, 10.0, 190.0, 370.0]),
    "delay_s": np.array([5.0, 22.9, np.nan, 3.0]),
    "bearing_deg": np.array([0.0, 359.5, np.nan, 90.0]),
    "snr_db": np.array([9.25, 30.0, np.nan, 12.5]),
}
EVERYTHING = COLUMNS | {
    "doppler_hz": np.array([-1.5, 0.0, np.nan, 2.25]),
    **{name: np.array([1.0, 1.0, 2.0, 3.0]) * number for number, name in enumerate(MOVING)},
}


@pytest.mark.parametrize("name", ["returns.csv", "returns.zarr"])
@pytest.mark.parametrize("content", [COLUMNS, EVERYTHING], ids=["least", "everything"])
def test_what_is_written_is_read(tmp_path: Path, name: str, content: dict[str, np.ndarray]) -> None:
    for _ in range(2):  # an earlier file is replaced
        write_returns(tmp_path / name, from_columns(content))
    returns = read_returns(str(tmp_path / name))
    back = to_columns(returns)
    assert set(back) == set(content)
    for column, values in content.items():
        np.testing.assert_allclose(back[column], values, rtol=1e-8, atol=1e-8)
    assert returns.counts.tolist() == [2, 0, 1]
    assert returns.rows.tolist() == ([2, 3, 5] if name == "returns.csv" else [0, 1, 3])
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_units_and_conventions_inside() -> None:
    returns = from_columns(EVERYTHING)
    np.testing.assert_allclose(np.degrees(returns.bearing), [90.0, -269.5, 0.0])
    np.testing.assert_allclose(returns.power, 10 ** np.array([0.925, 3.0, 1.25]))
    assert returns.source is not None
    np.testing.assert_array_equal(returns.source[:, 1], [1.0, 2.0, 3.0])
    assert returns.receiver is None


def test_a_spreadsheet_with_other_habits_is_read(tmp_path: Path) -> None:
    path = tmp_path / "Returns.CSV"
    path.write_bytes(b"\xef\xbb\xbfsnr_db, time_s ,bearing_deg,delay_s\r\n13, 0 ,-90,5\r\n\r\n,60,,\r\n,,,\r\n")
    returns = read_returns(path)
    assert returns.times.tolist() == [0.0, 60.0]
    assert returns.counts.tolist() == [1, 0]
    assert np.degrees(returns.bearing[0]) == pytest.approx(180.0)


def test_zarr_of_xarray_is_read(tmp_path: Path) -> None:
    data = xr.Dataset({name: ("return", values) for name, values in COLUMNS.items()}, {"return": np.arange(4)})
    data.to_zarr(tmp_path / "a.zarr", consolidated=False)
    np.testing.assert_array_equal(read_returns(tmp_path / "a.zarr").counts, [2, 0, 1])


def test_returns_go_to_the_nearest_bin_and_back() -> None:
    table = scenario(sonar={"doppler": [-4.0, 4.0], "doppler_step": 2.0}).sonar
    rng = np.random.default_rng(0)
    pings, each = 3, 40
    flat = np.concatenate([rng.choice(200 * 24 * 5, each, replace=False) for _ in range(pings)])
    delay, beam, shift = np.unravel_index(flat, (200, 24, 5))
    content = {
        "time_s": np.repeat(120.0 * np.arange(pings), each),
        "delay_s": 3.0 + 0.1 * (delay + rng.uniform(-0.49, 0.49, delay.size)),
        "bearing_deg": (90 - 15 * (beam + rng.uniform(-0.49, 0.49, beam.size))) % 360,
        "doppler_hz": -4.0 + 2.0 * (shift + rng.uniform(-0.49, 0.49, shift.size)),
        "snr_db": rng.uniform(9.0, 30.0, delay.size),
    }
    returns = from_columns(content)
    sonar = build_sonar(table)
    binned = in_bins(returns, sonar, 10**0.9)
    assert binned.capacity == 48
    stack = binned.pings(np.arange(pings))
    assert stack.there.sum(axis=1).tolist() == [each] * pings
    for ping in range(pings):
        mine = slice(ping * each, (ping + 1) * each)
        order = np.argsort(flat[mine])
        np.testing.assert_array_equal(stack.bins[ping, :each], np.stack([delay, beam, shift], -1)[mine][order])
        np.testing.assert_allclose(stack.power[ping, :each], returns.power[mine][order], rtol=1e-6)
    again = in_bins(from_pings(stack, sonar), sonar, 10**0.9)
    np.testing.assert_array_equal(again.bins, binned.bins)


def test_pings_without_any_return() -> None:
    nothing = np.full(3, np.nan)
    returns = columns(delay_s=nothing, bearing_deg=nothing, snr_db=nothing)
    table = scenario().sonar
    binned = in_bins(returns, build_sonar(table), 10**0.9)
    assert binned.capacity == 16
    assert not binned.pings(np.arange(3)).there.any()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (f"{HEADER}\n", "there is no ping"),
        (f"{HEADER}\n0,5,90,loud\n", "row 2: snr_db is 'loud'; expected a number"),
        (f"{HEADER}\n0,5,90,12\n60,nan,90,12\n", "row 3: delay_s is 'nan'; expected a number"),
        (f"{HEADER}\n0,5,90,inf\n", "row 2: snr_db is 'inf'; expected a number"),
        (f"{HEADER}\n0,5,,12\n", "row 2: bearing_deg is missing; expected a number, or a row with its time alone"),
        (f"{HEADER}\n,5,90,12\n", "row 2: time_s is missing; expected seconds"),
        (f"{HEADER}\n60,5,90,12\n0,5,90,12\n", "row 3: time_s is 0; expected ascending times"),
        (f"{HEADER}\n0,5,90,12\n60,5,90,12\n0,6,90,12\n", "row 4: time_s is 0; expected ascending times"),
        (f"{HEADER}\n0,5,361,12\n", "row 2: bearing_deg is 361; expected -180 to 360 degrees, clockwise from north"),
        (f"{HEADER}\n0,5,90,101\n", "row 2: snr_db is 101; expected at most 100 dB"),
        (f"{HEADER}\n0,5,90,12\n0,,,\n", "row 3: a row with its time alone, 0 s, in a ping of several rows"),
        (f"{HEADER}\n0,5,90\n", "row 2: 3 values; expected 4"),
        ("time_s,delay_s,bearing_deg\n0,5,90\n", "there is no column snr_db; expected time_s, delay_s"),
        (f"{HEADER},level\n0,5,90,12,1\n", "there is a column 'level'; expected none but time_s"),
        (f"{HEADER},snr_db\n0,5,90,12,1\n", "there are two columns snr_db"),
        (f"{HEADER},source_x_m\n0,5,90,12,1\n", "there is no column source_y_m"),
        (
            f"{HEADER},{','.join(MOVING)}\n0,5,90,12,1,1,0,0\n0,6,90,12,1,2,0,0\n",
            "row 3: source_y_m is 2; expected the same",
        ),
        (
            f"{HEADER},{','.join(MOVING)}\n0,5,90,12,1,1,0,\n",
            "row 2: source_vy is missing; expected a number in every row",
        ),
        ("", "is empty"),
        (f"{HEADER}\n0,5,90,12\n".encode("utf-16").decode("latin-1"), "there is a column"),
    ],
)
def test_csv_that_holds_no_returns(tmp_path: Path, text: str, expected: str) -> None:
    path = tmp_path / "returns.csv"
    path.write_text(text)
    assert expected in sentence_about(path, lambda: read_returns(path))


@pytest.mark.parametrize(
    ("arrays", "expected"),
    [
        ({"bearing_deg": None}, "there is no column bearing_deg"),
        ({"delay_s": np.zeros((2, 2))}, "delay_s has shape (2, 2); expected (4,)"),
        ({"delay_s": np.array(list("abcd"))}, "delay_s holds <U1; expected real numbers"),
        ({"delay_s": np.array([5.0, 22.9, np.inf, 3.0])}, "row 2: delay_s is inf; expected a number"),
        ({"level": np.zeros(4)}, "there is a column 'level'"),
    ],
)
def test_zarr_that_holds_no_returns(tmp_path: Path, arrays: dict[str, np.ndarray | None], expected: str) -> None:
    content = {name: values for name, values in (COLUMNS | arrays).items() if values is not None}
    dims = {name: [f"{name}_{axis}" for axis in range(values.ndim)] for name, values in content.items()}
    path = tmp_path / "returns.zarr"
    xr.Dataset({name: (dims[name], values) for name, values in content.items()}).to_zarr(path, zarr_format=2)
    assert expected in sentence_about(path, lambda: read_returns(path))


def test_files_that_cannot_be_read_or_written(tmp_path: Path) -> None:
    for name, expected in (
        ("a.csv", "does not exist"),
        ("a.zarr", "does not exist"),
        ("a.txt", "expected .csv or .zarr"),
    ):
        path = tmp_path / name
        assert expected in sentence_about(path, lambda path=path: read_returns(path))
    with pytest.raises(InputError, match=r"none/a.csv cannot be written \(No such file"):
        write_returns(tmp_path / "none" / "a.csv", from_columns(COLUMNS))
    (tmp_path / "b.csv").write_bytes(b"time_s,delay_s,bearing_deg,snr_db\n0,5,90,\xff\n")
    path = tmp_path / "b.csv"
    assert "cannot be read as CSV" in sentence_about(path, lambda: read_returns(path))
