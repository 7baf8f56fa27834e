"""How far from the truth a result may lie, and why.

Two kinds of error are allowed: chance, measured in standard errors, and rounding, measured in units of the last place
times the number of operations. Nothing else is.
"""

import numpy as np

STANDARD_ERRORS = 5.0
"""Allowed between the mean of independent draws and its expectation. A normal mean strays further once in 1.7 million
comparisons. Keys are fixed, so that a failure is a change of the code and not of the dice."""

BEARING_AGREEMENT = np.radians(4.0)
"""Between two beamformers on the same infrasound. Theirs averages overlapping windows and searches slowness, ours takes
one window at one sound speed. The array spans 0.7 of a wavelength at the middle of the band, so that the beam is about
80 degrees wide: this is a twentieth of it."""

RATIO_OPERATIONS = 100
"""Roundings in one log ratio of the small scenes: a sum over channels, snapshots and bins, or over cells, and four
neighbours along each axis of a table."""

RATIO_AGREEMENT = 2e-4
"""Between log ratios in single and double precision, relative and absolute: `RATIO_OPERATIONS` roundings of terms as
large as 10, 100 * 1.2e-7 * 10 = 1.2e-4, and those of the scan's time and place."""

FAR = 1e7
"""Metres to a point source that stands for a plane wave. Over an array that reaches d = 0.8 m from its middle the
wavefront bends by d^2 / (2 FAR) = 3e-8 m, more than the 2e-9 m to which double precision rounds such a distance."""


def rounding(dtype: type, operations: int = 1) -> float:
    """Relative error after so many operations, each rounded once; rounding errors that all point the same way."""
    return float(np.finfo(dtype).eps) * operations


def errors_apart(draws: np.ndarray, expected: np.ndarray | float) -> float:
    """Largest distance between the mean of `draws` over the first axis and `expected`, in standard errors."""
    draws = np.asarray(draws, np.float64)
    error = draws.std(axis=0, ddof=1) / np.sqrt(len(draws))
    return float(np.max(np.abs(draws.mean(axis=0) - expected) / np.maximum(error, np.finfo(float).tiny)))


def assert_mean(draws: np.ndarray, expected: np.ndarray | float) -> None:
    """The mean of independent draws, along the first axis, is as expected."""
    apart = errors_apart(draws, expected)
    assert apart < STANDARD_ERRORS, (
        f"{apart:.1f} standard errors: {np.mean(draws, axis=0)} in {len(draws)} draws, expected {expected}"
    )


def assert_same_mean(first: np.ndarray, second: np.ndarray) -> None:
    """Two sets of independent draws, along the first axis, have the same mean."""
    first, second = np.asarray(first, np.float64), np.asarray(second, np.float64)
    error = np.sqrt(first.var(axis=0, ddof=1) / len(first) + second.var(axis=0, ddof=1) / len(second))
    apart = np.max(np.abs(first.mean(axis=0) - second.mean(axis=0)) / error)
    assert apart < STANDARD_ERRORS, f"{apart:.1f} standard errors: {first.mean(axis=0)} and {second.mean(axis=0)}"


def assert_equal(actual: np.ndarray, expected: np.ndarray, dtype: type, operations: int, scale: float = 0.0) -> None:
    """Equal but for rounding. `scale` is the size of the largest term where terms cancel."""
    relative = rounding(dtype, operations)
    np.testing.assert_allclose(np.asarray(actual), np.asarray(expected), rtol=relative, atol=relative * scale)


def assert_calibrated(existence: np.ndarray, exists: np.ndarray, bins: int = 5, least: int = 100) -> None:
    """Of targets believed in at 0.8, 80 % exist: in every bin of probability as many as are believed to.

    Parameters
    ----------
    existence : probability at the end of independent runs, from the filter whose model the runs were drawn from.
    exists : whether there was a target.
    bins : from 0 to 1, equally wide.
    least : runs that every bin must hold, or the test says little.
    """
    existence = np.asarray(existence, np.float64)
    number = np.minimum((existence * bins).astype(int), bins - 1)
    for chosen in range(bins):
        believed, there = existence[number == chosen], exists[number == chosen]
        error = np.sqrt(np.sum(believed * (1 - believed)))
        assert believed.size >= least
        assert abs(there.sum() - believed.sum()) < STANDARD_ERRORS * error
