"""The learnt background of returns: its tail by inverting the distribution, its rates by integrating over shares, and
both found again in drawn noise."""

import math

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from faintrack.beliefs.axis import Axis
from faintrack.sensors.active import ActiveSonar, Ping, Pulse, ping
from faintrack.signal.returns_background import (
    MEMORY,
    SHAPES,
    UNEVEN,
    VAGUE,
    Heard,
    ReturnsBackground,
    level,
    profile,
    returns_background,
    scale,
)

THRESHOLD = 6.0
CAPACITY = 2048
SONAR = ActiveSonar(Pulse(2350.0, 1.0, 50.0), Axis(4.0, 0.02, 1000), 64, math.radians(5), None)


def drawn(rng: np.random.Generator, power: np.ndarray) -> Ping:
    """Returns of a ping, from the power of every bin."""
    bins = np.argwhere(power > THRESHOLD)
    return ping(SONAR, 0.0, np.pad(bins, ((0, 0), (0, 1))), power[power > THRESHOLD], CAPACITY)


def learnt(background: ReturnsBackground, pings: list[Ping]) -> Heard:
    heard = background.init()
    for one in pings:
        heard = background.learn(heard, one, background.read(heard, one), jnp.zeros(CAPACITY))
    return heard


@pytest.mark.parametrize("shape", [0.03, 0.2])
@pytest.mark.parametrize("level", [0.8, 1.3, 2.0])
def test_scale_is_that_of_the_tail_at_the_threshold(shape: float, level: float) -> None:
    """P(Z > z) = (1 + shape z / level)^(-1 / shape), written down once more; an excess of one scale."""

    def tail(z: float) -> float:
        return (1 + shape * z / level) ** (-1 / shape)

    sigma = float(scale(jnp.asarray(tail(THRESHOLD)), jnp.asarray(shape), THRESHOLD))
    beyond = tail(THRESHOLD + sigma) / tail(THRESHOLD)
    assert beyond == pytest.approx((1 + shape) ** (-1 / shape), rel=1e-4)


