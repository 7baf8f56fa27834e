"""Records on one time axis: every row goes to the nearest scan, and what was not measured stays so."""

import numpy as np
import pytest

from faintrack.beliefs.axis import Axis
from faintrack.data.records import LONGEST_GAP, ROWS, in_step
from faintrack.data.sequence import Sequence
from faintrack.errors import InputError


def record(times, values=None, beams: int = 3, start_time: str | None = None, source: str = "a.npz") -> Sequence:
    """Rows whose beams all have one value: the row's number where not given."""
    times = np.asarray(times, float)
    values = np.arange(len(times), dtype=float) if values is None else np.asarray(values, float)
    rows = np.repeat(values[:, None], beams, axis=1)
    since = None if start_time is None else np.datetime64(start_time, "ns")
    return Sequence(lambda start, stop: rows[start:stop], times, (("bearing", Axis(0.0, 1.0, beams)),), source, since)


def everything(*records: Sequence, **options) -> np.ndarray:
    """Value of the first beam of every array in every scan."""
    together = in_step(records, **options)
    return together.read(0, together.length)[:, :, 0]


def test_one_record_is_itself() -> None:
    together = in_step((record(np.arange(50) * 0.1 + 7.0),))
    np.testing.assert_allclose(together.times, np.arange(50) * 0.1 + 7.0)
    np.testing.assert_array_equal(together.read(0, 50)[:, 0, 0], np.arange(50))
    assert together.interval == pytest.approx(0.1)


@pytest.mark.parametrize("off", [-0.49, -0.2, 0.3, 0.49])
def test_arrays_out_of_step_by_less_than_half_an_interval(off: float) -> None:
    found = everything(record(np.arange(20.0)), record(np.arange(20.0) + off))
    both = ~np.isnan(found).any(axis=1)
    assert both.sum() >= 19
    np.testing.assert_array_equal(found[both, 0], found[both, 1])


def test_beyond_half_an_interval_a_row_belongs_to_the_next_scan() -> None:
    found = everything(record(np.arange(20.0)), record(np.arange(20.0) + 0.6))
    both = ~np.isnan(found).any(axis=1)
    np.testing.assert_array_equal(found[both, 0], found[both, 1] + 1)


def test_a_clock_that_is_ahead_is_put_back() -> None:
    found = everything(record(np.arange(20.0)), record(np.arange(20.0) + 5.6), clock_offsets=(0.0, 5.6))
    np.testing.assert_array_equal(found[:, 0], found[:, 1])
    assert len(found) == 20


def test_the_slowest_record_sets_the_interval_and_faster_ones_are_averaged() -> None:
    fast = np.arange(100) * 0.25
    together = in_step((record(np.arange(10) * 2.0 + 1.0), record(fast, values=fast)))
    assert together.interval == pytest.approx(2.0)
    np.testing.assert_allclose(together.times, np.arange(10) * 2.0 + 1.0)
    found = together.read(0, 10)[:, :, 0]
    # Rows from a second before the scan on, to just before a second after it: their mean lies an eighth before it.
    np.testing.assert_allclose(found[:, 1], together.times - 0.125)


def test_an_average_is_of_what_was_measured() -> None:
    found = everything(record([0.0, 2.0, 4.0]), record([0.0, 0.9, 2.0, 2.9, 4.0], [1.0, 3.0, np.nan, 7.0, np.nan]))
    np.testing.assert_array_equal(found[:, 1], [2.0, 7.0, np.nan])


def test_gaps_and_arrays_with_fewer_beams_say_nothing() -> None:
    gap = record([0.0, 1.0, 5.0, 6.0], beams=2)
    together = in_step((record(np.arange(7.0)), gap))
    values = together.read(0, 7)
    assert np.isnan(values[:, 1, 2]).all()
    np.testing.assert_array_equal(np.isnan(values[:, 1, 0]), [False, False, True, True, True, False, False])


def test_jitter_and_slow_clocks_neither_lose_nor_double_rows() -> None:
    times = np.arange(5000) * 1.0003 + np.random.default_rng(0).uniform(-0.2, 0.2, 5000)
    together = in_step((record(times),))
    np.testing.assert_array_equal(together.read(0, together.length)[:, 0, 0], np.arange(5000))


def test_scans_reach_from_the_second_start_to_the_last_but_one_end() -> None:
    two = in_step((record(np.arange(10.0)), record(np.arange(4.0, 30.0))))
    assert two.times[[0, -1]].tolist() == [4.0, 9.0]
    three = in_step((record(np.arange(10.0)), record(np.arange(4.0, 30.0)), record(np.arange(8.0, 20.0))))
    assert three.times[[0, -1]].tolist() == [4.0, 19.0]


def test_starts_in_utc_are_one_clock() -> None:
    early = record(np.arange(20.0), start_time="2016-01-12T13:00:00")
    late = record(np.arange(20.0), start_time="2016-01-12T13:00:05")
    together = in_step((late, early))
    assert together.start_time == np.datetime64("2016-01-12T13:00:00")
    assert together.times[[0, -1]].tolist() == [5.0, 19.0]
    found = together.read(0, 15)[:, :, 0]
    np.testing.assert_array_equal(found[:, 0] + 5, found[:, 1])


def test_blocks_are_pieces_of_the_whole_and_few_rows_are_held() -> None:
    most = 0

    def read(start: int, stop: int) -> np.ndarray:
        nonlocal most
        most = max(most, stop - start)
        return np.arange(start, stop, dtype=float)[:, None]

    fast = Sequence(read, np.arange(20_000) * 1e-3, (("bearing", Axis(0.0, 1.0, 1)),))
    together = in_step((record(np.arange(0.0, 20.0, 10.0), beams=1), fast))
    whole = together.read(0, 2)
    assert 0 < most <= ROWS
    np.testing.assert_array_equal(np.concatenate([together.read(0, 1), together.read(1, 2)]), whole)
    np.testing.assert_allclose(whole[:, 1, 0], [(0 + 4999) / 2, (5000 + 14999) / 2])


@pytest.mark.parametrize(
    ("records", "expected"),
    [
        ((record([0.0]),), "a.npz: there is one row; expected two or more"),
        (
            (record(np.arange(5.0)), record(np.arange(9.0, 14.0), source="b.npz")),
            "a.npz has the times 0 to 4 s, the others together 9 to 4 s; expected records that overlap",
        ),
        (
            (record([0.0, 1.0, 2.0, 4.0 + LONGEST_GAP]),),
            "a.npz: row 3, at 100004 s, comes 100002 s after the one before",
        ),
        (
            (record(np.arange(5.0)), record(np.arange(5.0), source="b.npz", start_time="2016-01-12")),
            "b.npz tells its start in UTC and a.npz does not; expected both or none",
        ),
    ],
)
def test_records_that_do_not_belong_together(records: tuple[Sequence, ...], expected: str) -> None:
    with pytest.raises(InputError) as caught:
        in_step(records)
    assert expected in str(caught.value)
