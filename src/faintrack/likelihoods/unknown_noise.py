r"""White Gaussian signal in noise whose power in every frequency and frame is unknown.

The model is that of `faintrack.likelihoods.white_signal`. With K snapshots of M channels in bin f, energy
:math:`E = \sum_k \|z_k\|^2` and beam power :math:`B`, the density of the data given the noise power is

.. math::
    p(z \mid \sigma^2, a) = (\pi \sigma^2)^{-MK} (1 + M a)^{-K}
        \exp\left[-\frac{1}{\sigma^2}\left(E - \frac{a B}{1 + M a}\right)\right].

Nothing is known about the scale, so :math:`\sigma^2` is integrated out against :math:`d\sigma^2 / \sigma^2`, with
:math:`\int s^{-n} e^{-c/s}\, ds/s = \Gamma(n)\, c^{-n}`. The ratio to the same integral at a = 0 is

.. math::
    \log \ell = -\sum_f \left[ K \log(1 + M a) + M K \log\left(1 - \frac{M a}{1 + M a} \frac{B_f}{M E_f}\right) \right].

It depends on the share :math:`b = B / (M E)` of the power that arrives in one beam, and on nothing else: however
loud, however
coloured, however drifting the noise, a frame without direction says the same. It is a true likelihood ratio, that of
b, the maximal invariant under scaling: for K = 1, b under noise has a Beta(1, M - 1) distribution and
:math:`\int (1 - g b)^{-M} (M-1)(1-b)^{M-2} db = 1 / (1 - g) = 1 + M a`, so the mean ratio is 1. The price for not
knowing the noise falls with the number of channels and snapshots.

Sources that are there already are part of the noise (`faintrack.likelihoods.array_field`): with w, P, E and
:math:`M'` as defined there

.. math::
    \log \ell = -\sum_f K \left[ \log(1 + a w_f)
    + M'_f \log\left(1 - \frac{a w_f}{1 + a w_f} \frac{P_f}{w_f E_f}\right) \right].

A wave that need not be level has the same ratio in the direction that it comes from: bearing and elevation, in a table
of one axis more.

Under a taper neighbouring bins and snapshots say the same in part; the logarithm then counts by the share of them that
is independent.
"""

import dataclasses
import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from faintrack.likelihoods.array_field import (
    Sources,
    alike,
    beams_beside,
    beside,
    directions_beside,
    source_of,
    steered,
    with_beams,
)
from faintrack.likelihoods.beam_proposal import along_beams
from faintrack.likelihoods.interpolation import (
    bearing_neighbours,
    elevation_neighbours,
    neighbours,
    read_plane,
    read_space,
)
from faintrack.sensors.beams import BeamGrid, BeamScan
from faintrack.sensors.spectra import beams_of
from faintrack.signal.beamformer import Beamformer
from faintrack.targets.states import Direction, WaveState
from faintrack.targets.target import UniformBirth

MOST_CHANNELS = 1000
"""Channels for which the products in `UnknownNoise.table` stay within float32."""


DIRECTIONS, LEVELS = 33, 9
"""Points of a table near a belief, in bearing and in SNR."""

ACROSS = 17
"""Points of such a table in bearing and in elevation each, where waves need not be level."""

REACH = 4.0
"""Standard deviations of a belief to either side that its table reaches."""

NARROWEST = 1e-4
"""Standard deviation of the bearing for which a table is made at least; radians."""


class Zoomed(eqx.Module):
    """Log ratio of one scan near a belief, a table that is read in between.

    Attributes
    ----------
    bearing, reach : middle of the table and half of its width; radians.
    snr_db, reach_db : the same of the SNR; dB.
    table : log ratio.
    elevation, reach_up : the same of the elevation, radians; None of level waves.
    """

    bearing: Float[Array, ""]
    reach: Float[Array, ""]
    snr_db: Float[Array, ""]
    reach_db: Float[Array, ""]
    table: Float[Array, "*ring bearing snr"]
    elevation: Float[Array, ""] | None = None
    reach_up: Float[Array, ""] | None = None

    def log_ratio(self, states: Direction) -> Float[Array, "*points"]:
        """Natural log of p(scan | source at state) / p(scan | no source); states beyond are read at the ends."""
        off = states.bearing - self.bearing
        off = off - 2 * jnp.pi * jnp.round(off / (2 * jnp.pi))

        def along(off: Array, reach: Array, count: int) -> list[tuple[Array, Array]]:
            place = (jnp.clip(off / reach, -1, 1) + 1) / 2 * (count - 1)
            return [(jnp.clip(column, 0, count - 1), weight) for column, weight in neighbours(place)]

        *rings, rows, columns = self.table.shape
        of_snr = along(states.snr_db - self.snr_db, self.reach_db, columns)
        of_bearing = along(off, self.reach, rows)
        if not isinstance(states, WaveState):
            return read_plane(self.table, of_bearing, of_snr)
        assert self.elevation is not None
        assert self.reach_up is not None
        of_elevation = along(states.elevation - self.elevation, self.reach_up, rings[0])
        return read_space(self.table, of_elevation, of_bearing, of_snr)


