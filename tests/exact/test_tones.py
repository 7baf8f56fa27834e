"""Tones: spectra, noise, ratio and background against sums and matrices that share no code with them."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad

from faintrack.errors import InputError
from faintrack.likelihoods.protocols import with_others
from faintrack.likelihoods.unknown_tone import UnknownTone
from faintrack.sensors.array import sensor_array
from faintrack.sensors.tones import ToneScan
from faintrack.signal.tones import GUARD, SIDE, tone_analysis
from faintrack.targets.states import ToneState
from faintrack.targets.target import UniformBirth
from tests.scenes import LINE, part
from tests.tolerances import assert_mean

RATE, LENGTH = 400.0, 400
PLAN = tone_analysis(LINE, RATE, 1.0, (50.0, 150.0), 24)
LIKELIHOOD = UnknownTone(PLAN.grid)
TIME = np.arange(LENGTH) / RATE
SNR_DB = 9.0
BEARING = 1.1


def states(bearing: float, frequency: float, snr_db: float = SNR_DB, count: int = 1) -> ToneState:
    return ToneState(*(jnp.full(count, value) for value in (bearing, 0.0, snr_db, frequency)))


def samples(seed: int, amplitude: float = 0.0, frequency: float = 97.3) -> np.ndarray:
    """Noise of variance 1 in four channels, and a tone from `BEARING`."""
    noise = np.random.default_rng(seed).normal(size=(LENGTH, 4))
    delays = np.asarray(LINE.delays(np.array(BEARING)))
    return noise + amplitude * np.cos(2 * np.pi * frequency * (TIME[:, None] - delays) + 0.4)


def scan_of(values: np.ndarray) -> ToneScan:
    scans = PLAN.scan(jnp.zeros(1), jnp.asarray(values[None], jnp.float32), jnp.ones((1, 4), bool))
    return part(scans, 0)


def spectrum(values: np.ndarray, frequency: float) -> np.ndarray:
    """z of every channel by its definition."""
    window = np.sqrt(2) * np.sin(np.pi * (np.arange(LENGTH) + 0.5) / LENGTH)
    turns = frequency * (np.arange(LENGTH) - (LENGTH - 1) / 2) / RATE
    return (window[:, None] * values * np.exp(-2j * np.pi * turns)[:, None]).sum(axis=0) / math.sqrt(LENGTH)


def wave(frequency: float, bearing: float) -> np.ndarray:
    return np.exp(-2j * np.pi * frequency * np.asarray(LINE.delays(np.array(bearing))))


@pytest.mark.parametrize("frequency", [97.0, 97.25, 97.1, 61.37])
def test_ratio_is_that_of_sums_over_the_samples(frequency: float) -> None:
    """Of both ratios the smaller; between the grid's frequencies as near as they are read."""
    values = samples(1, 0.5, frequency)
    steps = [sign * (GUARD + 2 * number) for sign in (-1, 1) for number in range(SIDE)]
    around = [spectrum(values, frequency + step) for step in steps if 4 <= frequency + step <= 196]
    z, d = spectrum(values, frequency), wave(frequency, BEARING)
    own, n = abs(np.vdot(d, z)) ** 2 / 4, len(around)
    noise = sum(abs(np.vdot(wave(frequency, BEARING), each)) ** 2 for each in around) / 4
    louder = 4 * 10 ** (SNR_DB / 10) * 8 / np.pi**2
    drop = louder / (1 + louder)
    in_beam = -math.log1p(louder) - (1 + n) * math.log1p(-drop * own / (own + noise))
    energy = sum(np.sum(np.abs(each) ** 2) for each in around) + np.sum(np.abs(z) ** 2)
    in_white = -math.log1p(louder) - 4 * (1 + n) * math.log1p(-drop * own / energy)
    found = float(LIKELIHOOD.log_ratio(scan_of(values), states(BEARING, frequency))[0])
    on_grid = (4 * frequency) % 1 == 0
    # References of the beam are steered at their own frequencies, and read between beams 8 degrees apart.
    assert found == pytest.approx(min(in_beam, in_white), abs=0.8 if on_grid else 1.2)


def test_power_of_a_tone_is_as_stated() -> None:
    """Of an SNR in 1 Hz r: r T 8 / pi^2 over noise of variance 1, half of it at positive frequencies."""
    amplitude = 0.7
    heard = np.abs(spectrum(samples(0, amplitude, 97.0) - samples(0), 97.0)) ** 2
    snr = amplitude**2 / 2 / (1 / (RATE / 2))
    np.testing.assert_allclose(heard, snr * 8 / np.pi**2, rtol=1e-2)


@pytest.mark.parametrize("n", [6.0, 24.0])
@pytest.mark.parametrize("louder", [0.5, 30.0])
def test_mean_ratio_of_a_beam_is_1(n: float, louder: float) -> None:
    drop = louder / (1 + louder)

    def integrand(b: float) -> float:
        return (1 - drop * b) ** (-1 - n) * n * (1 - b) ** (n - 1) / (1 + louder)

    assert quad(integrand, 0, 1, epsabs=0, epsrel=1e-9)[0] == pytest.approx(1, rel=1e-8)


@pytest.mark.parametrize("shared", [0.0, 3.0])
def test_noise_alone_says_little_more_than_1_on_average(shared: float) -> None:
    """At most 1, also where all channels hear the same noise beside their own."""
    rng = np.random.default_rng(3)
    draws = rng.normal(size=(400, LENGTH, 4)) + math.sqrt(shared) * rng.normal(size=(400, LENGTH, 1))
    scans = PLAN.scan(jnp.zeros(400), jnp.asarray(draws, jnp.float32), jnp.ones((400, 4), bool))
    some = ToneState(*(jnp.array(x) for x in ([1.5, 0.4], [0.0, 0.0], [-1.0, -1.0], [77.1, 120.4])))
    ratios = np.exp(np.asarray(jax.vmap(lambda scan: LIKELIHOOD.log_ratio(scan, some))(scans), float))
    error = ratios.std(axis=0) / math.sqrt(len(ratios))
    assert np.all(ratios.mean(axis=0) < 1 + 5 * error)
    assert np.all(ratios.mean(axis=0) > 0.5)