@pytest.mark.parametrize("shape", [0.0, 0.05, 0.3])
def test_powers_are_as_rare_in_noise_of_mean_1(shape: float) -> None:
    """The excess that a share of all exceeds, found by bisection in the tail of the level that has the ping's rate, is
    read as the logarithm of the share."""
    background = returns_background(SONAR, THRESHOLD, shape)
    count, shares = 1000, np.array([0.9, 0.5, 0.1, 1e-3, 1e-6])

    def tail(z: float, level: float) -> float:
        return math.exp(-z / level) if shape == 0 else (1 + shape * z / level) ** (-1 / shape)

    # Evenly, so that every profile is nearly 1: the first few bins have one rate, that of the whole.
    number = np.arange(count) * 64
    bins = np.stack([number // 64, np.arange(count) % 64, np.zeros(count, int)], axis=1)
    before = background.read(background.init(), ping(SONAR, 0.0, bins, np.full(count, 9.0), CAPACITY))
    rate = float(before.ping.rate[0])
    assert rate == pytest.approx(float(before.expected) / SONAR.size, rel=1e-3)
    level = brentq(lambda level: tail(THRESHOLD, level) - rate, 0.1, 10)
    excess = [
        brentq(lambda y, share=share: tail(THRESHOLD + y, level) / rate - share, 0, 1e4, xtol=1e-9) for share in shares
    ]
    power = np.full(count, 9.0)
    power[: len(shares)] = THRESHOLD + np.array(excess)
    read = background.read(background.init(), ping(SONAR, 0.0, bins, power, CAPACITY))
    np.testing.assert_allclose(read.ping.power[: len(shares)] - THRESHOLD, -np.log(shares), rtol=2e-4)


@pytest.mark.parametrize(("count", "expected"), [(0, 1.7), (3, 1.7), (90, 1.7), (45, 38.0)])
def test_level_is_the_posterior_mean(count: int, expected: float) -> None:
    """By integrating over the logarithm of the factor, whose density beforehand is Gamma's."""

    def any_factor(power: float) -> float:
        def joint(log: float) -> float:
            density = VAGUE * (math.log(VAGUE) + log - math.exp(log)) - math.lgamma(VAGUE)
            return math.exp(power * log + count * (math.log(expected) + log) - expected * math.exp(log) + density)

        return sum(quad(joint, *ends, epsabs=0, epsrel=1e-10, limit=500)[0] for ends in ((-300, -3), (-3, 8)))

    even = (1 - UNEVEN) * expected**count * math.exp(-expected)
    found = float(level(jnp.asarray(float(count)), jnp.asarray(expected)))
    mean = (even + UNEVEN * any_factor(1)) / (even + UNEVEN * any_factor(0))
    assert found == pytest.approx(mean, rel=2e-4)


@pytest.mark.parametrize(("left", "right", "size"), [(7.0, 2.0, 0.5), (3.0, 40.0, 0.25), (20.0, 22.0, 0.5)])
def test_profile_is_the_posterior_mean(left: float, right: float, size: float) -> None:
    """Of two stretches, by integrating over the share that falls into the left one."""
    prior = 2 * size, 2 * (1 - size)
    beta = math.gamma(prior[0]) * math.gamma(prior[1]) / math.gamma(2)

    def any_share(power: float) -> float:
        return quad(
            lambda s: s ** (left + prior[0] - 1 + power) * (1 - s) ** (right + prior[1] - 1) / beta, 0, 1, epsabs=0
        )[0]

    even = (1 - UNEVEN) * size**left * (1 - size) ** right
    expected = (even * size + UNEVEN * any_share(1)) / (even + UNEVEN * any_share(0))
    found = profile(jnp.array([left, right]), jnp.array([size, 1 - size]))
    np.testing.assert_allclose(found, [expected / size, (1 - expected) / (1 - size)], rtol=2e-4)


def test_rates_keep_their_mean() -> None:
    """However the counts are spread: as many returns are expected as of the level alone."""
    rng = np.random.default_rng(0)
    for count in (64, 100):
        sizes = np.bincount(np.arange(count) * 128 // count, minlength=128) / count
        counts = rng.poisson(rng.gamma(0.3, 20.0, size=128)) * (sizes > 0)
        rates = profile(jnp.asarray(counts, float), jnp.asarray(sizes))
        assert float(rates @ sizes) == pytest.approx(1, abs=1e-5)


def test_levels_by_delay_and_bearing_are_found_again() -> None:
    """Twice the noise in the first fifth of the delays, three times as many returns in a quarter of the beams: rates
    within five standard errors of 20 pings in a stretch, 500 returns at least, and a tenth for what halves leave."""
    rng = np.random.default_rng(1)
    rate = np.exp(-THRESHOLD / np.where(np.arange(1000) < 200, 2.0, 1.0))[:, None] * np.where(
        np.arange(64) < 16, 3.0, 1
    )
    background = returns_background(SONAR, THRESHOLD)
    mean = THRESHOLD / -np.log(rate)
    pings = [drawn(rng, mean * rng.exponential(size=(1000, 64))) for _ in range(21)]
    read = background.read(learnt(background, pings[:-1]), pings[-1])
    bins = np.asarray(read.ping.bins)[np.asarray(read.ping.there)]
    off = np.log(np.asarray(read.ping.rate)[: len(bins)] / rate[bins[:, 0], bins[:, 1]])
    assert np.mean(np.abs(off)) < 0.1
    # One stretch of eight delays has both.
    assert np.quantile(np.abs(off), 0.95) < 5 / math.sqrt(500) + 0.1


def test_a_ridge_of_doppler_that_ends_is_found_again() -> None:
    """One bin of 32 exceeds the threshold 125 times as often over the first quarter of the delays. Profiles alone have
    0.63 of its rate there and 16 times the rate beyond; found within a tenth, and beyond, of few returns, a half."""
    rng = np.random.default_rng(5)
    sonar = ActiveSonar(Pulse(2000.0, 1.0), Axis(4.0, 0.05, 128), 16, 0.3, Axis(-31.0, 2.0, 32), None, (3, 3, 3))
    rate = np.full((128, 16, 32), 0.002)
    rate[:32, :, 16] = 0.25
    background = returns_background(sonar, THRESHOLD)
    heard, on, beyond = background.init(), [], []
    for number in range(16):
        bins = np.argwhere(rng.random(rate.shape) < rate)
        one = ping(sonar, 0.0, bins, THRESHOLD + rng.exponential(size=len(bins)), CAPACITY)
        read = background.read(heard, one)
        heard = background.learn(heard, one, read, jnp.zeros(CAPACITY))
        bins = np.asarray(one.bins)[np.asarray(one.there)]
        if number >= 8:
            over = np.log(np.asarray(read.ping.rate)[: len(bins)] / rate[tuple(bins.T)])
            on.extend(over[(bins[:, 0] < 32) & (bins[:, 2] == 16)])
            beyond.extend(over[(bins[:, 0] >= 32) & (bins[:, 2] == 16)])
    assert np.median(np.abs(on)) < 0.1
    assert np.median(np.abs(beyond)) < 0.5


@pytest.mark.parametrize(("cells", "shape"), [(math.inf, 0.0), (32, 1 / 32), (8, 1 / 8)])
def test_shape_of_a_normaliser_is_found_again(cells: float, shape: float) -> None:
    """Noise over its mean in N cells has the shape 1/N. Ten pings have n = 1600 returns at least, whose excess alone
    tells the shape to 1 / (5 sqrt(n)) = 0.005; five of that, and half of a step of `SHAPES`."""
    rng = np.random.default_rng(2)
    background = returns_background(SONAR, THRESHOLD)
    pings = []
    for _ in range(11):
        power = rng.exponential(size=(1000, 64))
        pings.append(drawn(rng, power if math.isinf(cells) else power / rng.gamma(cells, 1 / cells, size=power.shape)))
    read = background.read(learnt(background, pings[:-1]), pings[-1])
    step = np.diff(SHAPES)[np.searchsorted(SHAPES, shape) - (shape > 0)]
    assert float(read.shape) == pytest.approx(shape, abs=0.025 + step / 2)
    # What is read is exponential: the mean of n excesses within five standard errors, and what the shape is off by.
    excess = np.asarray(read.ping.power)[np.asarray(read.ping.there)] - THRESHOLD
    assert excess.mean() == pytest.approx(1, abs=5 / math.sqrt(len(excess)) + 0.05)


def test_what_targets_account_for_is_not_learnt() -> None:
    background = returns_background(SONAR, THRESHOLD)
    one = drawn(np.random.default_rng(3), np.random.default_rng(3).exponential(size=(1000, 64)))
    start = background.init()
    heard = background.learn(start, one, background.read(start, one), jnp.ones(CAPACITY))
    assert float(heard.pings) == 1
    for counts in (*heard.returns, heard.blocks, heard.fits):
        assert not np.any(counts)


def test_memory_is_bounded() -> None:
    """After many pings as many as `MEMORY` are remembered, of each its returns."""
    background = returns_background(SONAR, THRESHOLD)
    one = drawn(np.random.default_rng(4), np.random.default_rng(4).exponential(size=(1000, 64)))
    read = background.read(background.init(), one)
    heard = background.init()
    for _ in range(400):
        heard = background.learn(heard, one, read, jnp.zeros(CAPACITY))
    assert float(heard.pings) == pytest.approx(MEMORY, rel=1e-3)
    assert float(heard.returns[0].sum()) == pytest.approx(MEMORY * int(one.there.sum()), rel=1e-3)
