r"""From beam powers to one energy a beam, and energies whose noise is known.

Arrays that are fused report no spectra but the energy of every beam, a row of the bearing-time record. Of a scan of our
own beamformer (`faintrack.sensors.beams`) it is the mean over the band of beam power over total power,

.. math:: z(\psi) = \frac{1}{F} \sum_f \frac{B_f(\psi)}{E_f}

1 in noise without direction, whatever its level and its spectrum.

What a beam without a target reports, `faintrack.likelihoods.beam_energies` has to know. Most beams of a scan are
without one, so that their median and their median absolute deviation tell it from the scan itself:

.. math:: z' = \frac{z - \operatorname{med} z}{1.4826 \operatorname{med} |z - \operatorname{med} z|}

has mean 0 and standard deviation 1 there, if it is Gaussian, whatever the level of the noise was. It takes as many
beams without a target as with one, and noise that comes evenly from everywhere.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from faintrack.sensors.beams import BeamScan

DEVIATION = 1.4826
"""Standard deviation of a Gaussian over its median absolute deviation."""


def energies(scan: BeamScan) -> Float[Array, "*scan beam"]:
    """Energy of every beam: beam power over total power, mean over the band; 1 on average in noise without direction.

    Parameters
    ----------
    scan : one, or a stack of them.

    Returns
    -------
    Not a number where fewer than two channels were used.

    Examples
    --------
    >>> power = jnp.array([[1.0, 4.0], [2.0, 2.0]])
    >>> energies(BeamScan(jnp.array(0.5), power, jnp.array([2.0, 1.0]), jnp.array(4.0))).tolist()
    [1.25, 2.0]
    """
    total = jnp.maximum(scan.total_power, jnp.finfo(scan.total_power.dtype).tiny)
    energy = jnp.mean(scan.beam_power / total[..., None], axis=-2)
    return jnp.where(scan.channels[..., None] > 1, energy, jnp.nan)


def standardised(energy: Float[Array, "*scan beam"]) -> Float[Array, "*scan beam"]:
    """Energies less their median over the beams, over their deviation from it (the module's last equation).

    Parameters
    ----------
    energy : of every beam; not a number where it was not measured.

    Returns
    -------
    As many; all not a number in scans whose beams do not differ.

    Examples
    --------
    >>> [round(value, 2) for value in standardised(jnp.array([1.0, 2.0, 3.0, 9.0, jnp.nan])).tolist()]
    [-1.01, -0.34, 0.34, 4.38, nan]
    """
    off = energy - jnp.nanmedian(energy, axis=-1, keepdims=True)
    spread = DEVIATION * jnp.nanmedian(jnp.abs(off), axis=-1, keepdims=True)
    return jnp.where(spread > 0, off / jnp.where(spread > 0, spread, 1), jnp.nan)
