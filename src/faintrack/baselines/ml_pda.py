r"""Maximum likelihood over a batch: the straight path that explains the detections of all scans best.

A target without noise in its motion is a parameter, its state x at the first scan. With the log ratio of a scan summed
over which detection is the target's (`faintrack.baselines.pda`, with a state that is known), that of a batch is

.. math::
    \Lambda(x) = \sum_t \log \left[ 1 - P_D + \frac{P_D}{\lambda} \sum_i N(z_{ti}; h_t(x), R) \right]

(Jauffret and Bar-Shalom 1990), :math:`h_t(x)` the measurement of the moved state. Its maximum is the estimate, and the
track is accepted where that passes a threshold, which is found on batches without a target. Detections may be bearings,
returns of a sonar, or whatever else `Association` measures.

**The maximum.** :math:`\Lambda` has a peak wherever a path passes near some detections. It is climbed from many starts
at once, first with a wider error, then with narrower ones down to R. With the probabilities :math:`\beta_{ti}` of the
associations, the Jacobians :math:`H_t` of :math:`h_t`, and :math:`\nu_{ti} = z_{ti} - h_t(x)`, a step is that of
expectation and maximisation, linearised,

.. math::
    \Delta x = A^{-1} \nabla \Lambda, \qquad
    \nabla \Lambda = \sum_t H_t^T R^{-1} \sum_i \beta_{ti} \nu_{ti}, \qquad
    A = \sum_t \Big( \sum_i \beta_{ti} \Big) H_t^T R^{-1} H_t ,

of which the fraction is taken that raises :math:`\Lambda` most, or none.

**The covariance** is the inverse of the information that is observed: A less what is lost because the associations are
not known (Louis 1982), :math:`\sum_t H_t^T R^{-1} C_t R^{-1} H_t` with :math:`C_t` the covariance over i of
:math:`\nu_{ti}`, 0 where none is the target's.

Nothing is filtered and nothing appears or leaves within the batch; use it to compare with. For targets that manoeuvre,
come and go, there are the filters.
"""

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from faintrack.baselines.pda import Association, Gaussian
from faintrack.numerics.precision import full_precision

FRACTIONS = 0.5 ** jnp.arange(8)
"""Of a step."""

RIDGE = 1e-5
"""Added to the information, over its diagonal: enough to keep single precision from dividing by nothing."""


class Estimate(NamedTuple):
    """Likeliest target of a batch.

    Attributes
    ----------
    state : at the time of the first scan, and its covariance.
    log_ratio : of the batch there.
    """

    state: Gaussian
    log_ratio: Float[Array, ""]


