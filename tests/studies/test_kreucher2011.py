"""The study of kreucher2011: the scene has the paper's numbers, and rows and figures come from runs."""

import itertools
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr

from faintrack.errors import InputError
from faintrack.studies.kreucher2011 import runs, scene, study, tracks, triangulation
from faintrack.studies.kreucher2011.settings import DECLARING, SETTINGS
from faintrack.studies.printed import PRINTED
from faintrack.studies.study import Results
from faintrack.targets.states import PlanarState
from tests.tolerances import rounding

RUNS = 3


@pytest.fixture(scope="module")
def truth() -> PlanarState:
    return jax.jit(scene.truth)(jax.random.key(0))


def test_detectors_have_the_papers_cells() -> None:
    detectors = scene.tracker().detectors
    assert detectors.count == 16
    assert sorted(detectors.filter.grid.shape) == [21, 21, 26, 26]


def test_targets_start_and_meet_where_they_should(truth: PlanarState) -> None:
    place = np.stack([truth.x, truth.y], axis=-1)
    speed = np.hypot(truth.vx[0], truth.vy[0])
    assert np.all(np.linalg.norm(place[0] - scene.STARTS, axis=-1) < 1.1 * speed)
    np.testing.assert_allclose(place[scene.MEETING - 1], scene.AIMS, rtol=20 * rounding(np.float32))
    first, second = scene.CLOSE
    assert np.linalg.norm(np.subtract(scene.AIMS[first], scene.AIMS[second])) == pytest.approx(8.0)


def test_two_targets_cannot_be_taken_for_the_crossings_of_their_beams_at_first(truth: PlanarState) -> None:
    bearings = np.asarray(scene.FANS.bearings(scene.stations(), truth))
    (west, east), (south, north) = scene.REGION
    for first, second in itertools.permutations(range(3), 2):
        # Of the two crossings at least one is outside.
        inside = []
        for one, other in ((first, second), (second, first)):
            mixed = jnp.asarray(np.stack([bearings[0, :, one], bearings[1, :, other]], axis=1)[..., None])
            x, y = np.asarray(triangulation.crossing(scene.stations(), mixed))[:, 0].T
            inside.append((x > west) & (x < east) & (y > south) & (y < north))
        assert not np.any((inside[0] & inside[1])[:10])


def test_bearings_intersect_at_the_target(truth: PlanarState) -> None:
    bearings = jnp.moveaxis(scene.FANS.bearings(scene.stations(), truth), 0, 1)
    place = triangulation.crossing(scene.stations(), bearings)
    np.testing.assert_allclose(place[..., 0], truth.x, rtol=1e3 * rounding(np.float32), atol=0.1)
    np.testing.assert_allclose(place[..., 1], truth.y, rtol=1e3 * rounding(np.float32), atol=0.1)


def test_tracked_bearings_are_nearer_than_the_middles_of_beams(truth: PlanarState) -> None:
    # Before two of them come to be heard in neighbouring beams.
    truth = jax.tree.map(lambda values: values[:100], truth)
    scans = scene.scans(jax.random.key(1), truth, 100.0)
    true = np.moveaxis(np.asarray(scene.FANS.bearings(scene.stations(), truth)), 0, 1)
    measured = triangulation.measured_bearings(scans, truth)
    np.testing.assert_array_equal(measured, triangulation.true_bearings(scans, truth))
    off = np.asarray(measured) - true
    assert np.abs(off).max() <= scene.DEGREE / 2 * (1 + 1e-3)
    assert np.std(np.asarray(jax.jit(triangulation.filtered)(measured)) - true) < np.std(off)


