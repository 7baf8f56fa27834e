"""Several receivers and sources of a sonar: sums over every bin, and what must not change the mean of a product."""

import dataclasses
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.beliefs.axis import Axis, between
from faintrack.beliefs.grids import Grid
from faintrack.errors import InputError
from faintrack.likelihoods.exceedances import ExceedanceLikelihood
from faintrack.likelihoods.guided import Guided
from faintrack.likelihoods.multistatic import Multistatic
from faintrack.sensors.active import Ping
from faintrack.sensors.bistatic import Bistatic, fixed
from faintrack.sensors.multistatic import Pings
from faintrack.targets.states import PlanarState
from tests.exact.test_guided import heard
from tests.sonar import SOURCE, every_bin, log_ratio, planar, sweep

SNR, THRESHOLD = 8.0, 5.0
RECEIVERS = (-200.0, 500.0), (1500.0, -700.0)
SWATH, FINER = (6, 3, 0), (4, 16, 1)
"""All that an echo reaches, and points close enough for an echo of a wide beam."""
STEEP = 10.0
"""Nats that a cell may lie below the highest beside it: where a loud return only grazes, the mean hangs on a corner."""
SMALL = Grid(PlanarState, (("x", between(1200.0, 3600.0, 4)), ("y", between(600.0, 3000.0, 4))))
TARGET = 2300.0, 1700.0


def guided_of(receiver: tuple[float, float], cells: Grid = SMALL, finer: tuple[int, int, int] = FINER) -> Guided:
    sonar = sweep(pair=Bistatic(fixed(*SOURCE), fixed(*receiver)))
    return Guided(ExceedanceLikelihood(sonar, SNR, THRESHOLD), cells, SWATH, finer)


