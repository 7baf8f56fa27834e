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
:math:`\Sigma = I + B B^T` and, L being the Cholesky factor of :math:`I + B^T B`,

.. math:: \Sigma^{-1} = I - W W^T, \qquad W = B L^{-T} .

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

RIDGE = 1e-4
"""Added to the correlation of functions of the place, so that rounding leaves it a root."""


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
    >>> others = jax.tree.map(lambda component: component[None], here)
    >>> scan = likelihood.beside(scan, others, jnp.zeros((1, 1)), jnp.ones(1))
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
        root = jnp.linalg.cholesky(jnp.eye(columns.shape[1], dtype=columns.dtype) + columns.T @ columns)
        inverse = jax.scipy.linalg.solve_triangular(root, jnp.eye(len(root), dtype=root.dtype), lower=True)
        whitening = columns @ inverse.T
        levels = self.network.levels(states)
        spoilt = jnp.sum((levels @ whitening) ** 2, axis=-1)
        return levels @ (off - whitening @ (whitening.T @ off)) - (levels * levels @ usable - spoilt) / 2

    @full_precision
    def beside(
        self,
        scan: SuperposedScan,
        states: Any,
        log_weights: Float[Array, "target particle"],
        existence: Float[Array, " target"],
    ) -> SuperposedScan:
        """Scan with other targets as a part of its background (the module's equation).

        Parameters
        ----------
        scan : with a background of its own, which stays.
        states : of the others; components of shape (target, particle).
        log_weights : natural log of each particle's probability, if its target exists.
        existence : probability of each; what does not exist adds nothing.

        Notes
        -----
        Check: the order of the others does not matter, nor whether they are added at once or one after the other; one
        that is certain to be at a place leaves the covariance as it is.
        """
        means, explained = jax.vmap(self._moments)(states, jnp.exp(log_weights))
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
        x, y = _standard(jnp.stack([states.x, states.y]), weights)
        functions = _standard(jnp.stack([x, y, x * x, x * y, y * y]), weights)
        weighted = functions * weights
        root = jnp.linalg.cholesky(weighted @ functions.T + RIDGE * jnp.eye(5, dtype=weights.dtype))
        return middle, jax.scipy.linalg.solve_triangular(root, weighted @ (levels - middle), lower=True)


def _standard(
    values: Float[Array, "function particle"], weights: Float[Array, " particle"]
) -> Float[Array, "function particle"]:
    """Values less their mean, over their standard deviation; 0 where they are all the same."""
    values = values - (values @ weights)[:, None]
    variance = values**2 @ weights
    return values / jnp.sqrt(jnp.maximum(variance, jnp.finfo(values.dtype).tiny))[:, None]
