"""Contacts: the ratios are those of their densities, and what is simulated has them."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats
from scipy.integrate import quad

from faintrack.errors import InputError
from faintrack.likelihoods.contacts import (
    BearingContact,
    Contact,
    GaussianContact,
    RangeDetection,
    Together,
    convergence_zones,
)
from faintrack.targets.states import PlanarState
from tests.tolerances import assert_equal, assert_mean

COVARIANCE = np.array([[4.0, 1.0], [1.0, 2.0]])
LOW, HIGH = (-20.0, -30.0), (20.0, 30.0)
SENSOR = (70.0, 0.0)
OPERATIONS = 200
DRAWS = 20_000


def planar(x: object, y: object, dtype: type = np.float32) -> PlanarState:
    x, y = jnp.asarray(x, dtype), jnp.asarray(y, dtype)
    return PlanarState(x, y, jnp.zeros((), dtype), jnp.zeros((), dtype))


def contact(value: object, dtype: type = np.float32) -> Contact:
    return Contact(jnp.zeros((), dtype), jnp.asarray(value))


def gaussian_contact(dtype: type = np.float32) -> GaussianContact:
    return GaussianContact(("x", "y"), jnp.asarray(COVARIANCE, dtype), LOW, HIGH)


def likelihoods() -> dict[str, object]:
    return {
        "gaussian": gaussian_contact(),
        "bearing": BearingContact(SENSOR, 0.6),
        "detection": RangeDetection(SENSOR, convergence_zones(30.0, 5.0), 0.3),
    }


def draw(likelihood: object, states: PlanarState, present: bool) -> Contact:
    one = eqx.filter_jit(jax.vmap(lambda key: likelihood.simulate(contact(0.0), states, present, key)))
    return one(jax.random.split(jax.random.key(1), DRAWS))


def test_gaussian_contact_is_eq_8_over_a_uniform_density(dtype: type) -> None:
    x, y = np.linspace(-5.0, 5.0, 4), np.linspace(-4.0, 6.0, 3)
    mesh = planar(x[:, None], y[None, :], dtype)
    actual = gaussian_contact(dtype).log_ratio(contact(np.array([1.0, 2.0], dtype)), mesh)
    density = stats.multivariate_normal([1.0, 2.0], COVARIANCE)
    expected = density.logpdf(np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)) + np.log(40.0 * 60.0)
    assert_equal(actual, expected, dtype, OPERATIONS, scale=10.0)


@pytest.mark.parametrize("error", [0.05, 0.26, 2.0])
def test_bearing_is_a_wrapped_normal_over_the_circle(error: float, dtype: type) -> None:
    """135 degrees seen from (70, 0), as in stone2002; also across the seam at 180 degrees."""
    likelihood = BearingContact(SENSOR, error)
    states = planar([60.0, 60.0, 60.0, 80.0], [10.0, 1.0, -1.0, 0.0], dtype)
    for bearing in (np.radians(135.0), 3.1, -3.1):
        actual = likelihood.log_ratio(contact(np.asarray(bearing, dtype)), states)
        off = bearing - np.arctan2([10.0, 1.0, -1.0, 0.0], [-10.0, -10.0, -10.0, 10.0])
        off = (off + np.pi) % (2 * np.pi) - np.pi
        density = stats.norm(scale=error).pdf(off[:, None] + 2 * np.pi * np.arange(-1, 2)).sum(axis=1)
        # Rounding of an angle is multiplied by its distance from the mean in units of error squared.
        logs = np.log(np.maximum(density, 1e-300)) + np.log(2 * np.pi)
        shown = density > 1e-300
        assert_equal(np.asarray(actual)[shown], logs[shown], dtype, OPERATIONS, scale=np.pi / error**2)


def test_mean_bearing_ratio_over_the_circle_is_1(float64: type) -> None:
    likelihood, state = BearingContact(SENSOR, 1.0), planar(60.0, 10.0, float64)

    def density(bearing: float) -> float:
        return float(jnp.exp(likelihood.log_ratio(contact(jnp.array(bearing)), state))) / (2 * np.pi)

    # Turns left out begin three half turns away: 2 (1 - Phi(3 pi)) of the probability.
    assert abs(quad(density, -np.pi, np.pi, epsrel=1e-9)[0] - 1) < 1e-8


@pytest.mark.parametrize("detected", [True, False])
def test_detection_is_the_ratio_of_two_coins(detected: bool, dtype: type) -> None:
    likelihood = RangeDetection(SENSOR, convergence_zones(30.0, 3.0, zones=2, best=0.9, worst=0.02), 0.05)
    ranges = np.array([0.0, 15.0, 30.0, 33.0, 60.0, 90.0])
    probability = 0.02 + 0.88 * np.exp(-(np.array([0.0, 15.0, 0.0, 3.0, 0.0, 30.0]) ** 2) / 18)
    actual = likelihood.log_ratio(contact(np.asarray(detected)), planar(SENSOR[0], -ranges, dtype))
    expected = stats.bernoulli(probability).logpmf(int(detected)) - stats.bernoulli(0.05).logpmf(int(detected))
    assert_equal(actual, expected, dtype, OPERATIONS, scale=4.0)


def test_what_is_drawn_has_the_densities() -> None:
    place = planar(2.0, 1.0)
    value = np.asarray(draw(gaussian_contact(), place, True).value, np.float64)
    assert_mean(value, np.array([2.0, 1.0]))
    off = value - [2.0, 1.0]
    assert_mean(off[:, :, None] * off[:, None, :], COVARIANCE)
    value = np.asarray(draw(BearingContact(SENSOR, 0.3), place, True).value, np.float64)
    off = (value - np.arctan2(1.0, -68.0) + np.pi) % (2 * np.pi) - np.pi
    assert stats.kstest(off, stats.norm(scale=0.3).cdf).pvalue > 1e-5
    assert np.all(np.abs(value) <= np.float32(np.pi))
    detection = likelihoods()["detection"]
    near = planar(SENSOR[0] + 33.0, SENSOR[1])
    assert_mean(draw(detection, near, True).value, 0.02 + 0.88 * np.exp(-9 / 50))
    assert_mean(draw(detection, near, False).value, 0.3)


def test_together_is_the_product_of_the_ratios() -> None:
    """stone2002, figure 3: bearing and detection."""
    bearing, detection = likelihoods()["bearing"], likelihoods()["detection"]
    scans = contact(jnp.radians(135.0)), contact(jnp.array(True))
    mesh = planar(np.linspace(0.0, 100.0, 7)[:, None], np.linspace(-50.0, 50.0, 5)[None, :])
    actual = Together((bearing, detection)).log_ratio(scans, mesh)
    np.testing.assert_array_equal(actual, bearing.log_ratio(scans[0], mesh) + detection.log_ratio(scans[1], mesh))


@pytest.mark.parametrize(
    ("build", "expected"),
    [
        (lambda: GaussianContact(("x",), jnp.eye(2), LOW, HIGH), "have 2, 2 and 2 components; expected 1."),
        (lambda: GaussianContact(("x", "y"), jnp.eye(2), HIGH, LOW), "is not below high"),
        (lambda: BearingContact(SENSOR, 0.0), "error is 0; expected above 0."),
        (lambda: convergence_zones(30.0, 3.0, best=1.0), "expected 0 < worst <= best < 1, and lengths above 0."),
    ],
)
def test_what_cannot_be_used_is_said(build: object, expected: str) -> None:
    with pytest.raises(InputError) as raised:
        build()
    assert expected in str(raised.value)
