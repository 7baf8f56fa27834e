"""Data without a target made of data with one: what each sensor reported stays, what belongs together is parted."""

import tracemalloc
from typing import Any

import numpy as np
import pytest

import faintrack as ft
from faintrack.data.bearings import Bearings
from faintrack.kinds import kind_named, stretches
from faintrack.kinds.surrogates import exchanged, mixed, reordered, shifted_apart
from tests.kinds.small import SCENARIOS, data

RNG = np.random.default_rng(0)


def test_channels_keep_their_samples_and_lie_apart() -> None:
    """One click in all of 5 channels at once: in ten draws no two are nearer than asked, around the end too."""
    samples = np.zeros((1000, 5))
    samples[300] = 1 + np.arange(5)
    for seed in range(10):
        shifted = shifted_apart(ft.from_samples(samples, 100.0), 0.6, seed).read(0, 1000)
        np.testing.assert_array_equal(np.sort(shifted, axis=0), np.sort(samples, axis=0))
        at = np.sort(np.argmax(shifted, axis=0))
        assert np.diff([*at, at[0] + 1000]).min() >= 60


@pytest.mark.parametrize("length", [400, 5000])
def test_blocks_are_parts_of_the_whole(length: int) -> None:
    """In a recording that is as long as the shifts, and in a longer one."""
    recording = shifted_apart(ft.from_samples(RNG.normal(size=(length, 4)), 50.0), 1.0, seed=3)
    whole = recording.read(0, length)
    np.testing.assert_array_equal(np.concatenate(list(recording.blocks(37))), whole)


def test_memory_does_not_grow_with_the_length() -> None:
    def read(start: int, stop: int) -> np.ndarray:
        return np.zeros((stop - start, 4), np.float32)

    day = ft.Recording(read, 86_400 * 1000, 1000.0, tuple("abcd"))
    shifted = shifted_apart(day, 1.0, seed=0)
    tracemalloc.start()
    assert shifted.read(86_399_000, 86_400_000).shape == (1000, 4)
    assert tracemalloc.get_traced_memory()[1] < 3e6
    tracemalloc.stop()


def test_a_recording_that_is_too_short_is_refused() -> None:
    with pytest.raises(ft.InputError, match=r"lasts 3 s; expected at least 8 s, to shift 4 channels 1 s apart"):
        shifted_apart(ft.from_samples(np.zeros((300, 4)), 100.0), 1.0, seed=0)


def test_frames_are_whole_and_each_is_there_once() -> None:
    frames = np.arange(20.0)[:, None, None] + 100 * np.arange(12.0).reshape(1, 3, 4)
    other = reordered(ft.from_frames(frames), seed=1)
    values = np.concatenate([other.read(0, 7), other.read(7, 20)])
    order = values[:, 0, 0].astype(int)
    assert sorted(order) == list(range(20))
    assert list(order) != list(range(20))
    np.testing.assert_array_equal(values, frames[order])
    np.testing.assert_array_equal(other.times, np.arange(20.0))


def test_returns_of_a_ping_stay_together() -> None:
    returns = data("returns")
    other = exchanged(returns, seed=0)
    assert np.all(np.diff(other.ping) >= 0)
    assert sorted(other.counts) == sorted(returns.counts)

    def pings(of: Any) -> set[tuple[float, ...]]:
        return {tuple(of.delay[of.ping == ping]) for ping in range(of.length)}

    assert pings(other) == pings(returns)
    assert not np.array_equal(other.delay, returns.delay)
    np.testing.assert_array_equal(other.times, returns.times)


def test_sets_of_an_observer_stay_together_and_its_own() -> None:
    """The second observer reports in some scans alone, and gets no set elsewhere."""
    columns = {
        "time_s": np.repeat(np.arange(10.0), 3),
        "bearing_deg": RNG.uniform(0, 360, 30),
        "observer_x_m": np.zeros(30),
        "observer_y_m": np.zeros(30),
        "observer": np.tile([0, 0, 1], 10),
    }
    some = np.flatnonzero((columns["observer"] == 0) | (columns["time_s"] % 3 == 0))
    heard = ft.from_bearings({name: values[some] for name, values in columns.items()})
    other = mixed(heard, seed=0)

    def sets(of: Bearings, observer: int) -> set[tuple[float, ...]]:
        mine = of.observer == observer
        return {tuple(of.bearing[mine & (of.scan == scan)]) for scan in range(of.length)} - {()}

    for observer in (0, 1):
        assert sets(other, observer) == sets(heard, observer)
    assert np.all(other.heard[other.scan, other.observer])
    assert not np.array_equal(other.bearing, heard.bearing)


