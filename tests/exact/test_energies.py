"""Energies of beams: exact sums, the moments of noise, and noise whose level is not known."""

import jax
import jax.numpy as jnp
import numpy as np

from faintrack.sensors.array import line_array
from faintrack.sensors.beams import BeamScan
from faintrack.signal.beamformer import beamformer
from faintrack.signal.energies import energies, standardised
from tests.tolerances import assert_equal, assert_mean


def test_energy_is_the_mean_share_of_the_band() -> None:
    rng = np.random.default_rng(0)
    power, total = rng.uniform(1, 2, (5, 3, 7)), rng.uniform(1, 2, (5, 3))
    found = energies(BeamScan(jnp.arange(5.0), jnp.asarray(power), jnp.asarray(total), jnp.full(5, 4.0)))
    expected = np.stack([(scan / of[:, None]).mean(axis=0) for scan, of in zip(power, total, strict=True)])
    assert_equal(found, expected, np.float32, operations=8)


def test_scans_of_fewer_than_two_channels_were_not_measured() -> None:
    scans = BeamScan(jnp.zeros(3), jnp.zeros((3, 2, 4)), jnp.zeros((3, 2)), jnp.array([0.0, 1.0, 2.0]))
    found = energies(scans)
    assert np.isnan(found[:2]).all()
    assert (found[2] == 0).all()  # silence is no energy


def test_noise_has_the_mean_one_at_any_level() -> None:
    """Of M channels and one snapshot B / E is M times Beta(1, M - 1): mean 1, variance (M - 1) / (M + 1)."""
    channels, frames = 4, 400
    plan = beamformer(line_array(channels, 1.0), 1000.0, frame=0.064, beams=9)
    level = 10.0 ** np.linspace(-3, 3, frames)
    samples = level[:, None, None] * np.random.default_rng(1).normal(size=(frames, 64, channels))
    scans = plan.scan(jnp.arange(float(frames)), jnp.asarray(samples, jnp.float32), jnp.ones((frames, channels), bool))
    found = np.asarray(energies(scans))
    assert_mean(found, 1.0)
    bins, variance = plan.grid.frequency.size, (channels - 1) / (channels + 1)
    assert_mean((found - 1) ** 2, variance / bins)


def test_standardised_by_hand() -> None:
    values = jnp.array([[1.0, 2.0, 4.0, 8.0, jnp.nan], [3.0, 3.0, 3.0, 9.0, 3.0]])
    found = np.asarray(standardised(values))
    # Median 3, deviations 2, 1, 1, 5: their median is 1.5.
    assert_equal(found[0, :4], (np.array([1, 2, 4, 8]) - 3) / (1.4826 * 1.5), np.float32, operations=4)
    assert np.isnan(found[0, 4])
    assert np.isnan(found[1]).all()


def test_the_level_of_the_noise_is_forgotten_and_a_target_hardly_moves_it() -> None:
    noise = np.random.default_rng(2).normal(size=(2000, 181))
    one = noise.copy()
    one[:, 90] += 20
    plain = np.asarray(standardised(jnp.asarray(noise)))
    moved = np.asarray(standardised(jnp.asarray(100 + 0.01 * noise)))
    np.testing.assert_allclose(plain, moved, atol=0.01)
    assert_mean(plain.mean(axis=1), 0.0)
    # Of 181 beams the deviation is known to 0.09, and its inverse square has the mean 1 + 4 * 0.09^2 / 2.
    assert abs(np.mean(plain**2) - 1) < 0.05
    with_target = np.asarray(standardised(jnp.asarray(one)))
    assert abs(np.mean(np.delete(with_target, 90, axis=1))) < 0.02
    assert abs(with_target[:, 90].mean() - 20) < 0.5


def test_it_compiles_and_maps() -> None:
    values = jax.random.normal(jax.random.key(0), (3, 2, 40))
    np.testing.assert_allclose(jax.jit(standardised)(values)[1, 1], standardised(values[1, 1]), rtol=1e-5)
