"""Arrays that turn: true bearings, the two sides of a line, and what bad headings say."""

from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from typer.testing import CliRunner

import faintrack as ft
from faintrack import Recording
from faintrack.beliefs.belief import Belief
from faintrack.cli.app import app
from faintrack.errors import InputError
from faintrack.io.headings import read_headings
from faintrack.kinds.recording.heading import course_of
from faintrack.targets.motion import BearingMotion
from faintrack.targets.states import BearingState, SidedState
from faintrack.targets.turning import SidedMotion, turned, turned_beliefs

SQUARE = {"channels": [{"name": f"{x}{y}", "x": x, "y": y} for x in (0.0, 1.5) for y in (0.0, 1.5)]}
LINE = {"line": {"count": 8, "spacing": 0.75}}
"""The axis of the line points north at heading 0."""

TURN = ("time_s,heading_deg", "0,350", "10,350", "16,380", "24,20")


@pytest.fixture
def heading(tmp_path: Path) -> Path:
    path = tmp_path / "heading.csv"
    path.write_text("\n".join(TURN) + "\n")
    return path


def scene(array: Any, heading: Path, bearing_deg: float, duration: float = 24.0) -> tuple[Any, Recording]:
    source = {"snr_db": -5.0, "bearing_deg": bearing_deg}
    simulation = {"duration": duration, "sample_rate": 1000.0, "sources": [source]}
    scenario = ft.Scenario(kind="recording", array=array, heading=str(heading), simulation=simulation)
    return scenario, ft.simulate(scenario)


def off(bearings: Any, true: float) -> np.ndarray:
    return np.abs((np.asarray(bearings) - true + 180) % 360 - 180)


@pytest.mark.parametrize("side", [1, pytest.param(-1, marks=pytest.mark.slow)])
def test_a_turn_tells_the_side_of_a_line(heading: Path, side: int) -> None:
    true = 5.0 + side * 80.0
    scenario, recording = scene(LINE, heading, true)
    (track,) = ft.track(recording, scenario).tracks
    before, after = track.time < 10, track.time > 16
    # Particles are dealt to both sides evenly; what is left is their weights, a tenth at most.
    assert np.abs(track.mean["starboard"][before] - 0.5).max() < 0.1
    assert (track.mean["starboard"][after] > 0.99).all() if side > 0 else (track.mean["starboard"][after] < 0.01).all()
    assert off(track.mean["true_bearing"][after], true).max() < 2
    either = np.minimum(
        off(track.mean["true_bearing"][before], true), off(track.mean["true_bearing"][before], -20 - true)
    )
    assert either.max() < 2
    # The rate is that of a line that keeps its heading, which this source does not have.
    assert np.abs(track.mean["bearing_rate"]).max() < 1


@pytest.mark.slow
def test_a_planar_array_has_true_bearings(heading: Path) -> None:
    scenario, recording = scene(SQUARE, heading, 170.0)
    result = ft.track(recording, scenario, truth=scenario)
    (track,) = result.tracks
    assert "starboard" not in result.data
    assert off(track.mean["true_bearing"], 170.0).max() < 6
    np.testing.assert_allclose(track.std["true_bearing"], track.std["bearing"], rtol=1e-4)
    expected = track.mean["bearing"] + result.data.heading.sel(time=track.time).values
    np.testing.assert_allclose(off(track.mean["true_bearing"], 0), off(expected, 0), atol=1e-3)


def test_command_and_table_have_true_bearings(heading: Path, tmp_path: Path) -> None:
    scenario, _ = scene(LINE, heading, 85.0)
    recording = ft.simulate(scenario, tmp_path / "a.wav")
    (tmp_path / "array.toml").write_text("line = {count = 8, spacing = 0.75}\nsound_speed = 1500\n")
    out = tmp_path / "out"
    given = ["track", str(tmp_path / "a.wav"), "--array", str(tmp_path / "array.toml"), "--heading", str(heading)]
    done = CliRunner().invoke(app, [*given, "--out", str(out)])
    assert done.exit_code == 0, done.output
    columns = (out / "states.csv").read_text().splitlines()[0].split(",")
    assert {"bearing_deg", "true_bearing_deg", "true_bearing_deg_std", "starboard"} <= set(columns)
    assert "to starboard" in (out / "report.html").read_text()
    again = ft.read_result(out)
    np.testing.assert_array_equal(ft.track(recording, again.scenario).data.label, again.data.label)


def test_a_turn_moves_signed_bearings_and_undoes_itself() -> None:
    bearing = jnp.array([0.2, 1.0, 3.0, 3.0])
    states = SidedState(bearing, jnp.full(4, 0.1), jnp.zeros(4), jnp.array([1.0, -1.0, 1.0, -1.0]))
    there = turned(states, 0.5)
    # By hand: to starboard less, to port more; across an end onto the other side, with the rate turned about.
    np.testing.assert_allclose(there.bearing, [0.3, 1.5, 2.5, 2 * np.pi - 3.5], rtol=1e-6)
    assert there.side.tolist() == [-1, -1, 1, 1]
    np.testing.assert_allclose(there.bearing_rate, [-0.1, 0.1, 0.1, -0.1], rtol=1e-6)
    back = turned(there, -0.5)
    for name in ("bearing", "bearing_rate", "side"):
        np.testing.assert_allclose(getattr(back, name), getattr(states, name), atol=1e-6)