def made_up(end: str = "held") -> Results:
    """Runs that declare the targets at scans 10 to 12, three metres off, and end the close pass in one way."""

    def results(name: str) -> xr.Dataset:
        settings = {setting.name: setting for setting in SETTINGS}
        if name not in settings or name == "four":
            raise InputError(f"no setting {name}")
        setting, alone = settings[name], name.startswith(("close", "kept"))
        scans = {"close": scene.SCANS - runs.FROM, "kept": scene.CROWD_SCANS - 1}.get(name.split("_")[0])
        scans = scans or {"level": DECLARING, "crowd": 80, "found": 80}.get(name.split("_")[0], scene.SCANS)
        targets = 2 if alone or name.startswith("found") else 3
        true = np.linspace([300.0, 300.0], [500.0, 900.0], scans)[:, None] + 200.0 * np.arange(targets)[:, None]
        slots = np.arange(targets)
        place = true + np.array([3.0, 0.0])
        label = np.where(np.arange(scans)[:, None] >= 9 + slots, 1 + slots, 0)
        active = np.ones((scans, targets), bool)
        pair = [0, 1] if alone else list(scene.CLOSE)
        if end == "swapped":
            place[-1, pair] = place[-1, pair[::-1]]
        elif end == "merged":
            place[-1, pair[1]] = place[-1, pair[0]]
        elif end == "lost":
            label[-1, pair[1]], active[-1, pair[1]] = 0, False
        arrays = {
            "x": place[..., 0],
            "y": place[..., 1],
            "true_x": true[..., 0],
            "true_y": true[..., 1],
            "joint": np.ones((scans, targets), bool),
            "label": label,
            "active": active,
            "existence": np.where(np.arange(scans)[:, None] >= 5 + slots, 1.0, 0.0),
            "detection": np.zeros((scans, 16)),
            "full": np.zeros(scans, bool),
            "tracked": true + np.array([0.0, 5.0]),
            "exact": true + np.array([0.0, 7.0]),
        }
        return xr.Dataset({key: (("run", *axes), np.stack([arrays[key]] * RUNS)) for key, axes in setting.axes.items()})

    return results


def test_rows_say_what_the_runs_have() -> None:
    reported = study.rows(made_up())
    rows = {row.key: row for row in reported}
    assert len(rows) == len(reported)
    assert set(PRINTED["kreucher2011"]) < set(rows)
    expected = {
        "declared_mean": 3,
        "false_tracks_mean": 0,
        "declaration_scan_last": 12,
        "handover_scan_last": 7,
        "rmse_m": 3,
        "gospa": 27**0.5,
        "rmse_triangulated_m": 5,
        "rmse_true_beams_m": 7,
        "joint_scans": scene.SCANS - runs.FROM,
        "lost_in_close_pass": 0,
        "merged_in_close_pass_separate": 0,
        "swaps": 0,
        "level_2_declaration_scan": 11,
        "level_3.5_handover_scan_last": 7,
        "crowd_10_found": 3,
        "crowd_2_ghosts": 1,
        "crowd_2_found_ghosts": 3,
        "apart_1_kept": 1,
        "apart_0.5_kept_separate_gospa": 18**0.5,
    }
    for key, value in expected.items():
        assert rows[key].ours == pytest.approx(value, rel=1e-6), key


@pytest.mark.parametrize("end", ["lost", "merged", "swapped"])
def test_what_comes_of_a_close_pass(end: str) -> None:
    for name, before in (("close_3", 1), ("coarse", runs.FROM)):
        passed = tracks.before_and_after(tracks.tracks_of(made_up(end)(name)), before)
        assert {what: values.tolist() for what, values in passed.items()} == {
            what: [what == end] * RUNS for what in ("lost", "merged", "swapped")
        }


def test_a_track_of_nothing_is_false() -> None:
    (run, *_) = tracks.tracks_of(made_up()("coarse"))
    assert run.false() == 0
    run.place[:, 1] += 400.0
    assert run.false() == 1


def test_figures_are_drawn(tmp_path: Path) -> None:
    drawn = study.figures(made_up(), tmp_path)
    assert [path.name for path in drawn] == ["figure_3_to_7.png", "beyond.png"]
    assert all(path.stat().st_size > 5000 for path in drawn)


def test_every_setting_has_a_name_of_its_own() -> None:
    names = [setting.name for setting in SETTINGS]
    assert len(set(names)) == len(names)


def test_a_tracker_is_built_while_a_level_is_traced() -> None:
    limits = jax.jit(lambda level: scene.tracker(level).trackers.limits)(3.0)
    assert [float(limits[0].x), float(limits[1].y)] == [scene.REGION[0][0], scene.REGION[1][1]]
