"""Returns of a sonar: a target is found and followed, in blocks of any size, from a file to the report."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr

import faintrack as ft
from faintrack.data.returns import Returns, from_columns, to_columns
from faintrack.errors import InputError
from faintrack.io.returns import read_returns, write_returns
from faintrack.kinds.loop import datasets
from faintrack.kinds.returns.build import build_likelihood, build_sonar, expected_returns
from faintrack.kinds.returns.plan import plan
from faintrack.kinds.returns.simulate import silence
from faintrack.results.result import Result
from faintrack.results.schema import joined
from faintrack.results.truth import findings
from faintrack.sensors.active import ping
from faintrack.sensors.active_draws import draw_returns
from faintrack.signal.pings import from_pings
from faintrack.targets.states import PlanarState
from tests.returns import EAST, INTERVAL, NORTH, PINGS, SCENARIO, START, VELOCITY, columns, drawn, scenario

CELL = 2500.0
"""Width of a cell of the scenario's grid; m."""


@pytest.fixture(scope="module")
def followed() -> Result:
    return ft.track(drawn(), scenario())


def test_a_target_is_found_and_followed(followed: Result) -> None:
    (track,) = followed.tracks
    data = followed.data
    # Its echo tells 14 nats a ping where it is known; it has to be found in one of 144 cells and 9 velocities.
    assert track.start_s <= 4 * INTERVAL
    assert track.end_s == (PINGS - 1) * INTERVAL
    held = data.label.values[:, 0] > 0
    error = np.hypot(data.x[:, 0] - EAST, data.y[:, 0] - NORTH).values[held]
    # A cell of 2.5 km is 1.0 km from its middle on average.
    assert np.sqrt(np.mean(error**2)) < CELL
    off = [abs(float(data[name][-1, 0]) - true) for name, true in zip(("vx", "vy"), VELOCITY, strict=True)]
    assert max(off) < 3.0
    within = [
        np.abs(data[f"{name}_mode"] - true).values[held] < 1.5 * CELL for name, true in (("x", EAST), ("y", NORTH))
    ]
    assert np.mean(within) > 0.9


def test_noise_gives_no_track() -> None:
    result = ft.track(drawn(present=False, seed=1), scenario())
    assert result.tracks == []
    assert result.data.existence.max() < 0.5


def louder(decibel: float, present: bool, seed: int = 3) -> Returns:
    """Returns of the same sonar where its noise is louder, and so is what it measures a target's echo by."""
    what = scenario(sonar={"threshold_db": 9.0 - decibel, "snr_db": 14.0})
    section = what.sonar
    sonar = build_sonar(section)
    likelihood = build_likelihood(section, sonar)
    rng = np.random.default_rng(seed)
    rows = []
    for number in range(PINGS):
        state = PlanarState(*(jnp.asarray(one, float) for one in (EAST[number], NORTH[number], *VELOCITY)))
        empty = ping(sonar, 0.0, np.zeros((0, 3), int), np.zeros(0), 256)
        one, lost = draw_returns(
            jax.random.key(int(rng.integers(2**31))), sonar, likelihood.snr, likelihood.threshold, empty, state, present
        )
        assert lost == 0
        rows.append(replace(one, time=jnp.asarray(START + number * INTERVAL)))
    quiet = from_pings(jax.tree.map(lambda *leaves: jnp.stack(leaves), *rows), sonar)
    return replace(quiet, power=quiet.power * 10 ** (decibel / 10))


@pytest.mark.slow
def test_louder_noise_is_learnt_and_told() -> None:
    """Noise 3 dB louder than the model's has 90 returns a ping in place of 1.7."""
    result = ft.track(louder(3.0, present=False), scenario())
    assert result.tracks == []
    (remark,) = result.remarks
    assert "returns, where noise of mean 1 gives 1.7" in remark
    assert "+3 dB" in remark
    assert "it was learnt" in remark
    np.testing.assert_allclose(result.data.background_returns[5:], result.data.returns.mean(), rtol=0.3)
    assert float(result.data.tail_shape[-1]) < 0.03


