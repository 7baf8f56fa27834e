"""Means of the ratio over the cells of a grid: against the sum over the whole mesh, and against dense random states."""

import dataclasses
import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.beliefs.belief import Belief, update
from faintrack.errors import InputError
from faintrack.likelihoods.contacts import Together
from faintrack.likelihoods.exceedances import FADES, STEADY, ExceedanceLikelihood
from faintrack.likelihoods.guided import Guided
from faintrack.sensors.active import ActiveSonar, Ping, ping
from faintrack.sensors.bistatic import Bistatic, fixed
from tests.sonar import (
    RECEIVER,
    SONARS,
    SOURCE,
    count_points,
    grid,
    log_ratio,
    mean_ratios,
    pair,
    sweep,
    tone,
)
from tests.tolerances import assert_equal, rounding

SNR, THRESHOLD = 8.0, 5.0
SWATH = (2, 2, 2)
CAPACITY = 12
OPERATIONS = 3000
"""Roundings in a sum over a few hundred points, each with its shares of Doppler."""
PLACES = {
    "apart": (SOURCE, RECEIVER),
    "receiver on an edge": (SOURCE, (-1000.0, 500.0)),
    "source outside": ((5000.0, 1000.0), RECEIVER),
}
BINS = [[0, 0, 0], [11, 7, 6], [11, 0, 0], [0, 7, 3], [5, 2, 3], [6, 2, 3], [6, 3, 4], [8, 5, 1]]
"""At both ends of all axes, on either side of the first beam, and three whose swaths overlap."""
POWER = [30.0, 8.0, 6.0, 14.0, 60.0, 9.0, 25.0, 7.0]

kinds = pytest.mark.parametrize("kind", SONARS)


def names_of(sonar: ActiveSonar) -> tuple[str, ...]:
    return ("x", "y") if sonar.doppler is None else ("x", "y", "vx", "vy")


def returns_of(sonar: ActiveSonar) -> tuple[np.ndarray, np.ndarray]:
    """As above; the last delay is the sonar's own, and without Doppler there is one bin of it."""
    bins = np.array(BINS)
    bins[1:3, 0] = sonar.shape[0] - 1
    return bins * [1, 1, sonar.doppler is not None], np.array(POWER)


def guided_of(sonar: ActiveSonar, finer: tuple[int, int, int] = (1, 4, 1), *names: str) -> Guided:
    likelihood = ExceedanceLikelihood(sonar, SNR, THRESHOLD)
    return Guided(likelihood, grid(*(names or names_of(sonar))), SWATH, finer)


def heard(sonar: ActiveSonar, bins: Any, power: Any, pair: Bistatic | None = None) -> Ping:
    return ping(sonar, 0.0, np.asarray(bins), np.asarray(power), CAPACITY, pair)


@pytest.mark.parametrize(
    ("kind", "finer", "name"),
    [("tone", (1, 4, 1), "apart"), ("sweep", (2, 3, 1), "receiver on an edge"), ("tone", (2, 3, 2), "source outside")],
)
def test_means_are_sums_over_the_whole_mesh(kind: str, finer: tuple[int, int, int], name: str, float64: type) -> None:
    """Every point once, in the swath of one return or of several; cells without a point have the ratio of their
    middle, but for the straight lines of its table, 0.02 nats. Shares of Doppler below 1e-12 are rounded here, which in
    cells that are 1e-9 in reach of a return of e^50 comes to 1e-3 nats."""
    source, receiver = PLACES[name]
    sonar = SONARS[kind](pair=Bistatic(fixed(*source), fixed(*receiver)))
    guided, returns = guided_of(sonar, finer), returns_of(sonar)
    found = np.asarray(log_ratio(guided, heard(sonar, *returns)))
    expected = np.log(mean_ratios(guided, source, receiver, *returns)).reshape(found.shape)
    empty = np.broadcast_to(
        count_points(guided.mesh, source, receiver)[0][:, :, *(None,) * (found.ndim - 2)] == 0, found.shape
    )
    assert expected.max() > 5
    off = np.abs(found - expected)[~empty]
    assert np.quantile(off, 0.95) < rounding(np.float64, OPERATIONS)
    assert off.max() < 1e-3
    np.testing.assert_allclose(found[empty], expected[empty], atol=0.03)


