r"""Targets in superposition: every sensor reports the sum of what all targets add to it, and Gaussian noise.

With :math:`z` the readings, :math:`h(x)` what a target at x adds to each of them, and noise of variance 1,

.. math:: z = \sum_j h(x_j) + n, \qquad n \sim N(0, I) .

For one target the ratio is that of two Gaussians, :math:`\log \ell = h^T z - h^T h / 2`. **Beside others** what these
add is as uncertain as they are. Target j exists with probability :math:`q_j` and is then at state :math:`x` with weight
:math:`w(x)`, so that it adds, with the mean :math:`m_j` and covariance :math:`C_j` of :math:`h` under the weights,

.. math::
    \mu = \sum_j q_j m_j, \qquad
    \Sigma = I + \sum_j \left[ q_j C_j + q_j (1 - q_j) m_j m_j^T \right]

on average and in covariance. A Gaussian with these moments stands for the readings without the target in question; the
ratio for a target at x beside the others is

.. math::
    \log \ell(z|x) = h^T \Sigma^{-1} (z - \mu) - \tfrac{1}{2} h^T \Sigma^{-1} h .

It is exact where others are known for certain, and where what they add is Gaussian. The approximation is that of
Davies and Garcia-Fernandez's *information exchange* filters (IEEE Transactions on Signal Processing, 2024); there the
moments are those of Gaussian beliefs, here those of the points of a belief.

:math:`C_j` is kept as a few columns: what a linear and quadratic function of the place explains of h within the belief,
which is all of it as the belief gets narrow, and never more than :math:`C_j`. With all columns side by side in B,
:math:`\Sigma = I + B B^T`, whose inverse is :math:`I - W W^T`, one column after the other (Sherman and Morrison):

.. math:: u_i = (I - W_{<i} W_{<i}^T) b_i, \qquad w_i = u_i / \sqrt{1 + b_i^T u_i} .

**Newborn targets** are drawn where the readings point: a cell of a grid of places with a probability like the root of
the ratio in its middle times the birth density, a place within it evenly, and the rest of the state as births have it
there. The root, since the ratio is narrower than a cell where a target is near a sensor.

Use `faintrack.likelihoods.cells` where a target reaches a few cells only; it is cheaper, and has other amplitudes.
"""

import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from faintrack.beliefs.grids import Grid
from faintrack.numerics.draws import normal, uniform
from faintrack.numerics.precision import full_precision
from faintrack.numerics.resampling import systematic
from faintrack.sensors.superposed import SensorNetwork, SuperposedScan

ROOT = 0.5
"""Power of the ratio by which newborn targets are drawn."""

ANYWHERE = 0.05
"""Share of newborn targets that are drawn from the birth density, so that no weight is large."""

NOTHING = 1e-6
"""Share of a function's mean square that is taken for a rounding error."""


