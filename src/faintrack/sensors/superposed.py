"""Sensors that each report one number, to which every target adds: a network that measures levels.

Microphones that measure loudness, counters of radiation, receivers of signal strength: what a sensor reports is the sum
of what all targets bring to it, and noise. Nothing in it tells the targets apart. What a target brings falls with the
distance by a law that is a function of the squared distance, such as `inverse_square`.

`SuperposedScan` is what all sensors report at one time, in units of the noise's standard deviation. It also says what
is expected of other targets: what they add on average is taken off the values, and how uncertain that is stands in
columns whose products sum to a covariance (`faintrack.likelihoods.superposed`)."""

import functools
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from faintrack.errors import InputError

Gain = Callable[[Float[Array, "..."]], Float[Array, "..."]]
"""Function of the squared distance, m^2, to what a target adds to a sensor, over the noise's standard deviation."""


@functools.cache
def inverse_square(level: float, core: float) -> Gain:
    r"""Level that falls with the square of the distance, :math:`h = a / (d^2 + c^2)`, and stays finite near the sensor.

    Parameters
    ----------
    level : a, what a target far off adds, times its squared distance; m^2.
    core : c, distance at which half of the highest level is left; m.

    Raises
    ------
    InputError : a core that is not above 0.

    Examples
    --------
    >>> gain = inverse_square(500.0, 5.0)
    >>> float(gain(jnp.array(0.0))), float(gain(jnp.array(25.0)))
    (20.0, 10.0)
    """
    if not core > 0:
        raise InputError(f"inverse_square: core is {core:g} m; expected above 0.")
    return lambda squared: level / (squared + core * core)


class SensorNetwork(eqx.Module):
    """Where sensors stand, and how much of a target each of them hears.

    Attributes
    ----------
    x, y : east and north of every sensor; metres.
    gain : what a target at some squared distance adds.

    Examples
    --------
    >>> from faintrack.targets.states import PlanarState
    >>> network = SensorNetwork(jnp.array([0.0, 10.0]), jnp.zeros(2), inverse_square(500.0, 5.0))
    >>> still = jnp.zeros(1)
    >>> network.levels(PlanarState(jnp.array([5.0]), still, still, still)).tolist()
    [[10.0, 10.0]]
    """

    x: Float[Array, " sensor"]
    y: Float[Array, " sensor"]
    gain: Gain = eqx.field(static=True)

    def levels(self, states: Any) -> Float[Array, "*points sensor"]:
        """What a target at each state adds to every sensor; `x` and `y` are read."""
        return self.gain((states.x[..., None] - self.x) ** 2 + (states.y[..., None] - self.y) ** 2)


class SuperposedScan(eqx.Module):
    """What all sensors report at one time, less what a background is expected to add.

    Attributes
    ----------
    time : seconds.
    values : reading over the noise's standard deviation, less the background's mean; NaN where there is none.
    columns : of the background's covariance, which is the product of this matrix with its transpose; there are none
        where nothing is known to be there but noise.
    """

    time: Float[Array, ""]
    values: Float[Array, " sensor"]
    columns: Float[Array, "sensor column"]


def picture(time: Float[Array, ""] | float, values: Float[Array, " sensor"]) -> SuperposedScan:
    """Scan of readings, with noise as its only background.

    Parameters
    ----------
    time : seconds.
    values : reading of every sensor over the noise's standard deviation; NaN where there is none.

    Examples
    --------
    >>> picture(0.0, jnp.zeros(144)).columns.shape
    (144, 0)
    """
    return SuperposedScan(jnp.asarray(time, values.dtype), values, jnp.zeros((values.size, 0), values.dtype))