@pytest.mark.parametrize("fading", [STEADY, FADES], ids=["by bin", "by ping"])
def test_means_in_another_background_are_sums_over_the_whole_mesh(fading: Any, float64: type) -> None:
    """As above, of a sweep, with rates of the bins that lie up to twenty times apart."""
    sonar = sweep()
    likelihood = ExceedanceLikelihood(sonar, SNR, THRESHOLD, fading)
    guided, (bins, power) = Guided(likelihood, grid(*names_of(sonar)), SWATH), returns_of(sonar)
    rate = np.exp(np.random.default_rng(0).uniform(-7, -4, size=sonar.shape))
    told = heard(sonar, bins, power)
    told = dataclasses.replace(told, rate=jnp.asarray(rate)[tuple(told.bins.T)])
    found = np.asarray(log_ratio(guided, told))
    expected = np.log(mean_ratios(guided, SOURCE, RECEIVER, bins, power, rate)).reshape(found.shape)
    every = count_points(guided.mesh, SOURCE, RECEIVER)[0]
    assert expected.max() > 5
    assert np.abs(found - expected)[every > 0].max() < 1e-3


@pytest.mark.parametrize(("kind", "finer"), [("tone", (1, 4, 1)), ("sweep", (2, 3, 1))])
def test_every_point_is_sampled_once(kind: str, finer: tuple[int, int, int]) -> None:
    sonar = SONARS[kind]()
    guided, (bins, power) = guided_of(sonar, finer), returns_of(sonar)
    first = np.ceil(-np.array(finer) / 2).astype(int)
    end = first + np.array(finer) * sonar.shape
    steps = np.stack(
        np.meshgrid(
            *(np.arange(-s * f, s * f + 1) for s, f in zip(guided.swath, guided.mesh.finer, strict=True)), indexing="ij"
        )
    )
    points = (bins * finer)[:, :, None] + steps.reshape(3, -1)
    points[:, 1] %= finer[1] * sonar.beams
    points = points.transpose(0, 2, 1).reshape(-1, 3)
    inside = ((points >= first) & (points < end))[:, [0, 2]].all(axis=1)
    assert int(eqx.filter_jit(guided.samples)(heard(sonar, bins, power))) == len(np.unique(points[inside], axis=0))


@kinds
def test_sensors_that_move_give_the_same_means(kind: str) -> None:
    """Source and receiver of a ping that stand where those of the sonar do: equal but for rounding."""
    sonar, moving = SONARS[kind](), SONARS[kind](pair=None)
    returns = returns_of(sonar)
    first = log_ratio(guided_of(sonar), heard(sonar, *returns))
    second = log_ratio(guided_of(moving), heard(moving, *returns, pair()))
    assert_equal(first, second, np.float32, 100, scale=10.0)


def test_axes_may_come_in_any_order() -> None:
    sonar, names = tone(), ("vy", "x", "vx", "y")
    returns = returns_of(sonar)
    first = log_ratio(guided_of(sonar), heard(sonar, *returns))
    turned = log_ratio(guided_of(sonar, (1, 4, 1), *names), heard(sonar, *returns))
    order = [names_of(sonar).index(name) for name in names]
    assert_equal(turned, np.transpose(first, order), np.float32, 100, scale=10.0)


def test_a_sweep_says_nothing_about_velocity() -> None:
    """On a grid with velocities: one value along them."""
    sonar = sweep()
    returns = returns_of(sonar)
    flat = log_ratio(guided_of(sonar), heard(sonar, *returns))
    deep = log_ratio(guided_of(sonar, (1, 4, 1), "vx", "x", "vy", "y"), heard(sonar, *returns))
    assert deep.shape == (1, 9, 1, 7)
    assert_equal(deep[0, :, 0], flat, np.float32, 100, scale=10.0)


@kinds
def test_without_returns_there_is_less_than_nothing_to_hear(kind: str) -> None:
    """The default, and below 0 wherever an echo would be heard."""
    sonar = SONARS[kind]()
    guided = guided_of(sonar)
    nothing = np.zeros((0, 3), int), np.zeros(0)
    found = np.asarray(log_ratio(guided, heard(sonar, *nothing)))
    expected = np.log(mean_ratios(guided, SOURCE, RECEIVER, *nothing)).reshape(found.shape)
    assert np.mean(np.abs(found - expected) > 0.01) < 0.02
    assert found.max() <= 0
    assert found.min() < -1


@kinds
def test_what_is_not_heard_has_the_ratio_1(kind: str) -> None:
    """Cells in the blanked zone, beyond the last delay, and velocities outside the Doppler band: exactly 0 in logs,
    beside a return of power 400."""
    sonar = SONARS[kind]()
    guided, (bins, power) = guided_of(sonar), returns_of(sonar)
    found = np.asarray(log_ratio(guided, heard(sonar, bins, np.where(power > 10, 400.0, power))))
    every, audible = count_points(guided.mesh, SOURCE, RECEIVER)
    silent = (every > 0) & (audible == 0)
    x, y = np.meshgrid(*(dict(guided.mesh.grid.axes)[name].values for name in "xy"), indexing="ij")
    distance = np.hypot(x - RECEIVER[0], y - RECEIVER[1])
    assert silent[distance < 1000].any()
    assert silent[distance > 4000].any()
    assert not np.any(found[silent])
    assert np.all(found[audible > 0.2 * every].any(axis=tuple(range(1, found.ndim - 1))))


