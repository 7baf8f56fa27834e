"""Several receivers and sources of a sonar: from scenario and file to tracks, and what is refused."""

import dataclasses
import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import faintrack as ft
from faintrack.data.returns import Returns, from_columns, to_columns
from faintrack.io.returns import read_returns, write_returns
from faintrack.kinds.returns.build import build_binned, build_sonar
from faintrack.kinds.returns.simulate import silence
from faintrack.kinds.stretches import of_returns
from faintrack.kinds.surrogates import exchanged
from tests.kinds.refusing import refuse
from tests.returns import EAST, INTERVAL, NORTH, SCENARIO, VELOCITY, scenario

NORTHERN = {"name": "north", "place": [500.0, 1000.0]}
EASTERN = {"name": "east", "place": [6000.0, -2000.0], "beams": 36}
TARGET = {"x": EAST[0], "y": NORTH[0], "vx": VELOCITY[0], "vy": VELOCITY[1]}
SIMULATION = {"pings": 20, "interval": INTERVAL, "targets": [TARGET]}


def several(*receivers: dict[str, Any], **sections: Any) -> Any:
    """The scenario of one sonar, its receiver replaced by some."""
    whole = scenario(sonar={"receiver": None}, simulation=SIMULATION).model_dump(exclude_none=True)
    return ft.Scenario(**{**whole, "receivers": list(receivers), **sections})


def deviation(result: ft.Result) -> float:
    """Of the position that is believed in, on average over the last ten pings; m."""
    place = result.data.covariance.values[-10:, 0][:, [0, 1], [0, 1]]
    return float(np.sqrt(place.sum(axis=1)).mean())


@pytest.fixture(scope="module")
def both() -> tuple[Any, Returns]:
    what = several(NORTHERN, EASTERN)
    return what, ft.simulate(what)


def test_a_simulation_draws_for_every_pair(both: tuple[Any, Returns]) -> None:
    what, returns = both
    assert returns.pairs == (("", "north"), ("", "east"))
    assert returns.reported is not None
    assert returns.reported.all()
    assert set(returns.pair) == {0, 1}
    parts = build_binned(what, returns)
    assert [part.pair.name for part in parts] == ["north", "east"]
    assert [part.binned.sonar.beams for part in parts] == [24, 36]
    # 1.7 of 4800 bins exceed the threshold by noise alone, and of 36 beams one and a half times as many.
    quiet = silence(several(NORTHERN, EASTERN, simulation=SIMULATION | {"pings": 1000}), seed=3)
    counts = [quiet.of_pair(number).counts for number in (0, 1)]
    for count, beams in zip(counts, (24, 36), strict=True):
        expected = 200 * beams * np.exp(-(10**0.9))
        assert abs(count.mean() - expected) < 5 * np.sqrt(expected / 1000)
    # What two receivers hear of noise is independent.
    assert abs(np.corrcoef(*counts)[0, 1]) < 5 / np.sqrt(1000)


