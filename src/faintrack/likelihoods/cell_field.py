r"""Targets that are part of the background of cells.

What several targets put into a cell adds: their means where the value is an amplitude with noise about it, their powers
where it is a power. With :math:`h_i(x)` the share of a target's level u in cell i, q its existence and w what is
believed of its place, the others put into the cell

.. math::
    m_i = \sum_t q_t u_t \, \mathrm{E}_w[h_i], \qquad
    v_i = \sum_t q_t \overline{u_t^2} \, \mathrm{E}_w[h_i^2] - (q_t u_t \mathrm{E}_w[h_i])^2

as mean and variance. A cell with a mean m and a variance 1 + v is one with noise of variance 1 again, whose value is
:math:`(z - m) / \sqrt{1 + v}` and in which a level counts :math:`1 / \sqrt{1 + v}` (`means`); one of exponential power
1 + m is one of power 1, :math:`z / (1 + m)`, in which a level counts :math:`1 / (1 + m)` (`powers`, and `envelopes` for
their roots). So the scan that is left is read by the same likelihood. Check: under the others, at places that are
known, the mean of exp(log ratio) is 1.
"""

import dataclasses
import functools
import itertools
from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from faintrack.sensors.cells import Cells

Values = Float[Array, "*cells"]
Rule = Callable[[Values, Values, Values], tuple[Values, Values]]
"""Function of values, mean and variance of what others add, to values over what is left and the factor of a level."""


def means(values: Values, mean: Values, variance: Values) -> tuple[Values, Values]:
    """Amplitudes: means add.

    Examples
    --------
    >>> values, gain = means(jnp.array(5.0), jnp.array(2.0), jnp.array(3.0))
    >>> float(values), float(gain)
    (1.5, 0.5)
    """
    factor = 1 / jnp.sqrt(1 + variance)
    return (values - mean) * factor, factor


def powers(values: Values, mean: Values, variance: Values) -> tuple[Values, Values]:
    """Powers of fluctuating echoes: they add."""
    factor = 1 / (1 + mean)
    return values * factor, factor


def envelopes(values: Values, mean: Values, variance: Values) -> tuple[Values, Values]:
    """Roots of twice such powers."""
    factor = 1 / (1 + mean)
    return values * jnp.sqrt(factor), factor


def on_places(places: Cells, states: Any, log_weights: Float[Array, "*points"]) -> Float[Array, "*places"]:
    """Probability of a target to be at each of the places, from the points of a belief."""
    index, inside = places.nearest(states)
    ndim = log_weights.ndim
    still = tuple(
        axis for axis in range(ndim) if all(each.ndim < ndim - axis or each.shape[axis - ndim] == 1 for each in index)
    )
    weights = jnp.sum(jnp.exp(log_weights), axis=still, keepdims=True)
    weights = jnp.where(inside, weights, 0)
    numbers = tuple(jnp.broadcast_to(each, weights.shape).ravel() for each in index)
    return jnp.zeros(places.shape, weights.dtype).at[numbers].add(weights.ravel())


