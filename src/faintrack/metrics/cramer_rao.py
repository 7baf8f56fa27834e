r"""The posterior Cramer-Rao bound: how well any tracker could know a target that is there.

For a state that moves by :math:`x' = f(x) + w` with noise of covariance Q, and measurements :math:`z = h(x) + v` with
noise of covariance R, the information about the state obeys (Tichavsky, Muravchik and Nehorai 1998, for additive
Gaussian noise)

.. math::
    J' = D_{22} - D_{12}^T (J + D_{11})^{-1} D_{12}, \qquad
    D_{11} = \mathrm{E}[F^T Q^{-1} F], \quad D_{12} = -\mathrm{E}[F^T] Q^{-1}, \quad
    D_{22} = Q^{-1} + \rho\, \mathrm{E}[H'^T R^{-1} H'] ,

with the Jacobians F of f at the state before and H' of h at the state after, found by differentiation, and expectations
over trajectories. No unbiased estimate has a smaller covariance than :math:`J^{-1}`. The target is taken to be there
throughout.

Where it is not known which measurement is the target's, and the target may be missed, the information of a scan is less
by a factor :math:`\rho` between 0 and 1. For a bearing among false ones (`bearing_information`) it is the Fisher
information of the set over that of the bearing alone,

.. math::
    \rho = \sigma^2\, \mathrm{E}\left[ \left( \frac{\partial}{\partial \beta} \log \left(
    1 - P_D + P_D \sum_i \frac{p(z_i | \beta)}{M_c p_c} \right) \right)^2 \right] ,

:math:`P_D` where there are no false bearings.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.precision import full_precision
from faintrack.sensors.bearing_sets import BearingSensor

NEAR = 8.0
"""Standard deviations from the true bearing within which false ones bear on it."""

SMALLEST = 1e-7
"""Of a uniform number whose logarithm is taken."""


@full_precision
def posterior_bound(
    states: Float[Array, "run scan component"],
    information: Float[Array, "component component"],
    move: Callable[[Array], Array],
    noise: Float[Array, "component component"],
    measure: Callable[[Array, Array], Array],
    error: Float[Array, "measured measured"],
    share: Float[Array, ""] | float = 1.0,
) -> Float[Array, "scan component component"]:
    """Bound on the covariance of a state after every scan (the module's recursion).

    Parameters
    ----------
    states : trajectories of the target, one a run; the first scan is measured too.
    information : inverse of the covariance before the first scan.
    move : function of a state to the one at the next scan, without noise.
    noise : Q, of full rank.
    measure : function of (state, number of the scan) to the measured numbers, without noise.
    error : R.
    share : rho.

    Examples
    --------
    A place that walks at random, measured directly: the variance settles where prediction and measurement balance.

    >>> still = jnp.zeros((1, 40, 1))
    >>> one = jnp.eye(1)
    >>> bound = posterior_bound(still, one, lambda state: state, one, lambda state, scan: state, 2 * one)
    >>> round(float(bound[-1, 0, 0]), 4)
    1.0
    """
    precision, exactness = jnp.linalg.inv(noise), jnp.linalg.inv(error)

    def measured(at: Float[Array, "run component"], scan: Array) -> Float[Array, "component component"]:
        jacobian = jax.vmap(lambda state: jax.jacfwd(measure)(state, scan))(at)
        return share * jnp.einsum("rmi,mn,rnj->ij", jacobian, exactness, jacobian) / len(at)

    def advance(before: Array, item: tuple[Array, Array, Array]) -> tuple[Array, Array]:
        left, at, scan = item
        jacobian = jax.vmap(jax.jacfwd(move))(left)
        leaving = jnp.einsum("rki,kl,rlj->ij", jacobian, precision, jacobian) / len(left)
        across = -jacobian.mean(axis=0).T @ precision
        after = precision + measured(at, scan) - across.T @ jnp.linalg.solve(before + leaving, across)
        return after, jnp.linalg.inv(after)

    by_scan = jnp.moveaxis(states, 1, 0)
    first = information + measured(by_scan[0], jnp.array(0))
    _, later = jax.lax.scan(advance, first, (by_scan[:-1], by_scan[1:], jnp.arange(1, len(by_scan))))
    return jnp.concatenate([jnp.linalg.inv(first)[None], later])


def bearing_information(key: PRNGKeyArray, sensor: BearingSensor, draws: int = 20_000) -> tuple[float, float]:
    """Share of a bearing's information that is left among false bearings and misses, and its standard error.

    Parameters
    ----------
    key : random key.
    sensor : its error is narrow beside its sector.
    draws : scans over which the module's expectation is taken.

    Examples
    --------
    >>> alone = BearingSensor(error=0.02, detection_probability=0.7, false_per_scan=1e-9)
    >>> share, _ = bearing_information(jax.random.key(0), alone)
    >>> abs(share - 0.7) < 0.03
    True
    """
    expected = float(sensor.false_per_radian * 2 * NEAR * sensor.error)
    # As many places as the number of false bearings near the target passes once in a billion.
    most = int(np.ceil(expected + 6 * np.sqrt(expected) + 6))
    squares = np.asarray(_squared_scores(key, sensor, draws, most), float)
    return float(squares.mean()), float(squares.std() / np.sqrt(draws))


@eqx.filter_jit
def _squared_scores(key: PRNGKeyArray, sensor: BearingSensor, draws: int, most: int) -> Float[Array, " draw"]:
    """Of the bearing, in its standard deviations, in scans with room for so many false bearings near it."""
    # All numbers at once: XLA takes a second to compile each draw.
    drawn = jax.random.uniform(key, (draws, most + 2), minval=SMALLEST)
    # Arrivals of a Poisson process over what is near, in standard deviations.
    false = jnp.cumsum(-jnp.log(drawn[:, 2:]), axis=1) / (sensor.false_per_radian * sensor.error) - NEAR
    there = false < NEAR
    detected = drawn[:, 0] < sensor.detection_probability
    true = jax.scipy.special.ndtri(drawn[:, 1])
    off = jnp.concatenate([false, true[:, None]], axis=1)
    density = jnp.exp(-0.5 * off**2) / (sensor.error * jnp.sqrt(2 * jnp.pi) * sensor.false_per_radian)
    density = jnp.where(jnp.concatenate([there, detected[:, None]], axis=1), density, 0)
    ratio = 1 - sensor.detection_probability + sensor.detection_probability * density.sum(axis=1)
    slope = sensor.detection_probability * (off * density).sum(axis=1)
    return jnp.where(ratio > 0, slope / jnp.where(ratio > 0, ratio, 1), 0) ** 2
