r"""Thresholds on existence for a false-track probability over a stated time.

**By counting.** Run on noise alone, keep the highest existence of each run; the threshold is the quantile that as many
runs exceed as are wanted. It serves every method and needs thirty runs for each false track that is to be seen:
30,000 for a probability of 1e-3.

**By Wald's identity.** A Bernoulli filter carries a likelihood ratio: the product over scans of

.. math:: \Lambda_k = \prod_{j \le k} \left[ (1 - q_j) + q_j I_j \right]

with q the predicted existence and I the evidence is :math:`dP_1/dP_0`, P_1 the filter's own model in which targets come
and go and P_0 noise alone. So at the scan in which existence first passes the threshold,

.. math::
    P_0(\text{declare within } T) = E_1\left[ \frac{1(\text{declare})}{\Lambda_\text{at declaration}} \right]

(Wald 1945). Runs drawn from P_1 do declare, so a hundredth of the runs give the same precision. Draws with a target and
without one are strata: almost all that counts comes from the first. It needs a true likelihood ratio; the particles'
estimate of it is good enough that both ways agree.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.special import expit, logit, ndtri

from faintrack.errors import InputError
from faintrack.metrics.intervals import quantile_interval, tail

LARGEST_LOG_ODDS = 30.0
"""Thresholds are looked for up to existence 1 - 1e-13."""


@dataclass(frozen=True)
class Threshold:
    """Threshold on the probability of existence, and its interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Stratum:
    """Runs drawn from the filter's model, given something that happens with a known probability.

    Attributes
    ----------
    probability : of the stratum under the model.
    log_odds : shape (run, scan); of existence after each scan.
    log_ratio : shape (run, scan); the module's ratio after each scan, natural log.
    """

    probability: float
    log_odds: Float[np.ndarray, "run scan"]
    log_ratio: Float[np.ndarray, "run scan"]


def counted_threshold(
    highest_log_odds: Float[np.ndarray, " run"], probability: float, confidence: float = 0.95
) -> Threshold:
    """Threshold that noise passes with the given probability, from the highest log odds of each run on noise.

    Parameters
    ----------
    highest_log_odds : natural log of the odds of existence, the highest of each run.
    probability : of a false track in a run.
    confidence : of the interval; its upper end is 1 where the runs are too few to bound it.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> threshold = counted_threshold(rng.normal(size=10_000), 0.01)
    >>> round(float(logit(threshold.value)), 1)
    2.3
    """
    level = np.quantile(highest_log_odds, 1 - probability, method="higher")
    low, high = quantile_interval(highest_log_odds, 1 - probability, confidence)
    return Threshold(float(expit(level)), float(expit(low)), float(expit(high)))


def declaration_probability(strata: Sequence[Stratum], threshold: float) -> tuple[float, float]:
    """Probability that noise passes a threshold, by the module's identity, and its standard error.

    Parameters
    ----------
    strata : draws from the filter's model; their probabilities sum to 1.
    threshold : on existence.

    Examples
    --------
    >>> declared = Stratum(1.0, np.array([[0.0, 5.0], [0.0, 1.0]]), np.log(np.array([[1.0, 50.0], [1.0, 2.0]])))
    >>> round(declaration_probability([declared], 0.9)[0], 4)
    0.01
    """
    return _declared(strata, float(logit(threshold)))


def wald_threshold(strata: Sequence[Stratum], probability: float, confidence: float = 0.95) -> Threshold:
    """Threshold that noise passes with the given probability, by the module's identity.

    Parameters
    ----------
    strata : draws from the filter's model; their probabilities sum to 1.
    probability : of a false track in the time of a run.
    confidence : of the interval: thresholds whose estimated probability is not told from the wanted one.

    Raises
    ------
    InputError : the runs do not reach thresholds high enough; more, or longer, runs are needed.
    """
    highest = np.concatenate([stratum.log_odds.max(axis=1) for stratum in strata]).astype(float)
    # Log odds of loud targets reach thousands; thresholds that anybody uses lie within these.
    low, high = np.clip([highest.min(), np.quantile(highest, 0.98)], -LARGEST_LOG_ODDS, LARGEST_LOG_ODDS)
    grid = np.linspace(float(low), float(high), 1000)
    estimates = np.array([_declared(strata, level) for level in grid])
    z = -ndtri(tail(confidence))
    middle, spread = estimates.T

    def crossing(values: np.ndarray) -> float:
        above = np.flatnonzero(values > probability)
        if above.size == 0:
            return float(grid[0])
        if above[-1] == len(grid) - 1:
            raise InputError(
                f"the runs do not reach a threshold with a false-track probability of {probability:g}; "
                "draw more of them, or longer ones."
            )
        return float(grid[above[-1] + 1])

    return Threshold(*(float(expit(crossing(values))) for values in (middle, middle - z * spread, middle + z * spread)))


def _declared(strata: Sequence[Stratum], level: float) -> tuple[float, float]:
    total, variance = 0.0, 0.0
    for stratum in strata:
        passed = stratum.log_odds >= level
        first = passed.argmax(axis=1)
        at = np.take_along_axis(stratum.log_ratio, first[:, None], axis=1)[:, 0]
        weight = np.where(passed.any(axis=1), np.exp(-at.astype(float)), 0.0)
        total += stratum.probability * weight.mean()
        variance += stratum.probability**2 * weight.var(ddof=1) / len(weight) if len(weight) > 1 else 0.0
    return float(total), float(np.sqrt(variance))
