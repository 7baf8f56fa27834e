r"""A target: how often it appears and leaves, where it appears, how it moves.

Existence is a two-state Markov chain in continuous time with arrival rate :math:`\lambda` and departure rate
:math:`\mu`. Over an interval :math:`T` an absent target appears, and a present one stays, with

.. math::
    p_b = \frac{\lambda}{\lambda + \mu} (1 - e^{-(\lambda + \mu) T}), \qquad
    p_s = 1 - \frac{\mu}{\lambda + \mu} (1 - e^{-(\lambda + \mu) T})

the birth and survival probabilities of bosser2022, eq. 1. Two predictions over T equal one over 2 T, so scans need
not come at equal times. `rates` turns a paper's probabilities per scan into rates.

A target that is there at both ends need not be the same: it may have left in between and another come, with probability
:math:`p_r = p_s - e^{-\mu T}`. With q the probability that a target exists, one of five things happens,

.. math::
    1 &= \underbrace{(1 - p_b)(1 - q)}_\text{none} + \underbrace{p_b (1 - q)}_\text{appeared}
      + \underbrace{e^{-\mu T} q}_\text{same} + \underbrace{p_r q}_\text{replaced}
      + \underbrace{(1 - p_s) q}_\text{left}, \\
    \frac{q'}{1 - q'} &= \frac{p_b (1 - q) + p_s q}{(1 - p_b)(1 - q) + (1 - p_s) q} .

`Target.forecast` gives the logarithms of these five, and is the only place where existence is carried forward in time:
filters, trackers and baselines differ in what they do with the states of those that are the same and of those that are
new, and read the rest here.
"""

import math
from typing import Any, NamedTuple, Protocol, TypeVar, runtime_checkable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.errors import InputError
from faintrack.numerics.draws import uniform

Scalar = Float[Array, ""] | float
State = TypeVar("State")
Born = TypeVar("Born", covariant=True)


@runtime_checkable
class Motion(Protocol[State]):
    """Draws states after an interval; see `faintrack.targets.motion`."""

    def move(self, states: State, interval: Scalar, key: PRNGKeyArray) -> State:
        """Draw the states after `interval` seconds; of the same kind and shape."""


@runtime_checkable
class Birth(Protocol[Born]):
    """Draws states of targets that appear; see `UniformBirth` and `faintrack.targets.births`."""

    def sample(self, key: PRNGKeyArray, count: int) -> Born:
        """Draw `count` states; components have the shape (count,)."""


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


class Forecast(NamedTuple):
    """What may happen to a target within an interval: natural logs of probabilities, which sum to 1.

    Attributes
    ----------
    none : there is none, before and after.
    appeared : there was none, and is one.
    same : there is one, the same as before.
    replaced : there was one, and another is there.
    left : there was one, and is none.
    """

    none: Float[Array, "..."]
    appeared: Float[Array, "..."]
    same: Float[Array, "..."]
    replaced: Float[Array, "..."]
    left: Float[Array, "..."]

    @property
    def new(self) -> Float[Array, "..."]:
        """There is one that was not there before."""
        return jnp.logaddexp(self.appeared, self.replaced)

    @property
    def stayed(self) -> Float[Array, "..."]:
        """There is one at both ends, the same or another."""
        return jnp.logaddexp(self.same, self.replaced)

    @property
    def existence(self) -> Float[Array, "..."]:
        """There is one."""
        return jnp.logaddexp(self.same, self.new)

    @property
    def log_odds(self) -> Float[Array, "..."]:
        """Natural log of the odds that there is one."""
        return self.existence - jnp.logaddexp(self.left, self.none)

    @property
    def shares(self) -> tuple[Float[Array, "..."], Float[Array, "..."]]:
        """Natural logs of the shares of existence: of the same target, and of a new one.

        Where no target can exist yet, as in a scan at the time of the start, a new one is what is believed.
        """
        existence = self.existence
        possible = existence > -jnp.inf
        return (
            jnp.where(possible, self.same - existence, -jnp.inf),
            jnp.where(possible, self.new - existence, 0),
        )


def odds_of(log_probability: Float[Array, "..."]) -> Float[Array, "..."]:
    """Natural log of the odds, from that of a probability.

    Examples
    --------
    >>> round(float(odds_of(jnp.log(0.8))), 4)  # log 4
    1.3863
    """
    return log_probability - jnp.log(-jnp.expm1(log_probability))


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
        appears, leaves = self._changes(interval)
        return appears, 1.0 - leaves

    def forecast(self, log_odds: Float[Array, "..."], interval: Scalar) -> Forecast:
        """What may happen within `interval` seconds to a target that exists with these odds (the module's equation).

        Parameters
        ----------
        log_odds : natural log of q / (1 - q); of one target, or of several.
        interval : seconds.

        Examples
        --------
        >>> target = Target(birth=None, motion=None, arrival_rate=0.1, departure_rate=0.3)
        >>> once = target.forecast(jnp.array(2.0), 5.0).log_odds
        >>> twice = target.forecast(target.forecast(jnp.array(2.0), 2.0).log_odds, 3.0).log_odds
        >>> round(float(once), 4), round(float(twice), 4)
        (-0.684, -0.684)
        """
        there, absent = jax.nn.log_sigmoid(log_odds), jax.nn.log_sigmoid(-log_odds)
        appears, leaves = self._changes(interval)
        return Forecast(
            none=jnp.log1p(-appears) + absent,
            appeared=jnp.log(appears) + absent,
            same=there - self.departure_rate * interval,
            replaced=jnp.log(self.replacement(interval)) + there,
            left=jnp.log(leaves) + there,
        )

    def _changes(self, interval: Scalar) -> tuple[Scalar, Scalar]:
        """Probability that an absent target appears, and that of a present one to be absent at the end."""
        total = self.arrival_rate + self.departure_rate
        mixed = -jnp.expm1(-total * interval)
        share = jnp.where(total > 0, self.arrival_rate / jnp.where(total > 0, total, 1.0), 0.0)
        return share * mixed, (1.0 - share) * mixed

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
