"""Archives: the same tracks however time was cut, the same bits whoever computes them, nothing lost to bad files."""

import dataclasses
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pyarrow")
import pandas as pd

import faintrack as ft
from faintrack.archive import run as running
from faintrack.archive.burn_in import measured
from faintrack.archive.cut import Cut, chains_of
from faintrack.archive.pieces import laid, pieces_of
from faintrack.archive.plan import ArchivePlan
from faintrack.archive.run import retry, run
from faintrack.archive.samples import Samples
from faintrack.archive.sources import sources_of
from faintrack.archive.status import Status, status
from faintrack.archive.store import writing
from faintrack.errors import InputError
from faintrack.studies.running import connect
from tests.archive.small import BEGIN, CUT, PATTERN, RATE, SCENARIO, SECONDS, file_at, make
from tests.cli.calling import call

ROOT = Path(__file__).parents[2]
COARSE = Cut(2 * CUT.segment, CUT.chain, CUT.burn_in)
DAY = 86400
"""Seconds. Three of them from the start of 1970 hold the whole recording, with its midnight."""
SPOILT = 80.0
"""When the file begins that tests spoil; seconds from the start."""


@pytest.fixture(autouse=True, scope="module")
def _without_pictures() -> Iterator[None]:
    """Segments without the picture of their report and the checks of the array, which take longer than the rest."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("faintrack.kinds.recording.plan.about_array", lambda *arguments: ())
        patch.setattr("faintrack.results.report._picture", lambda result: "data:,")
        yield


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make(tmp_path_factory.mktemp("archive") / "recordings")


@pytest.fixture(scope="module")
def whole(recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Store of an undisturbed run, in this process alone."""
    store = tmp_path_factory.mktemp("archive") / "store"
    assert track(recordings, store).whole
    return store


@pytest.fixture
def north(recordings: Path, tmp_path: Path) -> Path:
    """Recordings of one station, which a test may spoil."""
    return Path(shutil.copytree(recordings, tmp_path / "north", ignore=shutil.ignore_patterns("south")))


