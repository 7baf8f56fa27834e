"""`faintrack calibrate DATA` and `faintrack track --false-tracks`: what they print, write and refuse."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from tests.cli.calling import call

ALONE = "--set", "tracker.targets=1"


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("frames") / "frames.npy"
    np.save(path, np.random.default_rng(0).normal(size=(12, 10, 12)))
    return path


def test_calibrate_writes_the_scenario_that_track_takes(frames: Path, tmp_path: Path) -> None:
    out = tmp_path / "scenario.toml"
    done = call("calibrate", frames, *ALONE, "--false-tracks", "1/h", "--draws", 2, "--out", out)
    assert done.status == 0, done.err
    assert "found by" in done.out
    assert "of surrogates" in done.out
    assert "Extrapolated" in done.out
    tracker = tomllib.loads(out.read_text())["tracker"]
    assert (tracker["false_tracks"], tracker["calibration"]["by"]) == ("1/h", "surrogates")
    tracked = call("track", frames, "--scenario", out, "--json")
    assert tracked.status == 0, tracked.err
    promise = json.loads(tracked.out)["false_tracks"]
    assert (promise["promised"], promise["by"], promise["extrapolated"]) == ("1/h", "surrogates", True)
    again = call("calibrate", frames, *ALONE, "--false-tracks", "1/h", "--out", out)
    assert again.status != 0
    assert "exists" in again.err


@pytest.mark.slow
def test_json_and_quiet_stretches(frames: Path) -> None:
    done = call("calibrate", frames, *ALONE, "--false-tracks", "60/h", "--quiet", "0:5,6:12", "--json")
    found = json.loads(done.out)
    assert found["by"] == "quiet stretches"
    assert found["hours"] * 3600 == pytest.approx(11)
    low, high = found["interval"]
    assert 0.5 <= low <= found["threshold"] <= high < 1


def test_track_promises_by_the_model(frames: Path) -> None:
    done = call("track", frames, *ALONE, "--false-tracks", "1/h")
    assert done.status == 0, done.err
    assert "1/h was promised, and existence of 0.7826 is passed 1 an hour at most" in done.out


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("--false-tracks", "1/week of"), "false_tracks is '1/week of'; expected a number an hour or a day"),
        (("--false-tracks", "1/h", "--quiet", "0:100"), "does not lie in the data"),
        (("--false-tracks", "1/h", "--quiet", "some"), "expected starts and ends in seconds"),
        ((), "data were given without a rate"),
    ],
)
def test_bad_input_is_one_sentence(frames: Path, arguments: tuple[str, ...], expected: str) -> None:
    done = call("calibrate", frames, *ALONE, *arguments)
    assert done.status != 0
    assert expected in done.err
    assert "Traceback" not in done.err
    assert len(done.err.strip().splitlines()) == 1


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("nowhere.npy", "--false-tracks", "1/h"), "nowhere.npy does not exist"),
        (("--false-tracks", "1/h"), "without data; expected files"),
        (("--quiet", "0:5"), "--quiet was given without data"),
    ],
)
def test_missing_data_is_one_sentence(arguments: tuple[str, ...], expected: str) -> None:
    done = call("calibrate", *arguments)
    assert done.status != 0
    assert expected in done.err
    assert len(done.err.strip().splitlines()) == 1
