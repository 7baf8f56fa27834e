"""The benchmark's rows on tiny problems; how fast anything is depends on the machine and is not asserted.

What is compared must compute the same: one step of Stone Soup's filter, and Acoular's beam power.
"""

import json
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.bench import FOR_GPU, ROWS, Sizes, chosen, run
from faintrack.bench.acoular_peer import FAR, acoular_beam_power
from faintrack.bench.beam_problem import SNAPSHOTS, draw_frames, plan_of
from faintrack.bench.bernoulli import problem, stone_soup_step
from faintrack.errors import InputError
from tests.tolerances import assert_same_mean

TINY = Sizes(
    recording_seconds=3,
    channels=4,
    beams=16,
    particles=20,
    births=10,
    bearing_particles=30,
    bearing_births=10,
    batch=2,
    steps=3,
    detectors=1,
    places=5,
    rates=3,
    small_places=4,
    small_rates=3,
    followers=16,
    scans=2,
    base=(5, 3),
    fine=(5, 3),
    peer_cells=5,
    pixels=8,
    target_scans=2,
    target_pixels=16,
    pixel_particles=30,
    pixel_births=10,
    region_places=4,
    region_rates=3,
    archive_seconds=3,
    study="tests.studies.small:study",
    repeat_seconds=0.0,
)


QUICK = {"beam_power_numpy", "implicit_step_4d", "pixel_frame"}
"""Rows that start in seconds; most others compile a whole tracker."""


@pytest.mark.parametrize(
    "name", [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in ROWS]
)
def test_a_row_is_finite_and_positive(name: str) -> None:
    (row,) = run([name], TINY)
    assert row.name == name
    assert row.unit in ("s", "ms")
    assert row.note
    assert row.median >= row.ours
    numbers = (row.ours, row.peer, row.ratio, row.limit, row.target)
    assert all(math.isfinite(value) and value > 0 for value in numbers if value is not None)
    assert row.compile_seconds is None or row.compile_seconds >= 0
    fields = json.loads(json.dumps(row.as_dict()))
    assert {"name", "unit", "ours", "peer", "ratio", "limit", "compile_seconds", "note"} <= set(fields)
    assert row.peer is None or fields["ratio"] == row.peer / row.ours


def test_without_its_peer_a_row_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("faintrack.bench.bernoulli.stone_soup_step", lambda *_: None)
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    for row in run(["bernoulli_step_single", "beam_power_acoular"], TINY):
        assert row.peer is None
        assert row.ratio is None
        assert "is not installed" in row.note


def test_a_name_that_is_no_row() -> None:
    with pytest.raises(InputError, match="no row 'speed'"):
        chosen(["speed"])


def test_rows_for_a_gpu_are_left_out_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = {name: ROWS["implicit_step_4d"] for name in ("a", *FOR_GPU)}
    monkeypatch.setattr("faintrack.bench.ROWS", rows)
    for backend, expected in (("cpu", ["a"]), ("gpu", list(rows))):
        monkeypatch.setattr("jax.default_backend", lambda backend=backend: backend)
        assert chosen() == expected
    monkeypatch.setattr("jax.default_backend", lambda: "cpu")
    assert chosen(FOR_GPU) == list(FOR_GPU)


def test_stone_soup_takes_the_same_step() -> None:
    """Both filters estimate the same existence from particles of the same density."""
    pytest.importorskip("stonesoup")
    ours = problem(particles=2000, births=500)

    def existence(key: jax.Array) -> jax.Array:
        for_start, for_step = jax.random.split(key)
        return ours.step(ours.filter.init(for_start, existence=0.5), for_step)[0].existence

    drawn = jax.jit(jax.vmap(existence))(jax.random.split(jax.random.key(0), 50))
    theirs = []
    for seed in range(20):
        np.random.seed(seed)
        step = stone_soup_step(particles=2000, births=500)
        assert step is not None
        theirs.append(float(step().existence_probability))
    assert_same_mean(np.asarray(drawn), np.asarray(theirs))


def test_acoular_forms_the_same_beams() -> None:
    r"""Their beam power is the mean over snapshots and pairs of channels, in their scale of spectra.

    Distances that are off by e metres, in wavefronts that bend and in rounding, turn channels by 2 pi f e / c.
    """
    pytest.importorskip("acoular")
    array, plan = plan_of(TINY)
    samples = draw_frames(TINY)[0]
    ours = np.asarray(plan.beam_power(plan.spectra(jnp.asarray(samples[None])))[0]) / (SNAPSHOTS * TINY.channels**2)
    theirs = acoular_beam_power(array, plan)(samples)
    bend = np.ptp(array.positions @ array.axis) ** 2 / (2 * FAR) + FAR * np.finfo(np.float32).eps
    turned = 2 * np.pi * plan.grid.frequency[-1] * bend / array.sound_speed
    scale = np.sum(ours) / np.sum(theirs)
    assert np.abs(theirs * scale - ours).max() < 4 * turned * ours.max()
