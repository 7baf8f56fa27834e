r"""Scans of sensors with a value a cell: noise, and targets on given paths.

What is drawn has exactly the distribution that `faintrack.likelihoods.cells` takes a scan to have, place within a cell
included: a target counts as lying at the nearest of the likelihood's `places`. To give a tracker scans of targets that
lie anywhere, draw them from a likelihood with a finer `oversample` than the one it tracks with.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from faintrack.errors import InputError
from faintrack.likelihoods.cells import Amplitude, CellLikelihood, gaussian, rayleigh, swerling0, swerling1
from faintrack.sensors.cells import CellScan


def gaussian_value(key: PRNGKeyArray, level: Float[Array, "*cells"]) -> Float[Array, "*cells"]:
    """Amplitude with variance 1 and mean `level`."""
    return level + jax.random.normal(key, level.shape, level.dtype)


def swerling1_value(key: PRNGKeyArray, level: Float[Array, "*cells"]) -> Float[Array, "*cells"]:
    """Exponential power with mean 1 + `level`."""
    return (1 + level) * jax.random.exponential(key, level.shape, level.dtype)


def swerling0_value(key: PRNGKeyArray, level: Float[Array, "*cells"]) -> Float[Array, "*cells"]:
    """Power of a constant amplitude in complex Gaussian noise of power 1; mean 1 + `level`."""
    parts = jax.random.normal(key, (2 * level.size,), level.dtype).reshape(2, *level.shape) * 0.5**0.5
    return (jnp.sqrt(level) + parts[0]) ** 2 + parts[1] ** 2


def rayleigh_value(key: PRNGKeyArray, level: Float[Array, "*cells"]) -> Float[Array, "*cells"]:
    """Envelope whose square has the mean 2 (1 + `level`)."""
    return jnp.sqrt(2 * swerling1_value(key, level))


VALUES: dict[Amplitude, Callable[[PRNGKeyArray, Array], Array]] = {
    gaussian: gaussian_value,
    swerling1: swerling1_value,
    swerling0: swerling0_value,
    rayleigh: rayleigh_value,
}
"""What draws the values that an amplitude model is the ratio of."""


@eqx.filter_jit
def draw_scans(
    key: PRNGKeyArray,
    likelihood: CellLikelihood,
    time: Float[Array, " frame"],
    states: object,
    present: Bool[Array, " frame *target"],
) -> CellScan:
    """Frames with targets on given paths.

    Parameters
    ----------
    key : random key.
    likelihood : cells, amplitude model, level and spread of a target.
    time : of the frames; seconds.
    states : components of shape (frame,), or (frame, target) for several targets, whose levels add.
    present : whether a target is there; the components broadcast to it, and mean nothing where it is not.

    Returns
    -------
    Stack of frames; the first axis of the values is the frame.

    Raises
    ------
    InputError : nothing is known about how to draw values of the amplitude model.

    Examples
    --------
    >>> from faintrack.beliefs.axis import Axis
    >>> from faintrack.sensors.cells import Cells
    >>> from faintrack.targets.states import RangeState
    >>> likelihood = CellLikelihood(Cells((("range", Axis(0.0, 1.0, 50)),)), swerling1, 1000.0)
    >>> states = RangeState(jnp.array([10.0, 11.0]), jnp.ones(2))
    >>> scans = draw_scans(jax.random.key(0), likelihood, jnp.arange(2.0), states, jnp.array([True, True]))
    >>> scans.values.shape, jnp.argmax(scans.values, axis=1).tolist()
    ((2, 50), [10, 11])
    """
    draw = VALUES.get(likelihood.amplitude)
    if draw is None:
        name = getattr(likelihood.amplitude, "__name__", likelihood.amplitude)
        known = ", ".join(amplitude.__name__ for amplitude in VALUES)
        raise InputError(f"amplitude {name}: there is no simulation of it; expected one of {known}.")

    def frame(key: PRNGKeyArray, states: object, present: Array) -> Array:
        """Values with targets along the first axis."""
        levels = jax.vmap(likelihood.levels)(states)
        there = present.reshape(-1, *(1,) * len(likelihood.cells.axes))
        return draw(key, jnp.sum(jnp.where(there, levels, 0), axis=0))

    count = time.shape[0]
    states, present = jax.tree.map(
        lambda component: jnp.broadcast_to(component, present.shape).reshape(count, -1), (states, present)
    )
    return CellScan(time, jax.vmap(frame)(jax.random.split(key, count), states, present))
