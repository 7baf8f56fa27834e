"""Returns of a sonar and scenarios that do not fit: one sentence that names file and field, nothing written."""

from pathlib import Path

import pytest

from tests.kinds.refusing import refuse
from tests.returns import SCENARIO

RETURNS = "time_s,delay_s,bearing_deg,snr_db\n0,8,90,12\n120,8,90,12\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Folder with good returns and a good scenario."""
    (tmp_path / "returns.csv").write_text(RETURNS, encoding="utf-8")
    (tmp_path / "scenario.toml").write_text(SCENARIO, encoding="utf-8")
    return tmp_path


def refuse_returns(folder: Path, names: tuple[str, ...]) -> None:
    refuse(folder, folder / "returns.csv", folder / "scenario.toml", names)


@pytest.mark.parametrize(
    ("old", "new", "names"),
    [
        ("threshold_db = 9.0", "threshold_db = 0.0", ("sonar.threshold_db is 0.0", "greater than 0")),
        ("threshold_db = 9.0", "threshold_db = -3.0", ("sonar.threshold_db is -3.0", "greater than 0")),
        ("threshold_db = 9.0", "", ("sonar.threshold_db is missing",)),
        ("snr_db = 12.0", "snr_db = inf", ("sonar.snr_db", "finite")),
        ("snr_db = 12.0", "snr_db = -60.0", ("sonar.snr_db is -60.0", "-40")),
        ("snr_db = 12.0", "snr_db = 12.0\nlevel = 1.0", ("no field sonar.level",)),
        ("frequency = 2000.0", "frequency = 0.0", ("sonar.pulse.frequency is 0.0",)),
        ("bandwidth = 10.0", "bandwidth = -1.0", ("sonar.pulse.bandwidth is -1.0",)),
        ("delay = [3.0, 22.9]", "delay = [22.9, 3.0]", ("sonar", "delay", "first bin below the last")),
        (
            "delay = [3.0, 22.9]",
            "delay = [-1.0, 18.9]",
            (
                "sonar",
                "delay begins at -1 s",
            ),
        ),
        ("delay_step = 0.1", "", ("sonar", "exactly one of delay_bins and delay_step")),
        ("delay_step = 0.1", "delay_step = 0.1\ndelay_bins = 200", ("exactly one of delay_bins and delay_step",)),
        ("delay_step = 0.1", "delay_bins = 0", ("sonar.delay_bins is 0",)),
        ("delay_step = 0.1", "delay_bins = 1", ("sonar", "delay_bins is 1", "at least 2")),
        ("delay_step = 0.1", "delay_step = 0.15", ("delay_step is 0.15", "whole number of times", "132.667")),
        ("beams = 24", "beams = 24\ndoppler_bins = 9", ("bins of doppler", "expected doppler")),
        ("beams = 24", "beams = 2", ("sonar.beams is 2",)),
        ("beam_width_deg = 6.0", "beam_width_deg = 0.0", ("sonar.beam_width_deg is 0.0",)),
        ("reach = [5, 4, 0]", "reach = [5, 4]", ("sonar.reach",)),
        ("reach = [5, 4, 0]", "reach = [500, 4, 0]", ("sonar.reach[0] is 500", "12")),
        ("source = [0.0, 0.0]", "", ("returns.csv", "sonar.source is missing", "source_x_m")),
        ("receiver = [500.0, 1000.0]", "receiver = 500.0", ("sonar.receiver",)),
        ("[grid]", "[background]\nshape = -0.1\n[grid]", ("background.shape is -0.1", "0")),
        ("[grid]", "[background]\nshape = 2.0\n[grid]", ("background.shape is 2.0", "0.5")),
        ("[grid]", "[background]\nshape = 0.1\nlearn = false\n[grid]", ("background", "learn is false")),
        ("[grid]", "[background]\nshape = 0.1\n[tracker]\ntargets = 1\n[grid]", ("background.shape", "targets is 1")),
        ("[grid]", "[background]\nevery = [0, 1, 1]\n[grid]", ("background.every[0] is 0",)),
        ("[grid]", "[background]\nevery = [2, 1]\n[grid]", ("background.every",)),
        ("[grid]", "[background]\nevery = [1, 5, 1]\n[grid]", ("background.every has 5", "divisor of the 24 beams")),
        ("[grid]", "[background]\nevery = [1, 12, 1]\n[grid]", ("background.every has 12", "3 beams at least")),
        ("[grid]", "[background]\nlevel = 2.0\n[grid]", ("no field background.level",)),
        ("cells = [12, 12]", "cells = [12, 0]", ("grid.cells[1] is 0",)),
        ("cells = [12, 12]", "cells = [12]", ("grid.cells",)),
        ("x = [-15e3, 15e3]", "x = [15e3, -15e3]", ("grid", "x goes from 15000 to -15000 m")),
        ("y = [-15e3, 15e3]", "y = [0.0, 0.0]", ("grid", "y goes from 0 to 0 m")),
        ("x = [-15e3, 15e3]", "x = [0.0, 500.0]", ("returns.csv", "cells of the 12 of grid.x", "larger grid")),
        ("speed = 9.0", "speed = 0.0", ("grid.speed is 0.0",)),
        ("speeds = 3", "speeds = 0", ("grid.speeds is 0",)),
        ("relaxation = 10_000.0", "relaxation = 0.0", ("target.relaxation is 0.0",)),
        ("relaxation = 10_000.0", "speed = 9.0", ("no field target.speed",)),
        ("[grid]", "[frames]\n[grid]", ("[sonar] is of returns", "[frames] of frames")),
        ("[grid]", "[analysis]\nframe = 1.0\n[grid]", ("[sonar] is of returns", "[analysis]")),
        ("[grid]", '[filter]\nkind = "particles"\n[grid]', ("no field filter.kind", "seed")),
        ("[grid]", '[tracker]\nmethod = "cfar"\n[grid]', ("no field tracker.method",)),
        ("[grid]", "[simulation]\npings = 1\n[grid]", ("simulation.pings is 1",)),
        (
            "[grid]",
            "[simulation]\npings = 9\ninterval = 120.0\ntargets = [{x = 0, y = 0, start = 9, end = 9}]\n[grid]",
            ("simulation.targets[0]", "end is 9 s", "more than start"),
        ),
    ],
)
def test_scenario_that_is_wrong(folder: Path, old: str, new: str, names: tuple[str, ...]) -> None:
    assert old in SCENARIO
    (folder / "scenario.toml").write_text(SCENARIO.replace(old, new), encoding="utf-8")
    refuse_returns(folder, names if "returns.csv" in names else ("scenario.toml", *names))


