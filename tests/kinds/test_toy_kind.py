"""A kind that is built outside the package and entered in its table is a kind like any other."""

import json
from pathlib import Path

import pytest
from matplotlib.figure import Figure

import faintrack as ft
from faintrack.kinds import KINDS
from faintrack.kinds.commented import commented_scenario
from tests.cli.calling import call

COUNTS = {
    "counts": {"background": 2.0, "source": 8.0},
    "filter": {"particles": 200, "births": 100},
    "simulation": {"scans": 20, "cells": 16, "cell": 11},
}


@pytest.fixture(autouse=True)
def _registered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(KINDS, "toy", "tests.kinds.toy_kind")


def test_it_is_simulated_tracked_and_reported(tmp_path: Path) -> None:
    """The sections tell the kind; 8 counts above 2 are found within three scans, in the very cell."""
    result = ft.track(ft.simulate(COUNTS), COUNTS, truth=ft.Scenario(**COUNTS))
    (track,) = result.tracks
    assert track.start_s <= 3
    assert abs(track.average("cell") - 11) < 0.5
    assert result.kind.name == result.scenario.kind == "toy"
    assert isinstance(result.plot(), Figure)
    assert "1 track in simulation" in result.report(tmp_path / "report.html").read_text(encoding="utf-8")
    kept = ft.read_result(result.save(tmp_path / "result"))
    assert list(kept.to_dataframe()) == ["time_s", "label", "existence", "cell", "cell_std"]
    assert kept.data.known.values.tolist() == ["source"]


def test_the_command_line_knows_it(tmp_path: Path) -> None:
    scenario, file = tmp_path / "scenario.toml", tmp_path / "counts.txt"
    ft.Scenario(**COUNTS).save(scenario)
    assert call("simulate", scenario, "--out", file).status == 0
    options = ("--kind", "toy", "--set", "counts.background=2.0", "--set", "counts.source=8.0")
    done = call("track", file, *options, "--out", tmp_path / "result", "--json")
    assert done.status == 0, done.err
    assert json.loads(done.out)["kind"] == "toy"
    assert call("report", tmp_path / "result").status == 0
    assert "20 counts of 16 cells" in call("info", file, "--kind", "toy").out
    done = call("track", file)
    assert done.status == 2
    assert "the name does not tell what it holds" in done.err
    assert "toy" in done.err


def test_init_writes_its_scenario(tmp_path: Path) -> None:
    (tmp_path / "scenario.toml").write_text(commented_scenario("toy"), encoding="utf-8")
    scenario = ft.Scenario.read(tmp_path / "scenario.toml")
    assert (scenario.kind, scenario.counts.source) == ("toy", 8.0)


def test_its_threshold_is_counted_on_its_own_silence() -> None:
    found = ft.calibrate(COUNTS, probability=0.2, duration=20.0, runs=10)
    assert found.by == "counting"
    assert 0 < found.threshold.low <= found.threshold.value < 1
