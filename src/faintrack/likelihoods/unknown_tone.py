r"""A tone of unknown frequency, in noise that is unknown in every direction and around every frequency.

With the spectra z of `faintrack.sensors.tones`, the steering vector d, tones that are there already in the covariance
:math:`\sigma^2 G` (`faintrack.likelihoods.tone_field`), :math:`w = d^* G^{-1} d` and
:math:`P = |d^* G^{-1} z|^2`, the beam's output is complex normal of variance :math:`\sigma^2 w` without the tone and
:math:`\sigma^2 w (1 + a w)` with it, a its power over that of the noise at one channel. The noise of the beam is told
by n references around, whose sum R over the M channels is a gamma variable of scale :math:`\sigma^2`. With
:math:`\sigma^2` integrated out against :math:`d\sigma^2 / \sigma^2`, as in `faintrack.likelihoods.unknown_noise`,

.. math::
    \log \ell = -\log(1 + a w)
        - (1 + n) \log\left(1 - \frac{a w}{1 + a w} \, \frac{P / w}{P / w + R / M}\right) .

It is a true likelihood ratio: under noise :math:`b = P / w / (P / w + R / M)` has a Beta(1, n) distribution, and

.. math:: \frac{1}{1 + a w} \int_0^1 \left(1 - \frac{a w}{1 + a w} b\right)^{-1 - n} n (1 - b)^{n - 1} \, db = 1 .

What is correlated between channels, and what is loud in the beam without being a tone, is in its references and says
nothing. A ship that is loud at all frequencies is not quite: in the side lobes of its direction the beam's power
changes from frequency to frequency. Such a bin has far more energy beside the beam than in it. With the energy
:math:`E = z^* G^{-1} z` in M' dimensions, and that of the references over all channels, :math:`R_E`, the ratio in noise
that is independent between channels is

.. math::
    \log \ell_E = -\log(1 + a w) - (M' + n M) \log\left(1 - \frac{a w}{1 + a w} \, \frac{P / w}{E + R_E}\right) ,

and the smaller of both is taken, whose mean under noise is at most 1. The spectra are read between their frequencies,
so that a tone may lie anywhere.

So few references say little of *where* a loud tone is: half a beam off it is nearly as loud. States of a belief of one
that is in hand are weighed by :math:`\ell_E` against the likeliest of them, :math:`x_0`; whether there is a tone at all
says the smaller of both: :math:`\min(\log \ell, \log \ell_E)(x_0) + \log \ell_E(x) - \log \ell_E(x_0)`.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Complex, Float, PRNGKeyArray

from faintrack.likelihoods.array_field import COHERENT
from faintrack.likelihoods.interpolation import Neighbours, neighbours, read_plane
from faintrack.likelihoods.tone_field import Tones, beside, coherence, level_of, tone_of
from faintrack.likelihoods.tone_proposal import where_tones_stand
from faintrack.sensors.tone_draws import draw_tone
from faintrack.sensors.tones import ToneGrid, ToneScan
from faintrack.targets.states import ToneState
from faintrack.targets.target import UniformBirth

ALIKE_BINS = 1.5
"""Frequencies nearer than this may be of one tone: about half the main lobe of the window."""

HIDDEN = 1e-3
"""Share of a wave that is left beside others up to which nothing is said of it."""


class BeamOutput(NamedTuple):
    """What is read of a scan at some states.

    Attributes
    ----------
    own : P / w.
    louder : a w.
    noise : R / M.
    references : n.
    energy, dimensions : E, and M'.
    valid : whether anything is said there.
    place : among the frequencies of the grid.
    """

    own: Float[Array, " point"]
    louder: Float[Array, " point"]
    noise: Float[Array, " point"]
    references: Float[Array, " point"]
    energy: Float[Array, " point"]
    dimensions: Float[Array, " point"]
    valid: Bool[Array, " point"]
    place: Float[Array, " point"]


class Closely(eqx.Module):
    """What one scan says near a belief.

    Attributes
    ----------
    likelihood, scan : whose it is.
    """

    likelihood: "UnknownTone"
    scan: ToneScan

    def log_ratio(self, states: ToneState) -> Float[Array, " point"]:
        """The module's last expression."""
        output = self.likelihood.output(self.scan, states)
        near = self.likelihood.in_white(self.scan, output, together=True)
        likeliest = jnp.argmax(near)
        return jnp.minimum(_in_beam(output), near)[likeliest] + near - near[likeliest]


