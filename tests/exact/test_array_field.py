"""Sources in the background of an array, against dense linear algebra."""

import dataclasses
import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.likelihoods.array_field import (
    COHERENT,
    CURVATURE,
    MISPLACED,
    ORDERS,
    Sources,
    alike,
    beams_beside,
    beside,
    coherence,
)
from faintrack.likelihoods.unknown_noise import UnknownNoise
from faintrack.sensors.array import SensorArray, line_array, sensor_array
from faintrack.sensors.beams import BeamScan
from faintrack.signal.beamformer import Beamformer, beamformer
from faintrack.targets.states import BearingState, WaveState

LINE = line_array(8, 1.5)
FLAT = sensor_array(np.array([[0.0, 0.0], [3.0, 0.5], [1.0, 4.0], [-2.0, 1.5], [2.0, -3.0]]))
SOURCES = Sources(*(jnp.asarray(values) for values in ([0.9, 2.0], [0.01, 0.05], [0.5, 20.0], [0.9, 1.0])))


def planned(array: SensorArray, beams: int = 24, **options: Any) -> Beamformer:
    return beamformer(array, 1000.0, 0.5, (50.0, 300.0), beams=beams, snapshot=0.125, taper=True, **options)


def heard(plan: Beamformer, seed: int = 0, source: tuple[float, float] | None = None) -> BeamScan:
    """Frame of white noise, with a plane wave of some bearing and amplitude over the noise."""
    array = plan.grid.array
    assert array is not None
    rng = np.random.default_rng(seed)
    samples = rng.normal(size=(500, len(array.gains)))
    if source is not None:
        bearing, amplitude = source
        frequency = np.fft.rfftfreq(500, 1e-3)[:, None]
        delays = np.asarray(array.delays(np.array(bearing)))
        wave = np.fft.rfft(rng.normal(size=500))[:, None] * np.exp(-2j * np.pi * frequency * delays)
        samples += amplitude * np.fft.irfft(wave, 500, axis=0)
    usable = jnp.ones((1, len(array.gains)), bool)
    scans = plan.scan(jnp.zeros(1), jnp.asarray(samples[None], jnp.float32), usable)
    return jax.tree.map(lambda values: values[0], scans)


@pytest.mark.parametrize("array", [LINE, FLAT], ids=["line", "flat"])
def test_numbers_of_the_field(array: SensorArray) -> None:
    plan = planned(array)
    scan = heard(plan)
    found = beside(plan, scan, SOURCES)
    power, gain = beams_beside(plan, found)
    channels, resolution = len(array.gains), plan.grid.frequency[0] / plan.first_bin
    spectra = np.asarray(scan.spectra)
    for number, frequency in enumerate(plan.grid.frequency):

        def vectors(bearing: np.ndarray, frequency: float = frequency) -> np.ndarray:
            return np.exp(-2j * np.pi * frequency * np.asarray(array.delays(bearing)))

        background = np.eye(channels, dtype=complex)
        for bearing, deviation, snr, existence in zip(
            *(np.asarray(part, float) for part in dataclasses.astuple(SOURCES)[:4]), strict=True
        ):
            level = 4 * snr * (1 + channels * snr) * (1 + snr / 10) ** 4 * existence
            delays = np.asarray(array.delays(np.array(bearing)))
            lag = (delays - delays.mean()) * resolution
            middle = vectors(np.array([bearing]))[0]
            turn = (np.asarray(array.delays(np.array(bearing + 1e-5))) - delays) / 1e-5
            phase = 2 * np.pi * (turn - turn.mean())
            least = MISPLACED / (np.abs(phase).max() * plan.grid.frequency.max())
            phase = phase * frequency * np.hypot(deviation, least)
            stretched = np.sqrt(2 * CURVATURE) * lag
            columns = [
                middle * stretched**order / math.sqrt(math.factorial(order)) * np.exp(-CURVATURE * lag**2)
                for order in range(ORDERS)
            ]
            columns.append(middle * phase / max(np.abs(phase).max(), 1))
            background += level * sum(np.outer(column, column.conj()) for column in columns)
        inverse = np.linalg.inv(background)
        z, beams = spectra[:, number], vectors(np.asarray(plan.grid.bearing))
        np.testing.assert_allclose(
            gain[number], np.einsum("bi,ij,bj->b", beams.conj(), inverse, beams).real, rtol=2e-3, atol=2e-3
        )
        products = np.abs(np.einsum("bi,ij,kj->kb", beams.conj(), inverse, z)) ** 2
        np.testing.assert_allclose(power[number], products.sum(axis=0), rtol=2e-2, atol=2e-2)
        energy = np.einsum("ki,ij,kj->", z.conj(), inverse, z).real
        assert float(found.field.energy[number]) == pytest.approx(energy, rel=2e-3)
        # Loud sources take whole dimensions with them.
        assert np.trace(inverse).real <= float(found.field.dimensions[number]) + 1e-3
        assert float(found.field.dimensions[number]) <= channels


