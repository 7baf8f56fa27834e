"""Sets of targets against Bayes' rule over all of them, written out with dictionaries."""

import itertools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.trackers.hypotheses import CAPACITY, Hypotheses
from tests.tolerances import STANDARD_ERRORS, rounding

ODDS = (0.4, -1.2, 2.0)
STAYS = 0.9


CROSSED = jnp.array([[10, 40, 10, 40], [20, 50, 50, 20]])
"""Beams in two arrays of two targets and of their two ghosts."""


def slot(number: int, slots: int = 4) -> jax.Array:
    return jnp.arange(slots) == number


def apart(slots: int = 4) -> jax.Array:
    """Beams of targets that share none."""
    return jnp.stack([10 * jnp.arange(slots)] * 2)


def three() -> Hypotheses:
    """Targets in the first three of four slots."""
    hypotheses = Hypotheses.none(4)
    for number, odds in enumerate(ODDS):
        hypotheses = hypotheses.joined(slot(number), jnp.array(odds), apart(), 1)
    return hypotheses


def told(hypotheses: Hypotheses) -> dict[frozenset[int], float]:
    """Probability of every set that is held; none is held twice."""
    weights = np.exp(np.asarray(hypotheses.log_weights, float))
    held = [
        (frozenset(np.flatnonzero(row).tolist()), weight)
        for row, weight in zip(np.asarray(hypotheses.members), weights, strict=True)
        if weight > 0
    ]
    assert len({members for members, _ in held}) == len(held)
    return dict(held)


def independent() -> dict[frozenset[int], float]:
    """Probability of every set of three targets that know nothing of each other."""
    share = [1 / (1 + math.exp(-odds)) for odds in ODDS]
    return {
        frozenset(members): math.prod(q if number in members else 1 - q for number, q in enumerate(share))
        for count in range(4)
        for members in itertools.combinations(range(3), count)
    }


def assert_alike(found: dict[frozenset[int], float], expected: dict[frozenset[int], float]) -> None:
    assert found.keys() == expected.keys()
    for members, probability in expected.items():
        assert found[members] == pytest.approx(probability, rel=rounding(np.float32, 100)), members


def normalised(weights: dict[frozenset[int], float]) -> dict[frozenset[int], float]:
    total = sum(weights.values())
    return {members: weight / total for members, weight in weights.items()}


def test_targets_join_with_their_odds() -> None:
    assert_alike(told(three()), independent())
    np.testing.assert_allclose(three().log_odds[:3], ODDS, atol=rounding(np.float32, 100))
    assert three().log_odds[3] == -jnp.inf


def test_ghosts_that_are_found_later_weigh_as_much_as_their_targets() -> None:
    """What spoke for two targets before their ghosts were in hand would have spoken for these as well."""
    hypotheses = Hypotheses.none(4)
    for number in range(2):
        hypotheses = hypotheses.joined(slot(number), jnp.array(1.0), CROSSED, 1)
    before = hypotheses.updated(lambda members: 8.0 * jnp.sum(members))
    after = before
    for number, shift in ((2, 1), (3, -1)):
        # A beam beside is the same one.
        after = after.joined(slot(number), jnp.array(1.0), CROSSED + shift * jnp.array([0, 0, 1, 1]), 1)
    found = told(after)
    assert found[frozenset({2, 3})] == pytest.approx(found[frozenset({0, 1})], rel=rounding(np.float32, 100))
    assert found[frozenset({2})] < 1e-3 * found[frozenset({0})]
    # Where the beams are others, they have their own odds alone.
    plain = before
    for number in (2, 3):
        plain = plain.joined(slot(number), jnp.array(1.0), apart(), 1)
    assert told(plain)[frozenset({2, 3})] < 1e-3 * told(plain)[frozenset({0, 1})]


