"""Sweeps of a radar: what moves among fixed echoes is found, wherever spoke 0 looks and however the antenna moves."""

import dataclasses
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

import faintrack as ft
from faintrack.beliefs.axis import Axis
from faintrack.kinds import kind_named
from faintrack.kinds.loop import advance
from faintrack.kinds.sweeps import Sweeps, from_sweeps
from faintrack.kinds.sweeps.echoes import Echoes
from faintrack.kinds.sweeps.plan import plan
from faintrack.likelihoods.cells import CellLikelihood, gaussian
from faintrack.likelihoods.unknown_level import UnknownLevel
from faintrack.sensors.cells import Cells, CellScan

START, VELOCITY = (1500.0, 1200.0), (-5.0, 3.0)
"""Of the target, in the middle of the first sweep; metres, m/s."""
SPOKES, SAMPLES, SWEEPS = 256, 128, 20


def scenario(**simulation: Any) -> dict[str, Any]:
    drawn = {"sweeps": SWEEPS, "spokes": SPOKES, "samples": SAMPLES, "fixed": 8, "seed": 1}
    drawn |= {"targets": [{"place": START, "velocity": VELOCITY}]} | simulation
    return {
        "kind": "sweeps",
        "echo": {"across": 4.0, "along": 3.0},
        "filter": {"windows": 64, "speeds": 9},
        "simulation": drawn,
    }


def in_memory(sweeps: Sweeps) -> np.ndarray:
    return sweeps.read(0, sweeps.length)


@pytest.fixture(scope="module")
def drawn() -> Sweeps:
    return ft.simulate(scenario())


@pytest.fixture(scope="module")
def result(drawn: Sweeps) -> Any:
    return ft.track(drawn, scenario())


def near(track: Any, place: Any, velocity: Any, deviations: float = 4.0) -> None:
    """The track ends at the place with the velocity, within so many of its own standard deviations."""
    names = ("x", "y", "vx", "vy")
    for name, true in zip(names, (*place, *velocity), strict=True):
        assert abs(track.mean[name][-1] - true) < deviations * track.std[name][-1], name


def end(result: Any) -> np.ndarray:
    return np.array(START) + np.array(VELOCITY) * float(result.data.time[-1])


def test_what_moves_among_fixed_echoes_is_found(result: Any) -> None:
    (track,) = result.tracks
    assert track.existence_max > 0.98
    # No track begins before its echo has been watched.
    assert track.start_s >= result.scenario.tracker.hold
    near(track, end(result), VELOCITY)
    assert result.data.x.attrs["units"] == "m"
    assert int(result.data.unwatched.max()) == 0


@pytest.mark.parametrize("seed", range(3))
def test_fixed_echoes_that_fluctuate_give_no_track(seed: int) -> None:
    kind = kind_named("sweeps")
    still = ft.Scenario(**scenario())
    assert ft.track(kind.silence(still, seed), still).tracks == []


def test_spoke_0_joins_the_last(drawn: Sweeps, result: Any) -> None:
    """Data turned by k spokes turn the tracks; the target then lies across spoke 0."""
    turn = -round(np.arctan2(*START) / (2 * np.pi) * SPOKES)
    # The rows of windows count from spoke 0: turned by whole windows nothing else changes.
    turn = turn // 16 * 16 + 16
    times = drawn.times[:, None] + np.zeros(SPOKES)
    plain, turned = (
        ft.track(from_sweeps(np.roll(in_memory(drawn), by, axis=1), drawn.spacing, times), scenario())
        for by in (0, turn)
    )
    (expected,), (track,) = plain.tracks, turned.tracks
    angle = turn / SPOKES * 2 * np.pi
    for east, north in (("x", "y"), ("vx", "vy")):
        x, y = expected.mean[east][-1], expected.mean[north][-1]
        rotated = x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle)
        # Velocities lie on a grid along east and north, which does not turn with the data.
        for name, true in zip((east, north), rotated, strict=True):
            assert abs(true - track.mean[name][-1]) < 2 * max(track.std[east][-1], track.std[north][-1])


