"""What is drawn follows the laws that it is drawn from, and what is computed twice is the same."""

import dataclasses
import itertools
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.beliefs.belief import Belief, log_gain, update
from faintrack.sensors.array import SensorArray, line_array, sensor_array
from faintrack.sensors.beams import BeamGrid, steering
from faintrack.signal.beamformer import beamformer
from faintrack.simulation.model import birth_probability, draw_target
from faintrack.simulation.spectra import draw_spectra, over_spectra
from faintrack.targets.motion import BearingMotion
from faintrack.targets.states import BearingState
from faintrack.targets.target import Target, UniformBirth, rates
from tests.scenes import COLOURED
from tests.tolerances import assert_equal, errors_apart

ALLOWED = 4.0
"""Standard errors. A normal mean strays further once in 16,000 comparisons; this file makes some 200, with fixed
keys."""
DRAWS, SCANS, APPEARS, STAYS = 20_000, 12, 0.1, 0.8
ROUNDINGS = 20
"""In a probability over twelve scans."""
OPERATIONS = 200
"""Roundings from spectra to beam power: a phase, a sum over channels, a sum over snapshots."""


def corner(*values: float) -> BearingState:
    return BearingState(*(jnp.asarray(value, jnp.float32) for value in values))


LOW, HIGH = (0.3, -0.02, -10.0), (2.5, 0.02, 3.0)
TARGET = Target(UniformBirth(corner(*LOW), corner(*HIGH)), BearingMotion(rate_noise=0.0), *rates(APPEARS, STAYS, 1.0))
"""It turns at a constant rate, so that another rate is another target."""


# Targets


@pytest.fixture(scope="module")
def drawn() -> tuple[BearingState, np.ndarray]:
    """States and presence of targets that appear at least once; (run, scan)."""
    time = jnp.arange(1.0, SCANS + 1)
    draw = jax.jit(jax.vmap(lambda key: draw_target(key, TARGET, time)))
    states, present = draw(jax.random.split(jax.random.key(5), DRAWS))
    return jax.tree.map(np.asarray, states), np.asarray(present)


def test_a_target_appears_and_is_somewhere(drawn: tuple[BearingState, np.ndarray]) -> None:
    states, present = drawn
    assert present.any(axis=1).all()
    for component in jax.tree.leaves(states):
        assert np.isfinite(component).all()
    assert states.bearing[present].min() >= 0
    assert states.bearing[present].max() <= np.pi


def test_it_is_born_where_targets_are(drawn: tuple[BearingState, np.ndarray]) -> None:
    """20,000 births, 4 standard errors of the mean of a uniform law."""
    states, present = drawn
    first = present.argmax(axis=1)[:, None]
    for name, low, high in zip(("bearing", "bearing_rate", "snr_db"), LOW, HIGH, strict=True):
        born = np.take_along_axis(getattr(states, name), first, axis=1)[:, 0]
        assert born.min() >= np.float32(low)
        assert born.max() <= np.float32(high)
        assert errors_apart(born, (low + high) / 2) < ALLOWED


def test_the_first_scan_follows_the_truncated_geometric_law(drawn: tuple[BearingState, np.ndarray]) -> None:
    """20,000 draws, 4 standard errors of each of twelve shares."""
    first = drawn[1].argmax(axis=1)
    law = APPEARS * (1 - APPEARS) ** np.arange(SCANS)
    assert errors_apart(first[:, None] == np.arange(SCANS), law / law.sum()) < ALLOWED


def test_it_stays_leaves_and_comes_back_as_often_as_the_model_says(drawn: tuple[BearingState, np.ndarray]) -> None:
    """4 standard errors, of as many independent changes as there were scans to change from."""
    present = drawn[1]
    been = np.maximum.accumulate(present, axis=1)[:, :-1]
    for now, law in ((present[:, :-1], STAYS), (been & ~present[:, :-1], APPEARS)):
        assert errors_apart(present[:, 1:][now], law) < ALLOWED


def test_one_target_replaces_another_as_often_as_the_model_says(drawn: tuple[BearingState, np.ndarray]) -> None:
    """4 standard errors. The ends of the line turn a rate round and do not change its size."""
    states, present = drawn
    rate = np.abs(states.bearing_rate)
    replaced = (rate[:, 1:] != rate[:, :-1]) & present[:, 1:]
    assert errors_apart(replaced[present[:, :-1]], float(TARGET.replacement(1.0))) < ALLOWED


@pytest.mark.parametrize("interval", [0.5, 1.0, 3.0])
def test_probability_that_a_target_appears_is_a_product(interval: float) -> None:
    appears = float(TARGET.transition(interval)[0])
    absent = np.prod(np.full(SCANS, 1 - appears))
    assert_equal(birth_probability(TARGET, interval, SCANS), 1 - absent, np.float32, ROUNDINGS)


