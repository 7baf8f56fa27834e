"""When a target was detected.

The probability of detection is the share of runs with a track, `np.mean(declared, axis=0)`, with
`faintrack.metrics.intervals.binomial_interval` for how sure it is. The delay is a number for each run, and where a run
ends before the target is detected only a lower bound of it is known. A mean over the detected runs alone would favour
the tracker that misses the hard ones; state the median or another quantile instead, with the runs that never detected
as infinite (`faintrack.metrics.intervals.quantile_interval`).
"""

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from faintrack.errors import InputError


def time_to_detection(declared: ArrayLike, time: ArrayLike, appears: ArrayLike = 0.0) -> Float[np.ndarray, "..."]:
    """Time from the appearance of a target to the first scan from then on in which it is declared.

    Parameters
    ----------
    declared : shape (..., scan); whether there is a track of the target. A false track that stands when the target
        appears would count as a detection: declare only what is near the target.
    time : shape (scan,), increasing; seconds.
    appears : when the target appears; seconds; broadcasts to the runs, shape (...).

    Returns
    -------
    Shape (...); seconds; NaN where it is never declared.

    Raises
    ------
    InputError : shapes that do not match, or times that do not increase.

    Examples
    --------
    >>> declared = [[True, False, False, True], [False, False, False, False]]
    >>> time_to_detection(declared, [1.0, 2.0, 3.0, 4.0], appears=1.5).tolist()
    [2.5, nan]
    """
    declared, time, appears = np.asarray(declared, bool), np.asarray(time, float), np.asarray(appears, float)
    if time.ndim != 1 or not time.size or declared.shape[-1:] != time.shape:
        raise InputError(
            f"declared has shape {declared.shape} and time {time.shape}; expected (..., scan) and (scan,)."
        )
    if not np.all(np.diff(time) > 0):
        raise InputError("time does not increase; expected the times of the scans in their order.")
    try:
        since = np.broadcast_to(appears, declared.shape[:-1])[..., None]
    except ValueError:
        raise InputError(
            f"appears has shape {appears.shape}; expected one time, or one for each of the runs, {declared.shape[:-1]}."
        ) from None
    detected = declared & (time >= since)
    first = np.argmax(detected, axis=-1)
    return np.where(detected.any(axis=-1), time[first] - since[..., 0], np.nan)