@pytest.mark.parametrize("suffix", [".csv", ".zarr"])
def test_rows_say_which(both: tuple[Any, Returns], tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"night{suffix}"
    write_returns(path, both[1])
    back = read_returns(path)
    assert set(back.pairs) == set(both[1].pairs)
    for name, number in (("north", 0), ("east", 1)):
        mine = back.of_pair([labels[1] for labels in back.pairs].index(name))
        np.testing.assert_allclose(mine.delay, both[1].of_pair(number).delay, rtol=1e-8)
    facts = ft.info(path).facts
    assert facts["receivers"] == "east, north"
    assert (
        facts["north"]
        == f"{len(both[1].of_pair(0).delay)} returns in 20 pings, {both[1].of_pair(0).counts.max()} at most in a ping"
    )


def test_numbers_are_those_of_the_scenario() -> None:
    columns = {"time_s": [0, 0, 120], "delay_s": [8, 9, 8], "bearing_deg": [90] * 3, "snr_db": [12] * 3}
    what = several(NORTHERN, EASTERN)
    by_name = build_binned(what, from_columns({**columns, "receiver": ["north", "east", "north"]}))
    by_number = build_binned(what, from_columns({**columns, "receiver": [1, 2, 1]}))
    for one, other in zip(by_name, by_number, strict=True):
        assert one.pair == other.pair
        np.testing.assert_array_equal(one.binned.bins, other.binned.bins)


def test_pairs_have_their_own_pulse_and_bins() -> None:
    tone = {"name": "tone", "place": [0, 0], "pulse": {"frequency": 3000.0, "duration": 1.0}}
    tone |= {"doppler": [-20.0, 20.0], "doppler_bins": 41, "delay_bins": 21, "finer": [2, 4, 2]}
    sources = [{"name": "sweep", "place": [0, 0]}, tone]
    what = several(
        NORTHERN, EASTERN, sonar={**dict(scenario().sonar), "source": None, "receiver": None}, sources=sources
    )
    tables = what.pairs
    assert list(tables) == list(itertools.product(("sweep", "tone"), ("north", "east")))
    sonars = {names: build_sonar(table) for names, table in tables.items()}
    assert sonars["sweep", "north"].shape == (200, 24, 1)
    assert sonars["tone", "east"].shape == (21, 36, 41)
    assert sonars["tone", "east"].pulse.frequency == 3000.0
    assert tables["sweep", "east"].receiver == (6000.0, -2000.0)


def test_a_silent_pair_and_one_that_is_off_are_told_apart() -> None:
    nan = np.nan
    columns = {"time_s": [0, 0, 120], "delay_s": [8, nan, 8], "bearing_deg": [90, nan, 90], "snr_db": [12, nan, 12]}
    returns = from_columns({**columns, "receiver": ["a", "b", "a"]})
    assert returns.reported.tolist() == [[True, True], [True, False]]
    again = from_columns(to_columns(returns))
    np.testing.assert_array_equal(again.reported, returns.reported)
    part = of_returns(returns, 60.0, 180.0)
    assert part.reported.tolist() == [[True, False]]
    assert part.of_pair(0).delay.tolist() == [8.0]


def test_surrogates_keep_what_a_pair_reported(both: tuple[Any, Returns]) -> None:
    reported = both[1].reported.copy()
    reported[::2, 1] = False
    some = dataclasses.replace(both[1], reported=reported)
    heard = reported[some.ping, some.pair]
    some = dataclasses.replace(
        some, **{name: getattr(some, name)[heard] for name in ("ping", "delay", "bearing", "power", "rows", "pair")}
    )
    other = exchanged(some, seed=1)
    assert reported[other.ping, other.pair].all()
    for number in (0, 1):
        np.testing.assert_array_equal(np.sort(other.of_pair(number).delay), np.sort(some.of_pair(number).delay))


@pytest.mark.slow
def test_one_receiver_with_a_name_gives_the_same_bits(both: tuple[Any, Returns]) -> None:
    alone = both[1].of_pair(0)
    plain = ft.track(alone, scenario())
    named = ft.track(alone, several(NORTHERN))
    for name in ("existence", "x", "y", "log_evidence", "position"):
        np.testing.assert_array_equal(named.data[name], plain.data[name])


@pytest.mark.slow
def test_a_second_receiver_improves_the_position(both: tuple[Any, Returns], tmp_path: Path) -> None:
    """From a file to the report: one track, no later than with one receiver, and its place known better than by a
    second look at the same (a factor of the root of two)."""
    _, returns = both
    grid = dict(scenario().grid) | {"cells": (24, 24)}
    what = several(NORTHERN, EASTERN, grid=grid)
    write_returns(tmp_path / "night.csv", returns)
    result = ft.track(tmp_path / "night.csv", what, out=tmp_path / "out")
    (track,) = result.tracks
    alone = ft.track(returns.of_pair(0), several(NORTHERN, grid=grid))
    assert track.start_s <= alone.tracks[0].start_s
    assert deviation(result) < deviation(alone) / np.sqrt(2)
    since = result.data.time.values
    off = [result.data.x[:, 0] - EAST[0] - VELOCITY[0] * since, result.data.y[:, 0] - NORTH[0] - VELOCITY[1] * since]
    # A cell is 1.25 km wide.
    assert np.hypot(*off).values[-10:].mean() < 1250.0
    assert result.data.returns_of_pair.sizes == {"time": 20, "pair": 2}
    assert result.data.pair.values.tolist() == ["north", "east"]
    np.testing.assert_allclose(result.data.receiver_x.values[3], [500.0, 6000.0])
    text = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "36 beams" in text
    assert "east, receiver" in text
    result.plot()
    again = ft.track(tmp_path / "night.csv", tmp_path / "out" / "scenario.toml")
    np.testing.assert_array_equal(again.data.existence, result.data.existence)


RECEIVERS = """
[[receivers]]
name = "north"
place = [500.0, 1000.0]

[[receivers]]
name = "east"
place = [6000.0, -2000.0]
"""
ROWS = "time_s,delay_s,bearing_deg,snr_db,receiver\n0,8,90,12,north\n0,8,90,12,east\n120,8,90,12,north\n"


@pytest.mark.parametrize(
    ("old", "new", "names"),
    [
        ('name = "east"', 'name = "north"', ("receivers[1].name is 'north'", "receivers[0]", "names that differ")),
        ('name = "east"', 'name = ""', ("receivers[1].name",)),
        ('name = "east"', "", ("receivers[1].name is missing",)),
        ("source = [0.0, 0.0]", "source = [0.0, 0.0]\nreceiver = [1.0, 1.0]", ("sonar.receiver and [[receivers]]",)),
        ("place = [6000.0, -2000.0]", "", ("night.csv", "the place of receiver 'east' is missing", "receiver_x_m")),
        ("place = [6000.0, -2000.0]", "place = 6000.0", ("receivers[1].place",)),
        ("place = [6000.0, -2000.0]", "beams = 2", ("receivers[1].beams is 2",)),
        ("place = [6000.0, -2000.0]", "delay_step = 0.15", ("receivers[1]", "delay_step is 0.15", "whole number")),
        ("place = [6000.0, -2000.0]", "plaace = [1.0, 1.0]", ("no field receivers[1].plaace", "place")),
        ("pulse = {", "# pulse = {", ("sonar.pulse is missing",)),
        ("[grid]", '[[sources]]\nname = "a"\n[grid]', ("sonar.source and [[sources]]",)),
        ("[grid]", "[background]\nevery = [1, 5, 1]\n[grid]", ("background.every has 5", "24 beams")),
    ],
)
def test_scenario_that_is_wrong(tmp_path: Path, old: str, new: str, names: tuple[str, ...]) -> None:
    text = SCENARIO.replace("receiver = [500.0, 1000.0]\n", "").replace("[grid]", f"{RECEIVERS}\n[grid]")
    assert old in text
    (tmp_path / "scenario.toml").write_text(text.replace(old, new), encoding="utf-8")
    (tmp_path / "night.csv").write_text(ROWS, encoding="utf-8")
    known = names if "night.csv" in names else ("scenario.toml", *names)
    refuse(tmp_path, tmp_path / "night.csv", tmp_path / "scenario.toml", known)


@pytest.mark.parametrize(
    ("old", "new", "names"),
    [
        ("east", "west", ("receiver is 'west'", "[[receivers]] of the scenario, north, east")),
        ("east", "3", ("receiver is '3'", "its number from 1 on")),
        ("120,8,90,12,north", "120,8,90,12,", ("row 4: receiver is missing", "in every row")),
        ("120,8,90,12,north", "120,8,90,12,1", ("told by a name and by a number",)),
        (
            ",receiver\n0,8,90,12,north\n0,8,90,12,east\n120,8,90,12,north",
            "\n0,8,90,12\n120,8,90,12",
            ("no column receiver", "2 [[receivers]]"),
        ),
        ("snr_db,receiver", "snr_db,source", ("column source", "no [[sources]]")),
        ("0,8,90,12,east", "0,8,90,12,north\n0,8,90,13,north", ("row 4", "same bin as that of row 2")),
    ],
)
def test_rows_that_are_wrong(tmp_path: Path, old: str, new: str, names: tuple[str, ...]) -> None:
    text = SCENARIO.replace("receiver = [500.0, 1000.0]\n", "").replace("[grid]", f"{RECEIVERS}\n[grid]")
    (tmp_path / "scenario.toml").write_text(text, encoding="utf-8")
    assert old in ROWS
    (tmp_path / "night.csv").write_text(ROWS.replace(old, new), encoding="utf-8")
    refuse(tmp_path, tmp_path / "night.csv", tmp_path / "scenario.toml", ("night.csv", *names))


def test_receivers_that_the_scenario_does_not_have(tmp_path: Path) -> None:
    (tmp_path / "scenario.toml").write_text(SCENARIO, encoding="utf-8")
    (tmp_path / "night.csv").write_text(ROWS, encoding="utf-8")
    names = "night.csv", "column receiver", "no [[receivers]]", "expected them"
    refuse(tmp_path, tmp_path / "night.csv", tmp_path / "scenario.toml", names)
