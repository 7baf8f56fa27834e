r"""Dynamic programming: the likeliest path of a target instead of the sum over all.

In place of the likelihood ratio of a state, the sum over all paths that lead there (stone2002, eq. 15-19), it keeps
that of the best one. With :math:`z_k` the scan, :math:`\phi` absence, :math:`p_b` and :math:`p_s` the probabilities of
appearing and of staying, b the birth density and T the motion,

.. math::
    V_k(s) &= \max\left[ p_b\, b(s) V_{k-1}(\phi),\; p_s \max_{s'} T(s|s') V_{k-1}(s') \right] \ell(z_k | s), \\
    V_k(\phi) &= \max\left[ (1 - p_b) V_{k-1}(\phi),\; (1 - p_s) \max_s V_{k-1}(s) \right],

Viterbi's algorithm with a state for absence. A target is declared where :math:`\max_s V_k(s) / V_k(\phi)` passes a
threshold, and is where that path ends. This is no probability: many paths that are alike count as one. Use it to
compare with; `faintrack.filters.grid` costs little more and says what to believe.
"""

import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from faintrack.beliefs.belief import Belief, mode
from faintrack.beliefs.grids import Grid
from faintrack.filters.shifts import Shifts
from faintrack.likelihoods.protocols import CellMeans, Likelihood, log_ratios


class Viterbi(eqx.Module):
    """What paths are like.

    Attributes
    ----------
    grid : states.
    transport : shifts that keep the likeliest of the paths that meet, `join` is `jax.numpy.max`.
    birth : probability that a target appears between two scans, all states alike.
    survival : that it stays.
    """

    grid: Grid = eqx.field(static=True)
    transport: Shifts
    birth: float
    survival: float


def follow(viterbi: Viterbi, likelihood: Likelihood | CellMeans, scans: Any) -> tuple[Float[Array, " scan"], Any]:
    """Score of the best path after every scan, and the state in which it ends.

    Parameters
    ----------
    viterbi : what paths are like.
    likelihood : what takes in a scan.
    scans : as many scans as the first axis of every field is long, an interval of the transport apart.

    Returns
    -------
    Natural log of the best path's ratio to absence (the module's equation); the state's components have the shape
    (scan,).
    """
    # Nothing is drawn: the key is never read.
    unused, states = jax.random.key(0), viterbi.grid.states()
    log_birth = math.log(viterbi.birth / viterbi.grid.size)

    def advance(carried: tuple[Array, Array], scan: Any) -> tuple[tuple[Array, Array], tuple[Array, Any]]:
        """Everything over V of absence, which therefore is 1."""
        before, time = carried
        absent = jnp.maximum(math.log1p(-viterbi.birth), math.log1p(-viterbi.survival) + jnp.max(before))
        moved, _ = viterbi.transport.carry(before, time, scan.time, unused)
        moved = jnp.maximum(log_birth, math.log(viterbi.survival) + moved)
        score = moved + log_ratios(likelihood, scan, states) - absent
        best = jnp.max(score)
        return (score, scan.time), (best, mode(Belief(states, score, best, scan.time)))

    nothing = jnp.full(viterbi.grid.shape, -jnp.inf), scans.time[0]
    return jax.lax.scan(advance, nothing, scans)[1]