def returns_near(guided: Guided, loud: float, *others: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Bins and powers: one return near the target, others at offsets from it in delay and bearing."""
    sonar = guided.likelihood.sonar
    place = np.round([float(each) for each in sonar.place(sonar.pair, fixed(*TARGET))]).astype(int)
    bins = np.array([place, *(place + np.array([*other, 0]) for other in others)])
    bins[:, 1] %= sonar.beams
    return bins, np.array([loud, *(0.4 * loud for _ in others)])


def scan_of(*pings: Ping, reported: tuple[bool, ...] = (True, True)) -> Pings:
    return Pings(jnp.zeros(()), pings, jnp.array(reported))


def plain(values: Any) -> np.ndarray:
    """Which cells are not only grazed."""
    values = np.asarray(values)
    padded = np.pad(values, 1, mode="edge")
    beside = np.max([padded[i : i + 4, j : j + 4] for i in range(3) for j in range(3)], axis=0)
    return values > beside - STEEP


def by_every_bin(guided: Guided, returns: tuple[np.ndarray, np.ndarray], x: np.ndarray, y: np.ndarray) -> np.ndarray:
    sonar = guided.likelihood.sonar
    place = np.stack([np.asarray(each) for each in sonar.place(sonar.pair, planar(x, y))], axis=1)
    return every_bin(sonar, SNR, THRESHOLD, *returns, place)


@pytest.mark.parametrize(
    ("second", "off"),
    [("crosses", ()), ("elsewhere", ((5, 3),)), pytest.param("nothing", (), marks=pytest.mark.slow)],
)
def test_means_are_those_of_the_product_bin_by_bin(second: str, off: tuple[Any, ...]) -> None:
    """2500 places a cell, evenly spaced, of which every bin is summed in double precision. Where both have returns in a
    cell, where only one has, and where the other's lie elsewhere: within half a nat."""
    both = [guided_of(receiver) for receiver in RECEIVERS]
    returns = [returns_near(both[0], 30.0, *off), returns_near(both[1], 22.0)]
    if second == "elsewhere":
        returns[1] = (returns[1][0] + [4, -2, 0], returns[1][1])
    if second == "nothing":
        returns[1] = np.zeros((0, 3), int), np.zeros(0)
    pings = [heard(each.likelihood.sonar, *one) for each, one in zip(both, returns, strict=True)]
    found = np.asarray(log_ratio(Multistatic(both), scan_of(*pings)))
    sides = [(np.arange(50) + 0.5) / 50 * axis.step + edge for _, axis in SMALL.axes for edge in axis.edges[:-1]]
    sides = np.reshape(sides, (2, 4, 50))
    expected = np.zeros((4, 4))
    for column, row in np.ndindex(4, 4):
        x, y = (each.ravel() for each in np.meshgrid(sides[0, column], sides[1, row], indexing="ij"))
        total = sum(by_every_bin(each, one, x, y) for each, one in zip(both, returns, strict=True))
        expected[column, row] = np.log(np.mean(np.exp(total)))
    assert plain(expected).sum() >= 3
    assert np.ptp(expected) > 3
    np.testing.assert_allclose(found[plain(expected)], expected[plain(expected)], atol=0.5)


def test_order_of_pairs_does_not_matter() -> None:
    both = [guided_of(receiver) for receiver in RECEIVERS]
    pings = [heard(each.likelihood.sonar, *returns_near(each, 25.0, (1, 0))) for each in both]
    one = log_ratio(Multistatic(both), scan_of(*pings))
    other = log_ratio(Multistatic(both[::-1]), scan_of(*pings[::-1]))
    # Patches are those of the pair that comes first where delays are as fine.
    np.testing.assert_allclose(one[plain(one)], other[plain(one)], atol=0.3)


@pytest.mark.slow
def test_pairs_of_other_bins_come_in_the_same_order() -> None:
    """With delays that are not as fine the pairs are put in order, so that the numbers are the same."""
    both = [guided_of(RECEIVERS[0]), guided_of(RECEIVERS[1], finer=(3, 16, 1))]
    pings = [heard(each.likelihood.sonar, *returns_near(each, 25.0)) for each in both]
    one = log_ratio(Multistatic(both), scan_of(*pings))
    other = log_ratio(Multistatic(both[::-1]), scan_of(*pings[::-1]))
    np.testing.assert_array_equal(one, other)


def test_a_pair_that_does_not_report_says_nothing() -> None:
    """Whatever its entries hold: the mean is that of the other alone, but for points between those of its mesh."""
    both = [guided_of(receiver) for receiver in RECEIVERS]
    pings = [heard(each.likelihood.sonar, *returns_near(each, 25.0)) for each in both]
    found = log_ratio(Multistatic(both), scan_of(*pings, reported=(True, False)))
    alone = log_ratio(both[0], pings[0])
    np.testing.assert_allclose(found[plain(alone)], alone[plain(alone)], atol=0.3)


def test_one_pair_is_itself() -> None:
    one = guided_of(RECEIVERS[0])
    ping = heard(one.likelihood.sonar, *returns_near(one, 25.0))
    found = log_ratio(Multistatic([one]), scan_of(ping, reported=(True,)))
    alone = log_ratio(one, ping)
    np.testing.assert_allclose(found[plain(alone)], alone[plain(alone)], atol=0.3)


@pytest.mark.slow
def test_sensors_that_move_give_the_same_means() -> None:
    both = [guided_of(receiver) for receiver in RECEIVERS]
    pings = [heard(each.likelihood.sonar, *returns_near(each, 25.0)) for each in both]
    moving = [Guided(ExceedanceLikelihood(sweep(pair=None), SNR, THRESHOLD), SMALL, SWATH, FINER) for _ in both]
    placed = [
        dataclasses.replace(ping, pair=each.likelihood.sonar.pair) for each, ping in zip(both, pings, strict=True)
    ]
    first = log_ratio(Multistatic(both), scan_of(*pings))
    np.testing.assert_allclose(log_ratio(Multistatic(moving), scan_of(*placed)), first, rtol=1e-3, atol=1e-3)


def test_what_cannot_be_used_is_said() -> None:
    with pytest.raises(InputError, match="no pair of a source and a receiver; expected one or more"):
        Multistatic([])
    other = Grid(PlanarState, (("x", Axis(0.0, 500.0, 4)), ("y", Axis(0.0, 500.0, 4))))
    with pytest.raises(InputError, match="pairs have different grids; expected one"):
        Multistatic([guided_of(RECEIVERS[0]), guided_of(RECEIVERS[1], other)])