@pytest.fixture(scope="module")
def lacking(recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """What comes of one station of which a file was never there."""
    folder = tmp_path_factory.mktemp("archive")
    copy = shutil.copytree(recordings, folder / "north", ignore=shutil.ignore_patterns("south"))
    file_at(copy, "north", SPOILT).unlink()
    track(copy, folder / "store", COARSE)
    return bits(folder / "store")


def track(recordings: Path, store: Path, cut: Cut = CUT, **options: Any) -> Status:
    options = {"workers": 0, **options}
    return run(recordings / "scenario.toml", [recordings], store, pattern=PATTERN, cut=cut, **options)


def states(store: Path, station: str) -> pd.DataFrame:
    """States of a station by track and time; labels count within a chain."""
    table = pd.read_parquet(store / "states" / f"station={station}").drop(columns=["day", "label"])
    return table.sort_values(["track", "utc"], ignore_index=True)


def bits(store: Path) -> dict[str, bytes]:
    """What has to be the same whoever computes it."""
    kept = [*store.glob("segments/*/*/seam.state"), *store.glob("segments/*/*/states.parquet")]
    kept += [*store.glob("states/*/*/*.parquet"), *store.glob("tracks/*/*/*.parquet")]
    assert kept
    return {str(file.relative_to(store)): file.read_bytes() for file in kept}


def of_station(kept: dict[str, bytes], station: str) -> dict[str, bytes]:
    return {name: content for name, content in kept.items() if station in name}


def test_tracks_are_those_of_the_sources(whole: Path) -> None:
    """Two sources a station; one of them over midnight, where a chain ends."""
    tracks = pd.read_parquet(whole / "tracks")
    for station, crossing in (("north", 60.0), ("south", 100.0)):
        mine = tracks[tracks["station"] == station]
        assert mine["track"].nunique() == 2
        over = mine[mine["track"].str.startswith("20260101T2358")]
        assert over["day"].astype(str).tolist() == ["2026-01-01", "2026-01-02"]
        assert over["track"].nunique() == 1
        np.testing.assert_allclose(over["bearing_deg_start"].iloc[0], crossing, atol=8)
        np.testing.assert_allclose(over["bearing_deg_end"].iloc[1], crossing + 11, atol=8)
        # It is in hand until the end; the other one is given up soon after it has stopped.
        last = pd.Timestamp(BEGIN, tz="UTC") + pd.Timedelta(seconds=SECONDS - 0.25)
        assert over["end"].max() == last
        assert mine["end"].min() < pd.Timestamp(BEGIN, tz="UTC") + pd.Timedelta(seconds=170 + 15)


@pytest.mark.parametrize("segment", [10, *(pytest.param(one, marks=pytest.mark.slow) for one in (15, 24, 40, 60, 120))])
def test_segments_of_any_length_give_the_same_bits(north: Path, whole: Path, tmp_path: Path, segment: float) -> None:
    store = tmp_path / "store"
    track(north, store, Cut(segment, CUT.chain, CUT.burn_in))
    expected = states(whole, "north")
    pd.testing.assert_frame_equal(states(store, "north"), expected, check_exact=True)


@pytest.mark.parametrize(
    ("segment", "chain", "burn_in"),
    [
        (60, 60, 30),
        *(pytest.param(*one, marks=pytest.mark.slow) for one in ((30, 60, 45), (80, 240, 30), (60, 480, 30))),
    ],
)
def test_chains_of_any_length_give_the_same_tracks(
    north: Path, whole: Path, tmp_path: Path, segment: float, chain: float, burn_in: float
) -> None:
    """After joining: the same names; where a state differs, within what the sensor tells apart."""
    store = tmp_path / "store"
    track(north, store, Cut(segment, chain, burn_in))
    one, other = states(whole, "north"), states(store, "north")
    assert set(one["track"]) == set(other["track"])
    both = one.merge(other, on=["track", "utc"])
    # A track that fades may end a few scans apart.
    assert len(both) >= 0.97 * max(len(one), len(other))
    apart = (both["bearing_deg_x"] - both["bearing_deg_y"]).abs()
    assert float(apart.max()) < json.loads(next(store.glob("segments/*/*/segment.json")).read_text())["within"]


@pytest.mark.slow
def test_a_worker_that_is_killed_costs_its_segment(
    north: Path, whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The bits are those of one worker that nothing happens to; in this process sums are rounded otherwise."""
    with connect(workers=1) as client:
        track(north, tmp_path / "alone", COARSE, workers=None, scheduler=client.scheduler.address)
    taken, killed = running._take, []
    with connect(workers=2) as client:

        def take(*arguments: Any) -> None:
            taken(*arguments)
            if not killed:
                killed.append(next(iter(client.run(os.getpid).values())))
                os.kill(killed[0], signal.SIGKILL)

        monkeypatch.setattr(running, "_take", take)
        found = track(north, tmp_path / "killed", COARSE, workers=None, scheduler=client.scheduler.address)
    assert found.whole
    assert killed
    assert bits(tmp_path / "killed") == bits(tmp_path / "alone")
    assert set(states(tmp_path / "killed", "north")["track"]) == set(states(whole, "north")["track"])


@pytest.mark.parametrize("segments", [2, *(pytest.param(one, marks=pytest.mark.slow) for one in (1, 5, 9))])
def test_a_run_that_was_killed_goes_on_with_the_same_bits(
    recordings: Path, whole: Path, tmp_path: Path, segments: int
) -> None:
    store = tmp_path / "store"
    cut = ("--segment", CUT.segment, "--chain", CUT.chain, "--burn-in", CUT.burn_in)
    words = ("archive", "run", recordings / "scenario.toml", recordings, "--out", store, "--pattern", PATTERN, *cut)
    command = [sys.executable, "-m", "faintrack.cli", *map(str, (*words, "--workers", 0))]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    end = time.monotonic() + 300
    while len(list(store.glob("segments/*/*/segment.json"))) < segments and time.monotonic() < end:
        assert process.poll() is None
        time.sleep(0.02)
    process.kill()
    process.wait()
    before = status(store)
    assert not before.whole
    assert not before.running
    assert track(recordings, store).whole
    assert bits(store) == bits(whole)


def test_tomorrow_s_files_are_added(north: Path, whole: Path, tmp_path: Path) -> None:
    """Also where the run of the next day is shown the new files alone."""
    store, later = tmp_path / "store", tmp_path / "later" / "north"
    later.mkdir(parents=True)
    for seconds in range(160, SECONDS, 20):
        file_at(north, "north", seconds).rename(later / file_at(north, "north", seconds).name)
    first = track(north, store)
    assert first.whole
    assert first.stations[0].segments < status(whole).stations[0].segments
    run(north / "scenario.toml", [later.parent], store, pattern=PATTERN, workers=0)
    assert bits(store) == of_station(bits(whole), "north")


def test_a_run_on_a_whole_store_computes_nothing(
    recordings: Path, whole: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(running, "compute", None)
    before = bits(whole)
    assert track(recordings, whole).whole
    assert bits(whole) == before


def truncate(file: Path) -> None:
    content = file.read_bytes()
    file.write_bytes(content[: len(content) // 2])


def touch(file: Path) -> None:
    os.utime(file, ns=(1, 1))


@pytest.mark.parametrize(
    ("spoil", "planned_before", "why"),
    [
        (truncate, False, "promises"),
        pytest.param(Path.unlink, True, "vanished", marks=pytest.mark.slow),
        pytest.param(touch, True, "changed", marks=pytest.mark.slow),
    ],
)
def test_a_file_that_goes_bad_is_told_and_left_out(
    north: Path,
    lacking: dict[str, bytes],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    spoil: Callable[[Path], None],
    planned_before: bool,
    why: str,
) -> None:
    """What comes out is what comes of an archive in which it never was."""
    bad, store = file_at(north, "north", SPOILT), tmp_path / "store"
    planned = running.planned

    def then_spoil(*arguments: Any, **options: Any) -> ArchivePlan:
        plan = planned(*arguments, **options)
        if bad.exists():
            spoil(bad)
        return plan

    if planned_before:
        monkeypatch.setattr(running, "planned", then_spoil)
    else:
        spoil(bad)
    said: list[str] = []
    found = track(north, store, COARSE, tell=said.append)
    assert found.whole
    assert list(found.left_out) == [str(bad)]
    assert why in found.left_out[str(bad)]
    assert len(said) == 1
    assert bits(store) == lacking


@pytest.mark.slow
def test_a_file_is_looked_at_again_where_that_is_asked_for(
    recordings: Path, north: Path, whole: Path, tmp_path: Path
) -> None:
    bad, store = file_at(north, "north", SPOILT), tmp_path / "store"
    truncate(bad)
    track(north, store, COARSE)
    shutil.copy2(file_at(recordings, "north", SPOILT), bad)
    found = retry(store, workers=0)
    assert found.whole
    assert not found.left_out
    pd.testing.assert_frame_equal(states(store, "north"), states(whole, "north"), check_exact=True)


@pytest.mark.slow
def test_results_of_files_that_are_gone_stay(north: Path, tmp_path: Path) -> None:
    """Recordings may be removed when their chain is done; before, what goes on from them waits until they are back."""
    store, later, away = tmp_path / "store", tmp_path / "later" / "north", tmp_path / "away"
    later.mkdir(parents=True)
    away.mkdir()
    for seconds in range(100, SECONDS, 20):
        file_at(north, "north", seconds).rename(later / file_at(north, "north", seconds).name)
    track(north, store, COARSE)
    before = bits(store)
    first = file_at(north, "north", 0)
    first.rename(away / first.name)
    said: list[str] = []
    found = run(north / "scenario.toml", [later.parent], store, pattern=PATTERN, workers=0, tell=said.append)
    assert not found.whole
    assert list(found.failed) == ["north/20260101T235900Z"]
    assert "has vanished" in said[0]
    segments = {name: content for name, content in before.items() if name.startswith("segments")}
    assert segments.items() <= bits(store).items()
    (away / first.name).rename(first)
    assert retry(store, workers=0).whole


def test_a_burn_in_is_measured(north: Path) -> None:
    """At seams where both sources have been heard for long, half a minute is enough."""
    pieces, _ = laid(pieces_of(sources_of([north / "north"], PATTERN)[0], {}, {})[0])
    ((segment,),) = chains_of(pieces, Cut(3 * DAY, 3 * DAY, 0), SCENARIO["analysis"]["frame"])
    with Samples(segment) as samples:
        recording = dataclasses.replace(samples.recording(), length=round(SECONDS * RATE))
        (found,) = measured(recording, ft.Scenario(**SCENARIO), [30.0], [110.0, 150.0])
    assert (found.right, found.seams, found.targets) == (2, 2, 4)
    assert found.interval[1] == 1


def test_two_runs_on_one_store(recordings: Path, whole: Path) -> None:
    with writing(whole):
        assert status(whole).running
        with pytest.raises(InputError, match="in use by another run"):
            track(recordings, whole)


def test_a_store_is_of_one_scenario_and_one_cut(recordings: Path, whole: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is cut as"):
        track(recordings, whole, Cut(10, 120, 30))
    with pytest.raises(InputError, match="another scenario"):
        run(SCENARIO | {"tracker": {"declare": 0.9}}, [recordings], whole, pattern=PATTERN, workers=0)
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "file").touch()
    with pytest.raises(InputError, match=r"holds file and no archive\.json"):
        track(recordings, tmp_path / "other")


def test_command_line_from_plan_to_report(recordings: Path, whole: Path) -> None:
    asked = (recordings / "scenario.toml", recordings, "--pattern", PATTERN)
    plan = json.loads(call("archive", "plan", *asked, "--segment", 30, "--chain", 120, "--burn-in", 30, "--json").out)
    assert [station["files"] for station in plan["stations"]] == [12, 12]
    assert plan["stations"][0]["hours"] == pytest.approx(SECONDS / 3600)
    assert plan["seconds"] > 0
    told = call("archive", "status", whole)
    assert told.status == 0
    assert told.out.splitlines()[-1] == "whole"
    drawn = call("archive", "report", whole)
    assert drawn.status == 0, drawn.err
    page = (whole / "report.html").read_text(encoding="utf-8")
    # It asks nobody for anything, and every segment's report is there.
    assert "http" not in page
    assert "<script" not in page
    links = {part.split('"')[0] for part in page.split('<a href="')[1:]}
    assert len(links) == 16
    assert all((whole / link).is_file() for link in links)
    done = call("archive", "run", *asked, "--out", whole, "--workers", 0, "--json")
    assert json.loads(done.out)["whole"]
    assert call("archive", "status", recordings).status == 2
