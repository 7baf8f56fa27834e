"""Laws of likelihood ratios, on every one of them (`tests/tables.py`)."""

import functools
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from faintrack.likelihoods.protocols import CellMeans, Likelihood, Simulating, log_ratios
from tests.scenes import part
from tests.tables import CELL_MEANS, LIKELIHOODS, Case
from tests.tolerances import RATIO_AGREEMENT, RATIO_OPERATIONS, assert_equal, assert_mean

every = pytest.mark.parametrize("name", LIKELIHOODS)
means = pytest.mark.parametrize("name", CELL_MEANS)
both = pytest.mark.parametrize("name", [*LIKELIHOODS, *CELL_MEANS])


@functools.cache
def case_of(name: str, dtype: type = np.float32) -> Case:
    return (LIKELIHOODS | CELL_MEANS)[name](dtype)


@eqx.filter_jit
def drawn(likelihood: Any, scan: Any, states: Any, sure: Any, keys: jax.Array) -> tuple[Any, jax.Array, jax.Array]:
    """Scans of noise; their log ratios at all states; log ratios at each sure state of scans with a target there."""

    def one(key: jax.Array) -> tuple[Any, jax.Array, jax.Array]:
        for_noise, *for_targets = jax.random.split(key, 1 + len(jax.tree.leaves(sure)[0]))
        noise = likelihood.simulate(scan, part(states, 0), jnp.array(False), for_noise)

        def under(state: Any, key: jax.Array) -> jax.Array:
            return log_ratios(likelihood, likelihood.simulate(scan, state, jnp.array(True), key), state)

        return noise, log_ratios(likelihood, noise, states), jax.vmap(under)(sure, jnp.stack(for_targets))

    return jax.vmap(one)(keys)


@functools.cache
def draws(name: str) -> tuple[Any, np.ndarray, np.ndarray]:
    """Of a likelihood that reads states; one compiled program for all laws."""
    case = case_of(name)
    keys = jax.random.split(jax.random.key(1), case.draws)
    sure = part(case.states, np.array(case.sure or (0,)))
    noise, ratios, under = drawn(case.likelihood, case.scan, case.states, sure, keys)
    return noise, np.asarray(ratios, np.float64), np.asarray(under, np.float64)


@eqx.filter_jit
def ratios_of(likelihood: Any, scan: Any, states: Any) -> jax.Array:
    return log_ratios(likelihood, scan, states)


@both
def test_it_keeps_to_the_protocols(name: str) -> None:
    likelihood = case_of(name).likelihood
    assert isinstance(likelihood, Simulating)
    assert isinstance(likelihood, CellMeans if name in CELL_MEANS else Likelihood)


@every
def test_a_drawn_scan_is_like_its_template(name: str) -> None:
    case = case_of(name)
    scan = part(draws(name)[0], 0)
    assert jax.tree.structure(scan) == jax.tree.structure(case.scan)
    for one, other in zip(jax.tree.leaves(scan), jax.tree.leaves(case.scan), strict=True):
        assert jnp.shape(one) == jnp.shape(other)


@every
def test_mean_ratio_under_noise_is_1(name: str) -> None:
    """Scans drawn by the likelihood itself, 5 standard errors; exactly 1 where nothing is heard."""
    if not case_of(name).ratio:
        pytest.skip("no likelihood ratio, and said to be none")
    assert_mean(np.exp(draws(name)[1]), 1.0)


@every
def test_mean_inverse_ratio_under_the_target_is_1(name: str) -> None:
    """The law above, read from the other side: it holds draws with a target and the ratio together."""
    case = case_of(name)
    if not (case.ratio and case.sure):
        pytest.skip("no ratio, or one whose inverse has no variance")
    assert_mean(np.exp(-draws(name)[2]), 1.0)


@every
def test_order_of_points_is_irrelevant(name: str) -> None:
    case = case_of(name)
    scan, order = part(draws(name)[0], 0), np.arange(len(jax.tree.leaves(case.states)[0]))[::-1]
    turned = ratios_of(case.likelihood, scan, part(case.states, order))
    assert_equal(turned, ratios_of(case.likelihood, scan, case.states)[order], np.float32, RATIO_OPERATIONS, 10.0)


@every
def test_a_scan_in_which_nothing_was_measured_says_nothing(name: str) -> None:
    case = case_of(name)
    if case.quiet is None:
        pytest.skip("silence of this sensor is a measurement")
    quiet = case.quiet(part(draws(name)[0], 0))
    assert not np.any(ratios_of(case.likelihood, quiet, case.states))


@every
def test_what_was_not_measured_is_not_read(name: str) -> None:
    case = case_of(name)
    if case.masked is None:
        pytest.skip("scans of this sensor have no masks")
    scan = part(draws(name)[0], 0)
    masked = ratios_of(case.likelihood, case.masked(scan), case.states)
    np.testing.assert_array_equal(masked, ratios_of(case.likelihood, scan, case.states))


@every
def test_single_and_double_precision_agree(name: str) -> None:
    single, scan = case_of(name), part(draws(name)[0], 0)
    expected = np.asarray(ratios_of(single.likelihood, scan, single.states))
    with jax.enable_x64(True):
        case = case_of(name, np.float64)
        wide = jax.tree.map(lambda one, like: jnp.asarray(np.asarray(one), like.dtype), scan, case.scan)
        found = np.asarray(ratios_of(case.likelihood, wide, case.states))
    np.testing.assert_allclose(found, expected, rtol=RATIO_AGREEMENT, atol=RATIO_AGREEMENT)


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
