r"""How targets move between scans.

A motion model is a module with one verb, `move(states, interval, key)`: it draws the states after an interval. The
first two here are nearly constant velocity: position and rate driven by a white acceleration. Integrated exactly over
an interval :math:`T`, an acceleration of spectral density :math:`\sigma^2` has the covariance

.. math:: \sigma^2 \begin{bmatrix} T^3/3 & T^2/2 \\ T^2/2 & T \end{bmatrix}

so that two steps equal one and irregular scans need no care (`white_acceleration`). The papers' tracker holds the
acceleration constant within a scan of fixed length instead (`piecewise_acceleration`; bosser2022, eq. 5-8); at
:math:`T = 1` s the two differ in the position variance alone, 1/3 against 1/4.
"""

import dataclasses
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.beliefs.components import rates
from faintrack.numerics.draws import normal
from faintrack.targets.states import BearingState, ToneState, WaveState

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


class Step(NamedTuple):
    r"""What an interval does to a component x and its rate v, u and w unit normal.

    .. math:: x' = x + \text{gain}\, v + a u + b w, \qquad v' = \text{decay}\, v + c u
    """

    gain: Scalar
    decay: Scalar
    a: Scalar
    b: Scalar
    c: Scalar


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
        draws = normal(key, (3, *shape), dtype)
        a, b, c = self.noise(interval)
        bearing = states.bearing + interval * states.bearing_rate + self.rate_noise * (a * draws[0] + b * draws[1])
        rate = states.bearing_rate + self.rate_noise * c * draws[0]
        snr_db = states.snr_db + self.snr_noise_db * jnp.sqrt(interval) * draws[2]
        return BearingState(*self.within(bearing, rate), _reflected(snr_db, self.snr_low_db, self.snr_high_db))

    def within(
        self, bearing: Float[Array, "*points"], rate: Float[Array, "*points"]
    ) -> tuple[Float[Array, "*points"], Float[Array, "*points"]]:
        """Bearing and rate after a move, wrapped into the circle or reflected at the ends of a line."""
        if self.circular:
            return _turn(bearing + jnp.pi) - jnp.pi, rate
        turn = _turn(bearing)
        mirrored = turn > jnp.pi
        return jnp.where(mirrored, 2 * jnp.pi - turn, turn), jnp.where(mirrored, -rate, rate)


class WalkingMotion(eqx.Module):
    """Motion of a direction with one component more, which walks at random whatever the bearing does.

    Attributes
    ----------
    level : motion of the bearing and of the SNR.
    component : name of the one more, "elevation" or "frequency".
    walk : its random walk; its unit per root second.
    low, high : where it is reflected.
    """

    level: BearingMotion
    component: str = eqx.field(static=True)
    walk: Scalar
    low: Scalar
    high: Scalar

    def move(self, states: WaveState | ToneState, interval: Scalar, key: PRNGKeyArray) -> WaveState | ToneState:
        """Draw the states after `interval` seconds."""
        for_level, for_walk = jax.random.split(key)
        moved = self.level.move(BearingState(states.bearing, states.bearing_rate, states.snr_db), interval, for_level)
        before = getattr(states, self.component)
        after = before + self.walk * jnp.sqrt(interval) * normal(for_walk, before.shape, before.dtype)
        values = {**vars(moved), self.component: _reflected(after, self.low, self.high)}
        return dataclasses.replace(states, **values)


def _reflected(values: Float[Array, "*points"], low: Scalar, high: Scalar) -> Float[Array, "*points"]:
    """Values after a walk, those beyond an end as far within it."""
    values = jnp.where(values < low, 2 * low - values, values)
    return jnp.where(values > high, 2 * high - values, values)


def _turn(angle: Float[Array, "*points"]) -> Float[Array, "*points"]:
    """Angle within one turn from zero. By the floor, since XLA takes remainders one number at a time."""
    return angle - 2 * jnp.pi * jnp.floor(angle / (2 * jnp.pi))


