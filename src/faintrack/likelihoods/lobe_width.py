r"""The lobe-width likelihood: power inside the main lobe against power outside it.

.. math::
    \ell = \frac{\frac{1}{|\Delta|} \sum_{\alpha \in \Delta(\psi)} B(\alpha)^r}
                {\frac{1}{|\Psi| - |\Delta|} \sum_{\alpha \notin \Delta(\psi)} B(\alpha)^r},
    \qquad \Delta(\psi) = \{\alpha : |\alpha - \psi| < L\}

(bosser2022, eq. 19, after Gunes and Guldogan 2016). It needs neither noise power nor SNR, and it is no likelihood
ratio: its mean under noise depends on the array, so thresholds on existence have to be calibrated. It is here to be
compared with; use `faintrack.likelihoods.unknown_noise` instead.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from faintrack.errors import InputError
from faintrack.likelihoods.beam_proposal import along_beams
from faintrack.likelihoods.interpolation import bearing_neighbours, read
from faintrack.numerics.precision import full_precision
from faintrack.sensors.beams import BeamGrid, BeamScan
from faintrack.sensors.spectra import beams_of
from faintrack.targets.states import BearingState, Direction, SidedState
from faintrack.targets.target import UniformBirth


class LobeWidth(eqx.Module):
    """Log of mean power inside over mean power outside the main lobe.

    Attributes
    ----------
    grid : axes of the scans.
    inside : shape (bearing, bearing); 1 where the column's bearing is within the lobe around the row's, else 0.
    exponent : r, raises the contrast of the beam power.
    """

    grid: BeamGrid
    inside: Float[np.ndarray, "bearing bearing"]
    exponent: float = 5.0

    def table(self, scan: BeamScan, snr_db: Float[Array, " snr"]) -> Float[Array, "bearing snr"]:
        """Log ratio at every bearing of the grid, the same at every SNR."""
        return jnp.broadcast_to(self._log_ratios(scan)[:, None], (self.grid.beams, snr_db.size))

    def log_ratio(self, scan: BeamScan, states: BearingState | SidedState) -> Float[Array, "*points"]:
        """Natural log of the module's ratio at the states' bearings; the SNR is not read."""
        return read(self._log_ratios(scan), bearing_neighbours(self.grid, states.bearing))

    def propose(
        self, scan: BeamScan, birth: UniformBirth, key: PRNGKeyArray, count: int
    ) -> tuple[Direction, Float[Array, " count"]]:
        """New targets where the beams are loud, see `faintrack.likelihoods.beam_proposal`."""
        return along_beams(self, scan, birth, key, count)

    def simulate(
        self, scan: BeamScan, states: BearingState | SidedState, present: Bool[Array, ""] | bool, key: PRNGKeyArray
    ) -> BeamScan:
        """Scan of a white source in white noise of power 1, see `faintrack.sensors.spectra.beams_of`."""
        return beams_of(self.grid, scan, states, present, 1.0, key)

    @full_precision
    def _log_ratios(self, scan: BeamScan) -> Float[Array, " bearing"]:
        power = jnp.sum(scan.beam_power, axis=0)
        tiny = jnp.finfo(power.dtype).tiny
        # Only ratios of powers count: the largest is set to 1, so that the exponent cannot overflow.
        contrast = (power / jnp.maximum(power.max(), tiny)) ** self.exponent
        inside = jnp.asarray(self.inside, power.dtype)
        # Silence is the same on both sides, and a null stays a number that can be interpolated.
        within = jnp.maximum(inside @ contrast / inside.sum(axis=1), tiny)
        outside = jnp.maximum((1 - inside) @ contrast / (1 - inside).sum(axis=1), tiny)
        return jnp.where(scan.channels >= 2, jnp.log(within / outside), 0)


def lobe_width_likelihood(grid: BeamGrid, width: float, exponent: float = 5.0) -> LobeWidth:
    """Lobe-width likelihood on a grid of bearings.

    Parameters
    ----------
    grid : axes of the scans.
    width : L, from the peak of the main lobe to its edge; radians.
    exponent : r; 5 in bosser2022, table I.

    Raises
    ------
    InputError : a width that is not above 0, or a lobe that leaves no bearing outside.

    Examples
    --------
    >>> grid = BeamGrid(np.array([100.0]), beams=180, snapshots=1, circular=False)
    >>> int(lobe_width_likelihood(grid, np.radians(2.12)).inside[90].sum())
    5
    """
    apart = np.abs(grid.bearing[:, None] - grid.bearing)
    if grid.circular:
        apart = np.minimum(apart, 2 * np.pi - apart)
    inside = apart < width
    if not width > 0 or inside.all(axis=1).any():
        raise InputError(
            f"the main lobe reaches {np.degrees(width):g} degrees to either side; expected more than 0, and a bearing "
            "outside it. Raise the band or use the unknown-noise likelihood."
        )
    return LobeWidth(grid, inside.astype(float), exponent)
