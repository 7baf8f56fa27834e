"""False alarms in sea clutter, and a floating sphere in it, by its Doppler line.

One range cell of an X-band radar, 131 s of I and Q at 1000 Hz a recording. Power spectra of windows that do not overlap
are the scans; frequency and its rate the state. Three models of what a cell does without a target:

- past: exponential, with the mean of the first half of the recording (Rayleigh clutter of known level);
- neighbours: exponential, with the mean of the cells beside it in the same scan;
- compound: that mean too, but known in part only (`faintrack.likelihoods.clutter`); and the same with the threshold of
  noise that has no more texture than this likelihood assumes.

What the models leave open is measured on the first half of the clutter recordings, before any detection: of a list of
trackers the one under which the powers are likeliest, and how long and how far in frequency a cell stays louder than
its neighbours. Every model has the threshold that its own noise passes in one segment of twenty. Declarations are
counted in the second half. Writes the numbers that `plot_sea_clutter.py` draws:

    python examples/sea_clutter.py ../shared/data/ipix_dartmouth --out docs/validation_data/sea_clutter.json
"""

import argparse
import itertools
import json
from pathlib import Path
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.optimize import brentq
from scipy.special import digamma, gammainccinv, logit, ndtr, polygamma, spence

from faintrack.beliefs.axis import Axis, between
from faintrack.beliefs.belief import Belief, mode
from faintrack.beliefs.grids import Grid
from faintrack.filters.grid import GridFilter
from faintrack.filters.run import run
from faintrack.filters.separable import separable
from faintrack.likelihoods.clutter import ClutterLikelihood
from faintrack.metrics.intervals import binomial_interval
from faintrack.metrics.thresholds import counted_threshold
from faintrack.sensors.cells import Cells
from faintrack.signal.clutter import ClutterScan, ClutterTracker, Level
from faintrack.targets.motion import PlanarMotion
from faintrack.targets.target import Target, rates

SAMPLE_RATE, WINDOW = 1000.0, 256
"""Hz; samples of a spectrum. Windows do not overlap, so that scans are independent given the level."""
BAND = 64
"""Cells on either side of 0 Hz in which a target is looked for: 250 Hz, 4 m/s."""
SCANS, FIRST = 16, 256
"""Of a segment, 4.1 s; of the half that the models are fitted on."""
FALSE_SHARE = 0.05
"""Probability of a declaration in a segment of noise."""
SNR = 10.0
"""Mean power of the target over that of the clutter in its cell; linear."""
APPEARS = 0.001
"""Probability of appearing from scan to scan. What floats stays."""
FASTEST, RATE_NOISE = 40.0, 20.0
"""Highest rate of the frequency, Hz/s, and density of its noise, Hz/s per root second: 0.6 m/s2 in waves of seconds."""
KNOWN = 1e6
"""Shape of a level that is taken as known: Lomax's density is then the exponential one."""
TRACKERS = tuple(
    ClutterTracker(forget, own, neighbour, guard, train)
    for (forget, own), neighbour, (guard, train) in itertools.product(
        ((0.0, 0.0), (0.5, 0.0), (0.5, 1.0), (0.8, 1.0)), (0.35, 0.5, 0.7, 1.0), ((1, 2), (1, 4), (1, 8), (2, 4))
    )
)
"""To choose from: what the past tells, in the first two numbers, and what the neighbours do."""
LOUD = 4.0
"""Clutter over the noise of the receiver from which a cell tells of clutter."""
NEAR = 30.0
"""Hz from 0 within which the sphere's line stays."""
CLUTTER = ("ipix30_clutter", "ipix17_bin06", "ipix17_clutter", "ipix18_bin06", "ipix18_clutter")


class DopplerState(eqx.Module):
    """Frequency of a line, Hz, and its rate, Hz/s."""

    frequency: Float[Array, "..."]
    frequency_rate: Float[Array, "..."]
    angles: ClassVar[tuple[str, ...]] = ()
    rates: ClassVar[dict[str, str]] = {"frequency": "frequency_rate"}


