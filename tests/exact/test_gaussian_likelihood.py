"""The ratios are those of the densities that they are said to come from."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

from faintrack.likelihoods import interpolation
from faintrack.likelihoods.lobe_width import lobe_width_likelihood
from faintrack.likelihoods.unknown_noise import UnknownNoise
from faintrack.sensors.array import line_array
from faintrack.sensors.beams import BeamGrid, steering
from faintrack.signal.beamformer import beamformer
from tests.scenes import CIRCLE, COLOURED, LINE, Scene, log_ratio
from tests.tolerances import assert_equal, rounding

SNR = 0.4
SNR_DB = 10 * np.log10(SNR)
OPERATIONS = 1000
"""Roundings in a density of a few dozen values, here and there."""
BEAMS = [0, 9, 22, 35]


def exact_scene(array: object, snapshots: int = 2) -> Scene:
    return Scene(np.float64, array, snapshots)


def samples(scene: Scene) -> np.ndarray:
    return np.random.default_rng(5).normal(size=(8 * scene.snapshots, 4))


def on_beams(scene: Scene) -> object:
    return scene.states([scene.grid.bearing[BEAMS], np.zeros(len(BEAMS)), np.full(len(BEAMS), SNR_DB)])


@pytest.mark.parametrize("array", [LINE, CIRCLE], ids=["line", "circle"])
@pytest.mark.parametrize("noise_power", [np.ones(3), COLOURED], ids=["white", "coloured"])
def test_white_signal_is_a_ratio_of_complex_gaussians(array: object, noise_power: np.ndarray, float64: type) -> None:
    """Covariance s (I + a d d*) against s I, for every bin and snapshot by itself."""
    scene = exact_scene(array)
    spectra = np.fft.rfft(samples(scene).reshape(2, 8, 4), axis=1)[:, 1:4] / np.sqrt(8)
    vectors = steering(scene.array, scene.grid.frequency, scene.grid.bearing[BEAMS])
    expected = np.zeros(len(BEAMS))
    for place in range(len(BEAMS)):
        for bin, power in enumerate(noise_power):
            noise = power * np.eye(4, dtype=complex)
            source = noise + power * SNR * np.outer(vectors[bin, place], vectors[bin, place].conj())
            for snapshot in range(2):
                z = spectra[snapshot, bin]
                expected[place] += complex_gaussian(z, source) - complex_gaussian(z, noise)
    actual = log_ratio(scene.white_signal(noise_power), scene.scan(samples(scene)), on_beams(scene))
    assert_equal(actual, expected, float64, OPERATIONS, scale=100.0)


def complex_gaussian(z: np.ndarray, covariance: np.ndarray) -> float:
    """Log density of a circular complex Gaussian."""
    form = (z.conj() @ np.linalg.solve(covariance, z)).real
    return -form - np.linalg.slogdet(np.pi * covariance)[1]


def test_white_signal_is_the_density_of_real_samples(float64: type) -> None:
    """bosser2022, eq. 20-23: covariance R of all samples of all channels; a signal without offset and half the rate.

    The bins at zero and at half the sample rate hold noise alone in both densities, so they cancel.
    """
    scene, size, variance = exact_scene(LINE, snapshots=1), 8, 1.7
    number = np.fft.fftfreq(size, 1 / size)
    transform = np.exp(-2j * np.pi * np.outer(np.arange(size), np.arange(size)) / size) / np.sqrt(size)
    carries = (number != 0) & (np.abs(number) != size / 2)
    z = np.sqrt(variance) * samples(scene)
    expected = []
    for bearing in scene.grid.bearing[BEAMS]:
        delays = scene.array.delays(np.array(bearing))
        phases = [carries * np.exp(-2j * np.pi * number * 1000 / size * delay) for delay in delays]
        heard = np.concatenate([transform.conj().T @ np.diag(phase) @ transform for phase in phases])
        assert np.abs(heard.imag).max() < rounding(float64, OPERATIONS)
        noise = variance * np.eye(4 * size)
        source = noise + variance * SNR * heard.real @ heard.real.T
        expected.append(real_gaussian(z.T.ravel(), source) - real_gaussian(z.T.ravel(), noise))
    actual = log_ratio(scene.white_signal(variance), scene.scan(z), on_beams(scene))
    assert_equal(actual, np.array(expected), float64, OPERATIONS, scale=100.0)


def real_gaussian(z: np.ndarray, covariance: np.ndarray) -> float:
    """Log density of a Gaussian."""
    return -0.5 * (z @ np.linalg.solve(covariance, z) + np.linalg.slogdet(2 * np.pi * covariance)[1])


@pytest.mark.parametrize("snapshots", [1, 3])
def test_unknown_noise_is_an_integral_over_the_noise_power(snapshots: int, float64: type) -> None:
    """Both densities integrated against d s / s, bin by bin, with t = log s."""
    scene = exact_scene(LINE, snapshots)
    likelihood = UnknownNoise(scene.grid, (-12.0, 6.0))
    scan = scene.scan(samples(scene))
    bearings, columns = [4, 20], [0, 9, 18]
    expected = np.zeros((2, 3))
    for row, bearing in enumerate(bearings):
        for column, snr_db in enumerate(likelihood.snr_axis_db[columns]):
            gain = 4 * 10 ** (snr_db / 10)
            for total, beam in zip(np.asarray(scan.total_power), np.asarray(scan.beam_power)[:, bearing], strict=True):
                rest = total - gain / 4 / (1 + gain) * beam
                expected[row, column] += marginal(4 * snapshots, rest) - marginal(4 * snapshots, total)
                expected[row, column] -= snapshots * np.log1p(gain)
    actual = np.asarray(likelihood.table(scan))[np.ix_(bearings, columns)]
    np.testing.assert_allclose(actual, expected, rtol=0, atol=1e-8, err_msg="quad is asked for 1e-10 in every bin")


def marginal(count: int, energy: float) -> float:
    """Log of the integral of s^-count exp(-energy / s) ds / s, whose integrand peaks at s = energy / count."""
    peak = -count * np.log(energy / count) - count

    def integrand(t: float) -> float:
        return np.exp(-count * t - energy * np.exp(-t) - peak)

    centre = np.log(energy / count)
    value, _ = quad(integrand, centre - 5, centre + 30, points=[centre], epsabs=0, epsrel=1e-10)
    return np.log(value) + peak


@pytest.mark.parametrize("array", [LINE, CIRCLE], ids=["line", "circle"])
def test_lobe_width_is_the_papers_sums(array: object, float64: type) -> None:
    """bosser2022, eq. 19, in loops; an angle goes the shorter way round."""
    scene, width, exponent = exact_scene(array), 0.45, 3.0
    scan, grid = scene.scan(samples(scene)), scene.grid
    power = np.asarray(scan.beam_power).sum(axis=0)
    expected = []
    for beam in BEAMS:
        within, outside = [], []
        for other in range(grid.beams):
            apart = abs(grid.bearing[beam] - grid.bearing[other])
            if grid.circular:
                apart = min(apart, 2 * np.pi - apart)
            (within if apart < width else outside).append(power[other] ** exponent)
        expected.append(np.log(np.mean(within) / np.mean(outside)))
    likelihood = lobe_width_likelihood(grid, width, exponent)
    assert_equal(log_ratio(likelihood, scan, on_beams(scene)), np.array(expected), float64, OPERATIONS, scale=10.0)


def test_a_ratio_is_told_by_its_scan(float64: type) -> None:
    """The likelihood reads the number of channels in the scan, not in the array."""
    scene = exact_scene(LINE)
    scan = scene.scan(samples(scene))
    fewer = dataclasses.replace(scan, channels=scan.channels - 1)
    expected = np.asarray(scan.beam_power).sum(axis=0)[BEAMS] * SNR / (1 + 3 * SNR) - 6 * np.log1p(3 * SNR)
    assert_equal(log_ratio(scene.white_signal(), fewer, on_beams(scene)), expected, float64, OPERATIONS)


def grid(beams: int, circular: bool) -> BeamGrid:
    return BeamGrid(np.array([1.0]), beams, 1, circular)


def read(axes: BeamGrid, values: np.ndarray, bearing: np.ndarray) -> np.ndarray:
    return np.asarray(
        interpolation.read(jnp.asarray(values), interpolation.bearing_neighbours(axes, jnp.asarray(bearing)))
    )


def test_interpolation_reproduces_parabolas(float64: type) -> None:
    def parabola(t: np.ndarray) -> np.ndarray:
        return 3 - 2 * t + 0.7 * t**2

    position = np.linspace(1, 8, 71)
    table = jnp.asarray(parabola(np.arange(11.0)))
    assert_equal(
        interpolation.read(table, interpolation.neighbours(jnp.asarray(position))),
        parabola(position),
        float64,
        20,
        scale=100.0,
    )


@pytest.mark.parametrize("circular", [False, True], ids=["line", "circle"])
@pytest.mark.parametrize("waves", [1, 3])
def test_interpolation_error_is_of_third_order(waves: int, circular: bool, float64: type) -> None:
    r"""Ends included: cos(k psi) is even about both ends of a line and wraps on a circle.

    With x = h k, the slopes at two neighbours are off by at most :math:`x - \sin x \le x^3 / 6`, of which the cubic
    carries at most :math:`t (1 - t) \le 1/4` into the value; with true slopes it would err by :math:`x^4 / 384`.
    """
    bearing = np.linspace(-np.pi if circular else 0.0, np.pi, 2001)
    worst = []
    for beams in (48, 96):
        axes = grid(beams, circular)
        error = np.abs(read(axes, np.cos(waves * axes.bearing), bearing) - np.cos(waves * bearing)).max()
        step = waves * (axes.bearing[1] - axes.bearing[0])
        assert error < step**3 / 24 + step**4 / 384
        worst.append(error / step**3)
    assert 0.9 < worst[0] / worst[1] < 1.2


def test_interpolation_on_beams_is_exact(float64: type) -> None:
    for circular in (False, True):
        axes = grid(9, circular)
        values = np.random.default_rng(2).normal(size=9)
        assert_equal(read(axes, values, axes.bearing), values, float64, 50, scale=1.0)


def test_bearings_wrap_on_a_circle_and_are_mirrored_on_a_line(float64: type) -> None:
    values = np.random.default_rng(3).normal(size=9)
    bearing = np.linspace(0.01, 3.0, 20)
    wrapped = read(grid(9, True), values, bearing), read(grid(9, True), values, bearing - 2 * np.pi)
    assert_equal(*wrapped, float64, 100, scale=1.0)
    mirrored = read(grid(9, False), values, -bearing[:5]), read(grid(9, False), values, bearing[:5])
    assert_equal(*mirrored, float64, 100, scale=1.0)


def test_little_is_lost_between_the_beams_of_the_default_grid() -> None:
    """Four beams in a lobe keep 99 % of a source half way between two at the top of the band; a line keeps 95 %."""
    array = line_array(32, 0.375)
    plan = beamformer(array, 4000.0, frame=0.02, band=(1900.0, 1950.0))
    bearing = plan.grid.bearing
    broadside = plan.grid.beams // 2
    between = np.array([(bearing[broadside] + bearing[broadside + 1]) / 2])
    wave = steering(array, plan.grid.frequency[-1:], between)[0, 0]
    beams = np.abs(steering(array, plan.grid.frequency[-1:], bearing)[0].conj() @ wave) ** 2 / 32**2
    assert read(plan.grid, beams, between)[0] > 0.99
    assert beams[broadside : broadside + 2].mean() < 0.96
