r"""Whether errors are as large as the estimator says.

An estimator gives a mean and a covariance P. Over many runs the error e of an honest one has that covariance, so the
*normalised estimation error squared*

.. math:: \epsilon = e^T P^{-1} e, \qquad \frac{1}{N} \sum_{r=1}^{N} \epsilon_r \sim \frac{1}{N} \chi^2_{N d}

averages to d, the number of components, and for Gaussian errors of N independent runs it lies between two quantiles of
the chi-square distribution (Bar-Shalom, Li and Kirubarajan 2001, sec. 5.4.2). Above them the estimator is too sure of
itself; below, it could have said more.

Beside it stand predicted and actual spread, component by component and in its unit, which tell by how much. For angles
take `faintrack.metrics.accuracy.bearing_error` as error. A posterior with several peaks is not Gaussian: its average is
still d, but the interval is too narrow.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike
from scipy.special import chdtri

from faintrack.errors import InputError
from faintrack.metrics.accuracy import rmse
from faintrack.metrics.intervals import tail


@dataclass(frozen=True, eq=False)
class Consistency:
    """Errors over runs against the covariance that was claimed for them.

    Attributes
    ----------
    nees : normalised estimation error squared, mean over runs; the number of components if the claim is true.
    low, high : between which that mean lies, with the given confidence, if the claim is true.
    predicted : root of the mean variance that was claimed; in the unit of the error.
    actual : root mean square error.
    """

    nees: Float[np.ndarray, "..."]
    low: float
    high: float
    predicted: Float[np.ndarray, "..."]
    actual: Float[np.ndarray, "..."]


def consistency(error: ArrayLike, variance: ArrayLike, confidence: float = 0.95) -> Consistency:
    """Errors of one component against their variances.

    Parameters
    ----------
    error : shape (run, ...); found minus true, in any unit.
    variance : of the estimate, above 0; shape of the error; its unit squared.
    confidence : of the interval.

    Returns
    -------
    All of shape (...), the mean over runs for each of the other axes.

    Raises
    ------
    InputError : shapes that do not match; values that are not finite; variances not above 0.

    Examples
    --------
    >>> said = consistency([1.0, -2.0, 2.0, -1.0], [1.0, 1.0, 1.0, 1.0])
    >>> float(said.nees), round(said.low, 3), round(said.high, 3)
    (2.5, 0.121, 2.786)
    >>> float(said.predicted), round(float(said.actual), 3)
    (1.0, 1.581)
    """
    errors, variances = np.asarray(error, float), np.asarray(variance, float)
    if errors.ndim < 1 or errors.shape != variances.shape:
        raise InputError(f"error has shape {errors.shape} and variance {variances.shape}; expected (run, ...) twice.")
    said = nees(errors[..., None], variances[..., None, None], confidence)
    return Consistency(said.nees, said.low, said.high, said.predicted[..., 0], said.actual[..., 0])


def nees(errors: ArrayLike, covariances: ArrayLike, confidence: float = 0.95) -> Consistency:
    """Errors of several components against their covariances.

    Parameters
    ----------
    errors : shape (run, ..., component); found minus true.
    covariances : shape (run, ..., component, component), positive definite.
    confidence : of the interval.

    Returns
    -------
    `nees` of shape (...); `predicted` and `actual` of shape (..., component).

    Raises
    ------
    InputError : shapes that do not match; values that are not finite; a covariance that is not positive definite.

    Notes
    -----
    The module's equation. Check: it does not change when a component is given in another unit.

    Examples
    --------
    >>> said = nees([[1.0, 10.0], [1.0, -10.0]], [[[1.0, 0.0], [0.0, 100.0]]] * 2)
    >>> float(said.nees), said.predicted.tolist(), said.actual.tolist()
    (2.0, [1.0, 10.0], [1.0, 10.0])
    """
    outside = tail(confidence)
    errors, covariances = np.asarray(errors, float), np.asarray(covariances, float)
    if errors.ndim < 2 or not errors.size or covariances.shape != (*errors.shape, errors.shape[-1]):
        raise InputError(
            f"errors has shape {errors.shape} and covariances {covariances.shape}; "
            "expected (run, ..., component) and (run, ..., component, component)."
        )
    if not (np.all(np.isfinite(errors)) and np.all(np.isfinite(covariances))):
        raise InputError("errors or covariances hold values that are not finite; expected numbers.")
    try:
        roots = np.linalg.cholesky(covariances)
    except np.linalg.LinAlgError:
        raise InputError("covariances holds one that is not positive definite; expected variances above 0.") from None
    squared = np.sum(np.linalg.solve(roots, errors[..., None])[..., 0] ** 2, axis=-1)
    runs, freedom = len(errors), len(errors) * errors.shape[-1]
    return Consistency(
        nees=np.asarray(squared.mean(axis=0)),
        low=float(chdtri(freedom, 1 - outside)) / runs,
        high=float(chdtri(freedom, outside)) / runs,
        predicted=np.sqrt(np.diagonal(covariances, axis1=-2, axis2=-1).mean(axis=0)),
        actual=rmse(errors),
    )
