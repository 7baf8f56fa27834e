r"""Cells whose noise has heavier tails than a Gaussian: what a real background leaves after whitening.

A residual of six deviations is impossible in Gaussian noise and an everyday event in front of trees. Under Student's
distribution with :math:`\nu` degrees of freedom, scaled to variance 1, a cell gains the logarithm of its value at most:

.. math::
    \log \ell(y) = \frac{\nu + 1}{2} \log \frac{\nu - 2 + y^2}{\nu - 2 + (y - r)^2}

with y the value and r the level. What a target puts into a cell is known to a share c only: it lies somewhere between
pixels, no two optics spread it alike, and its level changes. Its value then deviates by c r beside the noise, and with
:math:`v = 1 + c^2 r^2`

.. math::
    \log \ell(y) = \frac{\nu + 1}{2} \log \frac{1 + y^2 / (\nu - 2)}{1 + (y - r)^2 / ((\nu - 2) v)}
        - \frac{1}{2} \log v .

With c = 0 a target of thirty deviations is taken for none, because the cell beside it has three and not six. With a
spread over several cells it also tells a target from a broken pixel: the
target's neighbours rise with it, those of the pixel do not, and each one that does not counts as a surprise of its own.
As :math:`\nu \to \infty` this is `faintrack.likelihoods.cells.gaussian`.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.errors import InputError
from faintrack.likelihoods.cell_field import Values, means


@dataclass(frozen=True)
class Student:
    """Amplitude model for Student noise of variance 1, whose mean the target raises.

    Attributes
    ----------
    freedom : degrees of freedom; above 2.
    slack : c, share of its level to which the value of a target in a cell is known; at least 0.

    Raises
    ------
    InputError : 2 degrees of freedom or fewer, which have no variance; a slack below 0.

    Notes
    -----
    Check: the mean of exp(log ratio) under noise is 1.

    Examples
    --------
    >>> round(float(Student(8.0)(jnp.array(3.0), 2.0)), 4), round(float(Student(1e6)(jnp.array(3.0), 2.0)), 2)
    (3.4296, 4.0)
    >>> round(float(Student(10.0)(jnp.array(0.0), 6.0)), 1), round(float(Student(10.0, 0.7)(jnp.array(0.0), 6.0)), 1)
    (-9.4, -2.7)
    """

    freedom: float
    slack: float = 0.0

    def __post_init__(self) -> None:
        if not self.freedom > 2:
            raise InputError(f"student: freedom is {self.freedom:g}; expected above 2.")
        if not self.slack >= 0:
            raise InputError(f"student: slack is {self.slack:g}; expected at least 0.")

    def __call__(self, value: Float[Array, "..."], level: Float[Array, "..."] | float) -> Float[Array, "..."]:
        """Natural log of p(value | target) / p(value | noise), both over the standard deviation of the noise."""
        scale, variance = self.freedom - 2, 1 + (self.slack * level) ** 2
        nearer = jnp.log1p(value**2 / scale) - jnp.log1p((value - level) ** 2 / (scale * variance))
        return (self.freedom + 1) / 2 * nearer - jnp.log(variance) / 2

    def rule(self, values: Values, mean: Values, variance: Values) -> tuple[Values, Values]:
        """How what several targets put into a cell adds: by their means, each of which is known to its slack."""
        return means(values, mean, variance + (self.slack * mean) ** 2)

    def draw(self, key: PRNGKeyArray, level: Float[Array, "*cells"]) -> Float[Array, "*cells"]:
        """Amplitude with mean `level` and the variance v."""
        scale = jnp.sqrt((self.freedom - 2) / self.freedom * (1 + (self.slack * level) ** 2))
        return level + scale * jax.random.t(key, self.freedom, level.shape, level.dtype)


student = Student
"""`Student` by the name that goes with `faintrack.likelihoods.cells.gaussian`: `student(8.0)` is an amplitude model."""