def test_a_source_that_does_not_exist_adds_nothing() -> None:
    plan = planned(LINE)
    likelihood, scan = UnknownNoise(plan.grid, (-20.0, 10.0), plan), heard(plan, 1)
    states = BearingState(jnp.linspace(0.1, 3.0, 7), jnp.zeros(7), jnp.linspace(-15.0, 5.0, 7))
    absent = dataclasses.replace(SOURCES, existence=jnp.zeros(2))
    empty = beside(plan, scan, absent)
    # Products of eight factors are made in another order.
    np.testing.assert_allclose(
        likelihood.log_ratio(empty, states), likelihood.log_ratio(scan, states), rtol=1e-3, atol=2e-3
    )


def test_sources_come_in_any_order_and_one_by_one() -> None:
    plan = planned(LINE)
    scan = heard(plan, 2)
    turned = jax.tree.map(lambda values: values[::-1], SOURCES)
    first, second = (jax.tree.map(lambda values, end=end: values[end : end + 1], SOURCES) for end in (0, 1))
    both = beside(plan, scan, SOURCES)
    for other in (beside(plan, scan, turned), beside(plan, beside(plan, scan, first), second)):
        np.testing.assert_allclose(both.field.spectra, other.field.spectra, rtol=1e-3, atol=1e-3)
        np.testing.assert_allclose(both.field.energy, other.field.energy, rtol=1e-3)
        for one, two in zip(beams_beside(plan, both), beams_beside(plan, other), strict=True):
            np.testing.assert_allclose(one, two, rtol=1e-2, atol=1e-2)


def test_a_closer_look_says_the_same() -> None:
    """A table near a belief, read at the beams, is the table of the beams: cubic convolution between 33 points."""
    plan = planned(LINE, beams=181)
    likelihood = UnknownNoise(plan.grid, (-20.0, 10.0), plan)
    scan = beside(plan, heard(plan, 3, source=(1.3, 0.7)), SOURCES)
    beams = jnp.asarray(plan.grid.bearing[70:80], jnp.float32)
    belief = BearingState(beams, jnp.zeros(10), jnp.linspace(-6.0, 0.0, 10))
    closer = likelihood.zoomed(scan, belief, jnp.full(10, -jnp.log(10.0)))
    np.testing.assert_allclose(closer.log_ratio(belief), likelihood.log_ratio(scan, belief), atol=0.3)


def test_a_faint_source_is_heard_beside_a_loud_one() -> None:
    plan = planned(LINE, beams=181)
    likelihood = UnknownNoise(plan.grid, (-20.0, 20.0), plan)
    loud, faint = 0.9, 2.0
    frames = [heard(plan, seed, source=(loud, 30.0)) for seed in range(6)]
    known = Sources(*(jnp.asarray([value]) for value in (loud, 1e-3, 100.0, 1.0)))
    away = BearingState(jnp.asarray([faint]), jnp.zeros(1), jnp.asarray([-10.0]))
    for scan in frames:
        # Nothing is there: against it, not for it.
        assert float(likelihood.log_ratio(beside(plan, scan, known), away)[0]) < 3
    with_faint = heard(plan, 9, source=(faint, 1.0))
    assert float(likelihood.log_ratio(beside(plan, with_faint, known), away)[0]) > 3


def test_coherence() -> None:
    grid = planned(LINE, beams=31).grid
    found = np.asarray(coherence(grid, jnp.asarray(grid.bearing[[5, 16]], jnp.float32), jnp.float32))
    assert found.shape == (2, 31)
    np.testing.assert_allclose([found[0, 5], found[1, 16]], 1, atol=1e-5)
    assert found.max() <= 1 + 1e-5
    states = BearingState(jnp.asarray(grid.bearing, jnp.float32), jnp.zeros(31), jnp.zeros(31))
    centre = jax.tree.map(lambda values: values[16:17], states)
    np.testing.assert_array_equal(np.asarray(alike(grid, states, centre))[0], found[1] > COHERENT)


