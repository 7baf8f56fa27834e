r"""Histogram PMHT: a target's path from the histograms of a batch of scans, by expectation and maximisation.

Of every scan a histogram of shots is given (`faintrack.baselines.histogram`). The path :math:`x = (x_1, \ldots, x_T)`
of places and rates has a Gaussian prior, :math:`N(m, P)` and the motion F, Q. A target that is there in the first scan
stays from scan to scan with :math:`p_s`, and does not come back: it is last seen in scan d. With :math:`\ell_t` the log
ratio of scan t, what is maximised over x is

.. math::
    L(x) = \log p(x) + \log \sum_{d=1}^{T} u_d, \qquad
    u_d = p_s^{d-1} (1 - p_s)^{[d < T]}\, e^{\sum_{t \le d} \ell_t(x_t)} ,

with hidden: which shots are the target's, where in its cell each fell, and d.

**Expectation.** At the path in hand, a target that was there in the first scan still is in scan t with the probability
:math:`e_t = \sum_{d \ge t} u_d / \sum_d u_d`, and then sent :math:`W_t` shots about :math:`z_t`. In Streit's words the
mixing proportion of the target is either nothing or that of its level, and :math:`e_t` times the latter is its
expectation: the mixing proportion measures existence.

**Maximisation.** The expected complete log likelihood is

.. math::
    \log p(x) - \sum_t \frac{e_t W_t}{2 w^2} |z_t - H x_t|^2 + \ldots ,

so the new path is that of a Kalman smoother that is told places :math:`z_t` with variances :math:`w^2 / (e_t W_t)`.
L never falls.

**Existence** is not that of the likeliest path, which noise has too, and the more so the freer it is, but of all paths
about it. Where the ratio falls off from the path :math:`\hat x` as the expected complete likelihood does, its mean over
the prior is (Laplace) the ratio at :math:`\hat x` times

.. math::
    V = \int p(x) \prod_t \exp\left[ -\frac{e_t W_t}{2 w^2} \left( |z_t - H x_t|^2 - |z_t - H \hat x_t|^2 \right)
    \right] dx ,

of which the Kalman filter gives the factor of every scan. With :math:`u_d` of ratios times these factors, and the
probability q that the target was there in the first scan, the odds that it is in the last are :math:`q u_T` against all
else, :math:`1 - q + q \sum_{d < T} u_d`. All attributed shots count as certainly the target's in V, so that it is
somewhat too small.

One path is kept of many, the likeliest near the one that it starts from; `faintrack.baselines.histogram_tracks` starts
from peaks and carries the batch along. Streit (2001) has several targets that share each cell, with free mixing
proportions and no existence; here is one target of known level, in the words of the package. Use it to compare with:
`faintrack.filters.grid` sums over all paths.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from faintrack.baselines.histogram import Histogram
from faintrack.baselines.smoother import smooth
from faintrack.targets.target import Target


class Candidate(eqx.Module):
    """A target that may be there, before the scans of a batch are taken in, or a stack of such.

    Attributes
    ----------
    mean, covariance : of place and rate at the first scan; all axes have one covariance.
    log_odds : that it is there in the first scan.
    age : scans that there are of it; those of the batch beyond are left out.
    path : place and rate in every scan from which to start.
    """

    mean: Float[Array, "*candidate axis 2"]
    covariance: Float[Array, "*candidate 2 2"]
    log_odds: Float[Array, "*candidate"]
    age: Int[Array, "*candidate"]
    path: Float[Array, "*candidate scan axis 2"]


class Fit(NamedTuple):
    """What a batch says of a candidate.

    Attributes
    ----------
    path : likeliest place and rate in every scan, given all of them.
    filtered, covariance : mean and covariance of the state in every scan, of the scans up to it.
    log_ratio : of every scan at the path.
    log_width : of every scan, log of the share of paths that are as likely; sums to log V.
    presence : probability that the target is there in every scan, given all of them and that it was in the first.
    log_likelihood : L without the density of the path.
    log_odds : that the target is there in the last scan.
    """

    path: Float[Array, "scan axis 2"]
    filtered: Float[Array, "scan axis 2"]
    covariance: Float[Array, "scan 2 2"]
    log_ratio: Float[Array, " scan"]
    log_width: Float[Array, " scan"]
    presence: Float[Array, " scan"]
    log_likelihood: Float[Array, ""]
    log_odds: Float[Array, ""]


class HistogramPmht(eqx.Module):
    """Histogram PMHT for one target.

    Attributes
    ----------
    histogram : shots of noise and target.
    target : arrival and departure.
    transition, noise : F and Q of place and rate, the same along every axis, from scan to scan.
    interval : between scans; seconds.
    iterations : of expectation and maximisation, at least 1.
    """

    histogram: Histogram
    target: Target
    transition: Float[Array, "2 2"]
    noise: Float[Array, "2 2"]
    interval: float
    iterations: int = eqx.field(static=True)

    def fit(self, counts: Float[Array, "scan *wider"], candidate: Candidate) -> Fit:
        """Path of a candidate through a batch (the module's equations).

        Parameters
        ----------
        counts : shots of every cell, `Histogram.with_margin`.
        candidate : the one that is looked for; its path has as many scans.
        """
        within = jnp.arange(len(counts)) < candidate.age

        def ratios(path: Array) -> Array:
            return jnp.where(within, jax.vmap(self.histogram.log_ratio)(counts, path[..., 0]), 0)

        def improved(path: Array, _: None) -> tuple[Array, tuple[Array, Array, Array]]:
            until = self._until(candidate.age, ratios(path))
            shots, middle = jax.vmap(self.histogram.attribute)(counts, path[..., 0])
            precision = jnp.where(within, _presence(until) * shots, 0) / self.histogram.width**2
            smoothed = smooth(candidate.mean, candidate.covariance, self.transition, self.noise, middle, precision)
            off = ((smoothed.mean[..., 0] - middle) ** 2).sum(axis=1)
            log_width = smoothed.log_volume + 0.5 * precision * off
            return smoothed.mean, (smoothed.filtered, smoothed.covariance, log_width)

        path, history = jax.lax.scan(improved, candidate.path, length=self.iterations)
        filtered, covariance, log_width = jax.tree.map(lambda part: part[-1], history)
        log_ratio = ratios(path)
        until = self._until(candidate.age, log_ratio)
        log_odds = self._odds(candidate, self._until(candidate.age, log_ratio + log_width))
        log_likelihood = jax.nn.logsumexp(until)
        return Fit(path, filtered, covariance, log_ratio, log_width, _presence(until), log_likelihood, log_odds)

    def _until(self, age: Int[Array, ""], log_ratio: Float[Array, " scan"]) -> Float[Array, " scan"]:
        """Log of u: the target is last seen in each of the scans."""
        number = jnp.arange(len(log_ratio))
        _, survival = self.target.transition(self.interval)
        ended = jnp.where(number == age - 1, 0, jnp.log1p(-survival))
        return jnp.where(number < age, number * jnp.log(survival) + ended + jnp.cumsum(log_ratio), -jnp.inf)

    def _odds(self, candidate: Candidate, until: Float[Array, " scan"]) -> Float[Array, ""]:
        """Log odds that the target is there in the last scan."""
        left = jnp.where(jnp.arange(len(until)) == candidate.age - 1, -jnp.inf, until)
        # All over 1 - q, that of never having been there.
        gone = jnp.logaddexp(candidate.log_odds + jax.nn.logsumexp(left), 0)
        return candidate.log_odds + until[candidate.age - 1] - gone


def _presence(until: Float[Array, " scan"]) -> Float[Array, " scan"]:
    """Probability that the target is there in each scan, from the log of u."""
    return jnp.cumsum(jax.nn.softmax(until)[::-1])[::-1]
