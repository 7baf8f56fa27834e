r"""Channels that are not what an array's description says, told by what they do to the evidence of a source.

A channel whose poles are reversed, or two whose names are exchanged, turn the bearing of a source and hide it in part.
So a wave is sought with and without each such change to the channels: with :math:`z` the spectra of a frame,
:math:`\ell` the ratio of `faintrack.likelihoods.unknown_noise`, on a grid of B bearings and S levels,

.. math:: \Lambda = \sum_\text{frames} \Big[ \log \frac{1}{B S} \sum_{\psi, a} \ell(z \mid \psi, a) \Big]_+ .

The noise power is integrated out, so a change that only scales the noise gains nothing. The change with the largest
:math:`\Lambda` is named where it brings most of what one channel can and no change to other channels comes near. What
remains is looked at again with it made. Without a source nothing is told.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from jaxtyping import Complex, Float
from scipy.special import logsumexp

from faintrack.sensors.array import SensorArray
from faintrack.sensors.beams import BeamGrid

POINTS = 400_000
"""Frames times snapshots, frequencies and directions that are looked at, about."""

BEARINGS = 180
"""Directions that are looked at, at most."""

LEVELS_DB = np.arange(-15.0, 21.0, 5.0)
"""SNR that a source may have at a channel; dB."""

FACTORS = (-1.0, 0.5, 2.0)
"""That a channel may have to be multiplied by."""

LEAST = 30.0
"""Nats that a change gains before it is named."""

SHARE = 0.7
"""Of the part of the evidence that one channel of so many has, that a change brings at least."""

APART = 2.0
"""By how much more a change gains than any to other channels."""

PAIRS = 24
"""Channels up to which any two may be exchanged; of more, neighbours."""

LARGEST = 128
"""Channels of an array that is looked at, at most."""

SEVERAL = 3
"""Channels that are named at most."""


@dataclass(frozen=True)
class Doubt:
    """A change to the channels that makes a source much better heard.

    Attributes
    ----------
    channels : one that has a wrong factor, or two that are exchanged.
    factor : that corrects one; 1 of two.
    before, after : evidence of a source without and with the change; nats.
    """

    channels: tuple[int, ...]
    factor: float
    before: float
    after: float


def doubts(
    grid: BeamGrid, spectra: Complex[np.ndarray, "frame snapshot frequency channel"], slowness: float = 1.0
) -> list[Doubt]:
    """Channels that are reversed, exchanged or of another gain, as far as the sources in some frames tell.

    Parameters
    ----------
    grid : of the scans of a known array.
    spectra : of frames, with the gains that are known applied.
    slowness : of the waves, see `delays_of`.

    Examples
    --------
    >>> from faintrack.sensors.array import line_array
    >>> from faintrack.sensors.beams import steering
    >>> from faintrack.signal.beamformer import beamformer
    >>> grid = beamformer(line_array(5, 1.0), 1000.0, band=(100.0, 400.0), snapshot=0.1).grid
    >>> rng = np.random.default_rng(0)
    >>> wave, noise = (rng.normal(size=(2, 3, 10, 31, count)).T @ [1, 1j] for count in (1, 5))
    >>> waves = wave.T * steering(grid.array, grid.frequency, np.array([1.0]))[:, 0] + noise.T
    >>> waves[..., 3] *= -1
    >>> [(doubt.channels, doubt.factor) for doubt in doubts(grid, waves)]
    [((3,), -1.0)]
    """
    looked_at = _looked_at(grid, spectra, slowness)
    if looked_at is None:
        return []
    received, steering, alive = looked_at
    found: list[Doubt] = []
    while len(found) < SEVERAL:
        doubt = _likeliest(received, steering, grid.independent)
        if doubt is None:
            break
        received = _changed(received, doubt.channels, doubt.factor)
        found.append(replace(doubt, channels=tuple(int(alive[number]) for number in doubt.channels)))
    return found


def evidence(
    grid: BeamGrid, spectra: Complex[np.ndarray, "frame snapshot frequency channel"], slowness: float = 1.0
) -> float:
    """Evidence of a source in some frames, by which `doubts` judges; nats. 0 where channels cannot be judged.

    Parameters
    ----------
    grid, spectra, slowness : as of `doubts`.
    """
    looked_at = _looked_at(grid, spectra, slowness)
    return 0.0 if looked_at is None else _evidence_of(looked_at[0], looked_at[1], grid.independent)


def _looked_at(
    grid: BeamGrid, spectra: Complex[np.ndarray, "frame snapshot frequency channel"], slowness: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Spectra, steering vectors and numbers of the channels in use; None where they are too few or too many."""
    array = grid.array
    assert array is not None
    alive = np.flatnonzero(array.alive)
    # A frame that lacks a channel tells nothing of it.
    whole = np.flatnonzero(np.all(np.any(spectra[..., alive], axis=(1, 2)), axis=1))
    if not 3 <= len(alive) <= LARGEST or not len(whole):
        return None
    bearing = np.asarray(grid.bearing)[:: max(1, -(-grid.beams // BEARINGS))]
    bins = grid.frequency.size
    room = max(1, POINTS // (spectra.shape[1] * len(bearing)))
    frequencies = max(min(bins, 8), min(bins, room // len(whole)))
    frames, few = whole[spread(len(whole), room // frequencies)], spread(bins, frequencies)
    received = np.asarray(spectra[frames][:, :, few][..., alive], np.complex64)
    delays = delays_of(array, bearing, slowness)[:, alive]
    return received, np.exp(2j * np.pi * grid.frequency[few, None, None] * delays).astype(np.complex64), alive


def delays_of(
    array: SensorArray, bearing: Float[np.ndarray, " bearing"], slowness: float
) -> Float[np.ndarray, "bearing channel"]:
    """Delays of waves whose speed of sound over trace velocity is a slowness; seconds.

    Below 1 they come from above the horizon; above 1 the sound is slower than the array's description says.
    """
    if slowness >= 1:
        return slowness * np.asarray(array.delays(bearing))
    return np.asarray(array.delays(bearing, np.full_like(bearing, np.arccos(slowness))))


def spread(count: int, room: int) -> np.ndarray:
    """Numbers spread evenly over a count, as many as there is room for."""
    return np.unique(np.linspace(0, count - 1, max(1, min(room, count))).round().astype(int))


def _likeliest(received: np.ndarray, steering: np.ndarray, independent: float) -> Doubt | None:
    channels = received.shape[-1]
    powers = np.abs(received) ** 2
    beams = np.einsum("fbc,tkfc->tkfb", steering, received)
    energy = powers.sum(axis=(1, 3))

    def evidence(beams: np.ndarray, energy: np.ndarray) -> float:
        power = np.sum(np.abs(beams) ** 2, axis=1)
        return _evidence(power, energy, channels, received.shape[1], independent)

    def with_change(change: tuple[int, ...], factor: float) -> float:
        if len(change) == 1:
            (one,) = change
            more = (factor - 1) * steering[..., one] * received[..., None, one]
            return evidence(beams + more, energy + (factor**2 - 1) * powers[..., one].sum(axis=1))
        one, two = change
        apart = received[..., None, two] - received[..., None, one]
        return evidence(beams + (steering[..., one] - steering[..., two]) * apart, energy)

    before = evidence(beams, energy)
    gains = {change: with_change(*change) - before for change in _changes(channels)}
    best = max(gains, key=lambda change: gains[change])
    if len(best[0]) == 2:
        # Two that are reversed are nearly as well off exchanged; two that are exchanged gain nothing reversed.
        single = max((change for change in gains if len(change[0]) == 1), key=lambda change: gains[change])
        best = single if gains[best] < APART * gains[single] else best
    gain = gains[best]
    if gain < max(LEAST, SHARE / channels * (before + gain)):
        return None
    rival = max((change for change in gains if not set(change[0]) & set(best[0])), key=lambda change: gains[change])
    if gain < APART * gains[rival]:
        # Another change does as well: either is wrong, or both are.
        both = _evidence_of(_changed(_changed(received, *best), *rival), steering, independent)
        if both - before < gain + gains[rival]:
            return None
    return Doubt(*best, before, before + gain)


def _evidence_of(received: np.ndarray, steering: np.ndarray, independent: float) -> float:
    beams = np.einsum("fbc,tkfc->tkfb", steering, received)
    energy = np.sum(np.abs(received) ** 2, axis=(1, 3))
    power = np.sum(np.abs(beams) ** 2, axis=1)
    return _evidence(power, energy, received.shape[-1], received.shape[1], independent)


def _changes(channels: int) -> Iterator[tuple[tuple[int, ...], float]]:
    yield from (((number,), factor) for number in range(channels) for factor in FACTORS)
    for one, two in combinations(range(channels), 2):
        if channels <= PAIRS or two == one + 1:
            yield (one, two), 1.0


def _changed(received: np.ndarray, change: tuple[int, ...], factor: float) -> np.ndarray:
    received = received.copy()
    received[..., list(change)] = factor * received[..., list(change[::-1])]
    return received


def _evidence(
    power: Float[np.ndarray, "frame frequency bearing"],
    energy: Float[np.ndarray, "frame frequency"],
    channels: int,
    snapshots: int,
    independent: float,
) -> float:
    """Evidence of one source in each frame, summed (the module's equation)."""
    return float(np.maximum(log_evidences(power, energy, channels, snapshots, independent), 0).sum())


def log_evidences(
    power: Float[np.ndarray, "frame frequency bearing"],
    energy: Float[np.ndarray, "frame frequency"],
    channels: int,
    snapshots: int,
    independent: float,
) -> Float[np.ndarray, " frame"]:
    """Natural log of the mean ratio of one source in each frame, over bearings and levels.

    Parameters
    ----------
    power : of every beam, summed over snapshots.
    energy : of all channels.
    channels, snapshots : how many.
    independent : share of what snapshots and bins hold that is independent of each other.
    """
    share = power / np.maximum(channels * energy, np.finfo(np.float32).tiny)[..., None]
    gains = channels * 10 ** (LEVELS_DB / 10)
    # Groups of factors share a logarithm, each of them at least 1 / (1 + M a).
    size = max(1, int(80 / np.log1p(gains[-1])))
    starts = np.arange(0, share.shape[1], size)
    ratios = []
    for gain in gains:
        left = np.log(np.multiply.reduceat(1 - gain / (1 + gain) * np.minimum(share, 1), starts, axis=1)).sum(axis=1)
        ratios.append(-snapshots * independent * (share.shape[1] * np.log1p(gain) + channels * left))
    stacked = np.stack(ratios, axis=-1)
    return logsumexp(stacked, axis=(1, 2)) - np.log(stacked[0].size)