def test_a_beam_is_not_that_of_an_array_that_hears_nothing() -> None:
    """The newcomer is not heard by the first array, and the target is in its beam 0."""
    beams = jnp.array([[0, -1], [20, 20]])
    hypotheses = Hypotheses.none(2)
    for number, odds in enumerate((6.0, 0.0)):
        hypotheses = hypotheses.joined(slot(number, 2), jnp.array(odds), beams, 1)
    np.testing.assert_allclose(hypotheses.log_odds, [6.0, 0.0], atol=rounding(np.float32, 1000))


def test_a_scan_weighs_sets_and_odds_are_sums_over_them() -> None:
    """Evidence that no product of one number a target makes: it speaks for two of them together."""

    def evidence(members: jax.Array) -> jax.Array:
        return jnp.where(members[0] & members[1] & ~members[2], 5.0, 0.5 * members[2])

    def weight(members: frozenset[int]) -> float:
        return math.exp(5.0 if members == {0, 1} else 0.5 * (2 in members))

    expected = normalised({members: weight(members) * p for members, p in independent().items()})
    after = three().updated(evidence)
    assert_alike(told(after), expected)
    for target in range(3):
        share = sum(p for members, p in expected.items() if target in members)
        assert float(after.log_odds[target]) == pytest.approx(math.log(share / (1 - share)), abs=1e-4)


def test_two_pairs_that_explain_all_scans_alike_keep_what_they_have() -> None:
    pairs = three().updated(
        lambda members: jnp.where(members[2], -30.0, jnp.where(members[0] ^ members[1], 0.0, -30.0))
    )
    for _ in range(100):
        pairs = pairs.updated(lambda members: 4.0 * jnp.any(members) - 8.0 * jnp.all(members[:2]))
    expected = math.exp(ODDS[0] - ODDS[1])
    assert float(jnp.exp(pairs.log_odds[0])) == pytest.approx(expected, rel=1e-3)


def test_targets_leave_independently() -> None:
    expected = dict.fromkeys(independent(), 0.0)
    for members, probability in independent().items():
        for count in range(len(members) + 1):
            for left in itertools.combinations(members, count):
                leaves = (1 - STAYS) ** count * STAYS ** (len(members) - count)
                expected[members - set(left)] += probability * leaves
    assert_alike(told(three().departed(jnp.log(STAYS))), expected)
    assert_alike(told(three().departed(jnp.zeros(()))), independent())


def test_what_is_settled_is_a_condition() -> None:
    """One target exists, one does not: the third has what it had beside them."""
    after = three().updated(lambda members: 2.0 * (members[0] & members[2])).settled(slot(0), slot(1))
    q = 1 / (1 + math.exp(-ODDS[2]))
    assert_alike(told(after), normalised({frozenset({2}): q * math.exp(2.0), frozenset(): 1 - q}))
    again = after.joined(slot(1), jnp.array(0.0), apart(), 1)
    assert len(told(again)) == 4
    assert float(again.log_odds[1]) == pytest.approx(0.0, abs=1e-5)


def test_a_target_that_was_settled_before_changes_nothing() -> None:
    after = three().settled(slot(3), slot(3) & False)
    assert_alike(told(after), independent())


def test_the_likeliest_are_kept() -> None:
    """Nine targets have 512 sets: those held are the likeliest, and a sure target is in all of them."""
    hypotheses = Hypotheses.none(9)
    for number in range(9):
        odds = jnp.array(20.0 if number == 4 else 0.3 + 0.1 * number)
        hypotheses = hypotheses.joined(slot(number, 9), odds, apart(9), 1)
    held = told(hypotheses)
    assert len(held) == CAPACITY
    assert all(4 in members for members in held)
    assert frozenset(range(9)) in held
    assert sum(held.values()) == pytest.approx(1.0, abs=1e-5)


def test_sets_are_drawn_as_often_as_they_are_likely() -> None:
    """Systematic draws: every share is right to within one."""
    count = 1000
    drawn = np.asarray(three().drawn(jax.random.key(0), count))
    for members, probability in told(three()).items():
        times = np.sum(np.all(drawn == np.isin(np.arange(4), list(members)), axis=1))
        assert abs(times - count * probability) <= 1 + STANDARD_ERRORS * 1e-3
