"""Files that grow and folders that fill: the numbers are those of `track` on the same data, for every kind."""

import io
import shutil
import sys
import threading
import time
import types
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import faintrack as ft
from faintrack.errors import InputError
from faintrack.kinds import kind_named
from faintrack.live.growing import growing, watch_lines
from tests.cli.calling import call
from tests.kinds.small import SCENARIOS

SIMULATED = 24
"""Scans; what is compiled is made of the first sixteen."""


def longer(kind: str) -> dict[str, Any]:
    """The small scenario of a kind with more scans."""
    scenario = dict(SCENARIOS[kind])
    name = {"frames": "frames", "bearings": "scans"}[kind]
    return scenario | {"simulation": scenario["simulation"] | {name: SIMULATED}}


def same(moments: list[Any], path: Path, scenario: Any) -> None:
    """Scan by scan, and to the roundings of sums in another order."""
    whole = ft.track(path, scenario).data
    assert [moment.time for moment in moments] == whole.time.values.tolist()
    existence = np.concatenate([moment.data.existence.values for moment in moments])
    np.testing.assert_allclose(existence, whole.existence, atol=1e-3)
    label = np.concatenate([moment.data.label.values for moment in moments])
    np.testing.assert_array_equal(label, whole.label)
    assert label.max() == 1, "the target is found"


def test_a_folder_that_fills_gives_the_numbers_of_track(tmp_path: Path) -> None:
    """Each image is written in two halves, so that halves lie there to be read."""
    from PIL import Image

    scenario = longer("frames")
    sequence = ft.simulate(scenario)
    values = np.asarray(sequence.read(0, SIMULATED))
    low, high = float(values.min()), float(values.max())
    whole, filling, stop = tmp_path / "whole", tmp_path / "filling", threading.Event()
    whole.mkdir()
    filling.mkdir()
    for number, frame in enumerate(values):
        level = np.round((frame - low) / (high - low) * 65535).astype(np.uint16)
        Image.fromarray(level).save(whole / f"frame_{number:04d}.png")
    run = {name: part for name, part in scenario.items() if name != "simulation"}

    def fill() -> None:
        for file in sorted(whole.iterdir()):
            content = file.read_bytes()
            (filling / file.name).write_bytes(content[: len(content) // 2])
            time.sleep(0.02)
            shutil.copy(file, filling / file.name)
        time.sleep(0.5)
        stop.set()

    threading.Thread(target=fill, daemon=True).start()
    same(list(growing(filling, run, stop)), whole, run)


@pytest.mark.slow
def test_lines_that_come_give_the_numbers_of_track(tmp_path: Path) -> None:
    scenario = longer("bearings")
    whole, grows, stop = tmp_path / "whole.csv", tmp_path / "grows.csv", threading.Event()
    kind_named("bearings").write(whole, ft.simulate(scenario))
    run = {name: part for name, part in scenario.items() if name != "simulation"}

    def grow() -> None:
        content = whole.read_text()
        with grows.open("w") as file:
            for start in range(0, len(content), 97):
                file.write(content[start : start + 97])
                file.flush()
                time.sleep(0.02)
        stop.set()

    grows.touch()
    threading.Thread(target=grow, daemon=True).start()
    same(list(growing(grows, run, stop)), whole, run)


def test_what_cannot_be_read_at_the_end_is_told(tmp_path: Path) -> None:
    (tmp_path / "lines.csv").write_text("time_s,bearing_deg\n1.0,north\n")
    stop = threading.Event()
    stop.set()
    with pytest.raises(InputError, match=r"lines\.csv"):
        list(growing(tmp_path / "lines.csv", SCENARIOS["bearings"], stop))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--out", "watch"], "--out is of recordings; the source holds frames"),
        (["--nmea", "udp://127.0.0.1:10110"], "--nmea is of recordings; the source holds frames"),
    ],
)
def test_what_is_of_recordings_is_refused(options: list[str], said: str, tmp_path: Path) -> None:
    done = call("live", tmp_path, "--kind", "frames", *options)
    assert done.status == 2
    assert said in done.err


def given_on_standard_input(content: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", types.SimpleNamespace(buffer=io.BytesIO(content)))


@pytest.mark.slow
def test_lines_on_standard_input_are_taken_in_until_they_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One of them comes twice, which is told."""
    kind_named("bearings").write(tmp_path / "lines.csv", ft.simulate(longer("bearings")))
    run = {name: part for name, part in SCENARIOS["bearings"].items() if name != "simulation"}
    head, first, *rest = (tmp_path / "lines.csv").read_bytes().splitlines(keepends=True)
    given_on_standard_input(b"".join([head, first, first, *rest]), monkeypatch)
    events: list[Any] = []
    assert watch_lines(run, tell=events.append, stop=threading.Event()) == SIMULATED
    told = [event for event in events if event["event"] == "remark"]
    assert [event["event"] for event in events if event not in told] == ["start", *["scan"] * SIMULATED, "end"]
    assert len({event["text"] for event in told}) == len(told)
    assert ["stand in the file twice" in event["text"] for event in told] == [True]
    assert events[0]["source"] == "standard input (lines of CSV)"


def test_standard_input_without_lines_is_named_as_what_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    given_on_standard_input(b"\x89PNG\r\n", monkeypatch)
    with pytest.raises(InputError, match=r"^standard input \(lines of CSV\)"):
        watch_lines(SCENARIOS["frames"], tell=lambda event: None, stop=threading.Event())
