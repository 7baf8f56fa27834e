"""Sets of bearings: log ratios by enumeration of associations, and what a simulation draws."""

import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import norm, poisson

from faintrack.errors import InputError
from faintrack.likelihoods.bearing_sets import BearingSetLikelihood
from faintrack.likelihoods.contacts import Together
from faintrack.likelihoods.several_sets import SeveralSetsLikelihood
from faintrack.sensors.bearing_draws import draw_bearing_set
from faintrack.sensors.bearing_sets import BearingSensor, BearingSet, bearing_set
from faintrack.sensors.several_sets import SeveralSets
from faintrack.targets.states import PlanarState
from tests.tolerances import STANDARD_ERRORS, errors_apart, rounding

START, WIDTH, ERROR = -0.5, 2.5, 0.05
OBSERVER = (100.0, -50.0)


def planar(x: Any, y: Any) -> PlanarState:
    x, y = jnp.asarray(x, float), jnp.asarray(y, float)
    return PlanarState(x, y, jnp.zeros_like(x), jnp.zeros_like(x))


def at_bearing(bearing: Any) -> PlanarState:
    return planar(OBSERVER[0] + 400 * np.cos(bearing), OBSERVER[1] + 400 * np.sin(bearing))


def sensor(detection: float = 0.8, false: float = 3.0) -> BearingSensor:
    return BearingSensor(ERROR, detection, false, START, WIDTH)


def scan(bearings: list[float]) -> BearingSet:
    return bearing_set(sensor(), 2.0, np.array(bearings), planar(*OBSERVER), capacity=8)


def enumerated(bearings: list[float], true: float, detection: float, false: float) -> float:
    """Ratio of the densities of an ordered set, every association by itself."""
    n = len(bearings)
    none = poisson.pmf(n, false) * WIDTH**-n
    with_target = (1 - detection) * none
    for z in bearings:
        # The target's bearing comes first, second, ... among n, each as likely.
        rest = poisson.pmf(n - 1, false) * WIDTH ** -(n - 1)
        with_target += detection * norm.pdf(z, true, ERROR) * rest / n
    return with_target / none


@pytest.mark.parametrize("detection", [0.3, 0.8, 1.0])
@pytest.mark.parametrize("bearings", [[], [0.4], [0.41, 0.38, 1.6], [1.0, 1.5, 1.9, -0.4]])
def test_full_ratio_is_the_sum_over_associations(bearings: list[float], detection: float) -> None:
    true = np.array([0.4, 0.9, 1.55])
    found = BearingSetLikelihood(sensor(detection)).log_ratio(scan(bearings), at_bearing(true))
    with np.errstate(divide="ignore"):
        expected = np.log([enumerated(bearings, value, detection, 3.0) for value in true])
    # Bearings of float32 positions, in units of a narrow error.
    np.testing.assert_allclose(found, expected, rtol=rounding(np.float32, 2000), atol=1e-3)


def test_association_is_the_share_of_each_bearing() -> None:
    """Each term of the enumeration over their sum."""
    bearings, true = [0.41, 0.38, 1.6], 0.4
    total = enumerated(bearings, true, 0.8, 3.0)
    rest = poisson.pmf(2, 3.0) * WIDTH**-2 / (poisson.pmf(3, 3.0) * WIDTH**-3)
    expected = [0.8 * norm.pdf(z, true, ERROR) * rest / 3 / total for z in bearings]
    found = BearingSetLikelihood(sensor(0.8)).association(scan(bearings), at_bearing(true))
    np.testing.assert_allclose(found[:3], expected, rtol=rounding(np.float32, 3000), atol=1e-6)
    assert float(found[3:].sum()) == 0
    assert float(BearingSetLikelihood(sensor()).association(scan([0.4]), at_bearing(-2.0)).sum()) == 0


def test_published_ratio_leaves_out_how_many_there_are() -> None:
    bearings, true = [0.41, 0.38, 1.6], np.array([0.4, 1.55])
    found = BearingSetLikelihood(sensor(), published=True).log_ratio(scan(bearings), at_bearing(true))
    expected = [np.log(np.mean(norm.pdf(bearings, value, ERROR)) * WIDTH) for value in true]
    np.testing.assert_allclose(found, expected, rtol=rounding(np.float32, 2000), atol=1e-3)
    full = BearingSetLikelihood(sensor(detection=1.0)).log_ratio(scan(bearings), at_bearing(true))
    np.testing.assert_allclose(full - found, np.log(3 / 3.0), atol=1e-4)


def test_a_scan_without_bearings_rules_the_published_target_out() -> None:
    assert float(BearingSetLikelihood(sensor(), published=True).log_ratio(scan([]), at_bearing(0.4))) == -math.inf


