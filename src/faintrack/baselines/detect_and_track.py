r"""Detect and track, the classical way: CFAR detections, Kalman filters, track scores.

Every detection that no track explains starts a tentative track. A track predicts its bearing and rate, takes the
nearest detection in its gate, and keeps a score, the log odds that it follows a target (Blackman and Popoli 1999,
section 6.2). With p_b and p_s the birth and survival probabilities of a scan, P_D the detection probability,
:math:`\beta` the false detections per radian and scan, :math:`\nu` the innovation and S its variance,

.. math::
    L_0 = \log\frac{p_b P_D}{\pi \beta}, \qquad
    L' = \operatorname{logit}(p_s \operatorname{logit}^{-1} L), \qquad
    L \leftarrow L' + \begin{cases}
        \log \frac{P_D \, \mathcal{N}(\nu; 0, S)}{\beta} & \text{detection in the gate} \\
        \log (1 - P_D) & \text{none}
    \end{cases}

(:math:`\pi` radians of a line, :math:`2 \pi` of a circle). The existence probability of a track is
:math:`\operatorname{logit}^{-1} L`; a track is confirmed where it reaches `declare`, and deleted where its score is
`deletion` below its own highest, which is predicted as the score is, or another track, better, is within half a lobe.
What is reported is the track in hand, or the best.

This is what bosser2022 and others compare track-before-detect with. It has the same target and motion as the filters,
and takes and returns the same as `faintrack.trackers.single.SingleTargetTracker`.
"""

import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from faintrack.baselines.cfar import CellAveraging, Detections
from faintrack.targets.states import BearingState
from faintrack.targets.target import Target, odds_of
from faintrack.trackers.single import Estimate

FORGET_SCANS = 30.0
"""Scans over which the level at a track is averaged to tell its SNR."""


class Tracks(eqx.Module):
    """Tentative and confirmed tracks, a place for each.

    Attributes
    ----------
    bearing, bearing_rate : estimates; radians, rad/s.
    covariance : shape (track, 3); variances and covariance of bearing and rate, in the order bearing, both, rate.
    score : log odds that the track follows a target; -inf where the place is empty.
    highest : highest score so far, with the chance since then that the target has left.
    excess : mean level at the track less 1.
    label : number of the track, counted from 1.
    """

    bearing: Float[Array, " track"]
    bearing_rate: Float[Array, " track"]
    covariance: Float[Array, "track 3"]
    score: Float[Array, " track"]
    highest: Float[Array, " track"]
    excess: Float[Array, " track"]
    label: Int[Array, " track"]


class Standing(eqx.Module):
    """What the tracker knows between scans.

    Attributes
    ----------
    tracks : all of them.
    started : labels given so far; every scan takes as many as tracks may begin in it.
    held : label of the confirmed track that is reported; 0 where there is none.
    reported : confirmed tracks so far.
    time : of the last scan; seconds.
    """

    tracks: Tracks
    started: Int[Array, ""]
    held: Int[Array, ""]
    reported: Int[Array, ""]
    time: Float[Array, ""]