def test_a_target_is_found_in_louder_noise() -> None:
    result = ft.track(louder(3.0, present=True), scenario())
    assert len(result.tracks) == 1
    held = result.data.label.values[:, 0] > 0
    assert held.mean() > 0.7
    error = np.hypot(result.data.x[:, 0] - EAST, result.data.y[:, 0] - NORTH).values[held]
    assert np.sqrt(np.mean(error**2)) < CELL


def test_a_background_that_is_not_learnt_is_told_where_it_does_not_fit() -> None:
    noise = louder(3.0, present=False)
    result = ft.track(noise, scenario(background={"learn": False}, tracker={"declare": 1.0 - 1e-12}))
    assert any("existence may be wrong, expected background.learn" in misfit for misfit in result.misfits)
    assert "tail_shape" not in result.data


@pytest.mark.slow
def test_what_is_chosen_of_the_bins_is_saved(followed: Result) -> None:
    assert followed.scenario.background.every == (1, 1, 1)
    assert followed.remarks == followed.misfits == ()
    coarse = ft.track(drawn(), scenario(background={"every": [2, 1, 1]}))
    assert coarse.scenario.background.every == (2, 1, 1)


def test_what_is_kept_agrees_with_itself() -> None:
    data = ft.track(drawn(), scenario(), tracker={"targets": 1}).data
    sizes = {"axis_x": 12, "axis_y": 12, "axis_vx": 3, "axis_vy": 3}
    assert {**data.position.sizes, **data.velocity.sizes} == {"snapshot": 8, **sizes}
    assert data.existence.sizes == {"time": PINGS, "slot": 1}
    for names in (("x", "y"), ("vx", "vy")):
        chance = np.exp(data["position" if names[0] == "x" else "velocity"])
        axes = [f"axis_{name}" for name in names]
        np.testing.assert_allclose(chance.sum(axes), 1, rtol=1e-4)
        for name in names:
            axis = data[f"axis_{name}"]
            expected = (chance * axis).sum(axes)
            found = data[name].sel(time=data.snapshot.values)[:, 0]
            np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-3 * float(axis.max()))
    assert all("units" in data[name].attrs for name in data.data_vars)
    np.testing.assert_array_equal(data.returns, drawn().counts)
    assert data.attrs["first_scan_time"] == START
    assert data.attrs["scan_interval"] == INTERVAL
    assert float(data.receiver_y[3]) == 1000.0


@pytest.mark.slow
def test_blocks_of_any_size_give_the_same(followed: Result) -> None:
    pieces = joined(list(datasets(replace(plan(drawn(), scenario()), size=7))))
    # The covariance of a belief that is cells wide is a difference of large sums.
    xr.testing.assert_allclose(followed.data, pieces, rtol=1e-3, atol=1.0)
    xr.testing.assert_allclose(followed.data.existence, pieces.existence, rtol=1e-3, atol=1e-3)


@pytest.mark.slow
def test_platforms_in_columns_that_stand_still_give_the_same(followed: Result) -> None:
    content = to_columns(drawn())
    rows = len(content["time_s"])
    for platform, place in (("source", (0.0, 0.0)), ("receiver", (500.0, 1000.0))):
        names = (f"{platform}_x_m", f"{platform}_y_m", f"{platform}_vx", f"{platform}_vy")
        content |= dict(zip(names, (np.full(rows, value) for value in (*place, 0.0, 0.0)), strict=True))
    # What the scenario says of them does not count.
    moving = ft.track(from_columns(content), scenario(sonar={"source": [9e3, 9e3]}))
    np.testing.assert_allclose(moving.data.existence, followed.data.existence, rtol=1e-3, atol=1e-4)
    np.testing.assert_allclose(moving.data.source_x, 0.0)
    moving.plot()


def test_a_missing_ping_is_a_longer_interval(followed: Result) -> None:
    content = {
        name: column[to_columns(drawn())["time_s"] != START + 15 * INTERVAL]
        for name, column in to_columns(drawn()).items()
    }
    result = ft.track(from_columns(content), scenario())
    assert result.data.sizes["time"] == PINGS - 1
    (track,) = result.tracks
    assert track.end_s == (PINGS - 1) * INTERVAL


