"""A promise in false tracks an hour: by the model, found on a user's own data, and what a result says of it."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import faintrack as ft
from faintrack.kinds.false_tracks import stretches_of
from tests.kinds.small import SCENARIOS, data

ALONE: dict[str, Any] = SCENARIOS["frames"] | {"tracker": {"targets": 1}}
"""Twelve frames with a target, followed by the filter of one."""

PROFILES: dict[str, Any] = {
    "kind": "frames",
    "frames": {"background": "none"},
    "cells": {"amplitude": "swerling1", "levels": [10.0]},
    "target": {"arrival_rate": 0.5, "departure_rate": 0.05},
    "tracker": {"targets": 1},
}
"""Twelve cells of exponential noise, a second apart."""


def profiles(scans: int, seed: int) -> ft.Sequence:
    return ft.from_frames(np.random.default_rng(seed).exponential(size=(scans, 12)).astype(np.float32))


@pytest.mark.slow
def test_counted_tracks_are_as_many_as_promised() -> None:
    """120 an hour: 200 in 6,000 s of the noise that the threshold was found on, and in other noise as many.

    Four standard errors of the difference. The bound of the model is kept too.
    """
    found = ft.calibrate_on(profiles(6_000, 0), PROFILES, false_tracks="120/h", quiet=[(0.0, 6_000.0)])
    assert found.by == "quiet stretches"
    assert not found.kept.extrapolated
    assert found.exceedances.seconds == 6_000
    declare = found.kept.threshold.value
    assert found.scenario.tracker.declare == declare
    assert found.exceedances.count(declare) == 200
    result = ft.track(profiles(6_000, 1), found.scenario, pictures=False)
    assert abs(len(result.tracks) - 200) < 4 * np.sqrt(2 * 200)
    promise = result.summary()["false_tracks"]
    assert promise["by"] == "quiet stretches"
    np.testing.assert_allclose(promise["expected"], 200)
    assert promise["interval"][0] < 120 < promise["interval"][1]
    assert any("2e+02 false tracks are expected in these 1.67 h" in remark for remark in result.remarks)

    modelled = ft.track(profiles(6_000, 1), PROFILES, false_tracks="60/h", pictures=False)
    # The odds gain most in a second where they are (0.5 - 0.05) / 0.1.
    np.testing.assert_allclose(modelled.scenario.tracker.declare, 1 / (1 + (1 / 60) / (0.55**2 / 0.2)))
    np.testing.assert_allclose(modelled.summary()["false_tracks"]["expected"], 100)
    assert len(modelled.tracks) < 100
    assert not any("Existence rose" in misfit for misfit in modelled.misfits)


def test_noise_that_is_not_the_models_is_named() -> None:
    """Noise of twice the power: existence rises and falls far more often than the model has it."""
    louder = ft.from_frames(2 * profiles(2000, 2).read(0, 2000))
    misfits = ft.track(louder, PROFILES, false_tracks="60/h", pictures=False).misfits
    assert any("with the model's background does so at most 6 times" in misfit for misfit in misfits)


def test_thresholds_rise_as_rates_fall() -> None:
    """On surrogates of frames with a target."""
    sections = ALONE
    rates = ("600/h", "60/h", "1/h", "1/day")
    found = [ft.calibrate_on(data("frames"), sections, false_tracks=rate, draws=2) for rate in rates]
    thresholds = [one.kept.threshold.value for one in found]
    assert thresholds == sorted(thresholds)
    assert found[-1].kept.extrapolated
    assert len(found[-1].remarks) == 2
    assert found[-1].scenario.tracker.calibration.hours * 3600 == pytest.approx(24)


def test_a_scenario_says_how_its_threshold_was_found(tmp_path: Path) -> None:
    """Written and read it tracks the same; a result that is kept knows its promise."""
    found = ft.calibrate_on(data("frames"), ALONE, false_tracks="1/h", draws=1)
    found.scenario.save(tmp_path / "scenario.toml")
    again = ft.Scenario.read(tmp_path / "scenario.toml")
    assert again.tracker == found.scenario.tracker
    assert again.tracker.calibration.by == "surrogates"
    result = ft.track(data("frames"), tmp_path / "scenario.toml", out=tmp_path / "result")
    assert result.scenario.tracker.declare == found.kept.threshold.value
    assert result.summary()["false_tracks"]["by"] == "surrogates"
    assert result.summary()["false_tracks"]["promised"] == "1/h"
    assert "1/h was promised" in (tmp_path / "result" / "report.html").read_text()
    with pytest.raises(ft.InputError, match=r"tracker\.calibration was made for 1/h; expected the same"):
        ft.track(data("frames"), tmp_path / "scenario.toml", false_tracks="2/h")
    # 24 a day are one an hour.
    ft.track(data("frames"), tmp_path / "scenario.toml", false_tracks="24/day")


@pytest.mark.slow
def test_the_model_promises_where_it_is_a_likelihood_ratio() -> None:
    """By the section, by the option, and as `follow` takes it; a rate that allows all declares at one half."""
    frames = data("frames")
    by_section = ft.track(frames, ALONE, tracker={"targets": 1, "false_tracks": "1/h"})
    by_option = ft.track(frames, ALONE, false_tracks="1/h")
    for result in (by_section, by_option):
        np.testing.assert_allclose(result.scenario.tracker.declare, 3.6 / 4.6)
    moments = list(ft.follow(frames, ALONE, tracker={"targets": 1, "false_tracks": "1/h"}))
    assert len(moments[-1].tracks) == len(by_option.tracks)
    assert ft.track(frames, ALONE, false_tracks="1000/h").scenario.tracker.declare == 0.5
    assert ft.track(frames, ALONE).summary()["false_tracks"] is None
    assert by_option.summary()["false_tracks"] == pytest.approx(
        {
            "promised": "1/h",
            "by": "model",
            "per_hour": 1.0,
            "interval": None,
            "extrapolated": False,
            "expected": 12 / 3600,
        }
    )


@pytest.mark.parametrize(
    ("kind", "sections"),
    [
        ("recording", {"tracker": {"method": "cfar"}}),
        ("recording", {"likelihood": {"kind": "lobe_width"}, "tracker": {"targets": 1}}),
        ("records", {}),
    ],
)
def test_what_is_no_likelihood_ratio_is_calibrated_on_data(kind: str, sections: dict[str, Any]) -> None:
    with pytest.raises(ft.InputError, match="no threshold follows from the model; expected one that is found on data"):
        ft.track(data(kind), SCENARIOS[kind] | sections, false_tracks="1/h")


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"false_tracks": "1/week of"}, r"false_tracks is '1/week of'; expected a number an hour or a day"),
        ({"false_tracks": "1/h", "quiet": [(0.0, 99.0)]}, r"from 0 to 99 s does not lie in the data; .* 0 and 12 s"),
        ({"false_tracks": "1/h", "quiet": []}, "there is no quiet stretch"),
        ({"false_tracks": "1/h", "draws": 0}, "draws is 0; expected at least 1"),
    ],
)
def test_bad_input(given: dict[str, Any], expected: str) -> None:
    with pytest.raises(ft.InputError, match=expected):
        ft.calibrate_on(data("frames"), ALONE, **given)


def test_a_section_refuses_what_is_no_rate() -> None:
    with pytest.raises(ft.InputError, match=r"tracker\.false_tracks is '1/fortnight': expected a number an hour"):
        ft.Scenario(kind="frames", tracker={"false_tracks": "1/fortnight"})
    with pytest.raises(ft.InputError, match=r"declares at existence 0\.5; expected tracker\.drop, 0\.6, below it"):
        ft.track(data("frames"), ALONE, tracker={"targets": 1, "drop": 0.6}, false_tracks="1000/h")


@pytest.mark.parametrize("text", ["", "5", "0:a", "0:1:2", "0:5,,6:7", "-1:5"])
def test_stretches_that_are_none(text: str) -> None:
    with pytest.raises(ft.InputError, match="expected starts and ends in seconds, such as 0:600,1200:1800"):
        stretches_of(text)