class DetectAndTrack(eqx.Module):
    """CFAR, Kalman filters and track scores.

    Attributes
    ----------
    detector : calibrated; see `faintrack.baselines.cfar`.
    target : motion, arrival and departure; its birth density gives the rates of new targets.
    false_detections : mean number of detections in a frame of noise.
    detection_probability : that a target is detected in a scan.
    bearing_std : of a detection at broadside; radians. On a line it grows towards the ends as the lobe does.
    lobe : width of the main lobe; radians.
    declare : existence at which a track is confirmed; above `drop`.
    drop : existence of the track in hand below which it ends.
    deletion : a track ends where its score is this far below its highest.
    gate : largest innovation that is taken, in standard deviations.
    capacity : tracks at once; a new one takes the place of the worst where all are taken.
    starts : tracks that may begin in one scan, the strongest detections first.
    """

    detector: CellAveraging
    target: Target
    false_detections: Float[Array, ""] | float
    bearing_std: float
    lobe: float
    detection_probability: float = 0.7
    declare: float = 0.97
    drop: float = 0.3
    deletion: float = 5.0
    gate: float = 3.0
    capacity: int = eqx.field(static=True, default=24)
    starts: int = eqx.field(static=True, default=6)

    def init(self, key: PRNGKeyArray) -> Standing:
        """State before the first scan; nothing is drawn."""
        none = jnp.zeros(self.capacity)
        empty = jnp.full(self.capacity, -jnp.inf)
        label = jnp.zeros(self.capacity, jnp.int32)
        tracks = Tracks(none, none, jnp.ones((self.capacity, 3)), empty, empty, none, label)
        return Standing(tracks, jnp.array(0), jnp.array(0), jnp.array(0), jnp.array(0.0))

    def step(self, standing: Standing, scan: Any, key: PRNGKeyArray) -> tuple[Standing, Estimate]:
        """Take in one scan; `key` is not used."""
        interval = scan.time - standing.time
        born, _ = self.target.transition(interval)
        detections = self.detector.detect(scan)
        tracks = self._predict(standing.tracks, interval)
        tracks, explained = self._associate(tracks, detections, scan.channels >= 2)
        tracks = self._prune(tracks)
        tracks, started = self._start(tracks, detections, explained, born, standing.started)

        existence = jax.nn.sigmoid(tracks.score)
        mine = (tracks.label == standing.held) & (standing.held > 0) & (existence >= self.drop)
        kept = mine.any()
        best = jnp.argmax(tracks.score)
        declares = ~kept & (existence[best] >= self.declare)
        row = jnp.where(kept, jnp.argmax(mine), best)
        held = jnp.where(kept | declares, tracks.label[row], 0)
        reported = standing.reported + declares
        first, both, second = tracks.covariance[row]
        # How far off the level is it does not know.
        unknown = jnp.full_like(first, jnp.nan)
        covariance = jnp.array([[first, both, unknown], [both, second, unknown], [unknown, unknown, unknown]])
        snr_db = 10 * jnp.log10(jnp.maximum(tracks.excess[row], 1e-3) / jnp.maximum(scan.channels, 1))
        estimate = Estimate(
            scan.time,
            existence[best],
            jnp.where(held > 0, reported, 0),
            existence[row],
            BearingState(tracks.bearing[row], tracks.bearing_rate[row], snr_db),
            covariance,
            unknown,
        )
        return Standing(tracks, started, held, reported, scan.time), estimate

    @eqx.filter_jit
    def steps(self, standing: Standing, scans: Any, key: PRNGKeyArray) -> tuple[Standing, Estimate]:
        """Take in a stack of scans in one compiled loop; the estimates are stacked."""
        return jax.lax.scan(lambda carry, scan: self.step(carry, scan, key), standing, scans)

    def _predict(self, tracks: Tracks, interval: Array) -> Tracks:
        motion = self.target.motion
        a, b, c = motion.noise(interval)
        spread = motion.rate_noise**2
        bearing, rate = motion.within(tracks.bearing + interval * tracks.bearing_rate, tracks.bearing_rate)
        first, both, second = tracks.covariance.T
        covariance = jnp.stack(
            [
                first + 2 * interval * both + interval**2 * second + spread * (a * a + b * b),
                both + interval * second + spread * a * c,
                second + spread * c * c,
            ],
            axis=1,
        )
        # The highest score survives no better than the score does; else one miss would end a track that was certain.
        score, highest = odds_of(self.target.forecast(jnp.stack([tracks.score, tracks.highest]), interval).stayed)
        return Tracks(bearing, rate, covariance, score, highest, tracks.excess, tracks.label)

    def _associate(self, tracks: Tracks, detections: Detections, usable: Array) -> tuple[Tracks, Bool[Array, " beam"]]:
        variance = tracks.covariance[:, 0] + self._noise(tracks.bearing)
        off = self._difference(detections.bearing - tracks.bearing[:, None])
        distance = jnp.where(detections.found, jnp.abs(off), jnp.inf)
        within = distance <= self.gate * jnp.sqrt(variance)[:, None]
        nearest = jnp.argmin(distance, axis=1)
        hit = jnp.take_along_axis(within, nearest[:, None], axis=1)[:, 0]
        innovation = jnp.where(hit, jnp.take_along_axis(off, nearest[:, None], axis=1)[:, 0], 0)
        first, both, second = tracks.covariance.T
        gain, rate_gain = jnp.where(hit, first / variance, 0), jnp.where(hit, both / variance, 0)
        covariance = jnp.stack([(1 - gain) * first, (1 - gain) * both, second - rate_gain * both], axis=1)
        density = -0.5 * (innovation**2 / variance + jnp.log(2 * jnp.pi * variance))
        seen = jnp.log(self.detection_probability) + density - jnp.log(self._clutter)
        change = jnp.where(hit, seen, jnp.log1p(-self.detection_probability))
        score = tracks.score + jnp.where(usable, change, 0)
        beam = jnp.argmin(jnp.abs(self._difference(self._bearings - tracks.bearing[:, None])), axis=1)
        excess = tracks.excess + (detections.level[beam] - 1 - tracks.excess) / FORGET_SCANS
        bearing = tracks.bearing + gain * innovation
        updated = Tracks(
            self._difference(bearing) if self.detector.grid.circular else jnp.clip(bearing, 0, jnp.pi),
            tracks.bearing_rate + rate_gain * innovation,
            covariance,
            score,
            jnp.maximum(tracks.highest, score),
            excess,
            tracks.label,
        )
        return updated, (within & (tracks.score > -jnp.inf)[:, None]).any(axis=0)

    def _prune(self, tracks: Tracks) -> Tracks:
        apart = jnp.abs(self._difference(tracks.bearing[:, None] - tracks.bearing))
        better = (tracks.score > tracks.score[:, None]) | (
            (tracks.score == tracks.score[:, None]) & (tracks.label < tracks.label[:, None])
        )
        twin = (better & (apart < self.lobe / 2)).any(axis=1)
        lost = tracks.score < tracks.highest - self.deletion
        return eqx.tree_at(lambda t: t.score, tracks, jnp.where(twin | lost, -jnp.inf, tracks.score))

    def _start(
        self, tracks: Tracks, detections: Detections, explained: Array, born: Array | float, started: Array
    ) -> tuple[Tracks, Int[Array, ""]]:
        strength, beams = jax.lax.top_k(
            jnp.where(detections.found & ~explained, detections.level, -jnp.inf), self.starts
        )
        _, places = jax.lax.top_k(-tracks.score, self.starts)
        score = jnp.log(born * self.detection_probability / self._span) - jnp.log(self._clutter)
        # A tentative track may take the place of one that has come to less.
        fresh = (strength > -jnp.inf) & (tracks.score[places] < score)
        bearing = self._difference(detections.bearing[beams])
        rate_variance = (self.target.birth.high.bearing_rate - self.target.birth.low.bearing_rate) ** 2 / 12
        covariance = jnp.stack(
            [self._noise(bearing), jnp.zeros_like(bearing), jnp.full_like(bearing, rate_variance)], axis=1
        )
        new = Tracks(
            bearing,
            jnp.zeros_like(bearing),
            covariance,
            jnp.full_like(bearing, score),
            jnp.full_like(bearing, score),
            strength - 1,
            started + 1 + jnp.arange(self.starts),
        )

        def put(old: Array, value: Array) -> Array:
            keep = fresh.reshape(-1, *[1] * (value.ndim - 1))
            return old.at[places].set(jnp.where(keep, value, old[places]))

        return jax.tree.map(put, tracks, new), started + self.starts

    @property
    def _span(self) -> float:
        """Radians that the beams cover."""
        return 2 * math.pi if self.detector.grid.circular else math.pi

    @property
    def _clutter(self) -> Array | float:
        """False detections per radian and scan."""
        return self.false_detections / self._span

    @property
    def _bearings(self) -> Float[Array, " beam"]:
        return jnp.asarray(self.detector.grid.bearing, jnp.float32)

    def _noise(self, bearing: Array) -> Array:
        """Variance of a detection's bearing."""
        if self.detector.grid.circular:
            return jnp.full_like(bearing, self.bearing_std**2)
        return self.bearing_std**2 / jnp.maximum(jnp.sin(bearing), 0.2) ** 2

    def _difference(self, angle: Array) -> Array:
        """The shorter way round, on a circle."""
        if not self.detector.grid.circular:
            return angle
        return angle - 2 * jnp.pi * jnp.round(angle / (2 * jnp.pi))
