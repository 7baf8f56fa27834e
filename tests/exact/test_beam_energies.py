"""Energies of beams against densities multiplied out, sources from elsewhere summed over, and plane geometry."""

import dataclasses
import itertools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import norm

from faintrack.errors import InputError
from faintrack.likelihoods.beam_energies import (
    LEVELS,
    MOST_ELSEWHERE,
    SOURCES,
    BeamEnergies,
    beside,
    occupied_log_ratios,
    region_log_ratio,
    set_log_ratio,
)
from faintrack.sensors.stations import EnergyScan, Fans, Stations
from faintrack.targets.states import BearingState, PlanarState
from tests.tolerances import assert_mean, rounding

TEN = math.radians(10)
FANS = Fans((0.0, -math.pi), (TEN, TEN), (19, 36), (True, False))
"""A line and an array that hears the full circle, ten degrees from beam to beam."""

EAST = Stations(jnp.array([0.0, 700.0]), jnp.array([0.0, 50.0]), jnp.array([math.pi / 2, 0.0]))
MODEL = BeamEnergies(FANS, np.array([1.0, 2.0]), np.array([0.5, 1.0]), np.array([3.0, 4.5]), np.array([0.7, 1.0]))


def planar(x: np.ndarray, y: np.ndarray) -> PlanarState:
    return PlanarState(jnp.asarray(x), jnp.asarray(y), jnp.zeros(()), jnp.zeros(()))


def scan(rng: np.random.Generator) -> EnergyScan:
    usable = np.arange(36) < np.array([[19], [36]])
    return EnergyScan(jnp.array(0.0), jnp.asarray(rng.normal(2.0, 1.5, (2, 36))), jnp.asarray(usable), EAST)


def test_beams_of_a_line_and_a_circle_follow_from_plane_geometry(float64: type) -> None:
    x, y = np.random.default_rng(0).uniform(-900, 900, (2, 500))
    line, circle = np.asarray(FANS.beams(EAST, planar(x, y)))
    # The angle from the east axis, whichever side; and clockwise from north, seen from the second array.
    from_axis = np.degrees(np.arccos(x / np.hypot(x, y)))
    from_north = (90 - np.degrees(np.angle((x - 700) + 1j * (y - 50)))) % 360
    np.testing.assert_array_equal(line, np.round(from_axis / 10))
    np.testing.assert_array_equal(circle, np.round((from_north + 180) / 10) % 36)


def test_a_line_cannot_tell_its_sides_apart_and_may_be_turned(float64: type) -> None:
    turned = Stations(jnp.zeros(2), jnp.zeros(2), jnp.full(2, math.radians(30)))
    ahead = planar(
        np.array([math.sin(math.radians(30)), math.sin(math.radians(80)), math.sin(math.radians(-20))]),
        np.array([math.cos(math.radians(30)), math.cos(math.radians(80)), math.cos(math.radians(-20))]),
    )
    assert FANS.beams(turned, ahead)[0].tolist() == [0, 5, 5]


def test_a_bearing_of_its_own_needs_no_place() -> None:
    states = BearingState(jnp.array([0.0, 0.5, 4.0]), jnp.zeros(3), jnp.zeros(3))
    assert FANS.beams(EAST, states)[0].tolist() == [0, 3, -1]