# Spectra

GRID = BeamGrid(np.array([125.0, 250.0, 375.0]), beams=36, snapshots=2, circular=False)
FRAMES, SNR = 8000, 2.0
DEAD = sensor_array(line_array(4, 1.5).positions, gains=np.array([1.0, 1.0, 0.0, 1.0]))


@eqx.filter_jit
def spectra(
    key: jax.Array, array: SensorArray, bearing: jax.Array, snr_db: jax.Array, noise_power: jax.Array
) -> jax.Array:
    return draw_spectra(key, array, GRID, bearing, snr_db, noise_power)


def heard(snr_db: float) -> np.ndarray:
    """Spectra of shape (frame and snapshot, frequency, channel), the source at a constant bearing."""
    frames = jnp.full(FRAMES, 0.8), jnp.full(FRAMES, snr_db)
    found = spectra(jax.random.key(6), DEAD, *frames, jnp.asarray(COLOURED, jnp.float32))
    return np.asarray(found).reshape(-1, 3, 4)


@pytest.mark.parametrize("snr", [0.0, SNR])
def test_power_and_phase_between_channels(snr: float) -> None:
    r"""16,000 snapshots, 4 standard errors; the law is :math:`\sigma_f^2 (a d d^H + I)`, without the dead channel."""
    drawn = heard(10 * np.log10(snr) if snr else -np.inf)
    vector = steering(DEAD, GRID.frequency, np.array([0.8]))[:, 0]
    alive = np.outer(DEAD.alive, DEAD.alive)
    law = COLOURED[:, None, None] * alive * (snr * vector[:, :, None] * vector[:, None].conj() + np.eye(4))
    products = drawn[:, :, :, None] * drawn[:, :, None].conj()
    assert np.all(products[:, :, ~alive] == 0)
    for part in (np.real, np.imag):
        used = alive & (np.ones((4, 4), bool) if part is np.real else ~np.eye(4, dtype=bool))
        assert errors_apart(part(products)[:, :, used], part(law)[:, used]) < ALLOWED
    # Circular: neither part is favoured, and none goes with the other.
    assert errors_apart((drawn**2).real[..., DEAD.alive], 0) < ALLOWED
    assert errors_apart((drawn**2).imag[..., DEAD.alive], 0) < ALLOWED


def test_handed_out_spectra_are_the_drawn_ones() -> None:
    bearing, snr_db = jnp.linspace(0.3, 2.0, FRAMES), jnp.linspace(-10.0, 5.0, FRAMES)
    power = jnp.asarray(COLOURED, jnp.float32)

    def take_in(state: jax.Array, number: jax.Array, spectra: jax.Array) -> tuple[jax.Array, Any]:
        return state + number, (number, spectra)

    @eqx.filter_jit
    def hand_out(key: jax.Array) -> tuple[jax.Array, Any]:
        return over_spectra(take_in, jnp.array(0), key, DEAD, GRID, bearing, snr_db, power)

    last, (numbers, found) = hand_out(jax.random.key(7))
    assert last == sum(range(FRAMES))
    np.testing.assert_array_equal(numbers, np.arange(FRAMES))
    # Two programs: they may round differently.
    np.testing.assert_allclose(found, spectra(jax.random.key(7), DEAD, bearing, snr_db, power), rtol=1e-6, atol=1e-6)
    # No two frames alike.
    assert len(np.unique(np.asarray(found)[:, 0, 0, 0])) == FRAMES


# Gain

NOISE = np.array([0.5, 0.3, 0.2])
"""Probability of each of three scans without a target."""
WITH_TARGET = np.array([[0.2, 0.3, 0.5], [0.1, 0.6, 0.3]])
"""And with one at either of two points."""


def belief_of(existence: float, weights: np.ndarray) -> Belief:
    return Belief(None, jnp.log(weights), jnp.log(existence) - jnp.log1p(-existence), jnp.array(0.0))


@pytest.mark.parametrize("existence", [1e-9, 0.3, 0.999])
def test_gain_by_hand(existence: float, float64: type) -> None:
    weights = np.array([0.4, 0.6])
    for scan in range(3):
        ratio = WITH_TARGET[:, scan] / NOISE[scan]
        gain = log_gain(*update(belief_of(existence, weights), jnp.log(ratio)))
        assert_equal(np.exp(gain), 1 - existence + existence * weights @ ratio, float64, OPERATIONS)


def test_gain_stays_finite_in_single_precision() -> None:
    """One scan can change a ratio by e^88 and more, and existence be 1 or 0 but for rounding."""
    for log_odds, log_ratio in itertools.product((-200.0, 0.0, 200.0), (-200.0, 0.0, 200.0)):
        belief = Belief(None, jnp.zeros(1), jnp.array(log_odds), jnp.array(0.0))
        gain = log_gain(*update(belief, jnp.array([log_ratio])))
        expected = np.logaddexp(-np.logaddexp(0, log_odds), log_ratio - np.logaddexp(0, -log_odds))
        assert_equal(gain, expected, np.float32, OPERATIONS, scale=1.0)