class SuperposedLikelihood(eqx.Module):
    """Log ratio of a target in superposition with a background.

    Attributes
    ----------
    network : sensors, and what a target adds to each.
    places : grid of `x` and `y`, in whose cells newborn targets are proposed.

    Examples
    --------
    A second target where there is one already is out of the question; where none is yet, it is not:

    >>> from faintrack.beliefs.axis import Axis
    >>> from faintrack.sensors.superposed import inverse_square, picture
    >>> from faintrack.targets.states import PlanarState
    >>> network = SensorNetwork(jnp.array([0.0, 10.0, 20.0]), jnp.zeros(3), inverse_square(500.0, 5.0))
    >>> likelihood = SuperposedLikelihood(network, Grid(PlanarState, (("x", Axis(0, 2, 11)), ("y", Axis(0, 2, 1)))))
    >>> still = jnp.zeros(1)
    >>> here = PlanarState(jnp.array([4.0]), still, still, still)
    >>> scan = picture(0.0, network.levels(here)[0])
    >>> float(likelihood.log_ratio(scan, here)[0]) > 100
    True
    >>> parts = jax.tree.map(lambda part: part[None], likelihood.part(scan, here, jnp.zeros(1)))
    >>> scan = likelihood.beside(scan, parts, jnp.ones(1))
    >>> float(likelihood.log_ratio(scan, here)[0]) < -100
    True
    """

    network: SensorNetwork
    places: Grid = eqx.field(static=True)

    @eqx.filter_jit
    @full_precision
    def log_ratio(self, scan: SuperposedScan, states: Any) -> Float[Array, "*points"]:
        """Natural log of p(scan | background and target at state) / p(scan | background).

        Parameters
        ----------
        scan : readings, and what is known of the background (`beside`); one that is not a number says nothing.
        states : `x` and `y` are read.

        Notes
        -----
        The module's equation. Check: the mean of exp(log ratio) under the background is 1.
        """
        usable = (~jnp.isnan(scan.values)).astype(scan.values.dtype)
        off, columns = jnp.nan_to_num(scan.values), usable[:, None] * scan.columns
        whitening = _whitening(columns)
        levels = self.network.levels(states)
        spoilt = jnp.sum((levels @ whitening) ** 2, axis=-1)
        return levels @ (off - whitening @ (whitening.T @ off)) - (levels * levels @ usable - spoilt) / 2

    @full_precision
    def part(
        self, scan: SuperposedScan, states: Any, log_weights: Float[Array, " particle"]
    ) -> tuple[Float[Array, " sensor"], Float[Array, "place sensor"]]:
        """Mean of what a target adds to every reading, and columns of its covariance."""
        return self._moments(states, jnp.exp(log_weights))

    @full_precision
    def beside(
        self,
        scan: SuperposedScan,
        parts: tuple[Float[Array, "target sensor"], Float[Array, "target place sensor"]],
        existence: Float[Array, " target"],
    ) -> SuperposedScan:
        """Scan with other targets as a part of its background (the module's equation).

        Parameters
        ----------
        scan : with a background of its own, which stays.
        parts : of the others, see `part`.
        existence : probability of each; what does not exist adds nothing.

        Notes
        -----
        Check: the order of the others does not matter, nor whether they are added at once or one after the other; one
        that is certain to be at a place leaves the covariance as it is.
        """
        means, explained = parts
        doubt = jnp.sqrt(existence * (1 - existence))
        columns = jnp.concatenate(
            [jnp.sqrt(existence)[:, None, None] * explained, (doubt[:, None] * means)[:, None]], axis=1
        )
        return dataclasses.replace(
            scan,
            values=scan.values - existence @ means,
            columns=jnp.concatenate([scan.columns, columns.reshape(-1, means.shape[1]).T], axis=1),
        )

    def propose(
        self, scan: SuperposedScan, birth: Any, key: PRNGKeyArray, count: int
    ) -> tuple[Any, Float[Array, " count"]]:
        """Draw new targets where the readings point beside their background.

        Parameters
        ----------
        scan : with the background beside which they are new.
        birth : has `log_density(x, y)` and `sample_at(key, x, y)`, as `faintrack.targets.births.PlanarBirth`.
        key : random key.
        count : how many.

        Returns
        -------
        States, and the natural log of their weights: birth density over density of the draws.
        """
        for_cell, for_place, for_rest = jax.random.split(key, 3)
        dtype = scan.values.dtype
        middles = self.places.states(dtype)
        x, y = (each.ravel() for each in jnp.broadcast_arrays(middles.x, middles.y))
        born = jax.nn.log_softmax(birth.log_density(x, y))
        pointed = jax.nn.log_softmax(born + ROOT * self.log_ratio(scan, middles).ravel())
        log_share = jnp.logaddexp(jnp.log1p(-ANYWHERE) + pointed, jnp.log(ANYWHERE) + born)
        cell = systematic(for_cell, log_share, count, count)
        steps = {name: axis.step for name, axis in self.places.axes}
        off = uniform(for_place, (2, count), dtype) - 0.5
        at = x[cell] + steps["x"] * off[0], y[cell] + steps["y"] * off[1]
        log_drawn = log_share[cell] - jnp.log(steps["x"] * steps["y"])
        return birth.sample_at(for_rest, *at), birth.log_density(*at) - log_drawn

    def simulate(
        self, scan: SuperposedScan, states: Any, present: Bool[Array, ""] | bool, key: PRNGKeyArray
    ) -> SuperposedScan:
        """Readings drawn from the module's model, less the background's mean; where there are none they stay so.

        Parameters
        ----------
        scan : whose values are drawn anew.
        states : of a target; scalars.
        present : whether it is there.
        key : random key.
        """
        for_noise, for_background = jax.random.split(key)
        dtype = scan.values.dtype
        values = jnp.where(present, self.network.levels(states), 0) + normal(for_noise, scan.values.shape, dtype)
        values = values + scan.columns @ normal(for_background, scan.columns.shape[1:], dtype)
        return dataclasses.replace(scan, values=jnp.where(jnp.isnan(scan.values), jnp.nan, values))

    def _moments(
        self, states: Any, weights: Float[Array, " particle"]
    ) -> tuple[Float[Array, " sensor"], Float[Array, "function sensor"]]:
        """Mean of what a target adds if it exists, and columns of the covariance, as rows."""
        levels = self.network.levels(states)
        middle = weights @ levels
        constant = jnp.ones_like(weights)
        # Less their means first, which may be far from 0.
        off = (place - weights @ place for place in (states.x, states.y))
        _, x, y = _orthonormal([constant, *off], weights)
        _, *functions = _orthonormal([constant, x, y, x * x, x * y, y * y], weights)
        return middle, (jnp.stack(functions) * weights) @ (levels - middle)


@full_precision
def _whitening(columns: Float[Array, "sensor column"]) -> Float[Array, "sensor column"]:
    """W of the module's equation. A loop of products: LAPACK's solution of so small a system waits for its threads."""

    def add(number: Array, whitening: Array) -> Array:
        column = columns[:, number]
        left = column - whitening @ (whitening.T @ column)
        return whitening.at[:, number].set(left / jnp.sqrt(1 + column @ left))

    return jax.lax.fori_loop(0, columns.shape[1], add, jnp.zeros_like(columns)) if columns.shape[1] else columns


def _orthonormal(
    functions: list[Float[Array, " particle"]], weights: Float[Array, " particle"]
) -> list[Float[Array, " particle"]]:
    """Functions less what those before them explain (Gram and Schmidt), of mean square 1; 0 where nothing is left."""
    basis: list[Array] = []
    for function in functions:
        left = function
        for before in basis:
            left = left - (weights @ (left * before)) * before
        square = weights @ left**2
        some = square > NOTHING * (weights @ function**2)
        basis.append(jnp.where(some, left / jnp.sqrt(jnp.where(some, square, 1)), 0))
    return basis
