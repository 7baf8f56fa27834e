"""A result is whole or not there."""

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import faintrack as ft
from faintrack.errors import InputError
from faintrack.kinds import door
from faintrack.results import folder as folders

ARRAY = ft.line_array(4, 1.0)
RECORDING = ft.from_samples(np.random.default_rng(0).normal(size=(6000, 4)), 1000.0)


@pytest.fixture(scope="module")
def held() -> ft.Result:
    return ft.track(RECORDING, array=ARRAY)


@pytest.mark.slow
def test_written_in_pieces_equals_in_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(folders, "CHUNK", 4)
    monkeypatch.setattr("faintrack.kinds.recording.plan.LONGEST_BLOCK", 2)
    kept, held = ft.track(RECORDING, array=ARRAY, out=tmp_path / "out"), ft.track(RECORDING, array=ARRAY)
    xr.testing.assert_equal(kept.data.load(), held.data)
    assert kept.data.record.attrs == held.data.record.attrs
    assert kept.scenario == held.scenario


@pytest.mark.parametrize("reason", [KeyboardInterrupt, RuntimeError, OSError])
def test_an_interruption_leaves_the_earlier_result(
    held: ft.Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, reason: type[BaseException]
) -> None:
    out = held.save(tmp_path / "out")
    before = (out / "about.json").read_text()
    whole: Callable[..., Iterator[xr.Dataset]] = door.datasets

    def interrupted(*arguments: Any) -> Iterator[xr.Dataset]:
        yield from whole(*arguments)
        raise reason

    monkeypatch.setattr(door, "datasets", interrupted)
    with pytest.raises((reason, ValueError)):
        ft.track(RECORDING, array=ARRAY, out=out)
    assert (out / "about.json").read_text() == before
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_a_report_replaces_nothing_but_a_file(held: ft.Result, tmp_path: Path) -> None:
    """A device, of which a rename would make a file for everybody on the machine."""
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path, tmp_path / "pipe"):
        with pytest.raises(InputError, match="cannot be written: it is no file"):
            held.report(path)
    assert (tmp_path / "pipe").is_fifo()
