"""The study superposed: its truth, and what its rows count."""

import jax
import numpy as np
import pytest
import xarray as xr

from faintrack.errors import InputError
from faintrack.studies.superposed import rows as study_rows
from faintrack.studies.superposed import scene, study
from tests.tolerances import assert_mean


def test_the_truth_is_of_five_targets_that_meet() -> None:
    truth = scene.truth()
    there = np.isfinite(truth.x)
    assert there.shape == (scene.SCANS, 5)
    np.testing.assert_array_equal(there.argmax(axis=0) + 1, [10, 14, 18, 17, 5])
    np.testing.assert_array_equal(scene.SCANS - there[::-1].argmax(axis=0), [80, 79, 72, 67, 60])
    np.testing.assert_array_equal(np.isfinite(truth.y), there)
    assert np.hypot(truth.x[39:41] - scene.SIDE / 2, truth.y[39:41] - scene.SIDE / 2).max() < 1
    accelerations = np.stack([np.diff(place, 2, axis=0) for place in (truth.x, truth.y)])
    # Second differences of integrated white acceleration have two thirds of its density.
    drawn = accelerations[np.isfinite(accelerations)]
    assert_mean(drawn**2, scene.VELOCITY_NOISE**2 * 2 / 3)


def test_scans_are_the_sum_and_noise() -> None:
    scans = np.asarray(jax.jit(scene.look)(jax.random.key(0)).values, float)
    truth, network = scene.truth(), scene.network()
    squared = sum(
        (place[:, :, None] - np.asarray(at)) ** 2 for place, at in ((truth.x, network.x), (truth.y, network.y))
    )
    noise = scans - np.nansum(scene.LEVEL / (squared + scene.CORE**2), axis=1)
    assert_mean(noise.ravel(), 0.0)
    assert_mean(noise.ravel() ** 2, 1.0)


def test_births_are_where_the_targets_come() -> None:
    known = scene.birth(5)
    np.testing.assert_array_equal(known.mean.x, [40, 10, 60, 50, 60])
    np.testing.assert_array_equal(known.mean.y, [10, 80, 110, 110, 80])
    anywhere = scene.birth(1)
    assert (float(anywhere.mean.x[0]), float(anywhere.std.y[0]) ** 2) == pytest.approx((60.0, 1000.0))


def test_rows_count_what_they_say() -> None:
    truth = scene.truth()
    there = np.isfinite(truth.x)
    # Run 0 finds all of them 3 m to the east; run 1 misses the first, and finds one that is not there in every scan.
    existence = np.zeros((2, scene.SCANS, 6))
    existence[:, :, :5] = there
    existence[1, :, 0], existence[1, :, 5] = 0.0, 1.0
    x, y = (np.zeros(existence.shape) for _ in range(2))
    x[:, :, :5], y[:, :, :5] = np.nan_to_num(truth.x), np.nan_to_num(truth.y)
    x[0] += 3.0
    made = xr.Dataset(
        {name: (("run", "scan", "slot"), each) for name, each in zip("exy", (existence, x, y), strict=True)}
    )
    parts = study_rows.parts(made.rename(e="existence"))
    np.testing.assert_allclose(parts[0, :, 0], 9.0 * there.sum(axis=1), atol=1e-4)
    assert not parts[0, :, 1:].any()
    np.testing.assert_allclose(parts[1, :, 1], 12.5 * there[:, 0])
    np.testing.assert_allclose(parts[1, :, 2], 12.5)
    rows = {row.key: row.ours for row in study_rows.of_births(2, parts)}
    assert rows["gospa_rms_births2_m"] == pytest.approx(np.sqrt(parts.sum(axis=2).mean()))
    assert rows["missed_births2_m2"] == pytest.approx(12.5 * there[:, 0].mean() / 2)
    assert rows["false_births2_m2"] == pytest.approx(12.5 / 2)


def test_without_runs_there_are_no_rows() -> None:
    def nothing(name: str) -> xr.Dataset:
        raise InputError(f"no runs of {name}")

    assert study.rows(nothing) == []
    assert len({setting.name for setting in study.settings}) == len(study.settings)
