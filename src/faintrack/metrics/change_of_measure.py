r"""Probabilities under noise that are too small to count, from runs with a target.

With the likelihood ratio :math:`\Lambda = dP_1/dP_0` of all data of a run, any event A that the data decide has under
noise the probability

.. math:: P_0(A) = E_1\left[ \frac{1(A)}{\Lambda} \right],

the mean over runs drawn from P_1, in which A happens often. Everything stays in logarithms: 1e-20 costs no more runs
than 1e-3. P_1 must be exactly what the ratio is of: the target drawn from the prior and the motion that the filter
believes in. Within a run, at a first passage, it is Wald's identity (`faintrack.metrics.thresholds`).
"""

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import logsumexp

from faintrack.errors import InputError


def log_probability_under_noise(
    happened: Bool[np.ndarray, " run"], log_ratio: Float[np.ndarray, " run"]
) -> tuple[float, float]:
    """Natural log of the probability of an event under noise, and the standard error of the log.

    Parameters
    ----------
    happened : whether the event did, in each run with a target.
    log_ratio : natural log of p(all data of the run | target model) / p(the same | noise).

    Returns
    -------
    The log, minus infinity where the event never happened; its standard error by the delta method: that of the
    probability over the probability.

    Raises
    ------
    InputError : fewer than two runs, or arrays of different lengths.

    Notes
    -----
    The module's equation. It holds the error honest only if the event happens in many runs.

    Examples
    --------
    >>> found, error = log_probability_under_noise(np.array([True, True, True, False]), np.array([40.0, 42, 41, 3]))
    >>> round(found, 2), round(error, 2)
    (-40.98, 0.59)
    """
    happened, log_ratio = np.asarray(happened, bool), np.asarray(log_ratio, float)
    if happened.ndim != 1 or happened.shape != log_ratio.shape or happened.size < 2:
        raise InputError(
            f"happened and log_ratio have shapes {happened.shape} and {log_ratio.shape}; expected one value a run in "
            "each, at least two."
        )
    if not happened.any():
        return -np.inf, np.nan
    runs = happened.size
    logs = np.where(happened, -log_ratio, -np.inf)
    log_mean = logsumexp(logs) - np.log(runs)
    relative = np.exp(logs - log_mean)
    return float(log_mean), float(relative.std(ddof=1) / np.sqrt(runs))
