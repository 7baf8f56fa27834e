r"""Grids of states, and what is read off a belief on one.

A grid names its axes: :code:`Grid(RangeState, (("range", ...), ("range_rate", ...)))`. Its states are open meshes, so
that a likelihood that reads only the range costs one evaluation for each range. A belief on it has one log weight a
cell, takes in scans by the same `faintrack.beliefs.belief.update` as particles, and knows the mean, covariance and mode
of `faintrack.beliefs.belief`. What only a grid can tell is here: the likelihood ratio surface, marginals,
highest-density regions and the refinement of a peak between cells.

Stone's target likelihood ratio (stone2002, eq. 11) and its logarithm are views of a belief:

.. math::
    \Lambda(s) = \frac{p(s)}{p(\phi)} = \frac{q}{1 - q} w(s), \qquad
    \lambda(s) = \log \Lambda(s) = \text{log\_odds} + \text{log\_weights}

in probability a cell. The density is that less the log of the cell's volume, and depends on the units of the state.
"""

import dataclasses
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from faintrack.beliefs.axis import Axis, Lattice
from faintrack.beliefs.belief import Belief
from faintrack.beliefs.components import rates
from faintrack.errors import InputError
from faintrack.numerics.draws import uniform
from faintrack.numerics.precision import full_precision


@dataclass(frozen=True)
class Grid(Lattice):
    """Evenly spaced states.

    Attributes
    ----------
    kind : class of the states.
    axes : name and values of each axis, in the order of the array. Components without an axis are 0.

    Raises
    ------
    InputError : an axis that the state has no component for.

    Examples
    --------
    >>> from faintrack.targets.states import RangeState
    >>> grid = Grid(RangeState, (("range", Axis(0.0, 10.0, 50)), ("range_rate", Axis(-2.0, 1.0, 5))))
    >>> grid.shape, grid.states().range.shape, grid.states().range_rate.shape
    ((50, 5), (50, 1), (1, 5))
    """

    kind: Any
    axes: tuple[tuple[str, Axis], ...]

    def __post_init__(self) -> None:
        known = [field.name for field in dataclasses.fields(self.kind)]
        for name, _ in self.axes:
            if name not in known:
                raise InputError(f"grid axis {name}: expected one of {', '.join(known)}.")

    @property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """Numbers of the axes of every component that moves, and of its rate.

        Raises
        ------
        InputError : a rate without its component, or none of either.
        """
        found = []
        for name, rate in rates(self.kind).items():
            if (name in self.names) != (rate in self.names):
                raise InputError(f"grid axes {', '.join(self.names)}: expected both {name} and {rate}, or neither.")
            if name in self.names:
                found.append((self.names.index(name), self.names.index(rate)))
        if not found:
            raise InputError(f"grid axes {', '.join(self.names)}: expected a component and its rate.")
        return tuple(found)

    def states(self, dtype: Any = jnp.float32) -> Any:
        """Middles of the cells, as open meshes."""
        flat = (1,) * len(self.axes)
        meshes = {field.name: jnp.zeros(flat, dtype) for field in dataclasses.fields(self.kind)}
        for number, (name, axis) in enumerate(self.axes):
            meshes[name] = jnp.asarray(axis.values, dtype).reshape((*flat[:number], -1, *flat[number + 1 :]))
        return self.kind(**meshes)

    def draw(self, key: PRNGKeyArray, dtype: Any = jnp.float32) -> Any:
        """One state of every cell, drawn evenly; components are flat, cells in the order of the grid."""
        drawn = {field.name: jnp.zeros(self.size, dtype) for field in dataclasses.fields(self.kind)}
        # With the middles in memory XLA has one long loop, where those of an open mesh make it one of many short ones.
        middles = np.meshgrid(*(axis.values for _, axis in self.axes), indexing="ij")
        for number, ((name, axis), middle) in enumerate(zip(self.axes, middles, strict=True)):
            place = uniform(jax.random.fold_in(key, number), (self.size,), dtype) - 0.5
            drawn[name] = jnp.asarray(middle.ravel(), dtype) + axis.step * place
        return self.kind(**drawn)


def surface(belief: Belief) -> Float[Array, "*cells"]:
    r"""Log of the target likelihood ratio of every cell, :math:`\lambda` (the module's equation; stone2002, eq. 28).

    Examples
    --------
    >>> belief = Belief(None, jnp.log(jnp.array([0.5, 0.5])), jnp.log(jnp.array(3.0)), jnp.array(0.0))
    >>> [round(float(ratio), 3) for ratio in jnp.exp(surface(belief))]
    [1.5, 1.5]
    """
    return belief.log_odds + belief.log_weights