class UnknownNoise(eqx.Module):
    """Log ratio of a white Gaussian source, noise powers integrated out.

    Attributes
    ----------
    grid : axes of the scans.
    snr_db : lowest and highest SNR of the table, dB; states beyond are read at its end.
    beamformer : that made the scans; what is heard beside other sources is worked out with it.
    """

    grid: BeamGrid
    snr_db: tuple[float, float] = eqx.field(static=True)
    beamformer: Beamformer | None = None

    @property
    def snr_axis_db(self) -> Float[np.ndarray, " snr"]:
        """SNR of the table's columns, about 1 dB apart; dB."""
        low, high = self.snr_db
        return np.linspace(low, high, max(4, math.ceil(high - low) + 1))

    def table(self, scan: BeamScan, snr_db: Float[Array, " snr"] | None = None) -> Float[Array, "beam snr"]:
        """Log ratio at every beam of the grid and every SNR; those of the table where not given; dB."""
        snr_db = jnp.asarray(self.snr_axis_db) if snr_db is None else snr_db
        if scan.field is not None:
            assert self.beamformer is not None
            return self._beside(scan, snr_db, *beams_beside(self.beamformer, scan))
        heard = scan.total_power > 0
        share = scan.beam_power / jnp.where(heard, scan.channels * scan.total_power, jnp.inf)[:, None]
        share = jnp.minimum(share, 1.0)
        gain = scan.channels * 10 ** (snr_db.astype(share.dtype) / 10)
        groups = self._grouped(share)

        def log_left(drop: Array) -> Float[Array, " bearing"]:
            """Sum over frequencies of the module's second logarithm, at one SNR."""
            return jnp.sum(jnp.log(jnp.prod(1 - drop * groups, axis=1)), axis=0)

        logs = jax.lax.map(log_left, gain / (1 + gain)).T
        table = -jnp.sum(heard) * jnp.log1p(gain) - scan.channels * logs
        return jnp.where(scan.channels >= 2, self._independent * table, 0)

    def _beside(
        self,
        scan: BeamScan,
        snr_db: Float[Array, " snr"],
        power: Float[Array, "frequency direction"],
        gain: Float[Array, "frequency direction"],
    ) -> Float[Array, "direction snr"]:
        """The module's last equation, in directions of which P and w are given."""
        energy, dimensions = scan.total_power, jnp.full_like(scan.total_power, scan.channels)
        if scan.field is not None:
            energy, dimensions = scan.field.energy, scan.field.dimensions
        # Where nothing of a direction is left beside the others, nothing is said of it.
        some = (gain > 1e-3 * scan.channels) & (energy > 0)[:, None]
        share = jnp.minimum(jnp.where(some, power / jnp.where(some, gain * energy[:, None], 1), 0), 1)
        # What an array would gain beyond is lost to errors of its positions; a source counts as fainter instead.
        share, gain = self._grouped(share), self._grouped(jnp.where(some, jnp.minimum(gain, MOST_CHANNELS), 0))
        # Neighbouring bins have nearly the same dimensions: one logarithm serves a group of them.
        sums, counts = (jnp.sum(self._grouped(part[:, None]), axis=1) for part in (dimensions, jnp.ones_like(energy)))
        dimensions = sums / counts

        def log_ratio(snr: Array) -> Float[Array, " bearing"]:
            louder = snr * gain
            quieter = jnp.prod(1 - louder / (1 + louder) * share, axis=1)
            return -jnp.sum(jnp.log(jnp.prod(1 + louder, axis=1)) + dimensions * jnp.log(quieter), axis=0)

        table = jax.lax.map(log_ratio, 10 ** (snr_db.astype(share.dtype) / 10)).T
        return jnp.where(scan.channels >= 2, self._independent * table, 0)

    def _grouped(self, values: Float[Array, "frequency bearing"]) -> Float[Array, "group bin bearing"]:
        """Bins in groups whose factors float32 can multiply, each at least 1 / (1 + M a); zeros fill the last."""
        size = int(87 / math.log1p(MOST_CHANNELS * 10 ** (self.snr_db[1] / 10)))
        padded = jnp.pad(values, ((0, -len(values) % size), (0, 0)))
        return padded.reshape(-1, size, values.shape[1])

    @property
    def _independent(self) -> float:
        """Snapshots of a frame that are independent of each other."""
        return self.grid.snapshots * self.grid.independent

    @eqx.filter_jit
    def log_ratio(self, scan: BeamScan, states: Direction) -> Float[Array, "*points"]:
        r"""Natural log of p(scan | source at state) / p(scan | no source).

        Parameters
        ----------
        scan : one frame.
        states : `bearing` and `snr_db` are read, and `elevation` where waves need not be level.

        Notes
        -----
        The module's equation, tabulated over direction and SNR and interpolated by the states. Check: the mean of
        exp(log ratio) under noise of any power is 1.
        """
        table = self.table(scan)
        low, high = self.snr_db
        last = table.shape[1] - 1
        columns = neighbours(jnp.clip((states.snr_db - low) / (high - low), 0, 1) * last)
        inside = [(jnp.clip(column, 0, last), weight) for column, weight in columns]
        of_bearing = bearing_neighbours(self.grid, states.bearing)
        if not isinstance(states, WaveState):
            return read_plane(table, of_bearing, inside)
        rings = table.reshape(self.grid.rings, self.grid.beams, -1)
        return read_space(rings, elevation_neighbours(self.grid, states.elevation), of_bearing, inside)

    def part(self, scan: BeamScan, states: Direction, log_weights: Float[Array, " point"]) -> Sources:
        """A source, see `faintrack.likelihoods.array_field`."""
        return source_of(states, log_weights)

    def beside(self, scan: BeamScan, parts: Sources, existence: Float[Array, " source"]) -> BeamScan:
        """Scan with other sources as part of its background, see `faintrack.likelihoods.array_field`."""
        assert self.beamformer is not None
        return beside(self.beamformer, scan, dataclasses.replace(parts, existence=existence))

    def prepared(self, scan: BeamScan) -> BeamScan:
        """Scan with what is asked of its beams again and again worked out."""
        assert self.beamformer is not None
        return with_beams(self.beamformer, scan)

    def alike(self, scan: BeamScan, states: Direction, centres: Direction) -> Bool[Array, "centre *points"]:
        """Which states are one source to the array with those of the centres."""
        return alike(self.grid, states, centres)

    def zoomed(self, scan: BeamScan, states: Direction, log_weights: Float[Array, " point"]) -> Zoomed:
        """What a scan says near a belief, in directions of its own."""
        assert scan.spectra is not None, "a scan that is looked at closely has its spectra"
        assert self.grid.array is not None, "an array that is looked at closely is known"
        believed = source_of(states, log_weights)
        dtype = scan.total_power.dtype
        reach = REACH * jnp.maximum(believed.deviation, NARROWEST)
        offsets = jnp.linspace(-1, 1, DIRECTIONS, dtype=dtype)
        middle_db = 10 * jnp.log10(believed.snr)
        weights = jnp.exp(log_weights)
        deviation_db = jnp.sqrt(jnp.sum(weights * (states.snr_db - middle_db) ** 2))
        reach_db = REACH * jnp.maximum(deviation_db, 0.5)
        snr_db = jnp.clip(middle_db + reach_db * jnp.linspace(-1, 1, LEVELS, dtype=dtype), *self.snr_db)
        frequency, middle = jnp.asarray(self.grid.frequency, dtype), believed.bearing
        if believed.elevation is None or believed.elevation_deviation is None:
            vectors, _ = steered(self.grid.array, frequency, middle + reach * offsets)
            return Zoomed(
                middle, reach, middle_db, reach_db, self._beside(scan, snr_db, *directions_beside(vectors, scan))
            )
        elevation = believed.elevation
        reach_up = REACH * jnp.maximum(believed.elevation_deviation, NARROWEST)
        offsets = jnp.linspace(-1, 1, ACROSS, dtype=dtype)
        around = jnp.tile(middle + reach * offsets, ACROSS), jnp.repeat(elevation + reach_up * offsets, ACROSS)
        vectors, _ = steered(self.grid.array, frequency, *around)
        table = self._beside(scan, snr_db, *directions_beside(vectors, scan)).reshape(ACROSS, ACROSS, -1)
        return Zoomed(middle, reach, middle_db, reach_db, table, elevation, reach_up)

    def propose(
        self, scan: BeamScan, birth: UniformBirth, key: PRNGKeyArray, count: int
    ) -> tuple[Direction, Float[Array, " count"]]:
        """New targets where the beams are loud, see `faintrack.likelihoods.beam_proposal`."""
        return along_beams(self, scan, birth, key, count)

    def simulate(
        self, scan: BeamScan, states: Direction, present: Bool[Array, ""] | bool, key: PRNGKeyArray
    ) -> BeamScan:
        """Scan drawn from the module's model, with noise of power 1: the ratio is the same for any."""
        return beams_of(self.grid, scan, states, present, 1.0, key)
