"""The study davey2008: what its trackers see, and what its rows count."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr
from scipy import stats

from faintrack.errors import InputError
from faintrack.sensors.cells import CellScan
from faintrack.studies.davey2008 import rows as study_rows
from faintrack.studies.davey2008 import runs, scene, study
from faintrack.targets.states import PlanarState
from tests.tolerances import assert_mean, rounding


def test_a_pixel_has_the_mean_ratio_of_its_places() -> None:
    model = scene.likelihood(6.0)
    power = np.random.default_rng(0).exponential(size=(scene.PIXELS, scene.PIXELS)).astype(np.float32)
    scan = CellScan(jnp.array(0.0), jnp.asarray(power))
    x, y = np.meshgrid(7 + np.array([-1, 0, 1]) / 3, 9 + np.array([-1, 0, 1]) / 3)
    still = np.zeros(x.shape)
    places = model.log_ratio(scan, PlanarState(*(jnp.asarray(values, jnp.float32) for values in (x, y, still, still))))
    mean = scene.PixelMean(model).log_mean_ratio(scan)[7, 9]
    assert np.exp(mean) == pytest.approx(np.exp(np.asarray(places, float)).mean(), rel=100 * rounding(np.float32))


def test_the_target_stays_in_the_image() -> None:
    look = jax.jit(jax.vmap(lambda key: scene.look(key, scene.likelihood(6.0), True)[1]))
    path = np.asarray(look(jax.random.split(jax.random.key(0), 50)))[:, scene.APPEARS : scene.LEAVES]
    assert np.all((path > -0.5) & (path < scene.PIXELS - 0.5))
    assert np.all(np.hypot(*np.moveaxis(np.diff(path, axis=1), 2, 0)) <= scene.FASTEST + 1e-5)


def made_up(statistic: np.ndarray, error: np.ndarray) -> xr.Dataset:
    both = {"statistic": statistic, "error": error}
    speed = {"speed": ("run", np.linspace(0.2, 0.9, len(statistic)))}
    followed = {
        f"{method}_{what}": (("run", "scan"), values) for method in runs.METHODS for what, values in both.items()
    }
    return xr.Dataset(speed | followed)


def test_rows_count_what_they_say() -> None:
    # Twenty runs without a target: one reaches 5 in two frames on end, the others 1. The threshold lies between.
    noise = np.zeros((20, scene.SCANS))
    noise[:, 3] = 1.0
    noise[0, 7:9] = 5.0
    # Four with one: found from frame 12 on and for three frames too long; declared elsewhere; twice nothing.
    statistic, error = np.zeros((4, scene.SCANS)), np.full((4, scene.SCANS), 0.5)
    statistic[0, 12 : scene.LEAVES + 3] = statistic[1, 15:20] = 9.0
    error[1] = 8.0
    made = {"noise_6": made_up(noise, 0 * noise), "target_6": made_up(statistic, error)}

    def results(name: str) -> xr.Dataset:
        if name not in made:
            raise InputError(f"no runs of {name}")
        return made[name]

    by_method = {method: study_rows.declared(results, method, 6) for method in runs.METHODS}
    assert by_method["grid"] is not None
    assert study_rows.declared(results, "grid", 3) is None
    assert 1 < by_method["grid"].threshold < 5
    rows = {row.key: row.ours for row in study_rows.of_method("k", "label", by_method["grid"])}
    assert rows["k_detected"] == 0.25
    assert rows["k_instantaneous"] == pytest.approx(18 / 80)
    assert rows["k_delay"] == np.inf
    assert rows["k_rmse"] == 0.5
    assert rows["k_wrong"] == pytest.approx(5 / 80)
    assert rows["k_lingers"] == 3
    assert rows["k_false_tracks"] == pytest.approx(1 / 20)
    assert rows["k_false_length"] == 2
    # Speeds 0.2, 0.43, 0.67 and 0.9 of the fastest: the one that is found is the slow one.
    assert [rows[f"k_{speed}_detected"] for speed in study_rows.SPEEDS] == [1, 0, 0]
    assert rows["k_slow_instantaneous"] == pytest.approx(18 / 20)


def test_amplitudes_are_those_of_rice() -> None:
    snr = np.array([0.0, 0.3, 4.0, 30.0])
    expected = stats.rice.mean(np.sqrt(2 * snr), scale=0.5**0.5)
    np.testing.assert_allclose(scene.amplitude(jnp.asarray(snr, jnp.float32)), expected, rtol=10 * rounding(np.float32))


def test_noise_has_shots_of_poisson() -> None:
    """Mean and variance of shots are one number, and that of the histogram."""
    power = np.random.default_rng(1).exponential(size=(20, scene.PIXELS, scene.PIXELS)).astype(np.float32)
    shots = np.asarray(scene.shots(CellScan(jnp.zeros(20), jnp.asarray(power)))).reshape(-1)
    background = float(scene.histogram(4.0).background)
    assert_mean(shots, background)
    assert_mean((shots - background) ** 2, background)


def test_every_setting_has_a_name_of_its_own() -> None:
    names = [setting.name for setting in study.settings]
    assert len(set(names)) == len(names)