def test_an_antenna_that_moves_sees_the_same_target() -> None:
    section = scenario(antenna_velocity=(4.0, 1.0))
    moved = ft.track(ft.simulate(section), section)
    (track,) = moved.tracks
    near(track, end(moved), VELOCITY)
    assert float(moved.data.antenna_x[-1] - moved.data.antenna_x[0]) == pytest.approx(4.0 * 57.0, rel=1e-3)


def test_an_antenna_that_passes_a_target_at_rest_declares_nothing() -> None:
    section = scenario(antenna_velocity=(4.0, 1.0), targets=[{"place": START}])
    assert ft.track(ft.simulate(section), section).tracks == []


def test_an_antenna_that_turns_sees_the_same_target(drawn: Sweeps) -> None:
    """Spokes that count from the bow of a ship with a heading are those that count from north, moved by it."""
    section = scenario()
    heading = 2 * np.pi * 16 * (np.arange(SWEEPS) % 4) / SPOKES
    rolled = np.stack([np.roll(sweep, -16 * (number % 4), axis=0) for number, sweep in enumerate(in_memory(drawn))])
    times = drawn.times[:, None] + np.zeros(SPOKES)
    straight = ft.track(from_sweeps(in_memory(drawn), drawn.spacing, times), section)
    turning = ft.track(from_sweeps(rolled, drawn.spacing, times, heading=heading), section)
    np.testing.assert_allclose(turning.data.existence[-1].max(), straight.data.existence[-1].max(), atol=0.02)
    near(turning.tracks[0], end(turning), VELOCITY)


def test_a_track_outlives_the_watch() -> None:
    """Windows that are laid out anew follow their target: one label through three watches."""
    section = scenario(sweeps=50)
    (track,) = ft.track(ft.simulate(section), section).tracks
    assert track.label == 1
    assert track.end_s == pytest.approx(49 * 3.0)
    # The grid of velocities is 2 m/s wide: over half a watch a step between two of them is 30 m.
    off = np.array([track.mean["x"][-1], track.mean["y"][-1]]) - np.array(START) - np.array(VELOCITY) * track.end_s
    assert np.hypot(*off) < 120


@pytest.mark.slow
def test_blocks_of_any_size_and_a_run_taken_up_again_give_the_same(drawn: Sweeps, result: Any) -> None:
    whole = plan(drawn, ft.Scenario(**scenario()))
    first = list(advance(whole, size=7))
    again = list(advance(whole, since=first[0][0], size=7))
    np.testing.assert_allclose(first[-1][1].existence[-1], result.data.existence[-1], atol=1e-4)
    np.testing.assert_array_equal(again[-1][1].existence, first[-1][1].existence)


def test_more_echoes_than_windows_are_counted() -> None:
    section = scenario()
    section["filter"]["windows"] = 8
    few = ft.track(ft.simulate(section), section)
    assert few.summary()["unwatched_scans"] > 0
    assert int(few.data.windows.max()) == 8


def test_the_ratio_of_an_echo_is_that_of_cells(float64: type) -> None:
    """Away from spoke 0 it is `CellLikelihood` with the same spread; at spoke 0 the cells wrap around."""
    echoes = Echoes(rows=40, samples=70, offset=0.0, spacing=1.0, across=1.5, along=1.5, levels=(0.3, 1.0))
    cells = Cells((("y", Axis(0.0, 1.0, 40)), ("x", Axis(0.0, 1.0, 70))))

    def spread(across: np.ndarray, along: np.ndarray) -> np.ndarray:
        return np.exp(-((across / 1.5) ** 2 + (along / 1.5) ** 2) / 2)

    values = jnp.asarray(np.random.default_rng(0).normal(size=(40, 70)))
    likelihood = UnknownLevel(tuple(CellLikelihood(cells, gaussian, level, spread, 3) for level in (0.3, 1.0)))
    expected = likelihood.table(CellScan(jnp.zeros(()), values))[3:-3, 3:]
    table = echoes.table(values, jnp.ones(40, bool))
    # Sums of 49 terms in another order.
    np.testing.assert_allclose(table[3:-3], expected[3:-3], atol=1e-12)
    turned = echoes.table(jnp.roll(values, 5, axis=0), jnp.ones(40, bool))
    np.testing.assert_allclose(turned, jnp.roll(table, 5, axis=0), atol=1e-12)