def test_joint_ratio_is_the_product_over_all_beams(float64: type) -> None:
    """kreucher2011, eq. 28, every beam multiplied out, two of three targets in one beam of an array."""
    rng = np.random.default_rng(1)
    here = scan(rng)
    x, y = rng.uniform(-900, 900, (2, 3, 40))
    x[1, :10], y[1, :10] = x[0, :10], y[0, :10]
    there = rng.random((3, 40)) < 0.7
    beams = np.asarray(FANS.beams(EAST, planar(x, y)))
    joint = np.array([[True, True, False], [True, True, False], [False, False, True]])
    table = MODEL.table(here, 3)
    found = jax.jit(occupied_log_ratios)(table, jnp.asarray(beams), jnp.asarray(there), jnp.asarray(joint))
    without, own = map(np.asarray, found)
    with_it = without + own.sum(axis=0)
    energy = np.asarray(here.energy)

    def direct(members: list[int], particle: int) -> float:
        total = 0.0
        for array in range(2):
            counts = np.bincount(beams[array, members, particle], minlength=36) if members else np.zeros(36, int)
            mean0, std0, mean1, std1 = (
                np.asarray(value)[array]
                for value in (MODEL.absent_mean, MODEL.absent_std, MODEL.present_mean, MODEL.present_std)
            )
            mean = mean0 + counts * (mean1 - mean0)
            std = np.sqrt(std0**2 + counts * (std1**2 - std0**2))
            total += np.sum(norm.logpdf(energy[array], mean, std) - norm.logpdf(energy[array], mean0, std0))
        return total

    for target, particle in itertools.product(range(3), range(40)):
        others = [u for u in range(3) if joint[target, u] and u != target and there[u, particle]]
        tolerance = rounding(np.float64, 2000) * 100
        assert abs(without[target, particle] - direct(others, particle)) < tolerance
        assert abs(with_it[target, particle] - direct([*others, target], particle)) < tolerance


def test_one_target_has_the_ratio_of_its_beams(float64: type) -> None:
    here = scan(np.random.default_rng(2))
    states = planar(np.array([200.0, -400.0]), np.array([300.0, 100.0]))
    beams = np.asarray(FANS.beams(EAST, states))
    expected = [
        sum(
            norm.logpdf(here.energy[j, b[j]], MODEL.present_mean[j], MODEL.present_std[j])
            - norm.logpdf(here.energy[j, b[j]], MODEL.absent_mean[j], MODEL.absent_std[j])
            for j in range(2)
        )
        for b in beams.T
    ]
    np.testing.assert_allclose(MODEL.log_ratio(here, states), expected, rtol=rounding(np.float64, 1000))


@pytest.mark.parametrize("most", [1, 3])
@pytest.mark.parametrize("elsewhere", [0.0, 0.01, 0.1, MOST_ELSEWHERE])
def test_targets_beside_sources_from_elsewhere_are_the_sum_over_their_number(
    elsewhere: float, most: int, float64: type
) -> None:
    """Forty sources multiplied out; the likelihood ends the sum, which leaves out a share e^(SOURCES + 1) at most."""
    here = scan(np.random.default_rng(3))
    table = np.asarray(dataclasses.replace(MODEL, elsewhere=elsewhere).table(here, most))
    mean0, std0, mean1, std1 = (np.asarray(getattr(MODEL, name))[:, None] for name in LEVELS)

    def density(targets: int) -> np.ndarray:
        shares = [(targets + k, elsewhere**k) for k in range(41)]
        return sum(
            share * norm.pdf(here.energy, mean0 + n * (mean1 - mean0), np.sqrt(std0**2 + n * (std1**2 - std0**2)))
            for n, share in shares
        )

    expected = np.stack([np.log(density(n) / density(0)) for n in range(most + 1)], axis=-1)
    rest = elsewhere ** (SOURCES + 1) / (1 - elsewhere)
    usable = np.asarray(here.usable)
    np.testing.assert_allclose(
        table[:, :-1][usable], expected[usable], atol=2 * rest + rounding(np.float64, 1000) * 100
    )


@pytest.mark.parametrize("elsewhere", [0.01, 0.1])
def test_no_beam_speaks_for_a_target_beyond_one_over_the_probability_of_another_source(
    elsewhere: float, float64: type
) -> None:
    model = BeamEnergies(Fans((0.0,), (TEN,), (2000,), (False,)), 0.0, 1.0, 2.0, 1.0, elsewhere)
    energy = jnp.linspace(-20.0, 500.0, 2000)[None]
    loud = EnergyScan(jnp.array(0.0), energy, jnp.ones(energy.shape, bool), EAST)
    table = np.asarray(model.table(loud, 3))[0, :-1]
    bound, tolerance = -np.arange(4) * math.log(elsewhere), rounding(np.float64, 1000) * 1000
    assert np.all(table <= bound + tolerance)
    # A loud beam reaches it, and a silent one is not bounded.
    np.testing.assert_allclose(table[-1], bound, atol=tolerance)
    assert table[0, 1] < -30


