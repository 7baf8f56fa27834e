r"""White Gaussian signal in noise of known power.

In each frequency bin the channels' spectra are circular complex Gaussian: covariance :math:`\sigma_f^2 I` under
noise, and
:math:`\sigma_f^2 (I + a\, d d^*)` under a source of signal to noise ratio a with steering vector d. Since :math:`d^*
d = M`, the matrix inversion lemma and the determinant give (bosser2022, eq. 20-27)

.. math::
    \log \ell = \sum_f \left[ \frac{a}{1 + M a} \frac{B_f(\psi)}{\sigma_f^2} - K \log(1 + M a) \right]

with M channels, K snapshots, and :math:`B_f` the beam power summed over snapshots. The paper sums over all N bins of
a real
signal, where each positive frequency stands twice: hence its factor 1/2. Use this where the noise is known, as in
simulation; on
real arrays use `faintrack.likelihoods.unknown_noise`, since a noise power that is a few percent off turns every frame
into a target.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from faintrack.likelihoods.beam_proposal import along_beams
from faintrack.likelihoods.interpolation import bearing_neighbours, read
from faintrack.sensors.beams import BeamGrid, BeamScan
from faintrack.sensors.spectra import beams_of
from faintrack.targets.states import BearingState, Direction, SidedState
from faintrack.targets.target import UniformBirth


class WhiteSignal(eqx.Module):
    """Log ratio of a white Gaussian source in white noise of known power.

    Attributes
    ----------
    grid : axes of the scans.
    noise_power : shape (frequency,) or (); power of the noise in each bin of the unitary spectrum, which for white
        noise is the variance of a sample.
    """

    grid: BeamGrid
    noise_power: Float[Array, "*frequency"]

    def table(self, scan: BeamScan, snr_db: Float[Array, " snr"]) -> Float[Array, "bearing snr"]:
        """Log ratio at every bearing of the grid and the given SNR; dB."""
        return self._ratio(scan, self._powers(scan)[:, None], snr_db)

    def log_ratio(self, scan: BeamScan, states: BearingState | SidedState) -> Float[Array, "*points"]:
        r"""Natural log of p(scan | source at state) / p(scan | no source).

        Parameters
        ----------
        scan : one frame.
        states : `bearing` and `snr_db` are read.

        Notes
        -----
        The module's equation. Check: the mean of exp(log ratio) under noise is 1.
        """
        power = read(self._powers(scan), bearing_neighbours(self.grid, states.bearing))
        return self._ratio(scan, power, states.snr_db)

    def propose(
        self, scan: BeamScan, birth: UniformBirth, key: PRNGKeyArray, count: int
    ) -> tuple[Direction, Float[Array, " count"]]:
        """New targets where the beams are loud, see `faintrack.likelihoods.beam_proposal`."""
        return along_beams(self, scan, birth, key, count)

    def simulate(
        self, scan: BeamScan, states: BearingState | SidedState, present: Bool[Array, ""] | bool, key: PRNGKeyArray
    ) -> BeamScan:
        """Scan drawn from the module's model, see `faintrack.sensors.spectra.beams_of`."""
        return beams_of(self.grid, scan, states, present, self.noise_power, key)

    def _powers(self, scan: BeamScan) -> Float[Array, " bearing"]:
        """Beam power over noise power, summed over the band."""
        noise_power = jnp.broadcast_to(self.noise_power, scan.total_power.shape)
        return jnp.sum(scan.beam_power / noise_power[:, None], axis=0)

    def _ratio(self, scan: BeamScan, power: Array, snr_db: Array) -> Array:
        snr = 10 ** (snr_db / 10)
        gain = scan.channels * snr
        count = self.grid.snapshots * scan.total_power.size
        log_ratio = snr / (1 + gain) * power - count * jnp.log1p(gain)
        return jnp.where(scan.channels >= 2, self.grid.independent * log_ratio, 0)
