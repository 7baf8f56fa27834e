"""Laws of likelihood ratios, on every one of them (`tests/cases.py`)."""

import functools
from collections.abc import Iterable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.likelihoods.protocols import CellMeans, Likelihood, Simulating, log_ratios
from tests.cases import CELL_MEANS, LIKELIHOODS, MASKED, NO_INVERSE, NO_RATIO, QUIET, Case
from tests.scenes import part
from tests.tolerances import RATIO_AGREEMENT, RATIO_OPERATIONS, assert_equal, assert_mean


@functools.cache
def case_of(name: str, dtype: type = np.float32) -> Case:
    return (LIKELIHOODS | CELL_MEANS)[name](dtype)


def those(names: Iterable[str]) -> pytest.MarkDecorator:
    """Likelihoods that a law speaks of."""
    return pytest.mark.parametrize("name", list(names))


every = pytest.mark.parametrize("name", LIKELIHOODS)
means = pytest.mark.parametrize("name", CELL_MEANS)
both = pytest.mark.parametrize("name", [*LIKELIHOODS, *CELL_MEANS])


class Drawn(NamedTuple):
    """Log ratios of drawn scans, and of one scan of noise in other forms.

    Attributes
    ----------
    scan : the one.
    noise : of scans without a target, shape (draw, state).
    under : of scans with a target at one of two states, read there; shape (draw, 2).
    plain : of the one, shape (state,).
    turned : with the states in reverse.
    masked : with something else where nothing was measured.
    quiet : with nothing measured.
    """

    scan: Any
    noise: np.ndarray
    under: np.ndarray
    plain: np.ndarray
    turned: np.ndarray
    masked: np.ndarray
    quiet: np.ndarray


@eqx.filter_jit
def simulated(likelihood: Any, scan: Any, state: Any, present: jax.Array, keys: jax.Array) -> Any:
    return jax.vmap(lambda key: likelihood.simulate(scan, state, present, key))(keys)


@eqx.filter_jit
def ratios_of(likelihood: Any, scans: Any, states: Any) -> jax.Array:
    return jax.vmap(lambda scan: log_ratios(likelihood, scan, states))(scans)


def alike(scan: Any, name: str) -> list[Any]:
    """A scan, the same with its masked parts filled, and with nothing measured."""
    masked, quiet = (changes.get(name, lambda same: same) for changes in (MASKED, QUIET))
    return [scan, masked(scan), quiet(scan)]


@functools.cache
def drawn(name: str) -> Drawn:
    """Of a likelihood that reads states; two compiled programs for all laws, one draws and one reads."""
    case = case_of(name)
    *for_targets, for_noise = (jax.random.split(key, case.draws) for key in jax.random.split(jax.random.key(1), 3))
    turned = part(case.states, np.arange(len(jax.tree.leaves(case.states)[0]))[::-1])

    def stack(place: int, present: bool, keys: jax.Array, rest: list[Any]) -> tuple[Any, list[Any]]:
        scans = simulated(case.likelihood, case.scan, part(case.states, place), jnp.array(present), keys)
        rest = rest or alike(part(scans, 0), name)
        return jax.tree.map(lambda many, *few: jnp.concatenate([many, jnp.stack(few)]), scans, *rest), rest

    scans, rest = stack(0, False, for_noise, [])
    noise = np.asarray(ratios_of(case.likelihood, scans, case.states), np.float64)
    first, second = (
        np.asarray(ratios_of(case.likelihood, stack(place, True, keys, rest)[0], states), np.float64)
        for place, keys, states in zip((0, 1), for_targets, (case.states, turned), strict=True)
    )
    under = np.stack([first[:-3, 0], second[:-3, -2]], axis=1)
    return Drawn(rest[0], noise[:-3], under, noise[-3], second[-3], noise[-2], noise[-1])


@both
def test_it_keeps_to_the_protocols(name: str) -> None:
    likelihood = case_of(name).likelihood
    assert isinstance(likelihood, Simulating)
    assert isinstance(likelihood, CellMeans if name in CELL_MEANS else Likelihood)


@every
def test_a_drawn_scan_is_like_its_template(name: str) -> None:
    case, scan = case_of(name), drawn(name).scan
    assert jax.tree.structure(scan) == jax.tree.structure(case.scan)
    for one, other in zip(jax.tree.leaves(scan), jax.tree.leaves(case.scan), strict=True):
        assert jnp.shape(one) == jnp.shape(other)


@those(name for name in LIKELIHOODS if name not in NO_RATIO)
def test_mean_ratio_under_noise_is_1(name: str) -> None:
    """Scans drawn by the likelihood itself, 5 standard errors; exactly 1 where nothing is heard."""
    assert_mean(np.exp(drawn(name).noise), 1.0)


@those(name for name in LIKELIHOODS if name not in NO_INVERSE)
def test_mean_inverse_ratio_under_the_target_is_1(name: str) -> None:
    """The law above, read from the other side: it holds draws with a target and the ratio together."""
    assert_mean(np.exp(-drawn(name).under), 1.0)


@every
def test_order_of_points_is_irrelevant(name: str) -> None:
    assert_equal(drawn(name).turned[::-1], drawn(name).plain, np.float32, RATIO_OPERATIONS, 10.0)


@those(QUIET)
def test_a_scan_in_which_nothing_was_measured_says_nothing(name: str) -> None:
    assert not np.any(drawn(name).quiet)


@those(MASKED)
def test_what_was_not_measured_is_not_read(name: str) -> None:
    np.testing.assert_array_equal(drawn(name).masked, drawn(name).plain)


@every
def test_single_and_double_precision_agree(name: str) -> None:
    single = drawn(name)
    with jax.enable_x64(True):
        case = case_of(name, np.float64)
        wide = jax.tree.map(lambda one, like: jnp.asarray(np.asarray(one), like.dtype)[None], single.scan, case.scan)
        found = np.asarray(ratios_of(case.likelihood, wide, case.states))[0]
    np.testing.assert_allclose(found, single.plain, rtol=RATIO_AGREEMENT, atol=RATIO_AGREEMENT)


@means
def test_mean_ratio_of_cells_under_noise_is_about_1(name: str) -> None:
    """A mean of ratios at points has the mean 1; what `Guided` leaves out beyond its swath is less than a twentieth."""
    case = case_of(name)
    keys = jax.random.split(jax.random.key(1), 500)

    @eqx.filter_jit
    def of_noise(key: jax.Array) -> jax.Array:
        noise = case.likelihood.simulate(case.scan, part(case.states, 0), jnp.array(False), key)
        return case.likelihood.log_mean_ratio(noise)

    ratios = np.exp(np.asarray(jax.lax.map(of_noise, keys), np.float64))
    error = ratios.std(axis=0) / np.sqrt(len(keys))
    assert np.all(np.abs(ratios.mean(axis=0) - 1) < 0.05 + 5 * error)