STEP = SAMPLE_RATE / WINDOW
INTERVAL = WINDOW / SAMPLE_RATE
FREQUENCY = Axis(-BAND * STEP, STEP, 2 * BAND)
MIDDLE = slice(WINDOW // 2 - BAND, WINDOW // 2 + BAND)


def spectra(samples: np.ndarray) -> jax.Array:
    """Power of every cell, shape (..., scan, frequency), from complex samples; 1 for white noise of variance 1."""
    window = np.hanning(WINDOW + 1)[:-1]
    frames = samples[..., : samples.shape[-1] // WINDOW * WINDOW].reshape(*samples.shape[:-1], -1, WINDOW)
    lines = np.fft.fftshift(np.fft.fft(frames * window / np.linalg.norm(window)), axes=-1)
    return jnp.asarray(np.abs(lines) ** 2, jnp.float32)


def read(file: Path) -> jax.Array:
    """Spectra of a recording."""
    data = np.load(file)
    samples = data["I"] + 1j * data["Q"]
    return spectra(samples - samples.mean())


@eqx.filter_jit
def levels(tracker: ClutterTracker, power: Float[Array, "scan frequency"]) -> Level:
    """Level to judge every cell by."""
    start = tracker.init(jnp.mean(power[:FIRST], axis=0))
    return jax.lax.scan(tracker.step, start, power)[1]


def surprise(tracker: ClutterTracker, power: Float[Array, "scan frequency"]) -> float:
    """Mean of minus the log of Lomax's density of every cell."""
    level, power = jax.tree.map(lambda values: values[:, MIDDLE], (levels(tracker, power), power))
    total = jnp.log(level.shape) - jnp.log(level.scale) - (level.shape + 1) * jnp.log1p(power / level.scale)
    return -float(jnp.mean(total))


class Texture(eqx.Module):
    """Level of a cell over the scale a of the tracker's: one over a gamma number, correlated from cell to cell.

    Attributes
    ----------
    shape : of the gamma number.
    scale : of the level.
    in_time, in_frequency : correlation from a scan, from a cell to the next.
    """

    shape: float
    scale: float = 1.0
    in_time: float = 0.0
    in_frequency: float = 0.0

    def draw(self, segments: int, seed: int) -> np.ndarray:
        """Levels, shape (segment, scan, frequency)."""
        normal = np.random.default_rng(seed).normal(size=(segments, SCANS, 2 * BAND)).astype(np.float32)
        for axis, keep in ((1, self.in_time), (2, self.in_frequency)):
            along = np.moveaxis(normal, axis, 0)
            for place in range(1, len(along)):
                along[place] = keep * along[place - 1] + (1 - keep**2) ** 0.5 * along[place]
        return (self.scale / gammainccinv(self.shape, ndtr(normal))).astype(np.float32)


def texture(tracker: ClutterTracker, powers: list[jax.Array]) -> Texture:
    """Measured where clutter is loud, by the moments of the logs of the powers over the tracker's scale.

    A log is the sum of the speckle's, of mean minus Euler's number and variance pi^2 / 6, and the texture's. The
    speckle is independent from scan to scan; in frequency the window correlates its amplitudes by 2/3, and the
    covariance of the logs of two such powers is the dilogarithm of 4/9. What is left is the texture's.
    """
    logs = []
    for power in powers:
        level = levels(tracker, power)
        floor = np.median(np.asarray(power)[:, : WINDOW // 4]) / np.log(2)
        loud = np.asarray(level.scale / level.shape) > LOUD * floor
        logs.append(np.where(loud, np.log(np.asarray(power / level.scale)), np.nan)[:, MIDDLE])
    off = np.stack(logs) - np.nanmean(logs)
    variance = float(np.nanmean(off**2)) - polygamma(1, 1)
    in_time = float(np.nanmean(off[:, 1:] * off[:, :-1])) / variance
    in_frequency = (float(np.nanmean(off[:, :, 1:] * off[:, :, :-1])) - spence(5 / 9)) / variance
    shape = brentq(lambda shape: polygamma(1, shape) - variance, 0.1, 100)
    scale = np.exp(float(np.nanmean(logs)) + np.euler_gamma + digamma(shape))
    return Texture(float(shape), float(scale), in_time, float(in_frequency))


def models(tracker: ClutterTracker, power: Float[Array, "scan frequency"]) -> dict[str, ClutterScan]:
    """Segments of the second half under every model, shape (segment, scan, frequency)."""
    beside = levels(tracker, power)

    def cut(values: Array) -> Array:
        return values[FIRST:, MIDDLE].reshape(-1, SCANS, 2 * BAND)

    segments, near = cut(power), jax.tree.map(cut, beside)
    known = jnp.full_like(segments, KNOWN)
    time = jnp.broadcast_to(INTERVAL * jnp.arange(SCANS), segments.shape[:2])
    chosen = {
        "past": Level(known, KNOWN * jnp.mean(power[:FIRST, MIDDLE], axis=0)),
        "neighbours": Level(known, KNOWN * near.scale / near.shape),
        "compound": near,
        "compound, no texture": near,
    }
    return {
        name: ClutterScan(time, segments, jax.tree.map(lambda values: jnp.broadcast_to(values, segments.shape), level))
        for name, level in chosen.items()
    }


def noise(shape: float, texture: Texture | None, segments: int) -> ClutterScan:
    """A model's own noise: speckle through the same window, over a level known or drawn; `shape` of the tracker's."""
    rng = np.random.default_rng(0)
    samples = rng.normal(scale=0.5**0.5, size=(segments, SCANS * WINDOW, 2)).astype(np.float32)
    speckle = spectra(samples[..., 0] + 1j * samples[..., 1])[..., MIDDLE]
    time = jnp.broadcast_to(INTERVAL * jnp.arange(SCANS), speckle.shape[:2])
    level = texture.draw(segments, 1) if texture else 1 / shape
    ones = jnp.ones_like(speckle)
    return ClutterScan(time, speckle * level, Level(shape * ones, ones))


class OnCells(eqx.Module):
    """Likelihood for a grid whose frequencies are the cells: its table, without looking every cell up."""

    likelihood: ClutterLikelihood

    def log_mean_ratio(self, scan: ClutterScan) -> jax.Array:
        """Log ratio of every frequency."""
        return self.likelihood.table(scan)[:, None]


def tracker_on_line() -> tuple[GridFilter, OnCells]:
    """Filter and likelihood."""
    grid = Grid(DopplerState, (("frequency", FREQUENCY), ("frequency_rate", between(-FASTEST, FASTEST, 5))))
    target = Target(None, None, *rates(APPEARS, 1.0, INTERVAL))
    transport = separable(grid, PlanarMotion(RATE_NOISE), INTERVAL)
    return GridFilter(grid, target, transport), OnCells(ClutterLikelihood(Cells((("frequency", FREQUENCY),)), SNR))


def keep(belief: Belief) -> tuple[Any, Any]:
    """Log odds and the likeliest frequency."""
    return belief.log_odds, mode(belief).frequency


def followed(scans: ClutterScan) -> tuple[np.ndarray, np.ndarray]:
    """Log odds of existence and likeliest frequency after every scan of every segment, each from nothing known."""
    filter, likelihood = tracker_on_line()

    @jax.jit
    def each(scans: ClutterScan) -> Any:
        return jax.lax.map(lambda one: run(filter, likelihood, one, jax.random.key(0), keep)[1], scans, batch_size=50)

    odds, frequency = each(scans)
    return np.asarray(odds), np.asarray(frequency)


def joined(segments: ClutterScan) -> ClutterScan:
    """All segments as one."""
    whole = jax.tree.map(lambda values: values.reshape(1, -1, *values.shape[2:]), segments)
    return eqx.tree_at(lambda scans: scans.time, whole, INTERVAL * jnp.arange(whole.time.shape[1])[None])


def main() -> None:
    """Calibrate, count declarations in clutter, follow the sphere."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--draws", type=int, default=1000, help="segments of noise for each threshold")
    options = parser.parse_args()
    if not options.folder.exists():
        parser.exit(0, f"{options.folder}: no recordings; nothing is measured.\n")
    powers = {name: read(options.folder / f"{name}_IQ_uint8.npz") for name in (*CLUTTER, "ipix30_target")}
    first = [powers[name][:FIRST] for name in CLUTTER]
    tracker = min(TRACKERS, key=lambda each: sum(surprise(each, power) for power in first))
    measured = texture(tracker, first)
    shape = float(levels(tracker, first[0]).shape[-1, WINDOW // 2])
    own = {"past": (KNOWN, None), "compound": (shape, measured), "compound, no texture": (shape, Texture(shape))}
    thresholds = {}
    for model, kind in own.items():
        found = counted_threshold(followed(noise(*kind, options.draws))[0].max(axis=1), FALSE_SHARE)
        thresholds[model] = {name: float(logit(getattr(found, name))) for name in ("value", "low", "high")}
    thresholds["neighbours"] = thresholds["past"]
    print(tracker, measured, thresholds, flush=True)

    rows: list[dict[str, Any]] = []
    for name, power in powers.items():
        for model, scans in models(tracker, power).items():
            level = thresholds[model]["value"]
            odds, frequency = followed(scans)
            passed = odds > level
            at_first = np.where(passed.any(axis=1), passed.argmax(axis=1), -1)
            (whole_odds,), (whole_frequency,) = followed(joined(scans))
            reported, near = whole_odds > level, np.abs(whole_frequency) <= NEAR
            rows.append(
                {
                    "recording": name,
                    "model": model,
                    "threshold": level,
                    "segments": len(odds),
                    "declared": int(passed.any(axis=1).sum()),
                    "first_scan": at_first.tolist(),
                    "first_frequency": [
                        float(line[at]) if at >= 0 else None for line, at in zip(frequency, at_first, strict=True)
                    ],
                    "share_followed": float(np.mean(reported & near)),
                    "share_elsewhere": float(np.mean(reported & ~near)),
                }
            )
            print({key: value for key, value in rows[-1].items() if not key.startswith("first_f")}, flush=True)

    held = {}
    for model in thresholds:
        counted = [row for row in rows if row["model"] == model and row["recording"] in CLUTTER]
        declared, segments = (sum(row[key] for row in counted) for key in ("declared", "segments"))
        low, high = (float(end) for end in binomial_interval(declared, segments))
        held[model] = {"declared": declared, "segments": segments, "low": low, "high": high}
        print(model, held[model])
    settings = {"false_share": FALSE_SHARE, "segment_s": SCANS * INTERVAL, "snr": SNR, "draws": options.draws}
    fitted = {"tracker": {key: float(value) for key, value in vars(tracker).items()}, "texture": vars(measured)}
    result = settings | fitted | {"thresholds": thresholds, "clutter": held, "rows": rows}
    options.out.write_text(json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    main()
