r"""Histogram PMHT through scans: candidates start at peaks, a batch of the last scans moves along.

A scan's log ratio in the middle of every cell has its local maxima where a target may just have appeared. The highest
become candidates, at rest within the spread of the rates, each with the odds of a target that appears in one cell of
all. Every candidate, with the scans that there are of it, is fitted by `faintrack.baselines.histogram_pmht`; from scan
to scan the path that was found is where the next fit starts. When the batch is full its first scan is dropped: what was
known at it, filtered and not smoothed, moved one scan on, becomes the prior, and its odds of existence go through the
chain with it (`Target.forecast`).

Candidates are alternatives, one target at most, and each is weighed against noise alone. Two that have come to the same
place at the same rate are one, the better; of all the best are kept. A target is declared where the log odds of the
best pass a threshold. They are those of one path and not of the sum over paths, so that the threshold has to be found
on scans without a target.
"""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from faintrack.baselines.histogram_pmht import Candidate, Fit, HistogramPmht

Followed = tuple[Float[Array, " scan"], Float[Array, "scan axis 2"]]
"""Log odds of the best candidate of every scan, and its place and rate along every axis of the cells."""


class HistogramTracks(eqx.Module):
    """Candidates of histogram PMHT.

    Attributes
    ----------
    pmht : fits a batch.
    covariance : of place and rate about a peak, along every axis.
    window : scans of a batch.
    capacity : candidates that are kept from scan to scan.
    starts : candidates that may begin in a scan.
    near, alike : distance and difference of rates below which two candidates are one.

    Examples
    --------
    A target in a profile of ranges, half a cell further in every scan:

    >>> from faintrack.baselines.histogram import Histogram
    >>> from faintrack.beliefs.axis import Axis
    >>> from faintrack.sensors.cells import Cells
    >>> from faintrack.targets.target import Target
    >>> histogram = Histogram(Cells((("range", Axis(0.0, 1.0, 20)),)), 4.0, 20.0, 0.8, reach=4)
    >>> moves, noise = jnp.array([[1.0, 1.0], [0.0, 1.0]]), 1e-3 * jnp.eye(2)
    >>> pmht = HistogramPmht(histogram, Target(None, None, 0.01, 0.05), moves, noise, interval=1.0, iterations=8)
    >>> tracks = HistogramTracks(pmht, jnp.eye(2) / 4, window=4, capacity=4, starts=2, near=1.0, alike=0.5)
    >>> places = 6 + 0.5 * jnp.arange(6.0)[:, None]
    >>> counts = 4 + 20 * 0.5 * jnp.exp(-0.5 * ((jnp.arange(20.0) - places) / 0.8) ** 2)
    >>> log_odds, state = tracks.follow(counts)
    >>> bool(log_odds[-1] > 3), state[-1, 0].round(1).tolist()
    (True, [8.5, 0.5])
    """

    pmht: HistogramPmht
    covariance: Float[Array, "2 2"]
    window: int = eqx.field(static=True)
    capacity: int = eqx.field(static=True)
    starts: int = eqx.field(static=True)
    near: float
    alike: float

    @eqx.filter_jit
    def follow(self, counts: Float[Array, "scan *cells"]) -> Followed:
        """Best candidate of every scan.

        Parameters
        ----------
        counts : shots of every cell; not a number (NaN) where nothing was measured.
        """
        histogram, window = self.pmht.histogram, self.window

        def advance(
            carried: tuple[Array, Candidate], scan: Float[Array, "*cells"]
        ) -> tuple[tuple[Array, Candidate], tuple[Array, Array]]:
            scans, candidates = carried
            scans = jnp.concatenate([scans[1:], histogram.with_margin(scan)[None]])
            candidates = jax.tree.map(lambda *parts: jnp.concatenate(parts), candidates, self._started(scan))
            # A candidate's own scans first; what comes after them is not read.
            order = (jnp.arange(window) + window - candidates.age[:, None]) % window
            fits = jax.vmap(lambda candidate, own: self.pmht.fit(scans[own], candidate))(candidates, order)
            now = jnp.take_along_axis(fits.path, (candidates.age - 1)[:, None, None, None], axis=1)[:, 0]
            score = jnp.where(self._twin(now, fits.log_odds), -jnp.inf, fits.log_odds)
            score, kept = jax.lax.top_k(score, self.capacity)
            candidates, fits = jax.tree.map(lambda part: part[kept], (candidates, fits))
            carried_on = jax.vmap(self._carried)(candidates, fits, score > -jnp.inf)
            return (scans, carried_on), (score[0], now[kept[0]])

        wider = histogram.with_margin(counts[0]).shape
        return jax.lax.scan(advance, (jnp.full((window, *wider), jnp.nan, counts.dtype), self._none(counts)), counts)[1]

    def _none(self, counts: Float[Array, "scan *cells"]) -> Candidate:
        """Places for candidates, empty."""
        nowhere = jnp.zeros((self.capacity, counts.ndim - 1, 2), counts.dtype)
        return self._at(nowhere, jnp.full(self.capacity, -jnp.inf, counts.dtype))

    def _at(self, mean: Float[Array, "candidate axis 2"], log_odds: Float[Array, " candidate"]) -> Candidate:
        """Candidates that begin."""
        count = len(mean)
        path = jnp.broadcast_to(mean[:, None], (count, self.window, *mean.shape[1:]))
        covariance = jnp.broadcast_to(self.covariance, (count, 2, 2))
        return Candidate(mean, covariance, log_odds, jnp.ones(count, jnp.int32), path)

    def _started(self, scan: Float[Array, "*cells"]) -> Candidate:
        """Candidates at the highest of a scan's local maxima."""
        cells = self.pmht.histogram.cells
        table = self.pmht.histogram.table(scan)
        around = jax.lax.reduce_window(table, -jnp.inf, jax.lax.max, (3,) * table.ndim, (1,) * table.ndim, "SAME")
        height, flat = jax.lax.top_k(jnp.where(table >= around, table, -jnp.inf).ravel(), self.starts)
        number = jnp.unravel_index(flat, table.shape)
        place = jnp.stack(
            [axis.first + axis.step * index for index, (_, axis) in zip(number, cells.axes, strict=True)], -1
        )
        born, _ = self.pmht.target.transition(self.pmht.interval)
        log_odds = jnp.where(height > -jnp.inf, jnp.log(born) - math.log(cells.size), -jnp.inf)
        return self._at(jnp.stack([place, jnp.zeros_like(place)], -1), log_odds)

    def _twin(
        self, states: Float[Array, "candidate axis 2"], log_odds: Float[Array, " candidate"]
    ) -> Bool[Array, " candidate"]:
        """Whether a better candidate is the same."""
        apart = jnp.sqrt(((states[:, None] - states) ** 2).sum(axis=2))
        same = (apart[..., 0] < self.near) & (apart[..., 1] < self.alike)
        order = jnp.arange(len(log_odds))
        tie = (log_odds == log_odds[:, None]) & (order < order[:, None])
        return (same & ((log_odds > log_odds[:, None]) | tie)).any(axis=1)

    def _carried(self, candidate: Candidate, fit: Fit, kept: Bool[Array, ""]) -> Candidate:
        """A candidate at the next scan; the first of a full batch is dropped."""
        pmht, full = self.pmht, candidate.age == self.window
        forecast = pmht.target.forecast(candidate.log_odds + fit.log_ratio[0] + fit.log_width[0], pmht.interval)
        odds = forecast.stayed - jnp.logaddexp(forecast.none, jnp.logaddexp(forecast.appeared, forecast.left))
        covariance = pmht.transition @ fit.covariance[0] @ pmht.transition.T + pmht.noise
        later = jnp.concatenate([fit.path[1:], fit.path[-1:] @ pmht.transition.T])
        return Candidate(
            jnp.where(full, fit.filtered[0] @ pmht.transition.T, candidate.mean),
            jnp.where(full, covariance, candidate.covariance),
            jnp.where(kept, jnp.where(full, odds, candidate.log_odds), -jnp.inf),
            jnp.minimum(candidate.age + 1, self.window),
            jnp.where(full, later, fit.path),
        )