def test_the_mean_ratio_under_noise_is_1(float64: type) -> None:
    echoes = Echoes(rows=40, samples=70, offset=0.0, spacing=1.0, across=1.0, along=1.0, levels=(0.2, 0.4))
    values = jnp.asarray(np.random.default_rng(1).normal(size=(200, 40, 70)))
    ratios = np.exp([np.asarray(echoes.table(sweep, jnp.ones(40, bool)))[::8, ::8] for sweep in values])
    # Cells 8 apart share none of theirs.
    assert abs(ratios.mean() - 1) < 5 * ratios.std() / np.sqrt(ratios.size)


def test_spokes_that_were_not_received_say_nothing() -> None:
    echoes = Echoes(rows=40, samples=70, offset=0.0, spacing=1.0, across=1.0, along=1.0, levels=(1.0,))
    received = jnp.ones(40, bool).at[10:20].set(False)
    table = echoes.table(jnp.ones((40, 70)), received)
    assert float(jnp.abs(table[12:18]).max()) == 0.0


@pytest.mark.parametrize("suffix", [".npz", ".zarr"])
def test_files_hold_what_was_written(tmp_path: Path, drawn: Sweeps, suffix: str) -> None:
    path = tmp_path / f"night{suffix}"
    moving = ft.simulate(scenario(antenna_velocity=(4.0, 1.0), sweeps=3))
    moving = dataclasses.replace(moving, heading=np.full(3, 0.5))
    kind_named("sweeps").write(path, moving)
    read = ft.read(path, kind="sweeps")
    np.testing.assert_array_equal(in_memory(read), in_memory(moving))
    for name in ("times", "x", "y", "heading"):
        np.testing.assert_allclose(getattr(read, name), getattr(moving, name), atol=1e-12)
    assert read.spacing == moving.spacing
    facts = ft.info(path, kind="sweeps").facts
    assert facts["holds"] == "3 sweeps, 3 s apart"


def test_names_of_the_arrays_are_the_scenarios(tmp_path: Path, drawn: Sweeps) -> None:
    path = tmp_path / "log.npz"
    times = drawn.times[:, None] + 3.0 * np.arange(SPOKES) / SPOKES
    times[0, :40] = np.nan
    np.savez(path, echo=in_memory(drawn), when=times)
    section = {"variable": "echo", "times": "when", "sample_spacing": drawn.spacing}
    read = ft.read(path, kind="sweeps", sweeps=section)
    assert read.interval == pytest.approx(3.0)
    assert not np.isfinite(read.look(0, 1).time[0, :40]).any()
    assert len(ft.track(path, scenario(), sweeps=section).tracks) == 1


def test_a_result_has_a_report_with_a_picture(tmp_path: Path, drawn: Sweeps, result: Any) -> None:
    again = ft.read_result(result.save(tmp_path / "out"))
    assert [track.label for track in again.tracks] == [1]
    text = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "1 track in simulation" in text
    assert "windows on echoes" in text
    assert len(result.plot().axes) == 2
    # A saved scenario gives the same numbers.
    np.testing.assert_array_equal(ft.track(drawn, again.scenario).data.existence, result.data.existence)


def test_truth_of_a_simulation_is_found(result: Any) -> None:
    (known,) = kind_named("sweeps").targets(ft.Scenario(**scenario()))
    place = known.at(result.data.time.values)
    (track,) = result.tracks
    assert np.hypot(place["x"][-1] - track.mean["x"][-1], place["y"][-1] - track.mean["y"][-1]) < 150
