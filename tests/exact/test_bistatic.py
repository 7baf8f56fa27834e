"""Source, receiver and target in the plane: lengths of paths, and sound followed from front to front."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.sensors.bistatic import Bistatic, fixed
from faintrack.targets.states import PlanarState
from tests.tolerances import assert_equal

SPEED = 1500.0
OPERATIONS = 30
PLACES = np.array([[9000.0, 2000.0], [-700.0, 4000.0], [-3000.0, -8000.0], [200.0, 20_000.0], [0.0, -2000.0]])
"""Metres. The last lies on the line through source and receiver, behind the source."""
PAIRS = {"bistatic": ((0.0, 0.0), (0.0, 5000.0)), "monostatic": ((300.0, -200.0), (300.0, -200.0))}

pairs = pytest.mark.parametrize("name", PAIRS)


def pair_of(name: str) -> Bistatic:
    source, receiver = PAIRS[name]
    return Bistatic(fixed(*source), fixed(*receiver), SPEED)


def moving(position: object, velocity: object) -> PlanarState:
    return PlanarState(*(jnp.asarray(each, float) for each in (*np.asarray(position).T, *np.asarray(velocity).T)))


@pairs
def test_an_echo_comes_from_the_place_of_its_delay_and_bearing(name: str, dtype: type) -> None:
    """The nearer the path to the direct one, the more its difference is rounded; here it is above 1/10 of it."""
    pair, states = pair_of(name), moving(PLACES, np.zeros((5, 2)))
    delay, bearing = pair.echo(states)
    assert delay.dtype == dtype
    (sx, sy), (rx, ry) = PAIRS[name]
    path = np.hypot(*(PLACES - [sx, sy]).T) + np.hypot(*(PLACES - [rx, ry]).T)
    assert_equal(delay, path / SPEED, dtype, OPERATIONS)
    assert_equal(jnp.stack(pair.position(delay, bearing), axis=1), PLACES, dtype, 10 * OPERATIONS, scale=2e4)


def test_range_is_that_of_the_paper(dtype: type) -> None:
    """aughenbaugh2010, eq. 15-16, term by term."""
    tau, phi = np.array([4.4, 10.0, 34.0])[:, None], np.radians(np.arange(0.0, 360.0, 15.0))
    (sx, sy), (rx, ry) = PAIRS["bistatic"]
    apart, psi = np.hypot(sx - rx, sy - ry), np.arctan2(sy - ry, sx - rx)
    share = apart / (SPEED * tau)
    expected = SPEED * tau / 2 * (1 - share**2) / (1 - share * np.cos(phi - psi))
    pair = pair_of("bistatic")
    assert_equal(pair.distance(jnp.asarray(tau, dtype), jnp.asarray(phi, dtype)), expected, dtype, 10 * OPERATIONS)
    assert_equal(pair.separation[0], apart, dtype, OPERATIONS)


def test_source_and_receiver_in_one_place(dtype: type) -> None:
    """Twice the range, and the Doppler shift of a mirror that moves."""
    pair = pair_of("monostatic")
    assert_equal(pair.distance(jnp.asarray([1.0, 20.0], dtype), jnp.zeros(2, dtype)), [750.0, 15_000.0], dtype, 10)
    away = moving([[8300.0, -200.0]], [[6.0, 9.0]])
    assert_equal(pair.doppler(away, 1000.0), [1000 * ((SPEED - 6) / (SPEED + 6) - 1)], dtype, 10, scale=1000.0)


def test_nothing_comes_before_the_direct_sound() -> None:
    """The range is 0 there; behind the source, where no delay tells places apart, it is finite."""
    pair = pair_of("bistatic")
    towards_source = -np.pi / 2
    delay = jnp.array([0.0, 1.0, 5000 / SPEED, 5000 / SPEED, 9000 / SPEED])
    bearing = jnp.array([0.3, towards_source, towards_source, 1.0, towards_source])
    distance = pair.distance(delay, bearing)
    assert_equal(distance, [0.0, 0.0, 0.0, 0.0, 7000.0], np.float32, 10 * OPERATIONS)
    x, y = pair.position(delay[:2], bearing[:2])
    assert x.tolist() == [0.0, 0.0]
    assert y.tolist() == [5000.0, 5000.0]


def arrival(emitted: float, source: tuple, target: tuple, receiver: tuple) -> tuple[float, np.ndarray, np.ndarray]:
    """When a wavefront arrives, and where target and receiver are when it meets them."""

    def meets(time: float, start: np.ndarray, position: np.ndarray, velocity: np.ndarray) -> float:
        """When sound that leaves `start` reaches what moves: |position + velocity t - start| = c (t - time)."""
        off = position + velocity * time - start
        a, b, c = SPEED**2 - velocity @ velocity, off @ velocity, off @ off
        return time + (b + np.sqrt(b * b + a * c)) / a

    at_target = meets(emitted, source[0] + source[1] * emitted, *target)
    where = target[0] + target[1] * at_target
    at_receiver = meets(at_target, where, *receiver)
    return at_receiver, where, receiver[0] + receiver[1] * at_receiver


VELOCITIES = np.array([[4.0, -7.0], [11.0, 5.0], [-3.0, 9.0]])
"""Of source, target and receiver; m/s."""


@pytest.mark.parametrize("place", PLACES, ids=str)
def test_doppler_is_the_rate_at_which_wavefronts_arrive(place: np.ndarray, float64: type) -> None:
    """Two wavefronts 10 ms apart. Eq. 17 is exact with the places where sound leaves, turns and arrives; with all
    places at one time the directions are off by the speed over that of sound, and the shift by the square of it."""
    frequency, gap = 2000.0, 0.01
    begin = [np.array([0.0, 0.0]), place, np.array([100.0, 5000.0])]

    def both(share: float) -> tuple[float, float, float]:
        motion = [(start, share * velocity) for start, velocity in zip(begin, VELOCITIES, strict=True)]
        fronts = [arrival(time, *motion)[0] for time in (-gap / 2, gap / 2)]
        _, turned, arrived = arrival(0.0, *motion)
        true = frequency * (gap / (fronts[1] - fronts[0]) - 1)
        source, target, receiver = (moving(*each) for each in motion)
        at_once = Bistatic(source, receiver, SPEED).doppler(target, frequency)
        pair = Bistatic(source, moving(arrived, motion[2][1]), SPEED)
        return true, float(pair.doppler(moving(turned, motion[1][1]), frequency)), float(at_once)

    true, retarded, at_once = both(1.0)
    assert abs(retarded - true) < 1e-7
    assert abs(at_once - true) < 6 * frequency * (12 / SPEED) ** 2
    slow_true, _, slow = both(0.1)
    assert abs(slow - slow_true) < 0.011 * abs(at_once - true) + 1e-7


@pairs
def test_the_gradient_is_that_of_a_slow_target(name: str, float64: type) -> None:
    """By differentiation at rest; at 12 m/s it is off by up to 3 v/c."""
    pair, frequency = pair_of(name), 2500.0

    def shift(velocity: jax.Array, place: jax.Array) -> jax.Array:
        return pair.doppler(PlanarState(*place, *velocity), frequency)

    slopes = jax.vmap(jax.grad(shift), in_axes=(None, 0))
    at_rest, fast = (slopes(jnp.array(velocity), jnp.array(PLACES)) for velocity in ([0.0, 0.0], [-7.0, 9.7]))
    ours = jnp.stack(pair.doppler_gradient(moving(PLACES, np.ones((5, 2))), frequency), axis=1)
    assert_equal(ours, at_rest, np.float64, OPERATIONS, scale=10.0)
    np.testing.assert_allclose(ours, fast, atol=3 * 12 / SPEED * 2 * frequency / SPEED)


def test_lines_of_equal_doppler_are_those_of_the_paper(float64: type) -> None:
    """aughenbaugh2010, eq. 18: the slope of the line across the gradient."""
    pair = pair_of("bistatic")
    (sx, sy), (rx, ry) = PAIRS["bistatic"]
    x, y = PLACES[:3].T
    to_receiver, to_source = np.hypot(rx - x, ry - y), np.hypot(sx - x, sy - y)
    slope = -((rx - x) / to_receiver + (sx - x) / to_source) / ((ry - y) / to_receiver + (sy - y) / to_source)
    along_x, along_y = pair.doppler_gradient(moving(PLACES[:3], np.zeros((3, 2))), 1000.0)
    assert_equal(-along_x / along_y, slope, np.float64, 10 * OPERATIONS)


def test_a_platform_in_the_place_of_a_target_is_finite() -> None:
    pair = pair_of("bistatic")
    here = fixed(0.0, 0.0)
    assert np.all(np.isfinite([pair.doppler(here, 1000.0), *pair.doppler_gradient(here, 1000.0), *pair.echo(here)]))
