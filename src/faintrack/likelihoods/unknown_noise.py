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
"""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.likelihoods.beam_proposal import along_beams
from faintrack.likelihoods.interpolation import bearing_neighbours, neighbours, read_plane
from faintrack.sensors.beams import BeamGrid, BeamScan
from faintrack.targets.states import BearingState
from faintrack.targets.target import UniformBirth

MOST_CHANNELS = 1000
"""Channels for which the products in `UnknownNoise.table` stay within float32."""


class UnknownNoise(eqx.Module):
    """Log ratio of a white Gaussian source, noise powers integrated out.

    Attributes
    ----------
    grid : axes of the scans.
    snr_db : lowest and highest SNR of the table, dB; states beyond are read at its end.
    """

    grid: BeamGrid
    snr_db: tuple[float, float] = eqx.field(static=True)

    @property
    def snr_axis_db(self) -> Float[np.ndarray, " snr"]:
        """SNR of the table's columns, about 1 dB apart; dB."""
        low, high = self.snr_db
        return np.linspace(low, high, max(4, math.ceil(high - low) + 1))

    def table(self, scan: BeamScan, snr_db: Float[Array, " snr"] | None = None) -> Float[Array, "bearing snr"]:
        """Log ratio at every bearing of the grid and every SNR; those of the table where not given; dB."""
        snr_db = jnp.asarray(self.snr_axis_db) if snr_db is None else snr_db
        heard = scan.total_power > 0
        share = scan.beam_power / jnp.where(heard, scan.channels * scan.total_power, jnp.inf)[:, None]
        share = jnp.minimum(share, 1.0)
        gain = scan.channels * 10 ** (snr_db.astype(share.dtype) / 10)
        # One logarithm serves as many factors as float32 can multiply: each is at least 1 / (1 + M a).
        group = int(87 / math.log1p(MOST_CHANNELS * 10 ** (self.snr_db[1] / 10)))
        padded = jnp.pad(share, ((0, -share.shape[0] % group), (0, 0)))
        groups = padded.reshape(-1, group, share.shape[1])

        def log_left(drop: Array) -> Float[Array, " bearing"]:
            """Sum over frequencies of the module's second logarithm, at one SNR."""
            return jnp.sum(jnp.log(jnp.prod(1 - drop * groups, axis=1)), axis=0)

        logs = jax.lax.map(log_left, gain / (1 + gain)).T
        table = -jnp.sum(heard) * jnp.log1p(gain) - scan.channels * logs
        return jnp.where(scan.channels >= 2, self.grid.snapshots * table, 0)

    @eqx.filter_jit
    def log_ratio(self, scan: BeamScan, states: BearingState) -> Float[Array, "*points"]:
        r"""Natural log of p(scan | source at state) / p(scan | no source).

        Parameters
        ----------
        scan : one frame.
        states : `bearing` and `snr_db` are read.

        Notes
        -----
        The module's equation, tabulated over bearing and SNR and interpolated by the states. Check: the mean of exp(log
        ratio) under noise of any power is 1.
        """
        table = self.table(scan)
        low, high = self.snr_db
        last = table.shape[1] - 1
        columns = neighbours(jnp.clip((states.snr_db - low) / (high - low), 0, 1) * last)
        inside = [(jnp.clip(column, 0, last), weight) for column, weight in columns]
        return read_plane(table, bearing_neighbours(self.grid, states.bearing), inside)

    def propose(
        self, scan: BeamScan, birth: UniformBirth, key: PRNGKeyArray, count: int
    ) -> tuple[BearingState, Float[Array, " count"]]:
        """New targets where the beams are loud, see `faintrack.likelihoods.beam_proposal`."""
        return along_beams(self, scan, birth, key, count)
