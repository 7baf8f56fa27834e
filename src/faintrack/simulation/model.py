r"""Targets drawn from a model: the same that a filter believes in.

Arrival, departure and replacement are those of `faintrack.targets.target`, motion and birth density the target's own.
With `born` the draw is conditional: a target appears at least once, at first in scan k with probability proportional to
:math:`(1 - p_b)^{k-1} p_b`.
"""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from faintrack.targets.target import Target


def draw_target(key: PRNGKeyArray, target: Target, time: Float[Array, " scan"]) -> tuple[Any, Bool[Array, " scan"]]:
    """State and presence of a target that appears at least once.

    Parameters
    ----------
    key : random key.
    target : birth, motion, arrival and departure.
    time : of each scan, at equal intervals, the first one interval after the start; seconds.

    Returns
    -------
    States with components of shape (scan,), which mean nothing where the target is absent; whether it is present.

    Examples
    --------
    >>> from faintrack.targets.motion import BearingMotion
    >>> from faintrack.targets.states import BearingState
    >>> from faintrack.targets.target import UniformBirth
    >>> corner = BearingState(jnp.array(1.0), jnp.array(0.0), jnp.array(-10.0))
    >>> target = Target(UniformBirth(corner, corner), BearingMotion(), 0.01, 0.01)
    >>> states, present = draw_target(jax.random.key(0), target, jnp.arange(1.0, 51.0))
    >>> states.bearing.shape, bool(present.any())
    ((50,), True)
    """
    interval = time[0]
    appears, stays = target.transition(interval)
    replaced = target.replacement(interval)
    scans = time.shape[0]
    for_first, for_birth, rest = jax.random.split(key, 3)
    # Inverse of the distribution of the first scan with a target, cut off at the last scan.
    share = jax.random.uniform(for_first) * -jnp.expm1(scans * jnp.log1p(-appears))
    first = jnp.clip(jnp.floor(jnp.log1p(-share) / jnp.log1p(-appears)), 0, scans - 1)
    newborn = jax.tree.map(lambda component: component[0], target.birth.sample(for_birth, 1))

    def advance(carry: tuple[Any, Array], number: Array) -> tuple[tuple[Any, Array], tuple[Any, Array]]:
        state, there = carry
        for_change, for_motion, for_state = jax.random.split(jax.random.fold_in(rest, number), 3)
        change = jax.random.uniform(for_change)
        fresh = jax.tree.map(lambda component: component[0], target.birth.sample(for_state, 1))
        moved = target.motion.move(state, interval, for_motion)
        is_first = number == first
        begins = jnp.where(there, change < replaced, change < appears) & (number > first)
        present = is_first | (((there & (change < stays)) | (~there & begins)) & (number > first))
        state = jax.tree.map(
            lambda old, new, start: jnp.where(is_first, start, jnp.where(begins, new, old)), moved, fresh, newborn
        )
        return (state, present), (state, present)

    return jax.lax.scan(advance, (newborn, jnp.array(False)), jnp.arange(scans))[1]


def birth_probability(target: Target, interval: Float[Array, ""] | float, scans: int) -> float:
    """Probability that a target appears at least once in so many scans.

    Examples
    --------
    >>> round(birth_probability(Target(None, None, 0.001, 0.005), 1.0, 180), 3)
    0.164
    """
    appears, _ = target.transition(interval)
    return float(-jnp.expm1(scans * jnp.log1p(-appears)))
