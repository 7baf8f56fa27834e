r"""Probabilistic data association: one Gaussian for all that the detections of a scan may mean.

A target that is believed to lie at :math:`N(m, P)` is detected with probability :math:`P_D`; false detections come with
density :math:`\lambda` a scan and unit of what is measured. With the predicted measurement :math:`\hat z` and the
covariance S of the innovation, detection i is the target's, or none is, with the probabilities

.. math::
    \beta_i = \frac{P_D\, N(z_i; \hat z, S) / \lambda}{I}, \quad \beta_0 = \frac{1 - P_D}{I}, \qquad
    I = 1 - P_D + \frac{P_D}{\lambda} \sum_i N(z_i; \hat z, S)

(Bar-Shalom and Tse 1975). I is the mean likelihood ratio of the scan, the evidence that
`faintrack.beliefs.belief.update` has from points. The mixture over i is replaced by one Gaussian with its mean and
covariance. There is no gate: what is far off has a weight of nothing.

Where the density of false detections is not known it may be taken from the scan itself, as many as there are detections
over the width of what is watched (the nonparametric form); with :math:`P_D = 1` that is the published form of
`faintrack.likelihoods.bearing_sets`.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from faintrack.numerics.precision import full_precision

Measure = Callable[[Array], Array]
"""Function of a state to what would be measured of it, without noise."""

Differ = Callable[[Array, Array], Array]
"""Difference of two measurements: `jnp.subtract`, or `turned` for angles."""


class Gaussian(eqx.Module):
    """A normal distribution of a state, or a stack of them.

    Attributes
    ----------
    mean, covariance : of the state.
    """

    mean: Float[Array, "*stack component"]
    covariance: Float[Array, "*stack component component"]


class Innovation(NamedTuple):
    """What a measurement is expected to be, and what it tells.

    Attributes
    ----------
    expected : measurement.
    covariance : S, of the measurement about it.
    gain : change of the state for a unit of the innovation.
    """

    expected: Float[Array, " measured"]
    covariance: Float[Array, "measured measured"]
    gain: Float[Array, "component measured"]


@full_precision
def extended(
    state: Gaussian, measure: Measure, error: Float[Array, "measured measured"], differ: Differ = jnp.subtract
) -> Innovation:
    """Innovation by the Jacobian of the measurement at the mean."""
    jacobian = jax.jacfwd(measure)(state.mean)
    across = state.covariance @ jacobian.T
    covariance = jacobian @ across + error
    return Innovation(measure(state.mean), covariance, jnp.linalg.solve(covariance, across.T).T)


@full_precision
def unscented(
    state: Gaussian, measure: Measure, error: Float[Array, "measured measured"], differ: Differ = jnp.subtract
) -> Innovation:
    """Innovation from points on the contour of one standard deviation, as many as twice the components."""
    count = state.mean.shape[-1]
    root = jnp.linalg.cholesky(state.covariance) * np.sqrt(count)
    off = jnp.concatenate([root.T, -root.T])
    middle = measure(state.mean)
    # Differences from the middle: bearings on both sides of a turn's end stay together.
    told = jax.vmap(lambda step: differ(measure(state.mean + step), middle))(off)
    mean = told.mean(axis=0)
    covariance = (told - mean).T @ (told - mean) / (2 * count) + error
    across = off.T @ (told - mean) / (2 * count)
    return Innovation(middle + mean, covariance, jnp.linalg.solve(covariance, across.T).T)


def turned(angle: Float[Array, "..."], other: Float[Array, "..."]) -> Float[Array, "..."]:
    """Difference of angles by the shorter way round."""
    difference = angle - other
    return difference - 2 * jnp.pi * jnp.round(difference / (2 * jnp.pi))


@full_precision
def merged(weights: Float[Array, " stack"], parts: Gaussian) -> Gaussian:
    """The Gaussian with the mean and covariance of a mixture whose weights sum to 1."""
    mean = weights @ parts.mean
    off = parts.mean - mean
    covariance = jnp.einsum("s,sij->ij", weights, parts.covariance) + jnp.einsum("s,si,sj->ij", weights, off, off)
    return Gaussian(mean, covariance)


class Association(eqx.Module):
    """How detections of a scan are told apart.

    Attributes
    ----------
    measure : function of (state, scan) to the measured numbers, without noise.
    values : function of a scan to its detections, shape (entry, measured), and whether each entry is one.
    error : covariance of a measurement.
    detection_probability : of a target in a scan.
    false_density : expected number of false detections a scan and unit of what is measured; or a function of a scan to
        it.
    innovate : `extended` or `unscented`.
    differ : difference of two measurements.
    """

    measure: Callable[[Array, Any], Array] = eqx.field(static=True)
    values: Callable[[Any], tuple[Array, Array]] = eqx.field(static=True)
    error: Float[Array, "measured measured"]
    detection_probability: Float[Array, ""] | float
    false_density: Float[Array, ""] | float | Callable[[Any], Array]
    innovate: Callable[[Gaussian, Measure, Array, Differ], Innovation] = eqx.field(static=True, default=extended)
    differ: Differ = eqx.field(static=True, default=jnp.subtract)

    @full_precision
    def take_in(self, state: Gaussian, scan: Any) -> tuple[Gaussian, Float[Array, ""]]:
        """Gaussian after a scan, and the log of the evidence I (the module's equations)."""
        told = self.innovate(state, lambda each: self.measure(each, scan), self.error, self.differ)
        values, there = self.values(scan)
        off = self.differ(values, told.expected)
        density = self.false_density(scan) if callable(self.false_density) else self.false_density
        log_weights = self._log_weights(off, there, told, density)
        log_evidence = jax.nn.logsumexp(log_weights)
        # A target that cannot be missed, and no detection: there is none, and its state stays as it was.
        none = jnp.arange(len(log_weights)) == 0
        weights = jnp.where(log_evidence > -jnp.inf, jnp.exp(log_weights - log_evidence), none)
        after = state.covariance - told.gain @ told.covariance @ told.gain.T
        covariances = jnp.concatenate([state.covariance[None], jnp.broadcast_to(after, (len(off), *after.shape))])
        means = jnp.concatenate([state.mean[None], state.mean + off @ told.gain.T])
        return merged(weights, Gaussian(means, covariances)), log_evidence

    def known(
        self, state: Float[Array, " component"], scan: Any
    ) -> tuple[Float[Array, " hypothesis"], Float[Array, "entry measured"]]:
        """Of a target whose state is known: logs of the numerators, S the error itself; detections less the expected.

        The first hypothesis is that no detection is the target's.
        """
        expected = self.measure(state, scan)
        values, there = self.values(scan)
        off = self.differ(values, expected)
        density = self.false_density(scan) if callable(self.false_density) else self.false_density
        nothing = jnp.zeros((len(state), len(expected)), off.dtype)
        return self._log_weights(off, there, Innovation(expected, self.error, nothing), density), off

    def _log_weights(
        self,
        off: Float[Array, "entry measured"],
        there: Bool[Array, " entry"],
        told: Innovation,
        false_density: Float[Array, ""] | float,
    ) -> Float[Array, " hypothesis"]:
        """Of no detection being the target's, then of each: the numerators of the module's probabilities."""
        detected = jnp.asarray(self.detection_probability, off.dtype)
        root = jnp.linalg.cholesky(told.covariance)
        scaled = jax.scipy.linalg.solve_triangular(root, off.T, lower=True)
        log_density = -0.5 * (scaled**2).sum(axis=0) - jnp.log(jnp.diag(root)).sum()
        log_density = log_density - 0.5 * off.shape[1] * jnp.log(2 * jnp.pi)
        each = jnp.where(there, jnp.log(detected) + log_density - jnp.log(false_density), -jnp.inf)
        return jnp.concatenate([jnp.log1p(-detected)[None], each])
