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

import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from faintrack.numerics.precision import full_precision
from faintrack.sensors.bearing_sets import BearingSensor

NEAR = 8.0
"""Standard deviations from the true bearing within which false ones bear on it."""


@full_precision
def posterior_bound(
    states: Float[ArrayLike, "run scan component"],
    information: Float[ArrayLike, "component component"],
    move: Callable[[Array], Array],
    noise: Float[ArrayLike, "component component"],
    measure: Callable[[Array, Array], Array],
    error: Float[ArrayLike, "measured measured"],
    share: float = 1.0,
) -> Float[np.ndarray, "scan component component"]:
    """Bound on the covariance of a state after every scan (the module's recursion), in double precision.

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
    >>> one = np.eye(1)
    >>> bound = posterior_bound(still, one, lambda state: state, one, lambda state, scan: state, 2 * one)
    >>> round(float(bound[-1, 0, 0]), 4)
    1.0
    """
    # The noise of a motion is small beside what is known at the start: single precision loses half of its digits.
    precision, exactness = (np.linalg.inv(np.asarray(matrix, float)) for matrix in (noise, error))
    moved, measured = (np.asarray(each, float) for each in _jacobians(move, measure, jnp.asarray(states)))
    leaving = np.einsum("rski,kl,rslj->sij", moved, precision, moved) / len(moved)
    across = -np.swapaxes(moved.mean(axis=0), 1, 2) @ precision
    told = share * np.einsum("rsmi,mn,rsnj->sij", measured, exactness, measured) / len(measured)
    found = [np.asarray(information, float) + told[0]]
    for before, beside, now in zip(leaving[:-1], across[:-1], told[1:], strict=True):
        found.append(precision + now - beside.T @ np.linalg.solve(found[-1] + before, beside))
    return np.linalg.inv(np.stack(found))


@functools.partial(jax.jit, static_argnums=(0, 1))
def _jacobians(
    move: Callable[[Array], Array], measure: Callable[[Array, Array], Array], states: Array
) -> tuple[Array, Array]:
    """Of both functions, at every state: (run, scan, component of the result, component of the state)."""
    moved = jax.vmap(jax.vmap(jax.jacfwd(move)))(states)
    return moved, jax.vmap(jax.vmap(jax.jacfwd(measure)), in_axes=(0, None))(states, jnp.arange(states.shape[1]))


def bearing_information(sensor: BearingSensor, draws: int = 20_000, seed: int = 0) -> tuple[float, float]:
    """Share of a bearing's information that is left among false bearings and misses, and its standard error.

    Parameters
    ----------
    sensor : its error is narrow beside its sector.
    draws : scans over which the module's expectation is taken.
    seed : of the draws.

    Examples
    --------
    >>> alone = BearingSensor(error=0.02, detection_probability=0.7, false_per_scan=1e-9)
    >>> share, _ = bearing_information(alone)
    >>> abs(share - 0.7) < 0.03
    True
    """
    rng, heard = np.random.default_rng(seed), float(sensor.detection_probability)
    density = float(sensor.false_per_radian * sensor.error)
    # Deviations of the target's bearing and of the false ones near it, in standard deviations.
    true = rng.standard_normal(draws)[:, None]
    detected = rng.random(draws)[:, None] < heard
    number = rng.poisson(2 * NEAR * density, draws)[:, None]
    false = rng.uniform(-NEAR, NEAR, (draws, int(number.max())))
    there = np.arange(false.shape[1]) < number
    off = np.hstack([true, false])
    ratios = np.exp(-0.5 * off**2) / (np.sqrt(2 * np.pi) * density) * np.hstack([detected, there])
    ratio = 1 - heard + heard * ratios.sum(axis=1)
    slope = heard * (off * ratios).sum(axis=1)
    squares = np.divide(slope, ratio, out=np.zeros(draws), where=ratio > 0) ** 2
    return float(squares.mean()), float(squares.std() / np.sqrt(draws))
