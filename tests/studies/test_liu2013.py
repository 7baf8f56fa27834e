"""The study of liu2013: the scene has the paper's numbers, and rows and figures come from runs."""

from collections.abc import Callable
from pathlib import Path

import jax
import numpy as np
import pytest
import xarray as xr

from faintrack.errors import InputError
from faintrack.studies.liu2013 import panels, runs, scene, study
from faintrack.studies.liu2013 import rows as study_rows
from faintrack.studies.liu2013.settings import GROUPS, SETTINGS
from faintrack.studies.printed import PRINTED

RUNS = 5


def test_scans_with_a_target_are_those_that_the_papers_shares_count() -> None:
    """All six of its table 2 are whole numbers of scans in 100 runs: of 15 without a target, of 25 with one."""
    present = scene.present()
    assert (present.sum(), (~present).sum()) == (25, 15)
    for key, share in PRINTED["liu2013"].items():
        scans, error = (1500, 0.06) if key.startswith("pfa") else (2500, 1e-6)
        assert scans * share == pytest.approx(round(scans * share), abs=error)


def test_observer_has_the_papers_speed_and_turns_twice() -> None:
    observer = scene.observer()
    moved = np.hypot(np.diff(observer.x), np.diff(observer.y))
    assert np.allclose(moved, scene.SPEED * scene.INTERVAL, rtol=1e-4)
    course = np.arctan2(observer.vy, observer.vx)
    assert (np.diff(course) != 0).sum() == 2
    assert np.allclose(np.hypot(observer.vx, observer.vy), scene.SPEED)


def test_false_bearings_raise_the_bound() -> None:
    path = scene.path(jax.random.key(1))
    runs = {name: (("run", "scan"), np.asarray(component)[None]) for name, component in (("x", path.x), ("y", path.y))}
    alone, among = study_rows.bound(xr.Dataset(runs))
    assert len(alone) == 25
    assert np.all(among >= alone)
    # One bearing is better than none.
    assert alone[0] < np.hypot(50.0, 50.0)


def made_up(lost: int = 0) -> Callable[[str], xr.Dataset]:
    """Runs that declare the target from scan 10 to 33, and are wrong by 20 m everywhere."""

    def results(name: str) -> xr.Dataset:
        if name not in {setting.name for setting in SETTINGS}:
            raise InputError(f"no setting {name}")
        scan = np.arange(1, scene.SCANS + 1)
        odds = np.where((scan >= 10) & (scan <= 33), 4.0, -4.0)
        kinds = len(GROUPS[name.split("_")[-1]])
        shape = (RUNS, scene.SCANS, kinds, len(runs.FORMS))
        bearing = np.zeros((RUNS, scene.SCANS, 3))
        data = {
            "log_odds": (("run", "scan", "kind", "form"), np.broadcast_to(odds[:, None, None], shape)),
            "error": (("run", "scan", "kind", "form"), np.full(shape, 20.0)),
            "x": (("run", "scan"), np.full(shape[:2], 500.0)),
            "y": (("run", "scan"), np.full(shape[:2], 100.0)),
            "bearing": (("run", "scan", "entry"), bearing),
            "there": (("run", "scan", "entry"), np.ones(bearing.shape, bool)),
            "lost": (("run",), np.full(RUNS, lost)),
        }
        return xr.Dataset(data)

    return results


def test_rows_say_what_the_runs_have(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(study_rows, "bound", lambda data: (np.full(25, 10.0), np.full(25, 16.0)))
    reported = study.rows(made_up())
    rows = {row.key: row for row in reported}
    assert len(rows) == len(reported)
    assert set(PRINTED["liu2013"]) < set(rows)
    expected = {
        "pfa_particle": 1 / 15,
        "pd_particle_full": 23 / 25,
        "pfa_ipda": 1 / 15,
        "pd_immpda": 23 / 25,
        "delay_particle_s": 2,
        "delay_ipda_s": 2,
        "delay_immpda_full_s": 2,
        "termination_particle_s": 2,
        "rms_ratio_crlb": 2,
        "rms_ratio_crlb_full": 2,
        "rms_ratio_crlb_ipda": 2,
        "rms_m_bernoulli_full": 20,
        "rms_ratio_crlb_bernoulli_drawn": 2,
        "pd_particle_region": 23 / 25,
        "pd_bernoulli_along": 23 / 25,
        "pd_particle_false_20": 23 / 25,
        "pd_ipda_full_detection_70": 23 / 25,
        "rms_ratio_crlb_particles_300": 2,
        "crlb_m": 10,
        "crlb_clutter_m": 16,
        "chosen_death_probability": scene.CHOSEN["death_probability"].value,
    }
    for key, value in expected.items():
        assert rows[key].ours == pytest.approx(value, rel=1e-6), key
    assert (rows["pfa_ipda"].paper, rows["pd_ipda"].paper) == (0.04, 0.812)
    assert rows["pd_ipda_region"].paper is None


def test_lost_bearings_are_refused() -> None:
    with pytest.raises(InputError, match="start_paper: 2 bearings of a run found no place"):
        study.rows(made_up(lost=2))


def test_figures_are_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(panels, "bound", lambda data: (np.full(25, 10.0), np.full(25, 16.0)))
    drawn = study.figures(made_up(), tmp_path)
    names = ["figure_1", "figure_2", "figure_3", "figure_4", "roc", "influence", "particles"]
    assert [path.stem for path in drawn] == names
    assert all(path.stat().st_size > 5000 for path in drawn)