def test_sweeps_keep_the_place_that_they_were_taken_from() -> None:
    intensity = np.arange(6.0)[:, None, None] * np.ones((6, 32, 64))
    sweeps = ft.from_sweeps(intensity, 10.0, x=np.arange(6.0), y=np.zeros(6))
    other = kind_named("sweeps").surrogate(sweeps, None, 0)
    np.testing.assert_array_equal(other.read(0, 6)[:, 0, 0], other.x)
    assert sorted(other.x) == list(range(6))
    assert list(other.x) != list(range(6))
    part = kind_named("sweeps").stretch(sweeps, 2.0, 5.0)
    np.testing.assert_array_equal(part.read(0, 3)[:, 0, 0], part.x)
    assert part.length == 3


def test_records_are_reordered_each_by_itself() -> None:
    one = data("records").records[0]
    both = ft.from_records([one, one])
    region = {"x": [-9.0, 9.0], "y": [-9.0, 9.0], "cell": 3.0, "speed": 1.0}
    stations = [{"name": name, "x": 0.0, "y": 0.0, "heading_deg": 0.0} for name in "ab"]
    scenario = ft.Scenario(kind="records", stations=stations, region=region)
    first, second = kind_named("records").surrogate(both, scenario, 0).records
    assert not np.array_equal(first.read(0, 12), second.read(0, 12))
    np.testing.assert_array_equal(np.sort(first.read(0, 12), axis=0), np.sort(one.read(0, 12), axis=0))
    assert [part.length for part in kind_named("records").stretch(both, 2.0, 6.0).records] == [4, 4]


@pytest.mark.parametrize("kind", list(SCENARIOS))
def test_every_kind_has_both(kind: str) -> None:
    room, held = kind_named(kind), data(kind)
    assert isinstance(
        room.stretch(held, 0.0, 2.0 if kind == "recording" else 300.0 if kind == "returns" else 6.0), room.data
    )
    for start, stop in ((-1.0, 2.0), (2.0, 1.0), (0.0, 1e6)):
        with pytest.raises(ft.InputError, match="does not lie in the data; expected a start and a later end between 0"):
            room.stretch(held, start, stop)


def test_stretches_are_the_same_samples_frames_and_pings() -> None:
    samples = RNG.normal(size=(100, 2))
    recording = ft.from_samples(samples, 10.0, start_time="2020-01-01T00:00:00")
    part = stretches.of_recording(recording, 2.0, 5.0)
    np.testing.assert_array_equal(part.read(0, 30), samples[20:50])
    assert part.start_time == np.datetime64("2020-01-01T00:00:02")
    frames = RNG.normal(size=(9, 4, 4))
    np.testing.assert_array_equal(stretches.of_sequence(ft.from_frames(frames), 2.0, 5.0).read(1, 3), frames[3:5])
    returns = data("returns")
    pings = stretches.of_returns(returns, 60.0, 180.0)
    np.testing.assert_array_equal(pings.counts, returns.counts[1:3])
    np.testing.assert_array_equal(pings.delay, returns.delay[(returns.ping == 1) | (returns.ping == 2)])
    bearings = data("bearings")
    scans = stretches.of_bearings(bearings, 3.0, 5.0)
    np.testing.assert_array_equal(scans.bearing, bearings.bearing[(bearings.scan >= 3) & (bearings.scan < 5)])
    with pytest.raises(ft.InputError, match=r"there is no scan from 0\.2 to 0\.7 s"):
        stretches.of_sequence(ft.from_frames(frames), 0.2, 0.7)


def test_a_loud_source_is_gone() -> None:
    """At 10 dB it is a track from its second frame on; with channels apart there is none."""
    scenario = SCENARIOS["recording"] | {
        "simulation": {
            "duration": 10.0,
            "sample_rate": 500.0,
            "sources": [{"snr_db": 10.0, "bearing_deg": 60.0}],
        }
    }
    loud = ft.simulate(scenario)
    apart = kind_named("recording").surrogate(loud, ft.Scenario(**scenario), 0)
    assert len(ft.track(loud, scenario).tracks) == 1
    assert not ft.track(apart, scenario).tracks