@pytest.mark.slow
def test_pings_that_come_early_and_late_have_their_own_intervals(followed: Result) -> None:
    """By five percent, as drawn; the target is found where it was at the times of the pings, within the same bound."""
    late = 0.05 * INTERVAL * np.random.default_rng(0).uniform(-1, 1, PINGS)
    uneven = ft.track(replace(drawn(), times=drawn().times + late), scenario())
    (track,), (even,) = uneven.tracks, followed.tracks
    assert len(track.time) >= len(even.time) - 1
    assert np.all(np.diff(uneven.data.time) != INTERVAL)
    np.testing.assert_allclose(track.mean["x"][-10:], even.mean["x"][-10:], atol=700)
    np.testing.assert_allclose(track.mean["y"][-10:], even.mean["y"][-10:], atol=700)


@pytest.mark.slow
def test_a_ping_of_thousands_of_returns_is_read() -> None:
    """The whole output of 1486 delays and 72 beams above 5 dB, of noise."""
    rng = np.random.default_rng(0)
    delay, beam = np.divmod(np.sort(rng.permutation(1486 * 72)[:4651]), 72)
    one = {"delay_s": 3.0 + 0.0134 * delay, "bearing_deg": (90 - 5.0 * beam) % 360}
    one["snr_db"] = 10 * np.log10(10**0.5 + rng.exponential(size=len(delay)))
    returns = from_columns(
        {"time_s": np.repeat([0.0, 120.0], len(delay)), **{name: np.tile(column, 2) for name, column in one.items()}}
    )
    fine = {"threshold_db": 5.0, "delay": [3.0, 22.899], "delay_step": 0.0134, "beams": 72}
    result = ft.track(returns, scenario(sonar=fine, background={"every": [1, 1, 1]}))
    assert result.data.attrs["capacity"] == 5120
    assert np.all(np.isfinite(result.data.log_evidence))
    assert result.tracks == []


@pytest.mark.slow
def test_doppler_tells_the_velocity() -> None:
    """A tone whose echo from the east comes 16 Hz higher: the target closes at 6 m/s."""
    tone = {"pulse": {"frequency": 2000.0, "duration": 1.0}, "doppler": [-24.0, 24.0], "doppler_step": 2.0}
    bins = {"delay": [3.0, 23.0], "delay_step": 1.0, "reach": [1, 4, 2], "swath": [1, 3, 1]}
    # Five returns teach no background.
    told = scenario(sonar=tone | bins | {"receiver": [0, 0]}, background={"learn": False})
    result = ft.track(columns(5, doppler_hz=np.full(5, 16.0)), told)
    assert result.data.existence[-1, 0] > 0.97
    assert float(result.data.x_mode[-1]) == pytest.approx(6000, abs=CELL)
    assert float(result.data.vx[-1, 0]) == pytest.approx(-6.0, abs=1.5)


def test_from_a_file_to_the_report(followed: Result, tmp_path: Path) -> None:
    write_returns(tmp_path / "returns.csv", drawn())
    (tmp_path / "scenario.toml").write_text(SCENARIO, encoding="utf-8")
    result = ft.track(tmp_path / "returns.csv", tmp_path / "scenario.toml", out=tmp_path / "out")
    header, row = (tmp_path / "out" / "tracks.csv").read_text(encoding="utf-8").splitlines()
    assert header.startswith("label,start_s,end_s,x_m,x_m_std,x_m_start,x_m_end,y_m,")
    assert header.endswith(",speed_m_s,existence_max")
    np.testing.assert_allclose(result.data.existence, followed.data.existence, rtol=1e-3, atol=1e-3)
    np.testing.assert_allclose(result.data.position, followed.data.position, rtol=1e-3, atol=1e-3)
    text = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    for fact in (
        "1 track in returns.csv",
        "30, 120 s apart",
        "200 delays from 3 to 22.9 s",
        "24 beams",
        "1000 s; times",
    ):
        assert fact in text
    # The scenario in the result runs again.
    again = ft.track(tmp_path / "returns.csv", tmp_path / "out" / "scenario.toml", out=tmp_path / "again")
    assert again.scenario == result.scenario
    assert (tmp_path / "again" / "tracks.csv").read_text(encoding="utf-8").splitlines()[1] == row


