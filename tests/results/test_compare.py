"""Two results beside each other: what is the same is 0 apart, and parts are those that the definition gives."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest

import faintrack as ft
from faintrack.results.compare import compare
from faintrack.results.pictures import jumps
from faintrack.results.result import Result
from faintrack.results.schema import NORTH, bearing, estimated, planar
from faintrack.targets.states import BearingState, PlanarState
from tests.cli.calling import call
from tests.kinds.small import SCENARIOS, result


def made(label: list[list[int]], shift: float = 0.0, start: str = "", first: float = 0.0) -> Result:
    """Two slots 100 m apart, scans a second apart, deviations of 1 m."""
    labels = np.array(label)
    count = len(labels)
    east = np.arange(count)[:, None] + np.array([0.0, 100.0])
    say = SimpleNamespace(
        existence=np.full((count, 2), 0.9),
        label=labels,
        track_existence=np.full((count, 2), 0.9),
        mean=PlanarState(*(jnp.asarray(part) for part in (east, 0 * east + shift, 0 * east + 1, 0 * east))),
        covariance=np.tile(np.eye(4), (count, 2, 1, 1)),
    )
    data = estimated(first + np.arange(count, dtype=float), say, planar())
    data = data.assign_attrs(source="test", start_time=start, scan_interval=1.0)
    return Result(data, ft.Scenario(**SCENARIOS["bearings"]), None, 1.0)


def test_a_result_is_0_from_itself() -> None:
    one = made([[1, 2]] * 4)
    same = compare(one, one)
    assert (same.gospa, same.differences, same.only_first, same.only_second, same.fields) == (0, (), (), (), {})
    assert [(pair.first, pair.second, pair.scans) for pair in same.pairs] == [(1, 1, 4), (2, 2, 4)]
    assert same.within == 4  # four deviations of 1 m


def test_parts_are_those_of_the_definition() -> None:
    """A pair 3 m apart in all of four scans; one track of the first alone in two of them: 10^2 / 2 each."""
    apart = compare(made([[1, 2], [1, 2], [1, 0], [1, 0]]), made([[7, 0]] * 4, shift=3.0), within=10.0)
    assert apart.localisation == pytest.approx(3)
    assert apart.missing == pytest.approx(np.sqrt((50 + 50) / 4))
    assert apart.extra == 0
    assert apart.gospa == pytest.approx(np.sqrt(9 + 25))
    (pair,) = apart.pairs
    assert (pair.first, pair.second, pair.scans, pair.rms) == (1, 7, 4, pytest.approx(3))
    assert (apart.only_first, apart.only_second) == ((2,), ())
    (difference,) = apart.differences
    assert (difference.from_s, difference.to_s, difference.only_first, difference.only_second) == (0, 1, (2,), ())


def test_turned_round_what_is_missing_is_extra() -> None:
    first, second = made([[1, 2], [1, 2], [0, 2]]), made([[3, 0]] * 3, shift=0.5)
    one, other = compare(first, second, 5.0), compare(second, first, 5.0)
    assert (one.missing, one.extra, one.gospa) == pytest.approx((other.extra, other.missing, other.gospa))
    assert one.only_first == other.only_second


def test_beyond_within_they_are_two() -> None:
    apart = compare(made([[1, 0]] * 3), made([[1, 0]] * 3, shift=11.0), within=10.0)
    assert (apart.pairs, apart.only_first, apart.only_second) == ((), (1,), (1,))
    assert apart.gospa == pytest.approx(10)


def test_scans_are_laid_beside_each_other_by_utc() -> None:
    first = made([[1, 0]] * 6, start="2020-05-01T00:00:00Z")
    second = made([[1, 0]] * 4, start="2020-05-01T00:00:02Z")
    shared = compare(first, second, 10.0)
    assert shared.scans == 4
    assert shared.localisation == pytest.approx(2)  # the second begins 2 m to the west of where the first is then


def test_round_the_circle_they_are_near() -> None:
    def at(degrees: float) -> Result:
        say = SimpleNamespace(
            existence=np.full(3, 0.9),
            label=np.ones(3, int),
            track_existence=np.full(3, 0.9),
            mean=BearingState(*(jnp.full(3, value) for value in (np.radians(degrees), 0.0, 0.0))),
            covariance=np.tile(np.eye(3) * 1e-4, (3, 1, 1)),
        )
        data = estimated(np.arange(3.0), say, bearing(NORTH))
        return replace(made([[1, 0]]), data=data.assign_attrs(source="test", start_time="", scan_interval=1.0))

    apart = compare(at(179.0), at(-179.0), 5.0)
    assert apart.localisation == pytest.approx(2, rel=1e-4)
    assert apart.unit == "degree"


def test_no_line_leads_across_a_gap_or_the_ends_of_the_circle() -> None:
    (track,) = made([[1, 0]] * 6).tracks
    assert jumps(track, "x").size == 0
    gap = replace(track, time=np.array([0.0, 1, 2, 30, 31, 32]))
    assert jumps(gap, "x").tolist() == [3]
    turned = replace(track, units={"x": "degree"}, mean={"x": np.array([170.0, 175, 179, -179, -175, -170])})
    assert jumps(turned, "x").tolist() == [3]


def test_what_cannot_be_compared_is_a_sentence() -> None:
    one = made([[1, 0]] * 3)
    with pytest.raises(ft.InputError, match="one result tells x in m, y in m, the other x in pixel, y in pixel"):
        compare(one, result("frames"))
    with pytest.raises(ft.InputError, match="no scan of the same time"):
        compare(one, made([[1, 0]] * 3, first=100.0))
    with pytest.raises(ft.InputError, match="within is 0; expected a number above 0"):
        compare(one, one, 0.0)


def test_the_command_compares(tmp_path: Path) -> None:
    one = result("frames")
    first = one.save(tmp_path / "first")
    tracker = one.scenario.tracker.model_copy(update={"declare": 0.5})
    second = replace(one, scenario=one.scenario.model_copy(update={"tracker": tracker})).save(tmp_path / "second")
    done = call("report", first, second, "--json")
    said = json.loads(done.out)
    assert (said["gospa"], len(said["pairs"])) == (0, 1)
    assert list(said["fields"]) == ["tracker.declare"]
    page = tmp_path / "both.html"
    done = call("report", first, second, "--out", page)
    assert done.status == 0
    assert max(len(line) for line in done.out.splitlines() if str(page) not in line) <= 80
    text = page.read_text(encoding="utf-8")
    assert "Tracks that are the same" in text
    assert "tracker.declare" in text
    assert not [part for part in ("http://", "https://") if part in text]
    done = call("report", first, "--within", 3)
    assert (done.status, done.err) == (2, "faintrack: --within was given with one result; expected two.\n")
    assert call("report", first, tmp_path / "none").status == 2