def test_outside_the_sector_nothing_is_told() -> None:
    assert float(BearingSetLikelihood(sensor()).log_ratio(scan([0.4]), at_bearing(-2.0))) == 0


def test_bearings_wrap_around() -> None:
    around = BearingSensor(ERROR, 0.9, 3.0)
    here = bearing_set(around, 0.0, np.array([math.pi - 0.01]), planar(*OBSERVER), capacity=2)
    near, far = BearingSetLikelihood(around).log_ratio(here, at_bearing(np.array([-math.pi + 0.01, -math.pi + 1])))
    assert near > 2 > 0 > far


@eqx.filter_jit
def draws(key: jax.Array, sensor: BearingSensor, present: bool) -> tuple[BearingSet, jax.Array]:
    def one(key: jax.Array) -> tuple[BearingSet, jax.Array]:
        return draw_bearing_set(key, sensor, 16, jnp.array(0.0), planar(*OBSERVER), at_bearing(0.9), present)

    return jax.vmap(one)(jax.random.split(key, 20_000))


def test_false_bearings_are_poisson_and_even() -> None:
    drawn, _ = draws(jax.random.key(1), sensor(), False)
    number = np.asarray(drawn.there.sum(axis=1))
    assert errors_apart(number, 3.0) < STANDARD_ERRORS
    assert errors_apart((number - 3.0) ** 2, 3.0) < STANDARD_ERRORS
    every = np.asarray(drawn.bearing)[np.asarray(drawn.there)]
    share = np.histogram(every, 10, (START, START + WIDTH))[0] / len(every)
    assert np.abs(share - 0.1).max() < STANDARD_ERRORS * math.sqrt(0.09 / len(every))


def test_target_is_detected_as_often_as_it_should() -> None:
    quiet = sensor(detection=0.8, false=1e-3)
    drawn, _ = draws(jax.random.key(2), quiet, True)
    hit = np.asarray(drawn.there.any(axis=1), float)
    assert errors_apart(hit, 0.8 + 0.2 * (1 - math.exp(-1e-3))) < STANDARD_ERRORS
    first = np.asarray(drawn.bearing[:, 0])[hit > 0]
    near = first[np.abs(first - 0.9) < 8 * ERROR]
    assert errors_apart(near, 0.9) < STANDARD_ERRORS
    assert errors_apart((near - 0.9) ** 2, ERROR**2) < STANDARD_ERRORS


def test_what_finds_no_place_is_counted() -> None:
    crowded = sensor(false=40.0)
    drawn, lost = draws(jax.random.key(3), crowded, True)
    assert bool(drawn.there.all())
    assert int(lost.min()) >= 1


def test_two_observers_add_their_log_ratios() -> None:
    first, second = scan([0.4]), bearing_set(sensor(), 2.0, np.array([1.2]), planar(300.0, -80.0), capacity=8)
    one, states = BearingSetLikelihood(sensor()), at_bearing(np.array([0.4, 1.0]))
    both = Together((one, one)).log_ratio((first, second), states)
    np.testing.assert_allclose(both, one.log_ratio(first, states) + one.log_ratio(second, states), rtol=1e-6)
    sets = jax.tree.map(lambda *parts: jnp.stack(parts), first, second)
    for heard, expected in ([True, True], both), ([True, False], one.log_ratio(first, states)):
        told = SeveralSetsLikelihood(one).log_ratio(SeveralSets(jnp.array(2.0), sets, jnp.array(heard)), states)
        np.testing.assert_allclose(told, expected, rtol=1e-6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"error": 0.0}, "error is 0; expected above 0"),
        ({"detection_probability": 1.2}, "detection_probability is 1.2; expected above 0, at most 1"),
        ({"false_per_scan": float("nan")}, "false_per_scan is nan; expected above 0"),
        ({"width": 7.0}, "width of the sector is 7 rad; expected above 0 to a turn"),
    ],
)
def test_a_sensor_that_cannot_be(change: dict[str, float], message: str) -> None:
    known = {"error": ERROR, "detection_probability": 0.9, "false_per_scan": 3.0, "start": START, "width": WIDTH}
    with pytest.raises(InputError, match=message):
        BearingSensor(**(known | change))


def test_bearings_that_cannot_be() -> None:
    with pytest.raises(InputError, match=r"scan at 2 s: 9 bearings; expected at most the capacity, 8"):
        scan([0.1] * 9)
    with pytest.raises(InputError, match=r"scan at 2 s, bearing 1: -2 rad; expected one of the sector from -0.5 rad"):
        scan([0.1, -2.0])
    with pytest.raises(InputError, match=r"bearing 0: nan rad"):
        scan([math.nan])