class UnknownTone(eqx.Module):
    """Log ratio of a tone, the noise around it integrated out.

    Attributes
    ----------
    grid : axes of the scans.

    Examples
    --------
    >>> import numpy as np
    >>> from faintrack.sensors.array import line_array
    >>> from faintrack.signal.tones import tone_analysis
    >>> plan = tone_analysis(line_array(8, 1.5), 1000.0, 1.0, (50.0, 450.0))
    >>> time = np.arange(1000) / 1000.0
    >>> samples = np.random.default_rng(0).normal(size=(1, 1000, 8)) + 0.3 * np.cos(2 * np.pi * 200.3 * time)[:, None]
    >>> scan = jax.tree.map(lambda x: x[0], plan.scan(jnp.zeros(1), jnp.asarray(samples), jnp.ones((1, 8), bool)))
    >>> states = ToneState(*jnp.array([[jnp.pi / 2] * 2, [0.0] * 2, [12.0] * 2, [200.3, 260.0]]))
    >>> [round(float(x)) for x in UnknownTone(plan.grid).log_ratio(scan, states)]
    [46, -2]
    """

    grid: ToneGrid

    @eqx.filter_jit
    def log_ratio(self, scan: ToneScan, states: ToneState) -> Float[Array, "*points"]:
        """Natural log of p(scan | tone at state) / p(scan | no tone); the module's first equation.

        Parameters
        ----------
        scan : one frame.
        states : `bearing`, `frequency` and `snr_db` are read; frequencies beyond the grid's at its ends.
        """
        shape = jnp.broadcast_shapes(*(jnp.shape(x) for x in (states.bearing, states.frequency, states.snr_db)))
        output = self.output(scan, states)
        return jnp.minimum(_in_beam(output), self.in_white(scan, output)).reshape(shape)

    def zoomed(self, scan: ToneScan, states: ToneState, log_weights: Float[Array, " point"]) -> Closely:
        """What a scan says near a belief, of all channels (the module's text)."""
        return Closely(self, scan)

    def output(self, scan: ToneScan, states: ToneState) -> BeamOutput:
        """What is read of a scan at some states, in one row.

        The background is that of the nearest frequency of the grid.
        """
        dtype = scan.power.dtype
        parts = jnp.broadcast_arrays(
            *(jnp.asarray(x, dtype) for x in (states.bearing, states.frequency, states.snr_db))
        )
        bearing, frequency, snr_db = (part.ravel() for part in parts)
        place = self.grid.place(frequency)
        vectors, received = self.grid.steered(frequency, bearing), self._between(scan.spectra, place)
        along = jnp.sum(vectors.conj() * received, axis=1)
        energy = jnp.sum(_squared(received), axis=1)
        gain: Array = jnp.broadcast_to(scan.channels, frequency.shape)
        dimensions = gain
        if scan.field is not None:
            nearest = jnp.round(place).astype(jnp.int32)

            def less(left: Any, tone: tuple[Array, Array]) -> tuple[Any, None]:
                def beside() -> tuple[Array, ...]:
                    columns = tone[0][nearest].conj()
                    of_wave, of_scan = (jnp.sum(columns * x[:, None], axis=2) for x in (vectors, received))
                    taken = (
                        of_wave.conj() * of_scan,
                        *map(_squared, (of_wave, of_scan, columns.reshape(len(place), -1))),
                    )
                    return tuple(before - jnp.sum(part, axis=1) for before, part in zip(left, taken, strict=True))

                return jax.lax.cond(tone[1] > -jnp.inf, beside, lambda: left), None

            start = along, gain, energy, dimensions
            (along, gain, energy, dimensions), _ = jax.lax.scan(less, start, (scan.field.columns, scan.field.frequency))
            dimensions = jnp.maximum(dimensions, 1)
        # Where nothing of a direction is left beside the others, nothing is said of it.
        some = gain > HIDDEN * scan.channels
        own = _squared(along) / jnp.where(some, gain, 1)
        noise = read_plane(scan.noise, *self._beside(place, bearing)) / jnp.maximum(scan.channels, 1)
        references = self._at(scan.references, place)
        valid = (scan.channels >= 2) & some & (noise > 0) & (references > 0)
        louder = level_of(self.grid, snr_db) * gain
        return BeamOutput(own, louder, noise, references, jnp.maximum(energy, own), dimensions, valid, place)

    def in_white(self, scan: ToneScan, output: BeamOutput, together: bool = False) -> Float[Array, " point"]:
        """Log ratio in noise that is independent between channels (the module's second equation).

        Parameters
        ----------
        scan, output : what is read of it.
        together : whether all points have one noise: what differs between bins would move a loud tone.
        """
        around = self._at(scan.energy, output.place)
        dimensions = output.dimensions + scan.channels * output.references
        if together:
            around, dimensions = jnp.mean(around), jnp.mean(dimensions)
        left = output.energy - output.own + around + output.own / (1 + output.louder)
        left = left / jnp.where(output.valid, output.energy + around, 1)
        ratio = -jnp.log1p(output.louder) - dimensions * jnp.log(jnp.where(output.valid, left, 1))
        return jnp.where(output.valid, ratio, 0)

    def part(self, scan: ToneScan, states: ToneState, log_weights: Float[Array, " point"]) -> Tones:
        """A tone, see `faintrack.likelihoods.tone_field`."""
        return tone_of(self.grid, states, log_weights)

    def beside(self, scan: ToneScan, parts: Tones, existence: Float[Array, " tone"]) -> ToneScan:
        """Scan with other tones as part of its background, see `faintrack.likelihoods.tone_field`."""
        return beside(self.grid, scan, parts, existence)

    def alike(self, scan: ToneScan, states: ToneState, centres: ToneState) -> Bool[Array, "centre *points"]:
        """Which states are one tone with those of the centres: near in frequency, and in one beam."""
        off = jnp.abs(states.frequency - centres.frequency.reshape(-1, *(1,) * states.frequency.ndim))
        spacing = self.grid.bearing[1] - self.grid.bearing[0]
        number = jnp.round((states.bearing - self.grid.bearing[0]) / spacing).astype(jnp.int32)
        number = number % self.grid.beams if self.grid.circular else jnp.clip(number, 0, self.grid.beams - 1)
        return (off * self.grid.frame < ALIKE_BINS) & (coherence(self.grid, centres) > COHERENT)[:, number]

    def propose(
        self, scan: ToneScan, birth: UniformBirth, key: PRNGKeyArray, count: int
    ) -> tuple[ToneState, Float[Array, " count"]]:
        """New tones where the beams have any, see `faintrack.likelihoods.tone_proposal`."""
        return where_tones_stand(self.grid, scan, birth, key, count)

    def simulate(
        self, scan: ToneScan, states: ToneState, present: Bool[Array, ""] | bool, key: PRNGKeyArray
    ) -> ToneScan:
        """Scan drawn from noise of power 1 and a tone, see `faintrack.sensors.tone_draws`."""
        return draw_tone(self.grid, scan, states, present, key)

    def _between(
        self, spectra: Complex[Array, "frequency channel"], place: Float[Array, " point"]
    ) -> Complex[Array, "point channel"]:
        spectra = jax.lax.optimization_barrier(spectra)
        parts = [spectra[index] * weight[:, None] for index, weight in self._near(place)]
        return sum(parts[1:], start=parts[0])

    def _beside(self, place: Float[Array, " point"], bearing: Float[Array, " point"]) -> tuple[Neighbours, Neighbours]:
        """Two neighbours an axis with the weights of a straight line, whose values are never below those of both."""
        grid = self.grid
        along = (bearing - grid.bearing[0]) / (grid.bearing[1] - grid.bearing[0])

        def line(place: Array, last: int | None) -> Neighbours:
            first = jnp.floor(place).astype(jnp.int32)
            share = place - first
            pair = [(first, 1 - share), (first + 1, share)]
            return [
                (index % grid.beams if last is None else jnp.clip(index, 0, last), weight) for index, weight in pair
            ]

        return line(place, grid.count - 1), line(along, None if grid.circular else grid.beams - 1)

    def _at(self, values: Float[Array, " frequency"], place: Float[Array, " point"]) -> Float[Array, " point"]:
        return jnp.broadcast_to(values, self.grid.count)[jnp.round(place).astype(jnp.int32)]

    def _near(self, place: Float[Array, " point"]) -> Neighbours:
        last = self.grid.count - 1
        return [(jnp.clip(index, 0, last), weight) for index, weight in neighbours(place)]


def _squared(values: Complex[Array, "*points"]) -> Float[Array, "*points"]:
    return values.real**2 + values.imag**2


def _in_beam(output: BeamOutput) -> Float[Array, " point"]:
    """Log ratio from the output of the beam alone."""
    left = output.noise + output.own / (1 + output.louder)
    left = left / jnp.where(output.valid, output.own + output.noise, 1)
    ratio = -jnp.log1p(output.louder) - (1 + output.references) * jnp.log(jnp.where(output.valid, left, 1))
    return jnp.where(output.valid, ratio, 0)