def marginal(belief: Belief, grid: Grid, *names: str) -> Float[Array, "..."]:
    """Natural log of the probability of the cells of some axes, summed over the others.

    Parameters
    ----------
    belief : on the grid.
    grid : that the belief is on.
    names : axes to keep; they stay in the order of the grid.

    Examples
    --------
    >>> from faintrack.targets.states import RangeState
    >>> grid = Grid(RangeState, (("range", Axis(0.0, 1.0, 2)), ("range_rate", Axis(0.0, 1.0, 2))))
    >>> weights = jnp.log(jnp.array([[0.1, 0.2], [0.3, 0.4]]))
    >>> belief = Belief(grid.states(), weights, jnp.array(0.0), jnp.array(0.0))
    >>> [round(float(share), 3) for share in jnp.exp(marginal(belief, grid, "range"))]
    [0.3, 0.7]
    """
    summed = tuple(number for number, name in enumerate(grid.names) if name not in names)
    return jax.nn.logsumexp(belief.log_weights, axis=summed)


def highest_density(belief: Belief, probability: float) -> Bool[Array, "*cells"]:
    """Smallest set of cells that holds the target with this probability, if it exists.

    Examples
    --------
    >>> belief = Belief(None, jnp.log(jnp.array([0.1, 0.6, 0.3])), jnp.array(0.0), jnp.array(0.0))
    >>> highest_density(belief, 0.8).tolist()
    [False, True, True]
    """
    weights = jnp.exp(belief.log_weights).ravel()
    order = jnp.argsort(-weights)
    before = jnp.cumsum(weights[order]) - weights[order]
    chosen = jnp.zeros(weights.shape, bool).at[order].set(before < probability)
    return chosen.reshape(belief.log_weights.shape)


@full_precision
def refined_mode(belief: Belief, grid: Grid) -> tuple[Any, Float[Array, "axis axis"]]:
    r"""Peak between the cells, and the covariance of the normal distribution that fits it.

    Parameters
    ----------
    belief : on the grid.
    grid : of at least three cells along every axis.

    Returns
    -------
    A state with scalar components, and the covariance over the grid's axes in their order. Where the neighbours of the
    highest cell make no peak, at an edge of the grid or on a ridge, the state is the cell's and the covariance is not a
    number.

    Notes
    -----
    A quadratic through the highest cell and its neighbours (stone2002, 4.1.2): with g and H the central differences
    of the log weights, the peak lies at :math:`s - H^{-1} g` and the covariance is :math:`-H^{-1}`. Exact for a normal
    density sampled at the middles of the cells.

    Examples
    --------
    >>> from faintrack.targets.states import RangeState
    >>> grid = Grid(RangeState, (("range", Axis(0.0, 1.0, 11)),))
    >>> weights = -((grid.states().range - 4.3) ** 2) / (2 * 1.5**2)
    >>> state, covariance = refined_mode(Belief(grid.states(), weights, jnp.array(0.0), jnp.array(0.0)), grid)
    >>> round(float(state.range), 3), round(float(covariance[0, 0]), 3)
    (4.3, 2.25)
    """
    shape, count = belief.log_weights.shape, len(grid.axes)
    top = jnp.stack(jnp.unravel_index(jnp.argmax(belief.log_weights), shape))
    middle = jnp.clip(top, 1, np.array(shape) - 2)
    patch = jax.lax.dynamic_slice(belief.log_weights, tuple(middle - 1), (3,) * count)

    def at(*offsets: tuple[int, int]) -> Array:
        """Log weight beside the middle: (axis, offset) for the axes that are left."""
        index = [1] * count
        for axis, offset in offsets:
            index[axis] += offset
        return patch[tuple(index)]

    gradient = jnp.stack([(at((i, 1)) - at((i, -1))) / 2 for i in range(count)])
    curvature = [[at() for _ in range(count)] for _ in range(count)]
    for i in range(count):
        curvature[i][i] = at((i, 1)) - 2 * at() + at((i, -1))
        for j in range(i):
            corners = at((i, 1), (j, 1)) - at((i, 1), (j, -1)) - at((i, -1), (j, 1)) + at((i, -1), (j, -1))
            curvature[i][j] = curvature[j][i] = corners / 4
    hessian = jnp.stack([jnp.stack(row) for row in curvature])
    finite = jnp.isfinite(hessian).all() & jnp.isfinite(gradient).all()
    safe = jnp.where(finite, hessian, -jnp.eye(count, dtype=hessian.dtype))
    spread = -jnp.linalg.inv(safe)
    off = spread @ jnp.where(finite, gradient, 0)
    peaked = finite & (jnp.linalg.eigvalsh(safe) < 0).all() & (jnp.abs(off) <= 1).all() & (top == middle).all()
    steps = jnp.array([axis.step for _, axis in grid.axes], off.dtype)
    first = jnp.array([axis.first for _, axis in grid.axes], off.dtype)
    place = first + steps * (top + jnp.where(peaked, off, 0))
    state = grid.kind(**{field.name: jnp.zeros((), off.dtype) for field in dataclasses.fields(grid.kind)})
    state = dataclasses.replace(state, **dict(zip(grid.names, place, strict=True)))
    return state, jnp.where(peaked, spread * jnp.outer(steps, steps), jnp.nan)
