r"""The Bernoulli filter on a grid: at most one target, a weight for every cell, log odds for whether.

Prediction is that of `faintrack.filters.bernoulli_particle` with sums in place of draws. A transport carries the
weights of one target over an interval; what it carries off the grid, a share :math:`\epsilon`, has left:

.. math::
    q' w'(s) = p_b (1 - q) b(s) + p_s q \sum_{s'} T(s|s') w(s'), \qquad \epsilon = 1 - \sum_{s, s'} T(s|s') w(s')

(stone2002, eq. 16; aughenbaugh2010, eq. 3-4). A target that is off the grid counts as absent, or, with `returns`, comes
back by the birth density at once, as aughenbaugh2010 has it.

Where the flow to absence balances the flow from it, absence is as likely after prediction as before, and the likelihood
ratio obeys the simplified recursion (stone2002, eq. 20-25)

.. math:: \Lambda^-(s) = q(s|\phi) + \sum_{s'} q(s|s') \Lambda(s')

which `simplified` takes, balanced or not. The error is that of taking :math:`p^-(\phi) = p(\phi)`: the odds are wrong
by the factor of the two.

Transports: `faintrack.filters.shifts`, exact where velocities are discrete; `faintrack.filters.separable`, nearly
constant velocity and Ornstein-Uhlenbeck; `faintrack.filters.adi`, the Fokker-Planck equation;
`faintrack.filters.cell_particles`, draws in every cell.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, Protocol, runtime_checkable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from faintrack.beliefs.belief import Belief
from faintrack.beliefs.grids import Grid
from faintrack.targets.target import Target

Advance = Callable[[Array, Array], tuple[Array, Array]]
Tabled = Array | np.ndarray


@runtime_checkable
class Transport(Protocol):
    """Carries the weights of a target that stays from one time to another."""

    def carry(
        self, log_weights: Float[Array, "*cells"], start: Any, end: Any, key: PRNGKeyArray
    ) -> tuple[Float[Array, "*cells"], Float[Array, ""]]:
        """Log weights that are still on the grid, not normalised, and the log of the weight that has left it."""


@runtime_checkable
class Linear(Protocol):
    """Transport by repeated linear steps of fixed length.

    Its weights can be mixed with those of new targets before their logarithms are taken, which saves half of them.
    """

    interval: float

    def advances(self, key: PRNGKeyArray) -> Sequence[Advance]:
        """Functions of (weights, number of the step), see `in_steps`."""


class GridFilter(eqx.Module):
    """Carries a belief on a grid forward in time.

    Attributes
    ----------
    grid : cells.
    target : arrival and departure; its motion is the transport's.
    transport : carries weights over an interval.
    log_birth : natural log of each cell's probability for a new target, broadcasts to the cells; the same for all cells
        where not given.
    returns : a target that leaves the grid comes back by the birth density; otherwise it has left.
    simplified : takes the simplified recursion (the module's last equation).
    """

    grid: Grid = eqx.field(static=True)
    target: Target
    transport: Transport
    log_birth: Float[Array, "..."] | None = None
    returns: bool = eqx.field(static=True, default=False)
    simplified: bool = eqx.field(static=True, default=False)

    def init(self, key: PRNGKeyArray, time: float = 0.0, existence: float = 0.0) -> Belief:
        """Belief before any scan: the birth density, and a probability of existence. Nothing is drawn."""
        birth = jnp.broadcast_to(self._birth, self.grid.shape)
        odds = jnp.asarray(existence, birth.dtype)
        log_odds = jnp.log(odds) - jnp.log1p(-odds)
        return Belief(self.grid.states(birth.dtype), birth, log_odds, jnp.asarray(time, birth.dtype))

    def predict(self, belief: Belief, time: Float[Array, ""] | float, key: PRNGKeyArray) -> Belief:
        """Belief carried forward to `time` (the module's equations).

        Parameters
        ----------
        belief, time : what to carry forward, and to when; seconds.
        key : random key; most transports draw nothing.
        """
        dtype = belief.log_weights.dtype
        time = jnp.asarray(time, dtype)
        interval = time - belief.time
        mixed, log_lost = self._moved(belief, time, key)
        log_kept = jnp.log1p(-jnp.minimum(jnp.exp(log_lost), 1))

        forecast = self.target.forecast(belief.log_odds, interval)
        off_grid = forecast.same + log_lost
        forecast = forecast._replace(same=forecast.same + log_kept)
        if self.returns:
            forecast = forecast._replace(replaced=jnp.logaddexp(forecast.replaced, off_grid))
        else:
            forecast = forecast._replace(left=jnp.logaddexp(forecast.left, off_grid))
        log_odds = forecast.log_odds
        if self.simplified:
            log_odds = forecast.existence - jax.nn.log_sigmoid(-belief.log_odds)
        return Belief(belief.states, mixed(*forecast.shares), log_odds, time)

    def carry(self, belief: Belief, time: Float[Array, ""], key: PRNGKeyArray) -> tuple[Belief, Float[Array, ""]]:
        """Belief of a target that stays, carried forward to `time` without births; the log of the share that left."""
        mixed, log_lost = self._moved(belief, time, key)
        log_weights = mixed(jnp.zeros_like(belief.log_odds), jnp.full_like(belief.log_odds, -jnp.inf))
        return Belief(belief.states, log_weights, belief.log_odds, time), log_lost

    def taken(self, belief: Belief, inside: Bool[Array, "..."], key: PRNGKeyArray) -> Belief:
        """Weights of a target that has been found: those of the cells inside."""
        mine = jnp.where(inside, belief.log_weights, -jnp.inf)
        share = jax.nn.logsumexp(mine)
        return Belief(belief.states, mine - share, belief.log_odds + share, belief.time)

    def _moved(
        self, belief: Belief, time: Float[Array, ""], key: PRNGKeyArray
    ) -> tuple[Callable[[Array, Array], Array], Float[Array, ""]]:
        """Log weights as a function of the log shares of those that stay and of those that are new; log of the loss."""
        birth = self._birth.astype(belief.log_weights.dtype)
        if not isinstance(self.transport, Linear):
            moved, log_lost = self.transport.carry(belief.log_weights, belief.time, time, key)
            total = jax.nn.logsumexp(moved)
            moved = jnp.where(total > -jnp.inf, moved - total, -jnp.inf)
            return lambda stay, new: jnp.logaddexp(stay + moved, new + birth), log_lost
        weights, lost, peak = _in_steps(
            self.transport.advances(key), belief.log_weights, belief.time, time, self.transport.interval
        )
        scale = jnp.sum(weights)
        scale = jnp.where(scale > 0, 1 / scale, 0)

        def mixed(stay: Array, new: Array) -> Array:
            larger = jnp.maximum(stay, new)
            return larger + jnp.log(jnp.exp(stay - larger) * scale * weights + jnp.exp(new - larger + birth))

        return mixed, jnp.log(lost) + peak

    @property
    def _birth(self) -> Float[Array, "..."]:
        """Natural log of each cell's share of new targets; one number where it is the same for all."""
        # A type of its own: with a weak one what a filter starts with would be compiled for apart from the rest.
        return jnp.asarray(-math.log(self.grid.size), float) if self.log_birth is None else self.log_birth


def in_steps(
    advances: Sequence[Advance], log_weights: Float[Array, "*cells"], start: Any, end: Any, interval: Any
) -> tuple[Float[Array, "*cells"], Float[Array, ""]]:
    """Repeat steps of fixed length as often as they fit between two times, to the nearest whole number.

    Parameters
    ----------
    advances : functions of (weights, number of the step) to weights that are still on the grid and the weight that is
        not; linear, so that weights may have any scale. They commute: each is repeated before the next begins.
    log_weights : natural logs.
    start, end : seconds.
    interval : of one step; seconds.

    Returns
    -------
    Log weights, and the log of the weight that has left. What is less than the type's smallest number times the
    largest weight, e^-87 in float32, becomes zero.
    """
    weights, lost, peak = _in_steps(advances, log_weights, start, end, interval)
    return jnp.log(weights) + peak, jnp.log(lost) + peak


def _in_steps(
    advances: Sequence[Advance], log_weights: Float[Array, "*cells"], start: Any, end: Any, interval: Any
) -> tuple[Float[Array, "*cells"], Float[Array, ""], Float[Array, ""]]:
    """Weights and what has left over the largest weight before, and the log of that."""
    count = jnp.round((end - start) / interval).astype(jnp.int32)
    peak = jnp.max(log_weights)
    weights, lost = jnp.exp(log_weights - peak), jnp.zeros((), log_weights.dtype)
    for advance in advances:

        def again(number: Array, carried: tuple[Array, Array], advance: Advance = advance) -> tuple[Array, Array]:
            weights, more = advance(carried[0], number)
            return weights, carried[1] + more

        weights, lost = jax.lax.fori_loop(0, count, again, (weights, lost))
    return weights, lost, peak


def left_the_grid(
    weights: Float[Array, "*cells"], place: int, rate: int, leaving: Float[Tabled, "rate place"]
) -> Float[Array, ""]:
    """Weight that one step of a component carries off the grid.

    Parameters
    ----------
    weights : before the step.
    place, rate : numbers of the axes of the component and of its rate.
    leaving : probability of leaving the grid in the step.
    """
    front = jnp.moveaxis(weights, (rate, place), (0, 1))
    return jnp.sum(front.sum(axis=tuple(range(2, front.ndim))) * jnp.asarray(leaving, weights.dtype))