@kinds
def test_a_loud_return_is_finite(kind: str) -> None:
    """Ratios of e^350 in single precision: every cell is finite, and as in double precision, but for velocities that
    are e^80 below the best of their place. A point on the edge of a cell may count to either side."""
    sonar = SONARS[kind]()
    loud = returns_of(sonar)[0], np.array([400.0, 8.0, 6.0, 380.0, 400.0, 9.0, 25.0, 7.0])
    found = np.asarray(log_ratio(guided_of(sonar), heard(sonar, *loud)))
    assert np.all(np.isfinite(found))
    assert found.max() > 300
    with jax.enable_x64(True):
        exact = SONARS[kind]()
        expected = np.asarray(log_ratio(guided_of(exact), heard(exact, *loud)))
    velocities = tuple(range(2, found.ndim))
    counts = expected > np.max(expected, axis=velocities, keepdims=True) - 80
    assert np.mean((np.abs(found - expected) > 0.01)[counts]) < 0.02


def test_two_receivers_add_their_log_means(float64: type) -> None:
    """Together they are one likelihood, and two updates one after the other.

    A mean is a sum over hundreds of points, and its logarithm far below those of the largest: a thousand roundings.
    """
    sonar = tone()
    other = tone(pair=Bistatic(fixed(*SOURCE), fixed(1500.0, 1200.0)))
    both = guided_of(sonar), guided_of(other)
    bins, power = returns_of(sonar)
    pings = heard(sonar, bins, power), heard(other, bins[::-1][:4], power[:4])
    single = [log_ratio(guided, each) for guided, each in zip(both, pings, strict=True)]
    together = log_ratio(Together(both), pings)
    assert_equal(together, single[0] + single[1], float64, 1000, scale=10.0)
    cells = grid(*names_of(sonar))
    belief = Belief(cells.states(), jnp.full(cells.shape, -math.log(cells.size)), jnp.array(-2.0), jnp.array(0.0))
    at_once, log_gain = update(belief, together)
    first, gained = update(belief, single[0])
    second, more = update(first, single[1])
    assert_equal(log_gain, gained + more, float64, 1000, scale=10.0)
    assert_equal(at_once.log_odds, second.log_odds, float64, 1000, scale=10.0)
    assert_equal(at_once.log_weights, second.log_weights, float64, 1000, scale=10.0)


def test_what_cannot_be_used_is_said() -> None:
    likelihood = ExceedanceLikelihood(tone(), SNR, THRESHOLD)
    for swath in ((2, 4, 2), (-1, 2, 2)):
        with pytest.raises(InputError, match=r"guided: swath .*; expected at least 0, and less than half of the beams"):
            Guided(likelihood, grid(), swath)
    with pytest.raises(InputError, match="the grid has no axis vx; expected x, y, vx, vy"):
        Guided(likelihood, grid("x", "y"), SWATH)
    with pytest.raises(InputError, match=r"\(0, 4, 1\) points a bin; expected at least 1"):
        Guided(likelihood, grid(), SWATH, (0, 4, 1))


def test_an_echo_that_another_is_the_source_of_speaks_for_no_target_more() -> None:
    """Alone every bin of it speaks for a target; beside one that is there, none."""
    sonar = SONARS["sweep"]()
    guided = guided_of(sonar)
    around = [(i, j) for i in (-2, -1, 0, 1, 2) for j in (-1, 0, 1)]
    power = [60.0 * float(sonar.response(jnp.array(float(i)), jnp.array(float(j)), jnp.array(0.0))) for i, j in around]
    loud = [(value, [5 + i, 3 + j, 0]) for value, (i, j) in zip(power, around, strict=True) if value > THRESHOLD]
    echo = heard(sonar, [bins for _, bins in loud], [value for value, _ in loud])
    assert len(loud) > 3
    alone = guided.log_mean_ratio(echo)
    weights = jax.nn.log_softmax(alone.ravel()).reshape(alone.shape)
    expected = guided.part(echo, None, weights)
    beside = guided.log_mean_ratio(guided.beside(echo, expected[None], jnp.array([1.0])))
    assert float(alone.max()) > 20
    # Off the peak of an echo a bin that says nothing at it says 0.9 nats at most.
    assert float(beside.max()) < 2.0
    nothing = guided.log_mean_ratio(guided.beside(echo, expected[None], jnp.array([0.0])))
    np.testing.assert_allclose(nothing, alone, rtol=1e-5)