class PlanarMotion(eqx.Module):
    """Nearly constant rate of every component that has one: velocity in the plane, range rate.

    Attributes
    ----------
    velocity_noise : density of the acceleration along each axis; m/s per root second.
    noise : how acceleration accumulates over an interval.
    """

    velocity_noise: Scalar
    noise: Noise = eqx.field(static=True, default=white_acceleration)

    def step(self, interval: Scalar) -> Step:
        """What `interval` seconds do to a component and its rate."""
        a, b, c = (self.velocity_noise * factor for factor in self.noise(interval))
        return Step(interval, 1.0, a, b, c)

    def move(self, states: Any, interval: Scalar, key: PRNGKeyArray) -> Any:
        """Draw the states after `interval` seconds."""
        return _drawn(states, self.step(interval), key)


class OrnsteinUhlenbeck(eqx.Module):
    r"""Integrated Ornstein-Uhlenbeck motion: the velocity decays and is driven, so that it stays bounded.

    Attributes
    ----------
    velocity_noise : density of the acceleration along each axis; m/s per root second.
    relaxation : time in which a velocity decays to 1/e; seconds.

    Notes
    -----
    With :math:`\gamma` one over the relaxation and :math:`e = \exp(-\gamma T)`,

    .. math::
        v' = e v, \quad x' = x + \frac{1 - e}{\gamma} v, \qquad
        Q_{vv} = \frac{\sigma^2 (1 - e^2)}{2 \gamma}, \quad Q_{xv} = \frac{\sigma^2 (1 - e)^2}{2 \gamma^2}, \quad
        Q_{xx} = \frac{\sigma^2}{\gamma^2} \left[T - \frac{2 (1 - e)}{\gamma} + \frac{1 - e^2}{2 \gamma}\right]

    (stone2002 and aughenbaugh2010 use it for ships). In the long run the velocity has the standard deviation
    :math:`\sigma \sqrt{\tau / 2}`, tau the relaxation.
    """

    velocity_noise: Scalar
    relaxation: Scalar

    def step(self, interval: Scalar) -> Step:
        """What `interval` seconds do to a component and its rate."""
        rate = 1 / self.relaxation
        turned = rate * interval
        lost, lost_twice = -jnp.expm1(-turned), -jnp.expm1(-2 * turned)
        c = jnp.sqrt(lost_twice / (2 * rate))
        a = jnp.where(c > 0, lost**2 / (2 * rate**2) / jnp.where(c > 0, c, 1), 0)
        # The bracket cancels to its third order where the interval is short beside the relaxation.
        series = turned**3 * (1 / 3 - turned / 4 + 7 * turned**2 / 60 - turned**3 / 24)
        bracket = jnp.where(turned < 0.1, series, turned - 2 * lost + lost_twice / 2)
        b = jnp.sqrt(jnp.maximum(bracket / rate**3 - a**2, 0))
        a, b, c = (self.velocity_noise * factor for factor in (a, b, c))
        return Step(lost / rate, 1 - lost, a, b, c)

    def move(self, states: Any, interval: Scalar, key: PRNGKeyArray) -> Any:
        """Draw the states after `interval` seconds."""
        return _drawn(states, self.step(interval), key)


def _drawn(states: Any, step: Step, key: PRNGKeyArray) -> Any:
    """States after a step: every component that has a rate, and the rate."""
    of_each = rates(states)
    first = getattr(states, next(iter(of_each)))
    draws = normal(key, (2, len(of_each), *first.shape), first.dtype)
    moved = {}
    for (name, rate), u, w in zip(of_each.items(), draws[0], draws[1], strict=True):
        place, speed = getattr(states, name), getattr(states, rate)
        moved[name] = place + step.gain * speed + step.a * u + step.b * w
        moved[rate] = step.decay * speed + step.c * u
    return dataclasses.replace(states, **moved)
