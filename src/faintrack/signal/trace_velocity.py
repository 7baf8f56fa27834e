r"""The speed at which the waves of some frames cross an array, told by what it does to the evidence of a source.

A wave from :math:`\varepsilon` above the horizon crosses a level array at the **trace velocity**
:math:`v = c / \cos\varepsilon`. Where every wave is taken for level it is heard at no bearing, or at a wrong one with
great certainty. So a wave is sought with its slowness free, on a grid of N values of :math:`s = c / v`: with
:math:`\ell` the ratio of `faintrack.likelihoods.unknown_noise`, on B bearings and S levels,

.. math:: \Lambda(s) = \log \frac{1}{B S} \sum_{\psi, a} \ell(z \mid \psi, a, s), \qquad
    \Lambda = \sum_\text{frames} \Big[ \log \frac{1}{N} \sum_s e^{\Lambda(s)} \Big]_+ ,

against the same with s as it is expected: 1 of level waves, the cosines of the elevations of rings of beams. The
slowness that the frames agree on is named where it is far from those, and they lack a good part of the evidence. A
slowness above 1 is that of no wave from above or below: the sound is slower than the array's description says.

Looked at are the frequencies whose main lobe the grid of bearings resolves.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float
from scipy.special import logsumexp

from faintrack.sensors.beams import BeamGrid, lobe_width
from faintrack.signal.channels import BEARINGS, LARGEST, LEAST, delays_of, log_evidences, spread

POINTS = 100_000
"""Frames times snapshots, frequencies and bearings that are looked at for each slowness, about."""

SLOWEST = 1.3
"""Largest slowness that is looked at, in units of that of sound."""

SPEEDS = 48
"""Values of the slowness at most."""

STEEPEST = 0.174
"""Least slowness that is named, of a wave from 80 degrees: what is alike in all channels may be hum as well."""

FAR = 0.05
"""From the slowness that is expected, in units of that of sound, before another is named."""

LACKS = 0.1
"""Part of the evidence that waves as they are expected lack before others are named."""


@dataclass(frozen=True)
class Crossing:
    """How the loudest waves of some frames cross an array.

    Attributes
    ----------
    bearing : that they come from; radians.
    slowness : speed of sound over trace velocity, the cosine of their elevation.
    expected : lowest and highest slowness that a grid of beams looks for.
    inside, free : evidence of waves of such a slowness, and of any; nats.
    """

    bearing: float
    slowness: float
    expected: tuple[float, float]
    inside: float
    free: float

    @property
    def lacks(self) -> float:
        """Part of the evidence that waves as they are expected lack."""
        return 1 - self.inside / self.free if self.free > self.inside else 0.0

    @property
    def unexpected(self) -> bool:
        """Whether waves as they are expected lack a good part of the evidence, and another speed has it."""
        low, high = self.expected
        outside = max(low - self.slowness, self.slowness - high)
        far = outside > FAR and self.slowness >= STEEPEST
        return far and self.free - self.inside >= LEAST and self.lacks >= LACKS


def crossing(grid: BeamGrid, spectra: Complex[np.ndarray, "frame snapshot frequency channel"]) -> Crossing | None:
    """How the waves of some frames cross an array; None where it cannot be told, as of a line.

    Parameters
    ----------
    grid : of the scans of a known array.
    spectra : of frames, with the gains that are known applied.

    Examples
    --------
    >>> from faintrack.sensors.array import sensor_array
    >>> from faintrack.sensors.beams import steering
    >>> from faintrack.signal.beamformer import beamformer
    >>> array = sensor_array(np.array([[0.0, 60.0], [55.0, -30.0], [-40.0, -35.0], [10.0, 5.0]]), 340.0)
    >>> grid = beamformer(array, 50.0, 10.0, (1.0, 8.0)).grid
    >>> rng = np.random.default_rng(0)
    >>> wave, noise = (rng.normal(size=(2, 3, 1, grid.frequency.size, count)).T @ [1, 1j] for count in (1, 4))
    >>> above = steering(array, grid.frequency, np.array([1.0]), np.radians([60.0]))[:, 0]
    >>> found = crossing(grid, wave.T * above + noise.T)
    >>> round(found.bearing, 1), round(found.slowness, 1), found.unexpected
    (1.0, 0.5, True)
    """
    array = grid.array
    assert array is not None
    alive = np.flatnonzero(array.alive)
    # A frame that lacks a channel is another array's.
    whole = np.flatnonzero(np.all(np.any(spectra[..., alive], axis=(1, 2)), axis=1))
    if not array.circular or not 3 <= len(alive) <= LARGEST or not len(whole):
        return None
    bearing = np.asarray(grid.bearing)[:: max(1, -(-grid.beams // BEARINGS))]
    # A main lobe at 1 Hz is as wide as this, and narrower in proportion.
    lobe = lobe_width(array, 1.0)
    resolved = np.flatnonzero(4 * 2 * np.pi / len(bearing) <= lobe / grid.frequency)
    if not len(resolved):
        return None
    room = max(1, POINTS // (spectra.shape[1] * len(bearing)))
    frequencies = max(min(len(resolved), 8), min(len(resolved), room // len(whole)))
    few = resolved[spread(len(resolved), frequencies)]
    received = spectra[whole[spread(len(whole), room // frequencies)]][:, :, few][..., alive].astype(np.complex64)
    step = SLOWEST / min(max(int(4 * SLOWEST * grid.frequency[few[-1]] / lobe), 16), SPEEDS)
    # That of level waves is one of them.
    slownesses = 1 + step * np.arange(-int((1 - step / 2) / step), int((SLOWEST - 1) / step) + 1)
    energy = np.sum(np.abs(received) ** 2, axis=(1, 3))
    evidences, best = [], []
    for slowness in slownesses:
        turns = grid.frequency[few, None, None] * delays_of(array, bearing, float(slowness))[:, alive]
        beams = np.einsum("fbc,tkfc->tkfb", np.exp(2j * np.pi * turns).astype(np.complex64), received)
        power = np.sum(np.abs(beams) ** 2, axis=1)
        evidences.append(log_evidences(power, energy, len(alive), received.shape[1], grid.independent))
        best.append(bearing[np.argmax(np.sum(power / np.maximum(energy, 1e-30)[..., None], axis=(0, 1)))])
    by_slowness = np.stack(evidences)
    low, high = expected = _expected(grid)
    inside = (slownesses >= low - step / 2) & (slownesses <= high + step / 2)
    of_each = np.maximum(by_slowness, 0).sum(axis=1)
    agreed = int(np.argmax(of_each))
    return Crossing(
        float(best[agreed]),
        float(slownesses[agreed] + step * _peak(of_each, agreed)),
        expected,
        _mean_evidence(by_slowness[inside]),
        _mean_evidence(by_slowness),
    )


def _expected(grid: BeamGrid) -> tuple[float, float]:
    """Lowest and highest slowness of the waves that a grid looks for."""
    if not grid.elevations:
        return 1.0, 1.0
    first, last = grid.elevations[1], grid.elevations[-2]
    highest = 1.0 if first <= 0 <= last else max(np.cos(first), np.cos(last))
    return float(min(np.cos(first), np.cos(last))), float(highest)


def _mean_evidence(by_slowness: Float[np.ndarray, "slowness frame"]) -> float:
    """Evidence of frames, the slowness integrated out (the module's second equation)."""
    logs = logsumexp(by_slowness, axis=0) - np.log(len(by_slowness))
    return float(np.maximum(logs, 0).sum())


def _peak(values: Float[np.ndarray, " point"], number: int) -> float:
    """Where between its neighbours the peak of a parabola lies, from a largest value; 0 at the ends."""
    if not 0 < number < len(values) - 1:
        return 0.0
    before, at, after = values[number - 1 : number + 2]
    bend = before - 2 * at + after
    return float((before - after) / (2 * bend)) if bend < 0 else 0.0
