r"""What is believed about at most one target: where it is if it is there, and whether it is there.

A belief is weighted points (grid cells or particles) and the log odds of existence. Every sensor enters through one
number a point, the log of the measurement likelihood ratio
:math:`\ell(z|x) = p(z \mid \text{target at } x) / p(z \mid \text{no target})`, and there is one rule:

.. math::
    I = \sum_i w_i \, \ell(z|x_i), \qquad w_i \leftarrow w_i \, \ell(z|x_i) / I, \qquad
    \frac{q}{1 - q} \leftarrow \frac{q}{1 - q} I

which is the measurement update of the Bernoulli filter (bosser2022, eq. 2-3) and of the likelihood ratio recursion
(stone2002, eq. 15-28). Everything stays in logarithms: one scan can change a ratio by e^88 and more.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from faintrack.beliefs.components import angles, components
from faintrack.numerics.trigonometry import sine_cosine

Axes = tuple[int, ...]
"""Numbers of axes, ascending."""


class Belief(eqx.Module):
    """Weighted points and log odds of existence.

    Attributes
    ----------
    states : named components that broadcast to the shape of `log_weights`.
    log_weights : natural log of each point's probability given that the target exists; sums to 1 in probability.
    log_odds : natural log of q / (1 - q), q the probability that the target exists.
    time : of the last prediction; seconds.
    born : time at which the target of each point appeared, seconds; None for points without a history.
    """

    states: Any
    log_weights: Float[Array, "*points"]
    log_odds: Float[Array, ""]
    time: Float[Array, ""]
    born: Float[Array, "*points"] | None = None

    @property
    def existence(self) -> Float[Array, ""]:
        """Probability that the target exists."""
        return jax.nn.sigmoid(self.log_odds)


def update(belief: Belief, log_ratio: Float[Array, "*points"] | Float[Array, "..."]) -> tuple[Belief, Float[Array, ""]]:
    r"""Take in one scan through its log likelihood ratio at every point.

    Parameters
    ----------
    belief : predicted to the time of the scan.
    log_ratio : natural log of p(scan | target at point) / p(scan | no target); broadcasts to the points.

    Returns
    -------
    The updated belief, and the log evidence :math:`\log I`, the log of the mean ratio over the belief. Where the scan
    rules out a target at every point there is none, and the weights stay as they were.

    Raises
    ------
    ValueError : the ratio does not broadcast to the points.

    Examples
    --------
    >>> belief = Belief(states=None, log_weights=jnp.log(jnp.array([0.5, 0.5])), log_odds=jnp.array(0.0),
    ...                 time=jnp.array(0.0))
    >>> belief, log_evidence = update(belief, jnp.log(jnp.array([3.0, 1.0])))
    >>> [round(float(x), 4) for x in (jnp.exp(log_evidence), belief.existence, jnp.exp(belief.log_weights[0]))]
    [2.0, 0.6667, 0.75]
    """
    points = belief.log_weights.shape
    try:
        fits = jnp.broadcast_shapes(log_ratio.shape, points) == points
    except ValueError:
        fits = False
    if not fits:
        raise ValueError(
            f"log_ratio has shape {log_ratio.shape}; the belief has {points}. "
            "Give one value per point: likelihood.log_ratio(scan, belief.states)."
        )
    log_joint = belief.log_weights + log_ratio
    top = jnp.max(log_joint)
    # From the top down: a loud target's ratios are so large that their own rounding would unbalance the weights.
    below = log_joint - jnp.where(top > -jnp.inf, top, 0)
    log_sum = jnp.log(jnp.sum(jnp.exp(below)))
    log_evidence = top + log_sum
    log_weights = jnp.where(log_evidence > -jnp.inf, below - log_sum, belief.log_weights)
    updated = dataclasses.replace(belief, log_weights=log_weights, log_odds=belief.log_odds + log_evidence)
    return updated, log_evidence


def log_gain(updated: Belief, log_evidence: Float[Array, ""]) -> Float[Array, ""]:
    r"""How much likelier the belief's own model makes a scan than noise alone.

    Parameters
    ----------
    updated : belief after the scan.
    log_evidence : that `update` returned with it.

    Returns
    -------
    Log of :math:`(1 - q) + q I`, q the existence before the scan. Its sum over scans is the log of the likelihood ratio
    of "targets come and go as the model says" to "never a target"; see `faintrack.metrics.thresholds`.

    Examples
    --------
    >>> belief = Belief(None, jnp.zeros(1), jnp.array(0.0), jnp.array(0.0))
    >>> updated, log_evidence = update(belief, jnp.log(jnp.array([3.0])))
    >>> round(float(jnp.exp(log_gain(updated, log_evidence))), 4)
    2.0
    """
    before = updated.log_odds - log_evidence
    return jnp.logaddexp(jax.nn.log_sigmoid(-before), jax.nn.log_sigmoid(before) + log_evidence)


def mean(belief: Belief, weights: Float[Array, "*points"] | None = None) -> Any:
    """Mean state; angles are averaged on the circle.

    Parameters
    ----------
    belief : points with named states; components in the state's `angles` are averaged as directions.
    weights : probability of each point, summing to 1; the belief's own where not given.

    Returns
    -------
    A state whose components are scalars.

    Examples
    --------
    >>> from faintrack.targets.states import BearingState
    >>> states = BearingState(bearing=jnp.array([3.1, -3.1]), bearing_rate=jnp.zeros(2), snr_db=jnp.array([-3.0, -5.0]))
    >>> belief = Belief(states, jnp.log(jnp.full(2, 0.5)), jnp.array(0.0), jnp.array(0.0))
    >>> middle = mean(belief)
    >>> round(abs(float(middle.bearing)), 4), float(middle.snr_db)
    (3.1416, -4.0)
    """
    weights = jnp.exp(belief.log_weights) if weights is None else weights
    return _by_component(belief.states, lambda name, values: _average(belief, name, weights, values))


def standard_deviation(belief: Belief, weights: Float[Array, "*points"] | None = None) -> Any:
    """Standard deviation of every component about `mean`; angles by the shorter way round.

    Parameters and shapes as in `mean`.

    Examples
    --------
    >>> from faintrack.targets.states import RangeState
    >>> belief = Belief(RangeState(jnp.array([1.0, 3.0]), jnp.zeros(2)), jnp.log(jnp.full(2, 0.5)), jnp.array(0.0),
    ...                 jnp.array(0.0))
    >>> float(standard_deviation(belief).range)
    1.0
    """
    return deviations(belief.states, covariance(belief, weights))


def covariance(belief: Belief, weights: Float[Array, "*points"] | None = None) -> Float[Array, "component component"]:
    """Covariance of the state's components in their order, about `mean`; angles by the shorter way round.

    Parameters and shapes as in `mean`.

    Examples
    --------
    >>> from faintrack.targets.states import PlanarState
    >>> states = PlanarState(x=jnp.array([0.0, 2.0]), y=jnp.zeros(2), vx=jnp.zeros(2), vy=jnp.zeros(2))
    >>> belief = Belief(states, jnp.log(jnp.full(2, 0.5)), jnp.array(0.0), jnp.array(0.0))
    >>> float(covariance(belief)[0, 0])
    1.0
    """
    return moments(belief, weights)[1]


def moments(
    belief: Belief, weights: Float[Array, "*points"] | None = None
) -> tuple[Any, Float[Array, "component component"]]:
    """`mean` and `covariance` at the price of the second.

    Parameters as in `mean`.

    Notes
    -----
    A product of two components of a grid needs the weights summed along all axes but theirs. These sums are made from
    each other: on four axes the six pairs read all cells three times, and the components are summed from what is left.

    Examples
    --------
    >>> from faintrack.targets.states import RangeState
    >>> belief = Belief(RangeState(jnp.array([1.0, 3.0]), jnp.zeros(2)), jnp.log(jnp.full(2, 0.5)), jnp.array(0.0),
    ...                 jnp.array(0.0))
    >>> middle, matrix = moments(belief)
    >>> float(middle.range), float(matrix[0, 0])
    (2.0, 1.0)
    """
    weights = jnp.exp(belief.log_weights) if weights is None else weights
    values = list(components(belief.states).values())
    pairs = [(row, column) for row in range(len(values)) for column in range(row + 1)]
    others = {(row, column): _axes(weights, values[row] + values[column]) for row, column in pairs}
    sums = _marginals(weights, set(others.values()))
    own = {name: sums[others[row, row]] for row, name in enumerate(components(belief.states))}
    middle = _by_component(belief.states, lambda name, values: _average(belief, name, own[name], values))
    off = list(components(_off(belief, middle)).values())
    lower = {pair: jnp.sum(sums[others[pair]] * (off[pair[0]] * off[pair[1]])) for pair in pairs}
    number = range(len(off))
    return middle, jnp.stack([jnp.stack([lower[max(i, j), min(i, j)] for j in number]) for i in number])


def deviations(state: Any, covariance: Float[Array, "*stack component component"]) -> Any:
    """Standard deviation of every component, as a state: the root of the covariance's diagonal.

    Parameters
    ----------
    state : any of the kind.
    covariance : of its components in their order; one, or a stack.

    Examples
    --------
    >>> from faintrack.targets.states import RangeState
    >>> float(deviations(RangeState(jnp.zeros(()), jnp.zeros(())), jnp.diag(jnp.array([4.0, 1.0]))).range)
    2.0
    """
    roots = jnp.sqrt(jnp.diagonal(covariance, axis1=-2, axis2=-1))
    return dataclasses.replace(state, **{name: roots[..., row] for row, name in enumerate(components(state))})


def mode(belief: Belief) -> Any:
    """State of the point with the largest weight; components are scalars.

    Examples
    --------
    >>> from faintrack.targets.states import PlanarState
    >>> still = jnp.zeros((1, 1))
    >>> grid = PlanarState(x=jnp.array([[0.0], [1.0]]), y=jnp.array([[5.0, 6.0]]), vx=still, vy=still)
    >>> belief = Belief(grid, jnp.log(jnp.array([[0.1, 0.2], [0.4, 0.3]])), jnp.array(0.0), jnp.array(0.0))
    >>> float(mode(belief).x), float(mode(belief).y)
    (1.0, 5.0)
    """
    best = jnp.argmax(belief.log_weights)
    return _by_component(
        belief.states, lambda _, values: jnp.broadcast_to(values, belief.log_weights.shape).ravel()[best]
    )


def _average(belief: Belief, name: str, weights: Float[Array, "*points"], values: Array) -> Float[Array, ""]:
    """Mean of one component."""
    if name in angles(belief.states):
        sine, cosine = sine_cosine(values)
        return jnp.arctan2(_expected(weights, sine), _expected(weights, cosine))
    return _expected(weights, values)


def _expected(weights: Float[Array, "*points"], values: Float[Array, "..."]) -> Float[Array, ""]:
    """Sum of weights times values.

    Weights are first summed along the axes that the values do not depend on: a component of a grid then costs one
    product for each of its own cells.
    """
    return jnp.sum(jnp.sum(weights, axis=_axes(weights, values), keepdims=True) * values)


def _axes(weights: Float[Array, "*points"], values: Float[Array, "..."]) -> Axes:
    """Axes of the weights that values do not depend on."""
    shape = (1,) * (weights.ndim - values.ndim) + values.shape
    return tuple(axis for axis, count in enumerate(shape) if count == 1)


def _marginals(weights: Float[Array, "*points"], wanted: set[Axes]) -> dict[Axes, Array]:
    """Weights summed along each of some sets of axes, kept with length 1; sets with an axis in common share its sum."""
    if len(wanted) == 1:
        (axes,) = wanted
        return {axes: jnp.sum(weights, axis=axes, keepdims=True)}
    # The axis that most sets have; of several the last, whose numbers lie side by side.
    common = max(range(weights.ndim), key=lambda axis: (sum(axis in axes for axes in wanted), axis), default=0)
    first = {axes for axes in wanted if common in axes}
    if not first:
        return dict.fromkeys(wanted, weights)
    left = {axes: tuple(axis for axis in axes if axis != common) for axes in first}
    sums = _marginals(jnp.sum(weights, axis=common, keepdims=True), set(left.values()))
    rest = wanted - first
    return {axes: sums[left[axes]] for axes in first} | (_marginals(weights, rest) if rest else {})


def _off(belief: Belief, middle: Any) -> Any:
    """States less a middle one; angles by the shorter way round."""

    def deviation(name: str, values: Array) -> Array:
        off = values - getattr(middle, name)
        return jnp.arctan2(jnp.sin(off), jnp.cos(off)) if name in angles(belief.states) else off

    return _by_component(belief.states, deviation)


def _by_component(state: Any, function: Callable[[str, Array], Array]) -> Any:
    return dataclasses.replace(state, **{name: function(name, values) for name, values in components(state).items()})
