r"""How targets move between scans.

A motion model is a module with one verb, `move(states, interval, key)`: it draws the states after an interval. Both
models here are nearly constant velocity: position and rate driven by a white acceleration. Integrated exactly over an
interval :math:`T`, an acceleration of spectral density :math:`\sigma^2` has the covariance

.. math:: \sigma^2 \begin{bmatrix} T^3/3 & T^2/2 \\ T^2/2 & T \end{bmatrix}

so that two steps equal one and irregular scans need no care (`white_acceleration`). The papers' tracker holds the
acceleration constant within a scan of fixed length instead (`piecewise_acceleration`; bosser2022, eq. 5-8); at
:math:`T = 1` s the two differ in the position variance alone, 1/3 against 1/4.
"""

import math
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.targets.states import BearingState, PlanarState

Scalar = Float[Array, ""] | float
Noise = Callable[[Scalar], tuple[Scalar, Scalar, Scalar]]


def white_acceleration(interval: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    r"""Square root of the covariance of (position, rate) under white acceleration of unit density.

    Returns
    -------
    (a, b, c): position noise is :math:`a u + b w`, rate noise is :math:`c u`, with u and w unit normal.

    Notes
    -----
    .. math:: a^2 + b^2 = T^3/3, \quad ac = T^2/2, \quad c^2 = T

    Examples
    --------
    >>> a, b, c = white_acceleration(4.0)
    >>> [round(float(v), 4) for v in (a * a + b * b, a * c, c * c)]
    [21.3333, 8.0, 4.0]
    """
    root = jnp.sqrt(interval)
    return interval * root / 2, interval * root / 12**0.5, root


def piecewise_acceleration(interval: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    """Square root of the covariance of (position, rate) when one acceleration holds for the whole interval.

    As `white_acceleration`, with the noise of bosser2022, eq. 6: position T^2/2, rate T.

    Examples
    --------
    >>> piecewise_acceleration(2.0)
    (2.0, 0.0, 2.0)
    """
    return interval * interval / 2, 0.0 * interval, interval


class BearingMotion(eqx.Module):
    """Nearly constant bearing rate; the SNR walks at random (bosser2022, eq. 4-8).

    Attributes
    ----------
    rate_noise : density of the bearing acceleration; rad/s per root second.
    snr_noise_db : random walk of the SNR; dB per root second.
    snr_low_db, snr_high_db : where the walk of the SNR is reflected; dB. The paper has no such bounds.
    circular : bearings wrap at -pi and pi; otherwise they are reflected at 0 and pi, the ends of a line array.
    noise : how acceleration accumulates over an interval.
    """

    rate_noise: Scalar = 0.001
    snr_noise_db: Scalar = 0.05
    snr_low_db: Scalar = -math.inf
    snr_high_db: Scalar = math.inf
    circular: bool = eqx.field(static=True, default=False)
    noise: Noise = eqx.field(static=True, default=white_acceleration)

    def move(self, states: BearingState, interval: Scalar, key: PRNGKeyArray) -> BearingState:
        """Draw the states after `interval` seconds."""
        shape, dtype = states.bearing.shape, states.bearing.dtype
        draws = jax.random.normal(key, (3, *shape), dtype)
        a, b, c = self.noise(interval)
        bearing = states.bearing + interval * states.bearing_rate + self.rate_noise * (a * draws[0] + b * draws[1])
        rate = states.bearing_rate + self.rate_noise * c * draws[0]
        snr_db = states.snr_db + self.snr_noise_db * jnp.sqrt(interval) * draws[2]
        snr_db = jnp.where(snr_db < self.snr_low_db, 2 * self.snr_low_db - snr_db, snr_db)
        snr_db = jnp.where(snr_db > self.snr_high_db, 2 * self.snr_high_db - snr_db, snr_db)
        return BearingState(*self.within(bearing, rate), snr_db)

    def within(
        self, bearing: Float[Array, "*points"], rate: Float[Array, "*points"]
    ) -> tuple[Float[Array, "*points"], Float[Array, "*points"]]:
        """Bearing and rate after a move, wrapped into the circle or reflected at the ends of a line."""
        if self.circular:
            return _turn(bearing + jnp.pi) - jnp.pi, rate
        turn = _turn(bearing)
        mirrored = turn > jnp.pi
        return jnp.where(mirrored, 2 * jnp.pi - turn, turn), jnp.where(mirrored, -rate, rate)


def _turn(angle: Float[Array, "*points"]) -> Float[Array, "*points"]:
    """Angle within one turn from zero. By the floor, since XLA takes remainders one number at a time."""
    return angle - 2 * jnp.pi * jnp.floor(angle / (2 * jnp.pi))


class PlanarMotion(eqx.Module):
    """Nearly constant velocity in the plane.

    Attributes
    ----------
    velocity_noise : density of the acceleration along each axis; m/s per root second.
    noise : how acceleration accumulates over an interval.
    """

    velocity_noise: Scalar
    noise: Noise = eqx.field(static=True, default=white_acceleration)

    def move(self, states: PlanarState, interval: Scalar, key: PRNGKeyArray) -> PlanarState:
        """Draw the states after `interval` seconds."""
        draws = jax.random.normal(key, (4, *states.x.shape), states.x.dtype)
        a, b, c = self.noise(interval)

        def along(position: Array, velocity: Array, u: Array, w: Array) -> tuple[Array, Array]:
            moved = position + interval * velocity + self.velocity_noise * (a * u + b * w)
            return moved, velocity + self.velocity_noise * c * u

        x, vx = along(states.x, states.vx, draws[0], draws[1])
        y, vy = along(states.y, states.vy, draws[2], draws[3])
        return PlanarState(x, y, vx, vy)