def test_background_is_the_inverse_of_the_covariance() -> None:
    """Two tones of the same frequency that are known: P, w, E and M' by matrices."""
    values = samples(5, 1.5)
    others = ToneState(*(jnp.array(x)[:, None] for x in ([BEARING, 2.2], [0.0, 0.0], [15.0, 3.0], [97.25, 97.25])))
    scan = with_others(LIKELIHOOD, scan_of(values), others, jnp.zeros((2, 1)), jnp.array([1.0, 0.5]))
    covariance = np.eye(4, dtype=complex)
    for bearing, snr_db, there in ((BEARING, 15.0, 1.0), (2.2, 3.0, 0.5)):
        level = 2 * there * 10 ** (snr_db / 10) * 8 / np.pi**2
        turned = (wave(97.25, bearing + 1e-3) - wave(97.25, bearing - 1e-3)) / 2e-3
        known = 0.02 / np.abs(turned).max()
        covariance += level * (
            np.outer(wave(97.25, bearing), wave(97.25, bearing).conj()) + known**2 * np.outer(turned, turned.conj())
        )
    inverse = np.linalg.inv(covariance)
    z, d = spectrum(values, 97.25), wave(97.25, 1.7)
    gain = float(np.vdot(d, inverse @ d).real)
    heard = LIKELIHOOD.output(scan, states(1.7, 97.25))
    assert float(heard.own[0]) == pytest.approx(abs(np.vdot(d, inverse @ z)) ** 2 / gain, rel=2e-3)
    assert float(heard.louder[0]) == pytest.approx(gain * 10 ** (SNR_DB / 10) * 8 / np.pi**2, rel=2e-3)
    assert float(heard.energy[0]) == pytest.approx(float(np.vdot(z, inverse @ z).real), rel=2e-3)
    assert float(heard.dimensions[0]) == pytest.approx(np.trace(inverse).real, rel=2e-3)


def test_beside_nothing_it_is_the_scan_alone() -> None:
    scan, one = scan_of(samples(6, 0.5)), states(BEARING, 97.3)
    beside = with_others(
        LIKELIHOOD, scan, part(states(0.4, 80.0, 20.0, 2), slice(None, 1)), jnp.zeros((1, 1)), jnp.zeros(1)
    )
    np.testing.assert_allclose(LIKELIHOOD.log_ratio(beside, one), LIKELIHOOD.log_ratio(scan, one), rtol=1e-5)


def test_newborn_stand_for_the_birth_density() -> None:
    """Draws of one key are spread evenly, so that those of many keys are counted."""
    ends = (0.0, 0.0, -3.0, 50.0), (math.pi, 0.0, 30.0, 150.0)
    birth = UniformBirth(*(ToneState(*map(jnp.array, values)) for values in ends))
    scan, keys = scan_of(samples(7, 1.0)), jax.random.split(jax.random.key(0), 50)
    drawn, log_weights = jax.vmap(lambda key: LIKELIHOOD.propose(scan, birth, key, 1000))(keys)
    weights = np.exp(np.asarray(log_weights, float))
    assert weights.max() <= 2 + 1e-3
    assert_mean(weights.mean(axis=1), 1.0)
    assert_mean((weights * np.asarray(drawn.frequency > 90.0)).mean(axis=1), 0.6)
    assert_mean((weights * np.asarray(drawn.bearing < 1.0)).mean(axis=1), 1 / math.pi)
    # Four channels within a third of a wave tell hardly any direction.
    assert (np.abs(np.asarray(drawn.frequency) - 97.3) < 1).mean() > 0.3


def test_a_circle_is_read_around() -> None:
    ring = sensor_array(np.array([[0.0, 0.0], [1.8, 0.3], [-0.4, 1.5], [-1.2, -1.4]]))
    plan = tone_analysis(ring, RATE, 1.0, (50.0, 150.0), 24)
    delays = np.asarray(ring.delays(np.array(math.pi - 0.01)))
    noise = np.random.default_rng(8).normal(size=(1, LENGTH, 4))
    values = noise + 0.6 * np.cos(2 * np.pi * 97.3 * (TIME[:, None] - delays))
    scan = part(plan.scan(jnp.zeros(1), jnp.asarray(values, jnp.float32), jnp.ones((1, 4), bool)), 0)
    both = ToneState(jnp.array([math.pi - 0.01, -math.pi - 0.01]), jnp.zeros(2), jnp.full(2, SNR_DB), jnp.full(2, 97.3))
    ratios = UnknownTone(plan.grid).log_ratio(scan, both)
    assert float(ratios[0]) > 8
    assert float(ratios[0]) == pytest.approx(float(ratios[1]), rel=1e-3)


@pytest.mark.parametrize(
    ("frame", "band", "said"),
    [
        (0.05, None, "frame is 0.05 s, 20 samples"),
        (1.0, (50.0, 300.0), "half the sample rate"),
        (1.0, (150.0, 50.0), "expected 0 <= low < high"),
        (0.1, (100.0, 105.0), "too few bins of 10 Hz"),
    ],
)
def test_what_does_not_fit_is_refused(frame: float, band: tuple[float, float] | None, said: str) -> None:
    with pytest.raises(InputError, match=said):
        tone_analysis(LINE, RATE, frame, band)
