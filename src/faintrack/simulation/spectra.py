r"""Spectra of an array straight from the signal model, for Monte Carlo runs.

.. math::
    z_{mf} = v_f \, d_{mf}(\psi) + e_{mf}, \qquad
    v_f \sim \mathcal{CN}(0, a \sigma_f^2), \quad e_{mf} \sim \mathcal{CN}(0, \sigma_f^2)

(bosser2022, eq. 13 in the frequency domain). For samples, propagation and all, see `faintrack.simulation.samples`.
"""

import math

import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float, PRNGKeyArray

from faintrack.sensors.array import SensorArray
from faintrack.sensors.beams import BeamGrid, steering


def draw_spectra(
    key: PRNGKeyArray,
    array: SensorArray,
    grid: BeamGrid,
    bearing: Float[Array, " frame"],
    snr_db: Float[Array, " frame"],
    noise_power: Float[Array, " frequency"] | float = 1.0,
) -> Complex[Array, "frame snapshot frequency channel"]:
    """Unitary spectra of consecutive frames.

    Parameters
    ----------
    key : random key.
    array : geometry; dead channels are silent.
    grid : frequencies and snapshots.
    bearing : of the source in each frame; radians.
    snr_db : of the source in each frame, at one channel; dB, -inf where it is absent.
    noise_power : in each bin.

    Examples
    --------
    >>> from faintrack.sensors.array import line_array
    >>> import numpy as np
    >>> grid = BeamGrid(np.array([100.0, 200.0]), beams=8, snapshots=3, circular=False)
    >>> draw_spectra(jax.random.key(0), line_array(4, 1.0), grid, jnp.zeros(5), jnp.full(5, -10.0)).shape
    (5, 3, 2, 4)
    """
    frames, frequencies, channels = bearing.shape[0], grid.frequency.size, len(array.gains)
    for_signal, for_noise = jax.random.split(key)
    dtype = bearing.dtype

    def unit(key: PRNGKeyArray, shape: tuple[int, ...]) -> Complex[Array, "..."]:
        # Drawn in one row: XLA takes seconds to compile random numbers along five axes.
        parts = jax.random.normal(key, (2 * math.prod(shape),), dtype).reshape(2, *shape)
        parts = parts * jnp.sqrt(jnp.asarray(0.5, dtype))
        return jax.lax.complex(parts[0], parts[1])

    amplitude = jnp.sqrt(10 ** (snr_db / 10))[:, None, None]
    signal = amplitude * unit(for_signal, (frames, grid.snapshots, frequencies))
    arrival = jnp.moveaxis(steering(array, jnp.asarray(grid.frequency, dtype), bearing), 1, 0)
    heard = signal[..., None] * arrival[:, None] + unit(for_noise, (frames, grid.snapshots, frequencies, channels))
    scale = jnp.sqrt(jnp.broadcast_to(jnp.asarray(noise_power, dtype), (frequencies,)))
    return heard * scale[:, None] * jnp.asarray(array.alive, dtype)