def integrals(level: float, elsewhere: float) -> dict[str, float]:
    """Means of a beam's ratio for one target, and of its logarithm, by the trapezoidal rule over energy."""
    energy = np.linspace(-9.0, 9.0 + 10 * level, 20_001)
    model = BeamEnergies(Fans((0.0,), (TEN,), (len(energy),), (False,)), 0.0, 1.0, level, 1.0, elsewhere)
    here = EnergyScan(jnp.array(0.0), jnp.asarray(energy)[None], jnp.ones((1, len(energy)), bool), EAST)
    log_ratio = np.asarray(model.table(here))[0, :-1, 1]
    noise, target = norm.pdf(energy), norm.pdf(energy, level)
    other = sum((1 - elsewhere) * elsewhere**k * norm.pdf(energy, k * level) for k in range(11))
    return {
        "of nothing": float(np.trapezoid(np.exp(log_ratio) * other, energy)),
        "of noise": float(np.trapezoid(np.exp(log_ratio) * noise, energy)),
        "log at a target": float(np.trapezoid(log_ratio * target, energy)),
        "log at none": float(np.trapezoid(log_ratio * noise, energy)),
    }


@pytest.mark.parametrize("level", [0.5, 1.0, 2.0, 3.0, 5.0])
@pytest.mark.parametrize("elsewhere", [0.0, 0.01, 0.03, 0.1])
def test_an_array_more_is_evidence_more(level: float, elsewhere: float, float64: type) -> None:
    """The mean ratio is 1 over a beam that may hold others, and the mean log ratio has the sign of the truth."""
    means = integrals(level, elsewhere)
    rest = elsewhere ** (SOURCES + 1)
    assert means["of nothing"] == pytest.approx(1.0, abs=2 * rest + 1e-9)
    assert means["of noise"] <= 1 / (1 - elsewhere) + 1e-9
    assert means["log at none"] < 0 < means["log at a target"]


def test_energies_are_drawn_from_the_densities(float64: type) -> None:
    """Mean and variance of beams with one target, within five standard errors; sources from elsewhere are geometric."""
    e, count = 0.1, 200_000
    model = BeamEnergies(Fans((0.0,), (TEN,), (count,), (False,)), 0.0, 1.0, 3.0, 1.5, e)
    energy = np.asarray(model.energies(jnp.ones((1, count), int), jax.random.key(0)))[0]
    assert_mean(energy, 3 * (1 + e / (1 - e)))
    variance = 1 + 1.25 * (1 + e / (1 - e)) + 9 * e / (1 - e) ** 2
    assert_mean((energy - 3 * (1 + e / (1 - e))) ** 2, variance)


def test_what_one_array_hears_alone_counts_against_a_target_only() -> None:
    ratios = jnp.array([[3.0, -3.0, 3.0], [5.0, 5.0, -1.0]])
    heard = jnp.array([[True, True, True], [False, False, True]])
    assert region_log_ratio(ratios, heard).tolist() == [0.0, -3.0, 2.0]
    assert region_log_ratio(ratios[:1], heard[:1]).tolist() == [3.0, -3.0, 3.0]


def test_beams_that_are_not_usable_say_nothing() -> None:
    here = scan(np.random.default_rng(4))
    silent = EnergyScan(here.time, here.energy.at[:, 3].set(jnp.nan), here.usable.at[:, 3].set(False), EAST)
    table = MODEL.table(silent, 2)
    assert jnp.all(table[:, 3] == 0)
    assert jnp.all(jnp.isfinite(table))
    assert jnp.all(table[:, -1] == 0)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"absent_std": 0.0}, "above 0"),
        ({"present_std": 0.5}, "not below"),
        ({"present_mean": 0.0}, "second above"),
        ({"elsewhere": 0.5}, "from elsewhere with probability 0.5"),
        ({"elsewhere": -0.1}, "expected 0 to 0.2"),
    ],
)
def test_levels_that_cannot_be_are_refused(change: dict[str, float], says: str) -> None:
    with pytest.raises(InputError, match=says):
        BeamEnergies(FANS, **{"absent_mean": 0.0, "absent_std": 1.0, "present_mean": 2.0, "present_std": 1.0, **change})


def test_fans_that_cannot_be_are_refused() -> None:
    with pytest.raises(InputError, match="above 0"):
        Fans((0.0,), (0.0,), (10,), (True,))
    with pytest.raises(InputError, match="as many entries"):
        Fans((0.0, 1.0), (0.1,), (10,), (True,))