def test_mean_gain_of_two_scans_on_noise_is_1(float64: type) -> None:
    """Every pair of scans; between them the target leaves, comes, and moves from point to point."""
    move = np.array([[0.9, 0.1], [0.3, 0.7]])
    newborn, start = np.array([0.5, 0.5]), np.array([0.4, 0.6])
    total = 0.0
    for first, second in itertools.product(range(3), repeat=2):
        belief, log_evidence = update(belief_of(0.2, start), jnp.log(WITH_TARGET[:, first] / NOISE[first]))
        log_ratio = log_gain(belief, log_evidence)
        existence, weights = float(belief.existence), np.exp(belief.log_weights)
        there = STAYS * existence * (weights @ move) + APPEARS * (1 - existence) * newborn
        predicted = belief_of(there.sum(), there / there.sum())
        log_ratio += log_gain(*update(predicted, jnp.log(WITH_TARGET[:, second] / NOISE[second])))
        total += NOISE[first] * NOISE[second] * float(np.exp(log_ratio))
    assert_equal(total, 1.0, float64, OPERATIONS)


# Mirrored arrays

SQUARE = np.array([[1.0, 0.2], [-0.2, 1.0], [0.2, -1.0], [-1.0, -0.2]])
MIRRORED = {
    "even line": line_array(4, 1.5),
    "odd line": line_array(5, 1.5, heading=0.4),
    "uneven mirrored line": sensor_array(np.outer([0.0, 1.0, 1.5, 2.5], [0.6, 0.8])),
    "dead channel": DEAD,
    "dead middle": sensor_array(line_array(5, 1.5).positions, gains=np.array([1.0, 1.0, 0.0, 1.0, 1.0])),
    "square": sensor_array(SQUARE),
}
OTHERS = {
    "uneven line": sensor_array(np.outer([0.0, 1.0, 3.0], [0.6, 0.8])),
    "line out of order": sensor_array(line_array(4, 1.5).positions[[1, 0, 2, 3]]),
    "square in another order": sensor_array(SQUARE[[0, 1, 3, 2]]),
}


@pytest.mark.parametrize("beams", [36, 37])
@pytest.mark.parametrize("case", [*MIRRORED, *OTHERS])
def test_beam_power_is_that_of_the_general_formula(case: str, beams: int, float64: type) -> None:
    """Also for an odd number of beams: the middle one of a line is its own opposite, and on a circle none has one."""
    array = (MIRRORED | OTHERS)[case]
    plan = beamformer(array, 1000.0, frame=0.016, snapshot=0.008, beams=beams, dtype=float64)
    channels, rng = len(array.gains), np.random.default_rng(8)
    shape = (3, plan.grid.snapshots, plan.grid.frequency.size, channels)
    heard = (rng.normal(size=shape) + 1j * rng.normal(size=shape)) * np.asarray(array.alive)
    vectors = steering(array, plan.grid.frequency, plan.grid.bearing)
    expected = np.sum(np.abs(np.einsum("fbc,tkfc->tkfb", vectors.conj(), heard)) ** 2, axis=1)
    found = plan.beam_power(jnp.asarray(heard))
    assert_equal(found, expected, float64, OPERATIONS, scale=channels**2)


@pytest.mark.parametrize("case", [*MIRRORED, *OTHERS])
def test_which_arrays_are_mirrored(case: str) -> None:
    plan = beamformer((MIRRORED | OTHERS)[case], 1000.0, frame=0.016, beams=36)
    assert plan.mirrored == (case in MIRRORED)


@pytest.mark.parametrize("case", ["even line", "dead channel", "uneven line"])
def test_one_frame_is_one_of_a_stack(case: str, float64: type) -> None:
    array = (MIRRORED | OTHERS)[case]
    plan = beamformer(array, 1000.0, frame=0.016, snapshot=0.008, beams=36, dtype=float64)
    channels, rng = len(array.gains), np.random.default_rng(9)
    shape = (3, plan.grid.snapshots, plan.grid.frequency.size, channels)
    heard = jnp.asarray(rng.normal(size=shape) + 1j * rng.normal(size=shape))
    time = jnp.arange(1.0, 4.0)
    stack = plan.scan_spectra(time, heard, jnp.ones((3, channels), bool))
    for number in range(3):
        one = plan.scan_frame(time[number], heard[number])
        assert one.channels == np.sum(array.alive)
        assert one.field is None
        for field in dataclasses.fields(one):
            if field.name == "field":
                continue
            expected = getattr(stack, field.name)[number]
            assert_equal(getattr(one, field.name), expected, float64, OPERATIONS, scale=channels**2)