def test_numbers_of_the_field_of_a_source_above_the_horizon() -> None:
    plan = planned(FLAT, beams=12, elevation=(0.2, 1.2))
    scan = heard(plan)
    bearing, elevation, snr = 0.9, 0.8, 2.0
    known = [jnp.asarray([value]) for value in (bearing, 0.02, snr, 1.0, elevation, 0.03)]
    found = beside(plan, scan, Sources(*known))
    power, gain = beams_beside(plan, found)
    channels, resolution = 5, plan.grid.frequency[0] / plan.first_bin

    def advance(bearing: np.ndarray, elevation: np.ndarray) -> np.ndarray:
        level = np.cos(elevation)
        return np.stack([level * np.sin(bearing), level * np.cos(bearing)], axis=-1) @ FLAT.positions[:, :2].T / 1500

    middle = -advance(np.array(bearing), np.array(elevation))
    lag, faded = middle * resolution, np.exp(-CURVATURE * (middle * resolution) ** 2)
    turn = (middle + advance(np.array(bearing + 1e-5), np.array(elevation))) / 1e-5
    rise = (middle + advance(np.array(bearing), np.array(elevation + 1e-5))) / 1e-5
    least = MISPLACED / (2 * np.pi * np.abs(turn).max() * plan.grid.frequency.max())
    beams = advance(*(np.asarray(angles) for angles in plan.grid.directions))
    for number, frequency in enumerate(plan.grid.frequency):
        wave = np.exp(-2j * np.pi * frequency * middle)
        columns = [
            wave * (np.sqrt(2 * CURVATURE) * lag) ** order / math.sqrt(math.factorial(order)) * faded
            for order in range(ORDERS)
        ]
        columns += [
            wave * 2 * np.pi * frequency * deviation * change
            for deviation, change in ((np.hypot(0.02, least), turn), (0.03, rise))
        ]
        level = 4 * snr * (1 + channels * snr) * (1 + snr / 10) ** 4
        inverse = np.linalg.inv(np.eye(channels) + level * sum(np.outer(c, c.conj()) for c in columns))
        vectors = np.exp(2j * np.pi * frequency * beams)
        expected = np.einsum("bi,ij,bj->b", vectors.conj(), inverse, vectors).real
        np.testing.assert_allclose(gain[number], expected, rtol=5e-3, atol=1e-2)
        products = np.einsum("bi,ij,kj->kb", vectors.conj(), inverse, np.asarray(scan.spectra)[:, number])
        np.testing.assert_allclose(power[number], (np.abs(products) ** 2).sum(axis=0), rtol=3e-2, atol=3e-2)


def test_a_closer_look_above_the_horizon_says_the_same() -> None:
    plan = planned(FLAT, beams=96, elevation=(0.0, 1.2))
    likelihood = UnknownNoise(plan.grid, (-20.0, 10.0), plan)
    scan = heard(plan, 3, source=(1.3, 1.0))
    bearing, elevation = (jnp.linspace(*ends, 5, dtype=jnp.float32) for ends in ((1.1, 1.4), (0.1, 0.4)))
    belief = WaveState(bearing, jnp.zeros(5), jnp.linspace(-6.0, 0.0, 5), elevation)
    closer = likelihood.zoomed(scan, belief, jnp.full(5, -jnp.log(5.0)))
    np.testing.assert_allclose(closer.log_ratio(belief), likelihood.log_ratio(scan, belief), atol=0.3)


def test_directions_above_each_other_are_alike_within_a_lobe() -> None:
    grid = planned(FLAT, beams=24, elevation=(0.0, 1.2)).grid
    bearing, elevation = grid.directions
    assert elevation is not None
    states = WaveState(*(jnp.asarray(part, jnp.float32) for part in (bearing, 0 * bearing, 0 * bearing, elevation)))
    number = 24 * 4 + 7
    centre = jax.tree.map(lambda values: values[number : number + 1], states)
    close = np.asarray(alike(grid, states, centre))[0].reshape(grid.rings, 24)
    assert close[4, 7]
    assert not close[-1, 7]
    assert not close[4, 19]
