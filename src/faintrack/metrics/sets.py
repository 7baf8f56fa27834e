r"""Distance between the set of targets that was found and the set that was there.

A tracker errs in three ways: a target is found in the wrong place, it is missed, or something is found that is not
there. A set distance weighs all three in one number, in the unit of the state. The price of a target that is missed or
false follows from the cutoff c, beyond which a found target is no longer held to be the true one. With :math:`d_c =
\min(d, c)`, n found and m true targets, and the best assignment :math:`\pi` of the smaller set to the larger,

.. math::
    \text{OSPA}^p = \frac{1}{\max(n, m)} \left[ \min_\pi \sum_i d_c(x_i, y_{\pi(i)})^p + c^p |n - m| \right], \qquad
    \text{GOSPA}^p = \min_\pi \sum_i d_c(x_i, y_{\pi(i)})^p + \frac{c^p}{\alpha} |n - m|

(Schuhmacher, Vo and Vo 2008; Rahmathullah, Garcia-Fernandez and Svensson 2017, definition 1). Both are metrics:
zero for equal sets only, symmetric, and the way through a third set is never shorter.

OSPA is an error per target and never above the cutoff; it suits few targets, and most of the literature states it.
GOSPA is a sum, so ten false targets cost ten times as much as one; with :math:`\alpha = 2` it splits into what was
localised, missed and false, and should be preferred where that matters. Where there is at most one target,
`single_ospa` is OSPA for whole arrays of runs and times.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy.typing import ArrayLike
from scipy.optimize import linear_sum_assignment

from faintrack.errors import InputError
from faintrack.metrics.accuracy import bearing_error

Distance = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Of states whose last axis holds the components; the other axes broadcast."""


@dataclass(frozen=True, eq=False)
class SetDistance:
    """A set distance and its parts.

    Attributes
    ----------
    total : the distance, in the unit of the state; `total**order` is the sum of the three parts.
    localisation : part of the pairs; unit of the state to the power `order`, as are the others.
    missed : part of true targets without a found one.
    false : part of found targets without a true one.
    pairs : index of the found and of the true target, -1 for none; each target of either set stands here once.
    """

    total: float
    localisation: float
    missed: float
    false: float
    pairs: Int[np.ndarray, "pair 2"]

    @property
    def cardinality(self) -> float:
        """Part of the targets that have no partner."""
        return self.missed + self.false


def euclidean_distance(found: ArrayLike, true: ArrayLike) -> Float[np.ndarray, "..."]:
    """Length of the difference over the last axis.

    Parameters
    ----------
    found, true : shapes (..., component) that broadcast; components of one unit.

    Examples
    --------
    >>> float(euclidean_distance([0.0, 0.0], [3.0, 4.0]))
    5.0
    """
    return np.asarray(np.linalg.norm(np.subtract(found, true), axis=-1))


def bearing_distance(found: ArrayLike, true: ArrayLike) -> Float[np.ndarray, "..."]:
    """Angle between two bearings, the shorter way round; over several angles the length of their differences.

    Parameters
    ----------
    found, true : shapes (..., component) that broadcast; every component an angle in radians.

    Examples
    --------
    >>> round(float(bearing_distance([3.1], [-3.1])), 4)
    0.0832
    """
    return euclidean_distance(bearing_error(found, true), 0.0)


def ospa(
    found: ArrayLike,
    true: ArrayLike,
    cutoff: float,
    order: float = 2.0,
    distance: Distance = euclidean_distance,
) -> SetDistance:
    """Optimal subpattern assignment: error per target, between 0 and the cutoff.

    Parameters
    ----------
    found : shape (n, component); n may be 0.
    true : shape (m, component); m may be 0.
    cutoff : price of a target without a partner, and the most that a pair costs; unit of the distance.
    order : p, at least 1; the larger, the more the worst target counts.
    distance : of two arrays of states, over their last axis.

    Returns
    -------
    The total and its parts, each already divided by max(n, m); the roots of order p of `localisation` and `cardinality`
    are the components in the unit of the state. Two empty sets are 0 apart.

    Raises
    ------
    InputError : arrays that are not finite or whose shapes do not match; a cutoff or order out of range.

    Notes
    -----
    The module's equation. Check: without `true` the total is the cutoff, however many were found.

    Examples
    --------
    >>> apart = ospa([[0.0, 0.0], [30.0, 0.0]], [[3.0, 4.0]], cutoff=10.0)
    >>> apart.localisation, apart.missed, apart.false          # 5^2 / 2, 0, 10^2 / 2
    (12.5, 0.0, 50.0)
    >>> round(apart.total, 4), apart.pairs.tolist()
    (7.9057, [[0, 0], [1, -1]])
    """
    apart = _distances(found, true, cutoff, order, distance)
    cost = np.minimum(apart, cutoff) ** order
    rows, columns = linear_sum_assignment(cost)
    size = max(*cost.shape, 1)
    return _set_distance(cost / size, rows, columns, cutoff**order / size, order)


