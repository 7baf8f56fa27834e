"""Sweeps that make no sense are refused in a sentence that names file and field."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import faintrack as ft
from faintrack.errors import InputError
from faintrack.kinds.sweeps import from_sweeps

SWEEPS = np.zeros((3, 64, 100), np.uint8)
SWEEPS[:, 10:20, 40:50] = 9


@pytest.mark.parametrize(
    ("arrays", "section", "message"),
    [
        ({"intensity": SWEEPS[0]}, {}, r"intensity holds uint8 of shape \(64, 100\); expected real values"),
        ({"intensity": SWEEPS}, {}, "there is no sample_spacing; expected sweeps.sample_spacing"),
        ({"power": SWEEPS}, {"sample_spacing": 3.0}, "there is no array intensity; the file holds power"),
        ({"intensity": SWEEPS}, {"sample_spacing": 3.0, "times": "when"}, "sweeps.times is 'when', and there is no"),
        ({"intensity": SWEEPS, "time": np.arange(2.0)}, {"sample_spacing": 3.0}, "expected 3 sweeps"),
        ({"intensity": SWEEPS, "time": np.array([0.0, 2.0, 1.0])}, {"sample_spacing": 3.0}, "sweep 2 is not after"),
        ({"intensity": SWEEPS, "time": np.array([0.0, np.nan, 1.0])}, {"sample_spacing": 3.0}, "sweep 1 has no time"),
        ({"intensity": SWEEPS, "heading_deg": np.zeros(5)}, {"sample_spacing": 3.0}, r"heading has shape \(5,\)"),
        ({"intensity": SWEEPS, "antenna_x": np.full(3, np.nan)}, {"sample_spacing": 3.0}, "x holds NaN"),
        ({"intensity": SWEEPS, "sample_spacing": np.ones(4)}, {}, r"sample_spacing has shape \(4,\)"),
        ({"intensity": SWEEPS[:, :8], "sample_spacing": 3.0}, {}, "8 spokes of 100 samples; expected at least"),
    ],
)
def test_files_that_make_no_sense(tmp_path: Path, arrays: Any, section: Any, message: str) -> None:
    path = tmp_path / "log.npz"
    np.savez(path, **arrays)
    with pytest.raises(InputError, match=message) as error:
        ft.track(path, {"kind": "sweeps", "sweeps": section})
    assert "log.npz" in str(error.value)


@pytest.mark.parametrize(
    ("sections", "message"),
    [
        ({"filter": {"speeds": 4}}, "filter.speeds is 4; expected an odd number"),
        ({"echo": {"across": 40.0}}, "makes windows of"),
        ({"filter": {"windows": 100_000, "speeds": 49}}, "expected fewer filter.windows"),
        ({"sweeps": {"sample_space": 3.0}}, "did you mean sample_spacing"),
    ],
)
def test_scenarios_that_make_no_sense(sections: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        ft.track(from_sweeps(SWEEPS, 30.0), {"kind": "sweeps", **sections})


def test_values_that_are_no_numbers() -> None:
    values = SWEEPS.astype(np.float32)
    values[1, 5, 5] = np.nan
    with pytest.raises(InputError, match="sweep 1 holds NaN or infinity"):
        ft.track(from_sweeps(values, 30.0), kind="sweeps")
    below = SWEEPS.astype(np.int16)
    below[2, 0, 0] = -1
    with pytest.raises(InputError, match="sweep 2 holds values below 0"):
        ft.track(from_sweeps(below, 30.0), kind="sweeps")


def test_sweeps_without_an_echo_need_the_scale() -> None:
    silent = from_sweeps(np.zeros_like(SWEEPS), 30.0)
    with pytest.raises(InputError, match="the first sweep holds no echo"):
        ft.track(silent, kind="sweeps")
    quick = {"echo": {"full_scale": 15.0}, "filter": {"windows": 8, "speeds": 3}}
    assert ft.track(silent, kind="sweeps", **quick).tracks == []


def test_arrays_that_make_no_sense() -> None:
    with pytest.raises(InputError, match=r"expected \(sweep, spoke, sample\)"):
        from_sweeps(SWEEPS[0], 30.0)
    with pytest.raises(InputError, match="sample spacing is 0; expected metres above 0"):
        from_sweeps(SWEEPS, 0.0)
    with pytest.raises(InputError, match="expected 3 sweeps"):
        from_sweeps(SWEEPS, 30.0, np.arange(4.0))