def test_motion_keeps_the_true_bearing_on_both_sides() -> None:
    states = SidedState(jnp.array([1.0, 0.05]), jnp.array([0.1, -0.1]), jnp.zeros(2), jnp.array([-1.0, 1.0]))
    moved = SidedMotion(BearingMotion(0.0, 0.0, circular=True)).move(states, 1.0, jax.random.key(0))
    np.testing.assert_allclose(moved.bearing, [1.1, 0.05], rtol=1e-5)
    assert moved.side.tolist() == [-1, -1]


def test_only_what_appeared_since_the_last_turn_is_dealt_to_both_sides() -> None:
    ones = jnp.ones(6)
    states = SidedState(ones, 0 * ones, ones, ones.at[5].set(0))
    belief = Belief(states, -ones, jnp.zeros(()), jnp.array(9.0), jnp.array([1.0, 1.0, 5.0, 5.0, 1.0, 1.0]))
    after = turned_beliefs({"any": (belief,)}, jnp.array(0.0), jnp.array(0.0), jnp.array(4.0), jax.random.key(0))[
        "any"
    ][0]
    assert after.states.side.tolist() == [1, 1, 1, -1, 1, -1]


def test_bearings_are_moved_apart_by_what_is_not_known_of_a_turn() -> None:
    count, turn = 4000, 0.06
    ones = jnp.ones(count)
    belief = Belief(BearingState(ones, 0 * ones, ones), -ones, jnp.zeros(()), jnp.array(9.0), ones)
    expected = 0.02
    turns = jnp.array(turn), jnp.array(expected), jnp.array(4.0)
    bearing = turned_beliefs(belief, *turns, jax.random.key(0)).states.bearing
    # Four standard errors of a mean and of a deviation.
    assert abs(float(bearing.mean()) - (1 - turn)) < 4 * expected / np.sqrt(count)
    assert abs(float(bearing.std()) / expected - 1) < 4 / np.sqrt(2 * count)


def test_a_course_tells_since_when_the_heading_is_kept() -> None:
    course = course_of(np.array([0.5, 1.5, 2.5, 3.5, 4.5]), np.array([1.0, 1.01, 1.5, 2.0, 2.0]), 0.1)
    np.testing.assert_allclose(course.turn, [0, 0.01, 0.49, 0.5, 0])
    assert course.steady_since.tolist() == [-np.inf, -np.inf, -np.inf, 2.0, 3.0]
    np.testing.assert_allclose(course.unsure, np.array([0, 0.01, 0.48, 0.01, 0.5]) / np.sqrt(3))
    turn, unsure, since = course.turns(4, 7)
    assert turn.tolist() == [0.0] * 3
    assert since.tolist() == [3.0] * 3
    np.testing.assert_allclose(unsure, [0.5 / np.sqrt(3), 0, 0], rtol=1e-6)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("time_s,course\n0,1\n", "the columns are time_s, course; expected time_s, heading_deg"),
        ("time_s,heading_deg\n", "there is no row"),
        ("time_s,heading_deg\n5,1\n5,2\n", "row 3: time_s is not after the row before"),
        ("time_s,heading_deg\n0,north\n", "heading_deg"),
        ("time_s,heading_deg\n0,1\n3,2\n", "headings of the times 0 to 3 s; expected all of the recording's"),
        ("time_s,heading_deg\n2024-01-01T00:00:00,1\n", "times are dates, and the recording does not tell"),
    ],
)
def test_bad_headings_are_sentences(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "heading.csv"
    path.write_text(text)
    noise = ft.from_samples(np.random.default_rng(0).normal(size=(24000, 8)), 1000.0)
    with pytest.raises(InputError, match=says):
        ft.track(noise, array=LINE, heading=str(path))


def test_dates_are_counted_from_the_start_of_the_recording(tmp_path: Path) -> None:
    path = tmp_path / "heading.csv"
    path.write_text("time_s,heading_deg\n2024-01-01T00:00:10,1\n2024-01-01T00:00:20,2\n")
    assert read_headings(path, np.datetime64("2024-01-01T00:00:04", "ns"))[0].tolist() == [6.0, 16.0]


def test_an_upright_line_and_the_baseline_have_no_heading(heading: Path) -> None:
    noise = ft.from_samples(np.random.default_rng(0).normal(size=(24000, 3)), 1000.0)
    upright = {"channels": [{"name": str(z), "x": 0.0, "y": 0.0, "z": float(z)} for z in range(3)]}
    with pytest.raises(InputError, match="stand upright"):
        ft.track(noise, array=upright, heading=str(heading))
    with pytest.raises(InputError, match=r"heading: tracker.method is .cfar., which knows of no turns"):
        ft.track(noise, array=LINE, heading=str(heading), tracker={"method": "cfar"})
