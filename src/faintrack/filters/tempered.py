r"""Taking in a scan that says far more than the particles can tell apart.

A loud source has a likelihood that is narrow beside the gaps between particles: taken in at once, it leaves one of
them. So it is taken in by powers :math:`0 < \beta_1 < \dots < \beta_n = 1` of the ratio (annealed importance sampling,
Neal 2001), each as large as leaves `SCARCE` of the particles in effect. In between the particles are drawn anew and
moved apart within what they have become, their mean and covariance kept (Liu and West 2001):

.. math:: x_i \leftarrow \bar x + \sqrt{1 - h^2} (x_i - \bar x) + h \, C^{1/2} n_i

The ratio may be read more closely the narrower they are. The evidence is the product of the mean ratios of the steps.
Where one step is enough nothing is moved, and the update is that of `faintrack.beliefs.belief`.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.beliefs.belief import Belief, moments, update
from faintrack.beliefs.components import angles, components, signs
from faintrack.numerics.draws import normal
from faintrack.numerics.precision import full_precision
from faintrack.numerics.resampling import systematic

SCARCE = 0.3
"""Share of the particles that is left in effect by a step."""

KERNEL = 0.4
"""h, standard deviation of a move over that of all particles."""

STEPS = 24
"""Steps at most; the last takes in what is left."""

HALVINGS = 30
"""Of the interval in which the size of a step is looked for."""


def tempered(
    belief: Belief, log_ratio: Callable[[Belief], Float[Array, " point"]], key: PRNGKeyArray
) -> tuple[Belief, Float[Array, ""]]:
    """Take in a scan in as many steps as its particles need (the module's equations).

    Parameters
    ----------
    belief : of particles, predicted to the time of the scan.
    log_ratio : function of a belief to the natural log of p(scan | target at state) / p(scan | no target), at its
        points.
    key : random key.

    Returns
    -------
    The updated belief, and the log evidence, as of `faintrack.beliefs.belief.update`.
    """

    def unfinished(carried: tuple[Any, ...]) -> Array:
        return carried[1] > 0

    def advance(carried: tuple[Any, ...]) -> tuple[Any, ...]:
        belief, left, evidence, number = carried
        ratio = log_ratio(belief)
        power = jnp.where(number >= STEPS - 1, left, _power(belief.log_weights, ratio, left))
        belief, gained = update(belief, power * ratio)
        left = jnp.where(power < left, left - power, 0)
        belief = jax.lax.cond(left > 0, lambda: apart(belief, jax.random.fold_in(key, number)), lambda: belief)
        return belief, left, evidence + gained, number + 1

    start = (belief, jnp.ones_like(belief.log_odds), jnp.zeros_like(belief.log_odds), 0)
    belief, _, evidence, _ = jax.lax.while_loop(unfinished, advance, start)
    return belief, evidence


def _power(log_weights: Array, log_ratio: Array, left: Array) -> Float[Array, ""]:
    """Largest power up to what is left with which the effective number of particles stays above `SCARCE`."""
    least = jnp.log(SCARCE * log_weights.size)
    log_ratio = log_ratio - jnp.max(log_ratio)

    def enough(power: Array) -> Array:
        tilted = jax.nn.log_softmax(log_weights + power * log_ratio)
        return -jax.nn.logsumexp(2 * tilted) >= least

    def halve(_: Any, ends: tuple[Array, Array]) -> tuple[Array, Array]:
        low, high = ends
        # By ratios: the power may be of any size.
        middle = jnp.sqrt(low * high)
        good = enough(middle)
        return jnp.where(good, middle, low), jnp.where(good, high, middle)

    low, _ = jax.lax.fori_loop(0, HALVINGS, halve, (1e-9 * left, left))
    return jnp.where(enough(left), left, low)


@full_precision
def apart(belief: Belief, key: PRNGKeyArray, count: int | None = None) -> Belief:
    """Particles drawn anew with equal weights, and moved apart (the module's second equation).

    Parameters
    ----------
    belief : of particles.
    key : random key.
    count : particles to draw; as many as there are where not given.
    """
    for_choice, for_move = jax.random.split(key)
    count = belief.log_weights.size if count is None else count
    middle, matrix = moments(belief)
    chosen = systematic(for_choice, belief.log_weights, count, count)
    states = jax.tree.map(lambda values: values[chosen], belief.states)
    scale = jnp.sqrt(jnp.maximum(jnp.diagonal(matrix), jnp.finfo(matrix.dtype).tiny))
    root = jnp.linalg.cholesky(matrix / (scale[:, None] * scale) + 1e-4 * jnp.eye(len(scale), dtype=matrix.dtype))
    moves = (root * scale[:, None]) @ normal(key=for_move, shape=(len(scale), count), dtype=matrix.dtype)
    moved = {}
    for number, (name, values) in enumerate(components(states).items()):
        if name in signs(states):
            continue
        at = getattr(middle, name)
        off = values - at
        if name in angles(states):
            off = off - 2 * jnp.pi * jnp.round(off / (2 * jnp.pi))
        moved[name] = (at + jnp.sqrt(1 - KERNEL**2) * off + KERNEL * moves[number]).astype(values.dtype)
    equal = jnp.full(count, -jnp.log(count), belief.log_weights.dtype)
    born = None if belief.born is None else belief.born[chosen]
    return dataclasses.replace(belief, states=dataclasses.replace(states, **moved), log_weights=equal, born=born)
