"""The study of aughenbaugh2010: the scene has the paper's numbers, and rows and figures come from runs."""

from collections.abc import Callable
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr

from faintrack.errors import InputError
from faintrack.sensors.active import ping
from faintrack.studies.aughenbaugh2010 import rows as study_rows
from faintrack.studies.aughenbaugh2010 import runs, scene, study
from faintrack.studies.aughenbaugh2010.settings import SETTINGS
from faintrack.studies.printed import PRINTED
from faintrack.studies.study import Results

RUNS = 6


def test_scans_in_view_are_the_papers() -> None:
    scan = np.arange(1, scene.SCANS + 1)
    assert scan[scene.in_view("fm")].tolist() == [*range(11, 30), *range(34, 52)]
    assert scan[scene.blanked("fm")].tolist() == [30, 31, 32, 33]
    # The printed ends are the middles of CW's first and last bin of 0.42 s.
    assert scan[scene.in_view("cw")].tolist() == [*range(11, 30), *range(33, 53)]


@pytest.mark.parametrize(("pulse", "bins", "returns"), [("fm", 1_296_000, 58.8), ("cw", 368_064, 49.6)])
def test_bins_and_returns_of_clutter_are_the_papers(pulse: str, bins: int, returns: float) -> None:
    likelihood = scene.likelihood(pulse)
    assert likelihood.sonar.size == bins
    assert bins * np.exp(-likelihood.threshold) == pytest.approx(returns, abs=0.06)


@pytest.mark.parametrize(
    ("pulse", "reduced", "points"), [("fm", False, 275), ("fm", True, 119), ("cw", False, 1225), ("cw", True, 425)]
)
def test_points_of_one_return_are_the_papers(pulse: str, reduced: bool, points: int) -> None:
    guided = runs.guided(pulse, scene.BASE, reduced)
    middle = [[count // 2 for count in guided.likelihood.sonar.shape]]
    one = ping(guided.likelihood.sonar, 0.0, np.array(middle), np.array([20.0]), capacity=2)
    assert int(guided.samples(one)) == points


def test_grids_have_the_papers_cells() -> None:
    assert (scene.grid(scene.BASE).size, scene.grid(scene.FINE).size) == (127_449, 644_809)


def made_up(error: float, lost: int = 0) -> Callable[[str], xr.Dataset]:
    """Runs that declare the target at scan 12 and are wrong by the same distance everywhere."""

    def results(name: str) -> xr.Dataset:
        if name not in {setting.name for setting in SETTINGS}:
            raise InputError(f"no setting {name}")
        odds = np.where(np.arange(scene.SCANS) < 11, -2.0, 4.0)
        shape = (RUNS, scene.SCANS)
        data = {
            "log_odds": np.broadcast_to(odds, shape),
            "error": np.full(shape, error),
            "velocity_error": np.full(shape, 2.0),
            "returns": np.full(shape, 60),
            "lost": np.full(shape, lost),
            "samples": np.full(shape, 16_000),
        }
        arrays = {key: (("run", "scan"), values) for key, values in data.items()}
        if name == "fm_unknown_snr":
            levels = np.full((*shape, runs.LEVELS_DB.count), 1 / runs.LEVELS_DB.count)
            arrays["snr"] = (("run", "scan", "snr_db"), levels)
        return xr.Dataset(arrays)

    return results


def test_rows_say_what_the_runs_have(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(study_rows, "update_seconds", lambda pulse, method: (0.02, 0.005))
    reported = study.rows(made_up(700.0))
    rows = {row.key: row for row in reported}
    assert len(rows) == len(reported)
    assert set(PRINTED["aughenbaugh2010"]) < set(rows)
    expected = {
        "fm_guided_rmse_km": 0.7,
        "cw_random1_fine_velocity_rmse": 2.0,
        "fm_guided_declared_scan": 12,
        "fm_guided_declared_soon": 1,
        "fm_guided_samples": 16_000,
        "cw_random5_samples": 637_245,
        "cw_guided_update_ms": 5,
        "cw_guided_update_ms_first": 20,
        "fm_reduced_rmse_km": 0.7,
        "fm_unknown_snr_snr_db": 9.5,
        # Scan 11 is in view and not declared.
        "fm_guided_probability": (36 / (1 + np.exp(-4.0)) + 1 / (1 + np.exp(2.0))) / 37,
        "fm_guided_blanked_probability": 1 / (1 + np.exp(-4.0)),
    }
    for key, value in expected.items():
        assert rows[key].ours == pytest.approx(value, rel=1e-6), key
    assert rows["fm_guided_update_ms"].paper == 1800


def test_lost_returns_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(study_rows, "update_seconds", lambda pulse, method: (0.02, 0.005))
    with pytest.raises(InputError, match="fm_guided: 3 returns of a ping found no place"):
        study.rows(made_up(700.0, lost=3))


def test_figures_are_drawn(tmp_path: Path) -> None:
    results: Results = made_up(700.0)
    drawn = study.figures(results, tmp_path)
    assert [path.name for path in drawn] == ["figure_4_to_7.png", "figure_8_to_11.png", "figure_12.png", "beyond.png"]
    assert all(path.stat().st_size > 5000 for path in drawn)


def test_snr_axis_holds_the_true_one() -> None:
    assert jnp.isclose(jnp.asarray(runs.LEVELS_DB.values), scene.SNR_DB).any()
