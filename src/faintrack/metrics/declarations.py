r"""When to say that a target is there: thresholds on the integrated target likelihood ratio.

The odds of existence :math:`\bar\Lambda = p(1) / p(\phi)` are all that a decision needs (stone2002, 3.4): a target is
declared where they exceed a threshold :math:`\Lambda_T`. Each function here gives the log of one, to be compared with
`Belief.log_odds`:

- `bayes_risk`, least expected cost (eq. 29);
- `confidence`, a probability that the target is there;
- `IDEAL_RECEIVER`, fewest wrong calls, the special case of equal costs, at a probability of one half;
- a wished rate of false alarms (Neyman and Pearson) is `faintrack.metrics.thresholds`, by drawing.

A threshold on the peak of the surface (`passes_peak`) is what stone2002 uses in its examples: it asks that the evidence
be in one cell, and says in the same breath where the target is.
"""

import math

import jax.numpy as jnp
from jaxtyping import Array, Bool

from faintrack.beliefs.belief import Belief
from faintrack.beliefs.grids import surface
from faintrack.errors import InputError

IDEAL_RECEIVER = 0.0
"""Log of the odds beyond which a target is likelier there than not."""


def bayes_risk(false_alarm: float, miss: float, detection: float = 0.0, rejection: float = 0.0) -> float:
    r"""Log of the odds beyond which declaring costs less than not declaring.

    Parameters
    ----------
    false_alarm : cost of declaring a target that is not there, :math:`C(1|\phi)`; any one unit for all costs.
    miss : of not declaring one that is, :math:`C(\phi|1)`.
    detection : of declaring one that is, :math:`C(1|1)`; less than `miss`.
    rejection : of not declaring where there is none, :math:`C(\phi|\phi)`; less than `false_alarm`.

    Raises
    ------
    InputError : a wrong decision that costs no more than the right one.

    Notes
    -----
    .. math:: \Lambda_T = \frac{C(1|\phi) - C(\phi|\phi)}{C(\phi|1) - C(1|1)}

    Source: stone2002, eq. 29.

    Examples
    --------
    >>> round(math.exp(bayes_risk(false_alarm=10.0, miss=2.0)), 3)
    5.0
    """
    if not (false_alarm > rejection and miss > detection):
        raise InputError(
            f"false_alarm {false_alarm:g}, rejection {rejection:g}, miss {miss:g}, detection {detection:g}: "
            "expected false_alarm above rejection and miss above detection."
        )
    return math.log(false_alarm - rejection) - math.log(miss - detection)


def confidence(probability: float) -> float:
    r"""Log of the odds at which a target is there with this probability, :math:`p_T / (1 - p_T)`.

    Raises
    ------
    InputError : a probability that is not between 0 and 1.

    Examples
    --------
    >>> confidence(0.5) == IDEAL_RECEIVER, round(confidence(0.97), 3)
    (True, 3.476)
    """
    if not 0 < probability < 1:
        raise InputError(f"probability is {probability:g}; expected a number between 0 and 1.")
    return math.log(probability) - math.log1p(-probability)


def passes_peak(belief: Belief, threshold: float) -> Bool[Array, ""]:
    """Whether the likelihood ratio surface exceeds a threshold anywhere; where, says `faintrack.beliefs.belief.mode`.

    Parameters
    ----------
    belief : on a grid.
    threshold : natural log of the target likelihood ratio of a cell.

    Examples
    --------
    >>> belief = Belief(None, jnp.log(jnp.array([0.9, 0.1])), jnp.array(2.0), jnp.array(0.0))
    >>> bool(passes_peak(belief, 1.5)), bool(passes_peak(belief, 2.0))
    (True, False)
    """
    return jnp.max(surface(belief)) > threshold
