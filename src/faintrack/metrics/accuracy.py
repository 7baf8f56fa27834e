"""How far estimates lie from the truth.

An estimate of a bearing near one end of the circle may differ from the truth by almost a full turn as a number and by
almost nothing as a direction: take `bearing_error` before anything is squared. Errors of a tracker are defined only
where it has a track, and their mean says nothing of the targets it missed; for both in one number use
`faintrack.metrics.sets`.
"""

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike


def bearing_error(found: ArrayLike, true: ArrayLike) -> Float[np.ndarray, "..."]:
    """Found minus true bearing, the shorter way round.

    Parameters
    ----------
    found, true : radians; shapes that broadcast.

    Returns
    -------
    Between -pi and pi; radians.

    Examples
    --------
    >>> bearing_error([3.1, 0.2], [-3.1, 0.1]).round(4).tolist()
    [-0.0832, 0.1]
    """
    apart = np.subtract(found, true)
    return np.asarray(np.arctan2(np.sin(apart), np.cos(apart)))


def rmse(errors: ArrayLike, axis: int | tuple[int, ...] = 0) -> Float[np.ndarray, "..."]:
    """Root mean square of errors.

    Parameters
    ----------
    errors : found minus true, in any unit; NaN stays NaN, so that no run drops out unseen.
    axis : along which to average; the first one, runs, where not given.

    Examples
    --------
    >>> rmse([[1.0, 3.0], [-1.0, 4.0]]).round(4).tolist()
    [1.0, 3.5355]
    """
    return np.asarray(np.sqrt(np.mean(np.square(np.asarray(errors, float)), axis=axis)))
