"""A threshold for a scenario: by the identity where there is a likelihood ratio, by counting where there is none."""

from typing import Any

import numpy as np
import pytest

from faintrack import InputError, calibrate, line_array
from faintrack.kinds.calibration import Calibrated

DURATION, FRAMES = 0.64, 10
SMALL: dict[str, Any] = {
    "array": line_array(4, 1.5),
    "analysis": {"frame": 0.064, "snapshot": 0.016, "beams": 24},
    "target": {"arrival_rate": 0.5, "departure_rate": 0.5, "snr_db": (-6.0, 10.0)},
    "filter": {"particles": 50, "births": 20, "guided": False},
    "simulation": {"duration": DURATION, "sample_rate": 500.0},
}
"""Three bins, four snapshots, 24 beams, 50 particles."""
CFAR = SMALL | {"tracker": {"method": "cfar"}}


def calibrated(scenario: dict[str, Any], runs: int) -> tuple[Calibrated, list[tuple[int, int]]]:
    """The threshold, and how far its runs were on the way to it."""
    steps: list[tuple[int, int]] = []
    found = calibrate(scenario, 0.1, DURATION, runs, progress=lambda drawn, total: steps.append((drawn, total)))
    return found, steps


def test_a_likelihood_ratio_is_calibrated_by_the_identity() -> None:
    """64 runs with a target, and a quarter as many without one."""
    found, steps = calibrated(SMALL, 64)
    assert found.by == "Wald's identity"
    assert 0 < found.threshold.low <= found.threshold.value <= found.threshold.high < 1
    assert found.threshold.low < found.threshold.high
    assert found.runs == sum(drawn for drawn, _ in steps) == 64 + 16
    assert {total for _, total in steps} == {80}


@pytest.mark.parametrize(
    "scenario",
    [pytest.param(SMALL | {"likelihood": {"kind": "lobe_width"}}, marks=pytest.mark.slow), CFAR],
    ids=["lobe width", "cfar"],
)
def test_what_is_no_ratio_is_calibrated_by_counting(scenario: dict[str, Any]) -> None:
    """100 runs, the last batch of which is not full."""
    found, steps = calibrated(scenario, 100)
    assert found.by == "counting"
    assert 0 < found.threshold.low <= found.threshold.value <= found.threshold.high < 1
    assert found.runs == sum(drawn for drawn, _ in steps) == 100
    assert {total for _, total in steps} == {100}


@pytest.mark.parametrize("probability", [2.0, 1.0, 0.0, -0.1, np.nan])
def test_probability_out_of_range(probability: float) -> None:
    with pytest.raises(InputError, match=r"probability is .*; expected a number between 0 and 1"):
        calibrate(SMALL, probability)


@pytest.mark.parametrize("duration", [0.0, -1.0, np.nan, np.inf])
def test_duration_that_is_none(duration: float) -> None:
    with pytest.raises(InputError, match=r"duration is .* s; expected a number above 0"):
        calibrate(SMALL, duration=duration)


@pytest.mark.parametrize("duration", [0.03, 1e12])
def test_duration_out_of_range(duration: float) -> None:
    with pytest.raises(InputError, match=r"duration is .* s; expected from 0\.064 s, one frame, to 6400 s"):
        calibrate(SMALL, duration=duration)


@pytest.mark.parametrize("rate", [0.0, -1.0, np.nan, np.inf])
def test_sample_rate_that_is_none(rate: float) -> None:
    with pytest.raises(InputError, match=r"simulation\.sample_rate is .*: input should be"):
        calibrate(SMALL, simulation={"sample_rate": rate})


def test_runs_that_would_not_end() -> None:
    with pytest.raises(InputError, match="probability is 1e-300; counted it takes more than 10,000,000 runs"):
        calibrate(CFAR, 1e-300)


def test_without_simulation_or_band_the_sample_rate_is_not_known() -> None:
    known = {name: section for name, section in SMALL.items() if name != "simulation"}
    with pytest.raises(InputError, match=r"the sample rate is not known; expected simulation\.sample_rate"):
        calibrate(known)


def test_runs_that_are_no_number_of_runs() -> None:
    with pytest.raises(InputError, match="runs is 1; expected at least 2"):
        calibrate(SMALL, runs=1)


def test_frames_are_calibrated_by_counting_runs_on_their_own_noise() -> None:
    """Ten runs of twelve frames of noise; so few do not tell where the interval ends above."""
    frames = {
        "frames": {"background": "none"},
        "cells": {"amplitude": "swerling1"},
        "simulation": {"frames": 12, "shape": (12,)},
    }
    found = calibrate(frames, probability=0.2, duration=10.0, runs=10)
    assert (found.by, found.runs) == ("counting", 10)
    assert 0 < found.threshold.low <= found.threshold.value < 1 == found.threshold.high
    with pytest.raises(InputError, match="the simulation lasts 12 s; expected at least the duration, 180 s"):
        calibrate(frames, probability=0.2, runs=10)
