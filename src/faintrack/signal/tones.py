r"""From the samples of a frame to spectra, and to the noise of every beam around every frequency.

What a beam hears around a frequency tells the noise that it hears there, whatever is correlated between channels and
whichever ship is loud in that direction: with :math:`B_f(\psi) = |d^* z(f)|^2` and references f' on both sides,
beyond a guard that the main lobe of a tone does not pass,

.. math:: R_f(\psi) = \sum_{f'} \min\left(B_{f'}(\psi), \; q \bar B_f(\psi)\right) .

A tone among the references would raise it: what exceeds q times the mean of the quieter side is replaced by that
mean. References two bins apart are independent of each other under this window, and of f.
"""

import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Complex, Float

from faintrack.errors import InputError
from faintrack.numerics.precision import full_precision
from faintrack.sensors.array import SensorArray
from faintrack.sensors.beams import lobe_width
from faintrack.sensors.tones import FINENESS, ToneGrid, ToneScan

GUARD, APART, SIDE = 4, 2, 12
"""Bins from a frequency to the first reference, from one to the next; references on either side."""

LIMIT = 12.0
"""q, times the mean of noise that are taken for a tone."""

TOGETHER = 32
"""Frequencies whose beams are formed at once."""

LEAST = 6
"""References from which on noise is told."""

EDGE = 4
"""Bins above zero, and below half the sample rate, where a tone meets its own negative frequency."""


class ToneAnalysis(eqx.Module):
    """Turns frames of samples into spectra and noise.

    Attributes
    ----------
    grid : frequencies and bearings.
    first : of the references below the band, counted from zero frequency.
    below : references' frequencies before the grid's first.
    count : frequencies, references' among them.
    gains : correction of each channel, 0 for a dead one.
    window : h.
    """

    grid: ToneGrid
    first: int = eqx.field(static=True)
    below: int = eqx.field(static=True)
    count: int = eqx.field(static=True)
    gains: Float[Array, " channel"]
    window: Float[Array, " sample"]

    def scan(
        self,
        time: Float[Array, " frame"],
        samples: Float[Array, "frame sample channel"],
        usable: Bool[Array, "frame channel"],
    ) -> ToneScan:
        """Scans of consecutive frames, stacked along the first axis of every field.

        Parameters
        ----------
        time : middle of each frame; seconds.
        samples : zero where a channel is not usable.
        usable : which channels of each frame are used, beside those that are dead.
        """
        length = len(self.window)
        windowed = samples * (self.gains / math.sqrt(length)) * self.window[:, None]
        spectra = jnp.fft.rfft(windowed, n=FINENESS * length, axis=1)[:, self.first : self.first + self.count]
        turns = (self.first + np.arange(self.count)) * (length - 1) / (2 * FINENESS * length)
        spectra = spectra * jnp.asarray(np.exp(2j * np.pi * turns), spectra.dtype)[:, None]
        inside = slice(self.below, self.below + self.grid.count)

        def one(spectra: Array) -> tuple[Array, ...]:
            power = self.power(spectra)
            energy = jnp.sum(spectra.real**2 + spectra.imag**2, axis=1)
            return (power[inside], self.around(power), self.around(energy[:, None])[:, 0])

        power, noise, energy = jax.lax.map(one, spectra)
        references = jnp.broadcast_to(jnp.asarray(self.references, energy.dtype), energy.shape)
        channels = jnp.sum(usable & (self.gains != 0), axis=1).astype(windowed.dtype)
        return ToneScan(time.astype(windowed.dtype), spectra[:, inside], power, noise, energy, references, channels)

    @full_precision
    def power(self, spectra: Complex[Array, "all channel"]) -> Float[Array, "all beam"]:
        """Beam power at every frequency, references' among them."""
        frequency = self.grid.lowest + self.grid.step * (np.arange(self.count) - self.below)
        room = -self.count % TOGETHER
        parts = (
            jnp.asarray(np.pad(frequency, (0, room)).reshape(-1, TOGETHER), spectra.real.dtype),
            jnp.pad(spectra, ((0, room), (0, 0))).reshape(-1, TOGETHER, spectra.shape[1]),
        )
        # All steering vectors together would be larger than a minute of the recording.
        power = jax.lax.map(lambda part: self.grid.powers(*part), parts)
        return power.reshape(-1, self.grid.beams)[: self.count]

    @property
    def references(self) -> Float[np.ndarray, " frequency"]:
        """References around every frequency of the grid."""
        return np.sum([*self._side(np.ones(self.count), -1), *self._side(np.ones(self.count), 1)], axis=0)

    def around(self, power: Float[Array, "all value"]) -> Float[Array, "frequency value"]:
        """Sum over the references around every frequency of the grid (the module's equation).

        Parameters
        ----------
        power : of every frequency, references' among them.
        """
        means, none = [], jnp.zeros((), power.dtype)
        for sign in (-1, 1):
            count = np.sum(self._side(np.ones(self.count), sign), axis=0)[:, None]
            mean = sum(self._side(power, sign), none) / np.maximum(count, 1)
            means.append(jnp.where(count >= LEAST / 2, mean, jnp.inf))
        quiet = jnp.minimum(*means)
        sides = (*self._side(power, -1), *self._side(power, 1))
        return sum((jnp.where(side > LIMIT * quiet, quiet, side) for side in sides), none)

    def _side(self, values: Any, sign: int) -> list[Any]:
        """Values at each of the references below or above every frequency of the grid; 0 where there is none."""
        offsets = FINENESS * (GUARD + APART * np.arange(SIDE))
        room = int(offsets[-1])
        xp: Any = jnp if isinstance(values, jax.Array) else np
        padded = xp.pad(values, ((room, room), *((0, 0),) * (values.ndim - 1)))
        starts = room + self.below + sign * offsets
        return [padded[start : start + self.grid.count] for start in starts]

    def record(self, scans: ToneScan) -> Float[Array, "frame beam"]:
        """Of every beam how far its loudest tone stands above the noise around it; a ratio."""
        mean = scans.noise / scans.references[..., None]
        over = jnp.where(mean > 0, scans.power / jnp.where(mean > 0, mean, 1), 0)
        return jnp.where(scans.channels[:, None] > 1, jnp.max(over, axis=1), jnp.nan)


