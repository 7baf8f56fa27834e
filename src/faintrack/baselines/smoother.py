r"""Kalman filter and smoother of a target's place on several axes, each measured apart, all to the same precision.

With state (place, rate) of an axis, F and Q of the motion, and :math:`H = (1, 0)`, a scan whose place :math:`z_t` is
known to the precision :math:`p_t` (one over its variance; 0 where nothing is measured) gives

.. math::
    \nu_t = z_t - H m_t, \qquad
    g_t = \frac{p_t}{1 + p_t H P_t H^T}, \qquad
    m_t^+ = m_t + g_t \nu_t P_t H^T, \qquad
    P_t^+ = P_t - g_t P_t H^T H P_t ,

and :math:`m_{t+1} = F m_t^+`, :math:`P_{t+1} = F P_t^+ F^T + Q`. What later scans say of scan t comes back as the
gradient of their log density (Bryson and Frazier 1963), without the inverse of a matrix:

.. math::
    r_t = H^T g_t \nu_t + (I - g_t P_t H^T H)^T F^T r_{t+1}, \qquad
    \hat m_t = m_t + P_t r_t, \qquad r_{T+1} = 0 .

:math:`\hat m` is the mean of every state given all scans, and for a Gaussian the likeliest path too.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from faintrack.numerics.precision import full_precision


class Smoothed(NamedTuple):
    """What all scans say, and what those up to each do.

    Attributes
    ----------
    mean : of every state, given all scans.
    filtered, covariance : mean and covariance of every state given the scans up to it; all axes have one covariance.
    log_volume : log of the integral of :math:`e^{-p_t (z_t - H s)^2 / 2}` over the density of the state s before the
        scan, summed over axes.
    """

    mean: Float[Array, "scan axis 2"]
    filtered: Float[Array, "scan axis 2"]
    covariance: Float[Array, "scan 2 2"]
    log_volume: Float[Array, " scan"]


@full_precision
def smooth(
    mean: Float[Array, "axis 2"],
    covariance: Float[Array, "2 2"],
    transition: Float[Array, "2 2"],
    noise: Float[Array, "2 2"],
    measured: Float[Array, "scan axis"],
    precision: Float[Array, " scan"],
) -> Smoothed:
    """States of a target whose place is measured (the module's equations).

    Parameters
    ----------
    mean, covariance : of the state at the first scan, before it is taken in.
    transition, noise : F and Q.
    measured, precision : of every scan; a precision of 0 is no measurement.

    Examples
    --------
    Two places a second apart give the velocity; the noise of the motion is nothing:

    >>> moves = jnp.array([[1.0, 1.0], [0.0, 1.0]])
    >>> places, precision = jnp.array([[3.0], [5.0]]), jnp.array([100.0, 100.0])
    >>> path = smooth(jnp.zeros((1, 2)), 1e4 * jnp.eye(2), moves, 0 * moves, places, precision)
    >>> path.mean[:, 0].round(2).tolist()
    [[3.0, 2.0], [5.0, 2.0]]
    """

    def forward(
        state: tuple[Array, Array], scan: tuple[Array, Array]
    ) -> tuple[tuple[Array, Array], tuple[Array, Array, Array, Array, Array, Array]]:
        before, spread = state
        place, exactness = scan
        across, known = spread[:, 0], 1 + exactness * spread[0, 0]
        innovation = place - before[:, 0]
        gain = exactness / known
        after = before + gain * innovation[:, None] * across
        narrowed = spread - gain * jnp.outer(across, across)
        volume = -0.5 * (gain * innovation**2 + jnp.log(known)).sum()
        moved = after @ transition.T, transition @ narrowed @ transition.T + noise
        return moved, (before, spread, gain * innovation, gain, volume, jnp.concatenate([after, narrowed]))

    _, (before, spread, pull, gain, volume, kept) = jax.lax.scan(forward, (mean, covariance), (measured, precision))

    def backward(later: Array, scan: tuple[Array, Array, Array]) -> tuple[Array, Array]:
        spread, pull, gain = scan
        gradient = later.at[:, 0].add(pull - gain * (later @ spread[:, 0]))
        return gradient @ transition, gradient

    _, gradient = jax.lax.scan(backward, jnp.zeros_like(mean), (spread, pull, gain), reverse=True)
    axes = mean.shape[0]
    return Smoothed(before + gradient @ spread, kept[:, :axes], kept[:, axes:], volume)