def crossings() -> tuple[jax.Array, jax.Array]:
    """A table of a scan, and the beams of two targets and of the two places where their beams cross otherwise."""
    table = MODEL.table(scan(np.random.default_rng(8)), 5)
    return table, jnp.asarray([[3, 11, 3, 11, 7], [20, 4, 4, 20, 30]])[:, :, None]


def ratio_of(members: tuple[int, ...], there: tuple[int, ...] = (), groups: tuple[tuple[int, ...], ...] = ()) -> float:
    """Log ratio of a set of the five; all are of one group where no others are told."""
    table, beams = crossings()
    number = np.arange(5)
    joint = np.ones((5, 5), bool)
    if groups:
        mark = np.array([next(mark for mark, group in enumerate(groups) if one in group) for one in number])
        joint = mark[:, None] == mark
    certain = jnp.asarray(np.isin(number, there))[:, None]
    chosen = jnp.asarray(np.isin(number, members))
    return float(set_log_ratio(table, beams, certain, chosen, jnp.asarray(joint))[0])


def test_a_set_of_one_target_has_the_ratio_of_the_region(float64: type) -> None:
    table, beams = crossings()
    for target in range(5):
        own = table[jnp.arange(2), beams[:, target, 0], 1]
        expected = float(region_log_ratio(own, jnp.ones(2, bool)))
        assert ratio_of((target,)) == pytest.approx(expected, abs=1e-12)
    assert ratio_of(()) == 0


def test_two_targets_and_their_ghosts_have_the_same_ratio(float64: type) -> None:
    """Whatever the scan is: they explain the same beams."""
    assert ratio_of((0, 1)) == pytest.approx(ratio_of((2, 3)), abs=1e-12)


def test_a_set_counts_every_beam_once_for_all_its_targets(float64: type) -> None:
    """Three of the four crossings: beams of one target and of two."""
    table, _ = (np.asarray(values) for values in crossings())
    expected = table[0, 3, 2] + table[0, 11, 1] + table[1, 20, 1] + table[1, 4, 2]
    assert ratio_of((0, 1, 2)) == pytest.approx(expected, abs=1e-12)


def test_beside_targets_that_are_there_a_set_has_what_it_adds(float64: type) -> None:
    """Both ghosts of two declared targets are the second in each of their beams."""
    table, _ = (np.asarray(values) for values in crossings())
    expected = sum(
        table[array, beam, 2] - table[array, beam, 1]
        for array, beams in enumerate([(3, 11), (20, 4)])
        for beam in beams
    )
    assert ratio_of((2, 3), there=(0, 1)) == pytest.approx(expected, abs=1e-12)


def test_groups_of_a_set_are_weighed_apart(float64: type) -> None:
    groups = ((0, 2), (1, 3), (4,))
    apart = ratio_of((0,)) + ratio_of((1,)) + ratio_of((4,))
    assert ratio_of((0, 1, 4), groups=groups) == pytest.approx(apart, abs=1e-12)


def test_one_target_more_beside_others_is_the_sum_over_who_is_in_its_beam(float64: type) -> None:
    """Eight sets of three targets, which are in each beam with probabilities of their own."""
    table = np.asarray(dataclasses.replace(MODEL, elsewhere=0.05).table(scan(np.random.default_rng(9)), 4))
    shares = np.random.default_rng(10).random((3, *table.shape[:2]))
    with_it, without = np.zeros(table.shape[:2]), np.zeros(table.shape[:2])
    for members in itertools.product([False, True], repeat=3):
        weight = np.prod(
            [share if member else 1 - share for share, member in zip(shares, members, strict=True)], axis=0
        )
        with_it += weight * np.exp(table[:, :, sum(members) + 1])
        without += weight * np.exp(table[:, :, sum(members)])
    found = beside(jnp.asarray(table), jnp.asarray(shares))
    np.testing.assert_allclose(found, np.log(with_it / without), atol=rounding(np.float64, 1000) * 100)
    np.testing.assert_allclose(beside(jnp.asarray(table), jnp.zeros(shares.shape)), table[:, :, 1], atol=1e-12)
