r"""Cells whose noise has heavier tails than a Gaussian: what a real background leaves after whitening.

A residual of six deviations is impossible in Gaussian noise and an everyday event in front of trees. Under Student's
distribution with :math:`\nu` degrees of freedom, scaled to variance 1, a cell gains the logarithm of its value at most:

.. math::
    \log \ell(y) = \frac{\nu + 1}{2} \log \frac{\nu - 2 + y^2}{\nu - 2 + (y - r)^2}

with y the value and r the level. With a spread over several cells it also tells a target from a broken pixel: the
target's neighbours rise with it, those of the pixel do not, and each one that does not counts as a surprise of its own.
As :math:`\nu \to \infty` this is `faintrack.likelihoods.cells.gaussian`.
"""

import functools

import jax.numpy as jnp
from jaxtyping import Array, Float

from faintrack.errors import InputError
from faintrack.likelihoods.cells import Amplitude


@functools.cache
def student(freedom: float) -> Amplitude:
    """Amplitude model for Student noise of variance 1, whose mean the target raises.

    Parameters
    ----------
    freedom : degrees of freedom; above 2.

    Returns
    -------
    Function of (value, level), both over the standard deviation of the noise, to the natural log of
    p(value | target) / p(value | noise): the module's equation.

    Raises
    ------
    InputError : 2 degrees of freedom or fewer, which have no variance.

    Notes
    -----
    Check: the mean of exp(log ratio) under noise is 1.

    Examples
    --------
    >>> round(float(student(8.0)(jnp.array(3.0), 2.0)), 4), round(float(student(1e6)(jnp.array(3.0), 2.0)), 2)
    (3.4296, 4.0)
    """
    if not freedom > 2:
        raise InputError(f"student: freedom is {freedom:g}; expected above 2.")

    def log_ratio(value: Float[Array, "..."], level: Float[Array, "..."] | float) -> Float[Array, "..."]:
        scale = freedom - 2
        return (freedom + 1) / 2 * (jnp.log1p(value**2 / scale) - jnp.log1p((value - level) ** 2 / scale))

    return log_ratio
