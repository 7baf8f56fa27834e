r"""Scans of sensors with a value a cell: noise, and targets on given paths.

What is drawn has exactly the distribution that `faintrack.likelihoods.cells` takes a scan to have, place within a cell
included: a target counts as lying at the nearest of the likelihood's `places`. To give a tracker scans of targets that
lie anywhere, draw them from a likelihood with a finer `oversample` than the one it tracks with.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from faintrack.likelihoods.cells import CellLikelihood
from faintrack.sensors.cells import CellScan


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
    >>> from faintrack.likelihoods.cells import swerling1
    >>> from faintrack.sensors.cells import Cells
    >>> from faintrack.targets.states import RangeState
    >>> likelihood = CellLikelihood(Cells((("range", Axis(0.0, 1.0, 50)),)), swerling1, 1000.0)
    >>> states = RangeState(jnp.array([10.0, 11.0]), jnp.ones(2))
    >>> scans = draw_scans(jax.random.key(0), likelihood, jnp.arange(2.0), states, jnp.array([True, True]))
    >>> scans.values.shape, jnp.argmax(scans.values, axis=1).tolist()
    ((2, 50), [10, 11])
    """
    draw = likelihood.draw

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