def tone_analysis(
    array: SensorArray,
    sample_rate: float,
    frame: float,
    band: tuple[float, float] | None = None,
    beams: int | None = None,
) -> ToneAnalysis:
    """Plan the analysis of an array's frames.

    Parameters
    ----------
    array : geometry, sound speed, gains.
    sample_rate : Hz.
    frame : seconds between scans, each transformed whole.
    band : lowest and highest frequency of tones; as far as possible where not given. Hz.
    beams : number of bearings; where not given, four in a main lobe at the top of the band, 90 to 720.

    Raises
    ------
    InputError : frame, band and sample rate do not fit together.

    Examples
    --------
    >>> from faintrack.sensors.array import line_array
    >>> plan = tone_analysis(line_array(32, 0.375), 4000.0, 1.0, (100.0, 1800.0))
    >>> float(plan.grid.frequency[0]), float(plan.grid.frequency[-1]), len(plan.grid.frequency)
    (100.0, 1800.0, 6801)
    """
    length = round(frame * sample_rate)
    if length < 8 * EDGE:
        raise InputError(f"frame is {frame:g} s, {length} samples at {sample_rate:g} Hz; expected {8 * EDGE} at least.")
    frame = length / sample_rate
    step = sample_rate / (FINENESS * length)
    edge = FINENESS * EDGE
    lowest, highest = edge, FINENESS * length // 2 - edge
    low, high = (0.0, sample_rate / 2) if band is None else band
    if not 0 <= low < high <= sample_rate / 2:
        raise InputError(
            f"band is {low:g} to {high:g} Hz; expected 0 <= low < high <= {sample_rate / 2:g}, half the sample rate."
        )
    first, last = max(math.ceil(low / step), lowest), min(math.floor(high / step), highest)
    reach = FINENESS * (GUARD + APART * (SIDE - 1))
    outer = max(first - reach, lowest), min(last + reach, highest)
    if last - first < FINENESS or outer[1] - outer[0] < reach + FINENESS * (GUARD + APART * LEAST):
        raise InputError(
            f"band {low:g} to {high:g} Hz holds too few bins of {1 / frame:g} Hz in which tones and the noise around "
            "them could be told; expected a wider band or a longer frame."
        )
    frequency = step * np.arange(first, last + 1)
    if beams is None:
        span = 2 * np.pi if array.circular else np.pi
        beams = int(np.clip(math.ceil(4 * span / lobe_width(array, float(frequency[-1]))), 90, 720))
    if beams < 8:
        raise InputError(f"beams is {beams}; expected at least 8.")
    grid = ToneGrid(float(frequency[0]), len(frequency), frame, beams, array.circular, array)
    window = jnp.asarray(math.sqrt(2) * np.sin(np.pi * (np.arange(length) + 0.5) / length), jnp.float32)
    count = outer[1] - outer[0] + 1
    return ToneAnalysis(grid, outer[0], first - outer[0], count, jnp.asarray(array.gains, jnp.float32), window)
