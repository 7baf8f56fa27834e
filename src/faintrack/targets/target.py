r"""A target: how often it appears and leaves, where it appears, how it moves.

Existence is a two-state Markov chain in continuous time with arrival rate :math:`\lambda` and departure rate
:math:`\mu`. Over an interval :math:`T` an absent target appears, and a present one stays, with

.. math::
    p_b = \frac{\lambda}{\lambda + \mu} (1 - e^{-(\lambda + \mu) T}), \qquad
    p_s = 1 - \frac{\mu}{\lambda + \mu} (1 - e^{-(\lambda + \mu) T})

the birth and survival probabilities of bosser2022, eq. 1. Two predictions over T equal one over 2 T, so scans need
not come at equal times. `rates` turns a paper's probabilities per scan into rates.
"""

import math
from typing import Any, Protocol, runtime_checkable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.errors import InputError
from faintrack.numerics.draws import uniform

Scalar = Float[Array, ""] | float


@runtime_checkable
class Motion(Protocol):
    """Draws states after an interval; see `faintrack.targets.motion`."""

    def move(self, states: Any, interval: Any, key: PRNGKeyArray) -> Any:
        """Draw the states after `interval` seconds."""


class UniformBirth(eqx.Module):
    """New targets spread evenly over a box of states.

    Attributes
    ----------
    low, high : states with scalar components, the corners of the box.

    Examples
    --------
    >>> from faintrack.targets.states import BearingState
    >>> low = BearingState(jnp.array(0.0), jnp.array(-0.01), jnp.array(-40.0))
    >>> high = BearingState(jnp.array(3.14), jnp.array(0.01), jnp.array(-15.0))
    >>> UniformBirth(low, high).sample(jax.random.key(0), 5).bearing.shape
    (5,)
    """

    low: Any
    high: Any

    def sample(self, key: PRNGKeyArray, count: int) -> Any:
        """Draw `count` states; components have the shape (count,) and the type of the corners."""
        low, treedef = jax.tree.flatten(self.low)
        high = jax.tree.leaves(self.high)
        draws = uniform(key, (len(low), count), jnp.result_type(*low))
        return jax.tree.unflatten(treedef, [a + (b - a) * u for a, b, u in zip(low, high, draws, strict=True)])


class Target(eqx.Module):
    """What is known of a target before any scan.

    Attributes
    ----------
    birth : where a new target appears; has `sample(key, count)`.
    motion : how it moves; has `move(states, interval, key)`.
    arrival_rate : of an absent target; per second.
    departure_rate : of a present target; per second.
    """

    birth: Any
    motion: Any
    arrival_rate: Scalar
    departure_rate: Scalar

    def transition(self, interval: Scalar) -> tuple[Scalar, Scalar]:
        """Birth and survival probability over `interval` seconds (the module's equation)."""
        total = self.arrival_rate + self.departure_rate
        mixed = -jnp.expm1(-total * interval)
        share = jnp.where(total > 0, self.arrival_rate / jnp.where(total > 0, total, 1.0), 0.0)
        return share * mixed, 1.0 - (1.0 - share) * mixed

    def replacement(self, interval: Scalar) -> Scalar:
        r"""Probability that a present target leaves within `interval` seconds and a new one is there at its end.

        Notes
        -----
        .. math:: p_s - e^{-\mu T}

        the part of the survival probability in which the target is not the same. It is tiny, and it is what lets a
        filter that has locked on to the wrong place start again while a target is certain to exist.

        Examples
        --------
        >>> target = Target(birth=None, motion=None, arrival_rate=0.001, departure_rate=0.005)
        >>> f"{float(target.replacement(1.0)):.3g}"
        '2.49e-06'
        """
        total = self.arrival_rate + self.departure_rate
        absent = jnp.where(total > 0, self.departure_rate / jnp.where(total > 0, total, 1.0), 0.0)
        # A difference of two small numbers, so that float32 keeps its leading digits.
        return jnp.maximum(absent * jnp.expm1(-total * interval) - jnp.expm1(-self.departure_rate * interval), 0.0)


def rates(birth_probability: float, survival_probability: float, interval: float) -> tuple[float, float]:
    r"""Arrival and departure rates from probabilities per scan.

    Parameters
    ----------
    birth_probability : that an absent target appears between two scans.
    survival_probability : that a present target is still there at the next; above `birth_probability`.
    interval : between scans; seconds.

    Raises
    ------
    InputError : probabilities outside 0 to 1, or survival not above birth.

    Notes
    -----
    Inverse of the module's equation: :math:`e^{-(\lambda + \mu) T} = p_s - p_b`.

    Examples
    --------
    >>> arrival, departure = rates(0.001, 0.999, 1.0)
    >>> round(arrival, 6), round(departure, 6)
    (0.001001, 0.001001)
    """
    stays, appears = survival_probability, birth_probability
    if not (0 <= appears < stays <= 1):
        raise InputError(
            f"birth_probability {appears} and survival_probability {stays}: "
            "expected 0 <= birth_probability < survival_probability <= 1."
        )

    total = -math.log(stays - appears) / interval
    if total == 0:
        return 0.0, 0.0
    share = appears / (1 - (stays - appears))
    return total * share, total * (1 - share)
