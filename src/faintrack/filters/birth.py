r"""Where new targets appear on a grid, if targets come and go by moving alone.

A uniform birth density lets targets appear anywhere. Where the region is open and ships neither surface nor sink, they
come in over its edge. With :math:`\pi` the prior of a target that is there, spread evenly over the positions with the
velocities that the motion has in the long run, T what the motion does to the weights of targets that stay on the grid,
and q the prior probability that there is a target, the prior is the same after every prediction if

.. math:: b \propto \pi - T \pi, \qquad p_b (1 - q) = q \sum (\pi - T \pi)

(La Cour, *Stationary priors for Bayesian target tracking*, 2008, to which aughenbaugh2010 points). The difference is
never negative, since every weight that arrives at a cell would do so on a grid without edges, where :math:`\pi` is
stationary. It sits at the edges, with velocities that point inward.
"""

import math
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from faintrack.errors import InputError
from faintrack.filters.separable import Separable

RARE = 1e-12
"""Weight relative to the prior's that a rounding error may leave in a cell."""


class Stationary(NamedTuple):
    """A birth density and rate that keep a prior as it is.

    Attributes
    ----------
    log_prior : natural log of each cell's probability for a target that is there.
    log_birth : the same for a new target.
    arrival_rate : of an absent target, per second; the departure rate is 0, targets leave by moving.
    """

    log_prior: Float[Array, "*cells"]
    log_birth: Float[Array, "*cells"]
    arrival_rate: float


def stationary(transport: Separable, existence: float) -> Stationary:
    """Birth density and rate that keep the prior of a motion on a grid.

    Parameters
    ----------
    transport : kernels on the grid.
    existence : q, prior probability that there is a target.

    Raises
    ------
    InputError : a probability that is not between 0 and 1, or so high that more targets leave than can appear.

    Examples
    --------
    >>> from faintrack.beliefs.axis import Axis
    >>> from faintrack.filters.separable import separable
    >>> from faintrack.beliefs.grids import Grid
    >>> from faintrack.targets.motion import PlanarMotion
    >>> from faintrack.targets.states import RangeState
    >>> grid = Grid(RangeState, (("range", Axis(0.0, 1.0, 4)), ("range_rate", Axis(-1.0, 2.0, 2))))
    >>> born = stationary(separable(grid, PlanarMotion(0.5), 0.5), existence=0.1)
    >>> [[round(float(share), 2) for share in at] for at in jnp.exp(born.log_birth)]
    [[0.0, 0.49], [0.0, 0.0], [0.0, 0.0], [0.49, 0.0]]
    """
    if not 0 < existence < 1:
        raise InputError(f"stationary birth: existence is {existence:g}; expected a probability between 0 and 1.")
    grid = transport.grid
    prior, moved = np.ones(grid.shape), np.ones(grid.shape)
    for (place, rate), kernel in zip(grid.pairs, transport.kernels, strict=True):
        of_rate = _in_the_long_run(kernel.sum(axis=1))
        count = grid.shape[place]
        before = np.broadcast_to(of_rate[:, None] / count, (len(of_rate), count))
        after = _moved(kernel, before)
        for total, part in ((prior, before), (moved, after)):
            shape = [1] * len(grid.shape)
            shape[place], shape[rate] = count, len(of_rate)
            total *= (part if rate < place else part.T).reshape(shape)
    others = prior.sum()
    prior, moved = prior / others, moved / others
    newborn = np.maximum(prior - moved, 0)
    newborn[newborn < RARE * prior] = 0
    share = existence * newborn.sum() / (1 - existence)
    if not 0 < share < 1:
        raise InputError(
            f"stationary birth: with existence {existence:g} a target would have to appear with probability "
            f"{share:g} a scan; expected above 0 and below 1."
        )
    with np.errstate(divide="ignore"):
        log_birth = np.log(newborn / newborn.sum())
    rate_of_arrival = -math.log1p(-share) / transport.interval
    return Stationary(jnp.asarray(np.log(prior), float), jnp.asarray(log_birth, float), rate_of_arrival)


def _in_the_long_run(transition: Float[np.ndarray, "rate rate"]) -> Float[np.ndarray, " rate"]:
    """Probabilities that a transition, whose columns sum to 1, leaves as they are."""
    start = np.full(len(transition), 1 / len(transition))
    # Squared sixty times: as many steps as the slowest mixing of any use needs.
    for _ in range(60):
        transition = transition @ transition
        transition = transition / transition.sum(axis=0)
    return transition @ start


def _moved(
    kernel: Float[np.ndarray, "rate displacement rate"], before: Float[np.ndarray, "rate place"]
) -> Float[np.ndarray, "rate place"]:
    """Weights after one step, what leaves the grid left out."""
    reach, count = kernel.shape[1] // 2, before.shape[1]
    padded = np.pad(before, ((0, 0), (reach, reach)))
    shifted = np.stack([padded[:, 2 * reach - d : 2 * reach - d + count] for d in range(2 * reach + 1)])
    return np.einsum("ldj,djx->lx", kernel, shifted)