def gospa(
    found: ArrayLike,
    true: ArrayLike,
    cutoff: float,
    order: float = 2.0,
    alpha: float = 2.0,
    distance: Distance = euclidean_distance,
) -> SetDistance:
    r"""Generalised optimal subpattern assignment: errors of localisation, missed and false targets added up.

    Parameters
    ----------
    found, true, cutoff, order, distance : as in `ospa`.
    alpha : above 0 and at most 2; a target without a partner costs cutoff**order / alpha.

    Returns
    -------
    The total and its parts. With alpha = 2 a pair as far apart as the cutoff, or farther, costs the same as one missed
    and one false target, and is reported as these (Rahmathullah, Garcia-Fernandez and Svensson 2017, proposition 1).
    With any other alpha it costs less than these and remains a pair.

    Raises
    ------
    InputError : as `ospa`; an alpha out of range.

    Notes
    -----
    The module's equation. Check: without `true`, the total of n found targets is
    :math:`c (n / \alpha)^{1/p}`.

    Examples
    --------
    >>> apart = gospa([[0.0, 0.0], [30.0, 0.0]], [[3.0, 4.0]], cutoff=10.0)
    >>> apart.localisation, apart.missed, apart.false          # 5^2, 0, 10^2 / 2
    (25.0, 0.0, 50.0)
    >>> round(apart.total, 4)
    8.6603
    """
    if not 0 < alpha <= 2:
        raise InputError(f"alpha is {alpha:g}; expected a number above 0 and at most 2.")
    apart = _distances(found, true, cutoff, order, distance)
    cost = np.minimum(apart, cutoff) ** order
    rows, columns = linear_sum_assignment(cost)
    if alpha == 2:
        near = apart[rows, columns] < cutoff
        rows, columns = rows[near], columns[near]
    return _set_distance(cost, rows, columns, cutoff**order / alpha, order)


def single_ospa(declared: ArrayLike, error: ArrayLike, present: ArrayLike, cutoff: float) -> Float[np.ndarray, "..."]:
    """OSPA, of any order, of at most one track and at most one target.

    Parameters
    ----------
    declared : whether there is a track. This and the next two broadcast.
    error : distance between track and target, at least 0; read only where both are there.
    present : whether there is a target.
    cutoff : as in `ospa`, in the unit of the error.

    Returns
    -------
    The error, at most the cutoff, where both are there; the cutoff where only one is; 0 where none is.

    Raises
    ------
    InputError : shapes that do not broadcast; a cutoff out of range; an error that is no distance where both are there.

    Examples
    --------
    >>> single_ospa([True, True, False], [3.0, np.nan, np.nan], [True, False, False], cutoff=10.0).tolist()
    [3.0, 10.0, 0.0]
    """
    _check_cutoff(cutoff)
    declared, present, error = np.asarray(declared, bool), np.asarray(present, bool), np.asarray(error, float)
    try:
        np.broadcast_shapes(declared.shape, error.shape, present.shape)
    except ValueError:
        raise InputError(
            f"declared, error and present have shapes {declared.shape}, {error.shape} and {present.shape}; "
            "expected shapes that broadcast."
        ) from None
    both = declared & present
    if not np.all((error >= 0) | ~both):
        raise InputError("error is negative or not a number where a track and a target are there; expected a distance.")
    return np.where(both, np.minimum(error, cutoff), np.where(declared ^ present, cutoff, 0.0))


def _distances(found: ArrayLike, true: ArrayLike, cutoff: float, order: float, distance: Distance) -> np.ndarray:
    """Distance of every found target (row) from every true one (column)."""
    _check_cutoff(cutoff)
    if not 1 <= order < np.inf:
        raise InputError(f"order is {order:g}; expected a finite number, at least 1.")
    found, true = _points("found", found), _points("true", true)
    if found.shape[1] != true.shape[1]:
        raise InputError(f"found has {found.shape[1]} components and true has {true.shape[1]}; expected as many.")
    apart = np.asarray(distance(found[:, None, :], true[None, :, :]), float)
    if apart.shape != (len(found), len(true)) or not np.all(apart >= 0):
        raise InputError(
            f"distance gives shape {apart.shape} or values below 0; expected one distance for each pair, "
            f"shape {(len(found), len(true))}."
        )
    return apart


def _points(name: str, states: ArrayLike) -> np.ndarray:
    points = np.asarray(states, float)
    if points.ndim != 2:
        raise InputError(f"{name} has shape {points.shape}; expected (targets, components), (0, components) for none.")
    if not np.all(np.isfinite(points)):
        raise InputError(f"{name} holds values that are not finite; expected numbers.")
    return points


def _check_cutoff(cutoff: float) -> None:
    if not 0 < cutoff < np.inf:
        raise InputError(f"cutoff is {cutoff:g}; expected a finite number above 0.")


def _set_distance(cost: np.ndarray, rows: np.ndarray, columns: np.ndarray, price: float, order: float) -> SetDistance:
    """From the cost of every pair, the pairs, and the price of a target without a partner."""
    false = np.setdiff1d(np.arange(cost.shape[0]), rows)
    missed = np.setdiff1d(np.arange(cost.shape[1]), columns)
    pairs = np.full((len(rows) + len(false) + len(missed), 2), -1)
    pairs[: len(rows) + len(false), 0] = np.concatenate([rows, false])
    pairs[: len(rows), 1] = columns
    pairs[len(rows) + len(false) :, 1] = missed
    parts = float(cost[rows, columns].sum()), price * len(missed), price * len(false)
    return SetDistance(float(sum(parts) ** (1 / order)), *parts, pairs)