@pytest.mark.parametrize("lacks", ["sonar", "grid"])
def test_scenario_with_half_of_its_sections(folder: Path, lacks: str) -> None:
    head, tail = SCENARIO.split("[grid]")
    (folder / "scenario.toml").write_text(head if lacks == "grid" else f"[grid]{tail}", encoding="utf-8")
    refuse_returns(folder, ("scenario.toml", f"no [{lacks}]", "expected [sonar]", "and [grid]"))


@pytest.mark.parametrize(
    ("rows", "names"),
    [
        ("240,2.9,90,12\n", ("row 4: delay_s is 2.9", "2.95 to 22.95 s")),
        ("240,8,90,8.9\n", ("row 4: snr_db is 8.9", "threshold, 9 dB")),
        ("240,8,90,12\n240,8.04,93,12\n", ("row 5", "same bin as that of row 4")),
        ("200000,8,90,12\n", ("time_s 200000 comes 199880 s after", "at most 1000 times 120 s")),
        ("240,8,90,twelve\n", ("row 4: snr_db is 'twelve'",)),
    ],
)
def test_returns_that_are_wrong(folder: Path, rows: str, names: tuple[str, ...]) -> None:
    (folder / "returns.csv").write_text(RETURNS + rows, encoding="utf-8")
    refuse_returns(folder, ("returns.csv", *names))


def test_returns_without_what_they_need(folder: Path) -> None:
    path, scenario = folder / "returns.csv", folder / "scenario.toml"
    refuse(folder, path, None, ("returns.csv", "--scenario", "[sonar]"))
    refuse(folder, [path, path], scenario, ("2 files", "one file"))
    (folder / "night.wav").write_text("not returns", encoding="utf-8")
    refuse(folder, folder / "night.wav", scenario, ("night.wav", "samples of hydrophones", "no array", "[reception]"))
    path.write_text("time_s,delay,bearing\n0,8,90\n", encoding="utf-8")
    refuse(folder, path, None, ("returns.csv", "what it holds", "returns", "--kind"))
    refuse(folder, path, scenario, ("returns.csv", "column 'delay'"))
    path.write_bytes(b"\xff\xfe\x00")
    refuse(folder, path, None, ("returns.csv cannot be read as CSV",))