@pytest.mark.parametrize("suffix", [".csv", ".zarr"])
def test_a_file_tells_what_it_holds(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"night{suffix}"
    write_returns(path, drawn())
    info = ft.info(path)
    assert info.kind == "returns"
    assert info.facts["holds"] == f"{PINGS} pings, 120 s apart"
    with pytest.raises(InputError, match=r"taken for returns.*there is no \[sonar\]"):
        ft.track(path)


SIMULATION = {"pings": 40, "interval": INTERVAL}


def test_a_simulated_target_is_found() -> None:
    target = {"x": EAST[0], "y": NORTH[0], "vx": VELOCITY[0], "vy": VELOCITY[1], "end": 25 * INTERVAL}
    what = scenario(simulation=SIMULATION | {"targets": [target]})
    result = ft.track(ft.simulate(what), what, truth=what)
    (track,) = result.tracks
    (found,) = findings(result.data)
    assert (found.name, found.from_s, found.to_s, found.tracks) == ("target 1", 0, 24 * INTERVAL, (track.label,))
    assert found.declared_s <= 4 * INTERVAL
    assert found.followed > 0.9
    assert found.rmse < CELL


def test_silence_has_as_many_returns_as_noise_gives() -> None:
    what = scenario(simulation=SIMULATION | {"pings": 2000, "targets": [{"x": 6e3, "y": 0.0}]})
    counts = silence(what, seed=5).counts
    expected = expected_returns(what.sonar)
    # A number out of thousands of rare ones is Poisson; five standard errors of the mean.
    assert abs(counts.mean() - expected) < 5 * np.sqrt(expected / len(counts))
    # A bin of 12 dB over the noise passes the threshold of 9 dB with probability 0.6.
    assert ft.simulate(what).counts.mean() > expected + 0.5


def test_zarr_holds_the_same(tmp_path: Path) -> None:
    write_returns(tmp_path / "returns.zarr", drawn())
    back = read_returns(tmp_path / "returns.zarr")
    for name, column in to_columns(drawn()).items():
        np.testing.assert_allclose(to_columns(back)[name], column, rtol=1e-12)


WIDE = {"doppler": [-9.0, 9.0], "doppler_bins": 9, "reach": [12] * 3, "swath": [12] * 3, "finer": [8] * 3}


@pytest.mark.parametrize(
    ("returns", "sections", "says"),
    [
        (columns(1), {}, "one ping; expected two or more"),
        (
            columns(5, time_s=np.array([0.0, 1.0, 2.1, 3.0, 2000.0])),
            {},
            "time_s 2000 comes 1997 s after .* expected at most 1000 times 1 s, the usual interval",
        ),
        (columns(), {"grid": {"speed": 300.0}}, "move up to .* cells of the 12 of grid.x"),
        (columns(), {"grid": {"cells": [2000, 2000]}}, "2000 x 2000 x 3 x 3 cells, more than"),
        (columns(doppler_hz=np.zeros(3)), {"sonar": WIDE}, "up to 1 returns, with 6,593,073 samples"),
        (columns(doppler_hz=np.zeros(3)), {"sonar": WIDE | {"swath": [3, 3, 3]}}, "bears on another at 26,.* offsets"),
        (columns(), {"sonar": {"source": None}}, "sonar.source is missing; expected metres"),
        (columns(delay_s=np.array([8.0, 2.0, 8.0])), {}, "row 1: delay_s is 2; expected 2.95 to 22.95 s"),
        (
            columns(snr_db=np.array([12.0, 12.0, 8.5])),
            {},
            "row 2: snr_db is 8.5; expected at least the threshold, 9 dB",
        ),
        (columns(time_s=np.array([0.0, 120.0, 120.0])), {}, "row 2: the return falls in the same bin as that of row 1"),
        (columns(doppler_hz=np.zeros(3)), {}, "there is a column doppler_hz; expected it where the sonar measures"),
        (columns(), {"sonar": {"doppler": [-9.0, 9.0], "doppler_bins": 9}}, "there is no column doppler_hz"),
        (
            columns(doppler_hz=np.array([0.0, -30.0, 0.0])),
            {"sonar": {"doppler": [-9.0, 9.0], "doppler_bins": 10}},
            "row 1: doppler_hz is -30; expected -10 to 10 Hz",
        ),
    ],
)
def test_what_does_not_fit_is_refused(returns: Returns, sections: dict[str, Any], says: str) -> None:
    with pytest.raises(InputError, match=f"returns in memory.*{says}"):
        ft.track(returns, scenario(**sections))