class MlPda(eqx.Module):
    """Maximum likelihood with data association.

    Attributes
    ----------
    association : how detections are told apart.
    move : function of a state and seconds to the state after them.
    widths : of the passes, factors of the standard deviation of a measurement; the last is 1.
    iterations : of each pass.

    Examples
    --------
    A line of places, one a second, with a false one in two of three scans:

    >>> from typing import NamedTuple
    >>> class Line(NamedTuple):
    ...     time: Array
    ...     values: Array
    ...     real: Array
    >>> values = jnp.array([[3.0, 40.0], [5.0, -9.0], [7.0, 0.0]])[..., None]
    >>> scans = Line(jnp.arange(3.0), values, jnp.array([[True, True], [True, True], [True, False]]))
    >>> association = Association(
    ...     lambda state, scan: state[:1], lambda scan: (scan.values, scan.real), jnp.eye(1) / 100, 0.9, 0.01
    ... )
    >>> method = MlPda(association, lambda state, seconds: state.at[0].add(seconds * state[1]))
    >>> method.fit(jnp.array([[4.0, 0.0], [40.0, 0.0]]), scans).state.mean.round(2).tolist()
    [3.0, 2.0]
    """

    association: Association
    move: Callable[[Array, Array], Array] = eqx.field(static=True)
    widths: tuple[float, ...] = eqx.field(static=True, default=(8.0, 4.0, 2.0, 1.0))
    iterations: int = eqx.field(static=True, default=10)

    def log_ratio(self, state: Float[Array, " component"], scans: Any) -> Float[Array, ""]:
        """Log ratio of a batch for a target that has this state at the first scan (the module's equation)."""
        return self._log_ratio(state, scans, jnp.asarray(1.0))

    @eqx.filter_jit
    @full_precision
    def fit(self, starts: Float[Array, "start component"], scans: Any) -> Estimate:
        """Highest maximum that is climbed to.

        Parameters
        ----------
        starts : states at the first scan.
        scans : as many scans as the first axis of every field is long; `time` in seconds.
        """
        widths = jnp.repeat(jnp.asarray(self.widths), self.iterations)

        def climb(state: Float[Array, " component"]) -> tuple[Array, Array]:
            def improved(state: Array, width: Array) -> tuple[Array, None]:
                gradient, complete, _ = self._information(state, scans, width)
                tried = state + FRACTIONS[:, None] * _solved(complete, gradient[:, None])[:, 0]
                tried = jnp.concatenate([state[None], tried])
                reached = jax.vmap(lambda state: self._log_ratio(state, scans, width))(tried)
                return tried[jnp.argmax(jnp.where(jnp.isnan(reached), -jnp.inf, reached))], None

            state, _ = jax.lax.scan(improved, state, widths)
            return state, self.log_ratio(state, scans)

        states, log_ratios = jax.vmap(climb)(starts)
        best = jnp.argmax(log_ratios)
        _, complete, lost = self._information(states[best], scans, jnp.asarray(1.0))
        covariance = _solved(complete - lost, jnp.eye(starts.shape[1]))
        return Estimate(Gaussian(states[best], covariance), log_ratios[best])

    def _scan(self, state: Array, scan: Any, since: Array, width: Array) -> tuple[Array, Array]:
        """Log weights of the hypotheses and innovations of a scan, the error wider by a factor."""
        association = dataclasses.replace(self.association, error=self.association.error * width**2)
        return association.known(self.move(state, since), scan)

    def _log_ratio(self, state: Array, scans: Any, width: Array) -> Float[Array, ""]:
        def of(scan: Any) -> Array:
            return jax.nn.logsumexp(self._scan(state, scan, scan.time - scans.time[0], width)[0])

        return jax.vmap(of)(scans).sum()

    def _information(self, state: Array, scans: Any, width: Array) -> tuple[Array, Array, Array]:
        """Gradient of the log ratio, complete information, and what of it is lost to the associations."""
        precision = jnp.linalg.inv(self.association.error * width**2)

        def of(scan: Any) -> tuple[Array, Array, Array]:
            since = scan.time - scans.time[0]
            log_weights, off = self._scan(state, scan, since, width)
            possible = log_weights.max() > -jnp.inf
            share = jnp.where(possible, jax.nn.softmax(jnp.where(possible, log_weights, 0)), 0)[1:]
            jacobian = jax.jacfwd(lambda state: self.association.measure(self.move(state, since), scan))(state)
            weighted = precision @ jacobian
            off = jnp.where(share[:, None] > 0, off, 0)
            middle = share @ off
            spread = jnp.einsum("i,im,in->mn", share, off, off) - jnp.outer(middle, middle)
            return weighted.T @ middle, share.sum() * jacobian.T @ weighted, weighted.T @ spread @ weighted

        return jax.tree.map(lambda part: part.sum(axis=0), jax.vmap(of)(scans))


def _solved(information: Float[Array, "component component"], right: Float[Array, "component column"]) -> Array:
    """Inverse of an information times columns, its components of whatever units."""
    scale = jnp.sqrt(jnp.maximum(jnp.diag(information), jnp.finfo(information.dtype).tiny))
    scaled = information / jnp.outer(scale, scale) + RIDGE * jnp.eye(len(scale))
    return jnp.linalg.solve(scaled, right / scale[:, None]) / scale[:, None]