def spread_out(
    chances: Float[Array, "*places"], shares: Float[np.ndarray, "..."], reach: int, oversample: int
) -> Float[Array, "*cells"]:
    """What arrives in every cell from targets at places, each as often as it is likely.

    Parameters
    ----------
    chances : of `on_places`.
    shares : by position within a cell and by cell around it, see `faintrack.likelihoods.cells.CellLikelihood.shares`.
    reach, oversample : of the likelihood.
    """
    dimensions = chances.ndim
    wide = tuple(count // oversample for count in chances.shape)
    by_position = chances.reshape([size for count in wide for size in (count, oversample)])
    padded = jnp.zeros(tuple(count + 2 * reach for count in wide), chances.dtype)
    for position in itertools.product(range(oversample), repeat=dimensions):
        here = by_position[tuple(part for place in position for part in (slice(None), place))]
        for start in itertools.product(range(2 * reach + 1), repeat=dimensions):
            window = tuple(slice(first, first + count) for first, count in zip(start, wide, strict=True))
            padded = padded.at[window].add(shares[position + start] * here)
    return padded[tuple(slice(2 * reach, count) for count in wide)]


def reached(
    places: Cells, shares: Float[Array, "..."], reach: int, oversample: int, states: Any
) -> tuple[tuple[Int[Array, "cell *points"], ...], Float[Array, "cell *points"], Bool[Array, "cell *points"]]:
    """Cells that targets reach, from each state as many.

    Parameters
    ----------
    places, shares, reach, oversample : of the likelihood.
    states : of targets.

    Returns
    -------
    Index of each cell, kept within the sensor; the share of the level that arrives there; whether the sensor has that
    cell and the state lies at one of the places.
    """
    nearest, near = places.nearest(states)
    *place, inside = jnp.broadcast_arrays(*nearest, near)
    counts = [count // oversample - 2 * reach for count in places.shape]
    starts = np.indices((2 * reach + 1,) * len(counts)).reshape(len(counts), -1, *(1,) * inside.ndim)
    # Cells from -reach are counted from 0 in `places`, those around a place from -reach in `shares`.
    cell = [each // oversample + first - 2 * reach for each, first in zip(place, starts, strict=True)]
    within = [(each >= 0) & (each < count) for each, count in zip(cell, counts, strict=True)]
    kept = tuple(jnp.clip(each, 0, count - 1) for each, count in zip(cell, counts, strict=True))
    share = shares[(*(each % oversample for each in place), *starts)]
    return kept, share, functools.reduce(jnp.logical_and, within, inside)


def shared(
    places: Cells,
    shares: Float[np.ndarray, "..."],
    reach: int,
    oversample: int,
    states: Any,
    log_weights: Float[Array, "*points"],
    few: bool = False,
) -> tuple[Values, Values]:
    r"""Mean share of a target's level that arrives in every cell, and mean square, :math:`E_w[h_i], E_w[h_i^2]`.

    Parameters
    ----------
    places, shares, reach, oversample : of the likelihood.
    states, log_weights : what is believed of the target.
    few : whether points are so few that each is spread out by itself.
    """
    if not few:
        chances = on_places(places, states, log_weights)
        return spread_out(chances, shares, reach, oversample), spread_out(chances, shares**2, reach, oversample)
    weights = jnp.exp(log_weights)
    cell, share, inside = reached(places, jnp.asarray(shares, weights.dtype), reach, oversample, states)
    part = jnp.where(inside, weights * share, 0)
    nothing = jnp.zeros((*(count // oversample - 2 * reach for count in places.shape), 2), weights.dtype)
    both = nothing.at[cell].add(jnp.stack([part, part * share], axis=-1))
    return both[..., 0], both[..., 1]


def added(
    means: Float[Array, "target *cells"], squares: Float[Array, "target *cells"], existence: Float[Array, " target"]
) -> tuple[Values, Values]:
    """Mean and variance of what targets put into every cell (the module's first equation).

    Parameters
    ----------
    means, squares : of what each puts there, if it exists.
    existence : of the targets.
    """
    mean = jnp.tensordot(existence, means, axes=1)
    variance = jnp.tensordot(existence, squares, axes=1) - jnp.tensordot(existence**2, means**2, axes=1)
    return mean, jnp.maximum(variance, 0)


def alike(cells: Cells, reach: int, states: Any, centres: Any) -> Bool[Array, "centre *points"]:
    """Whether targets are so near each other that they reach the same cells.

    Parameters
    ----------
    cells : of the sensor.
    reach : cells from its own that a target reaches.
    states, centres : see `faintrack.likelihoods.protocols.Beside.alike`.
    """
    apart = max(2 * reach, 1) + 0.5

    def along(name: str, step: float) -> Bool[Array, "centre *points"]:
        values = getattr(states, name)
        middle = getattr(centres, name).reshape(-1, *(1,) * values.ndim)
        return jnp.abs(values - middle) <= apart * step

    return functools.reduce(jnp.logical_and, [along(name, abs(axis.step)) for name, axis in cells.axes])


def with_gain(scan: Any, values: Values, gain: Values) -> Any:
    """Scan with other values, and what a level counts in it."""
    return dataclasses.replace(scan, values=values, gain=gain if scan.gain is None else scan.gain * gain)
