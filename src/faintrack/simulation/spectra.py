r"""Spectra of an array straight from the signal model, for Monte Carlo runs.

.. math::
    z_{mf} = v_f \, d_{mf}(\psi) + e_{mf}, \qquad
    v_f \sim \mathcal{CN}(0, a \sigma_f^2), \quad e_{mf} \sim \mathcal{CN}(0, \sigma_f^2)

(bosser2022, eq. 13 in the frequency domain). `over_spectra` hands frame after frame to whatever takes them in and keeps
none; `draw_spectra` keeps them all. For samples, propagation and all, see `faintrack.simulation.samples`.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float, Int, PRNGKeyArray

from faintrack.numerics.draws import normal_pairs
from faintrack.numerics.trigonometry import sine_cosine
from faintrack.sensors.array import SensorArray
from faintrack.sensors.beams import BeamGrid

TakeIn = Callable[[Any, Int[Array, ""], Complex[Array, "snapshot frequency channel"]], tuple[Any, Any]]


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

    def keep(state: None, number: Array, spectra: Array) -> tuple[None, Array]:
        return state, spectra

    return over_spectra(keep, None, key, array, grid, bearing, snr_db, noise_power)[1]


def over_spectra(
    take_in: TakeIn,
    state: Any,
    key: PRNGKeyArray,
    array: SensorArray,
    grid: BeamGrid,
    bearing: Float[Array, " frame"],
    snr_db: Float[Array, " frame"],
    noise_power: Float[Array, " frequency"] | float = 1.0,
) -> tuple[Any, Any]:
    """Draw frame after frame and hand each to a function, as `jax.lax.scan` does; no frame is kept.

    Parameters
    ----------
    take_in : function of (state, number of the frame, its spectra) to the next state and what to keep of it.
    state : before the first frame.
    key, array, grid, bearing, snr_db, noise_power : as in `draw_spectra`, which draws the same spectra.

    Returns
    -------
    The last state, and what was kept of every frame, stacked.
    """

    def numbers(frame: Array) -> Array:
        return _pairs(jax.random.fold_in(key, frame), array, grid, bearing.dtype)

    def spectra(pairs: Array, frame: Array) -> Array:
        return _received(pairs, bearing[frame], snr_db[frame], array, grid, noise_power)

    # The loop carries the random numbers of the frame after next and the spectra of the next. What a loop carries lies
    # in memory; otherwise XLA would draw every number anew for everything that reads it, three times as slow.
    def advance(carry: tuple[Any, Array, Array], frame: Array) -> tuple[tuple[Any, Array, Array], Any]:
        state, heard, pairs = carry
        state, kept = take_in(state, frame, heard)
        return (state, spectra(pairs, frame + 1), numbers(frame + 2)), kept

    first = jnp.array(0)
    start = (state, spectra(numbers(first), first), numbers(first + 1))
    last, kept = jax.lax.scan(advance, start, jnp.arange(bearing.shape[0]))
    return last[0], kept


def _pairs(key: PRNGKeyArray, array: SensorArray, grid: BeamGrid, dtype: Any) -> Complex[Array, " pair"]:
    """The random numbers of one frame, in one row: XLA takes seconds to compile random numbers along five axes."""
    return normal_pairs(key, grid.snapshots * grid.frequency.size * (len(array.gains) + 1), dtype)


def _received(
    pairs: Complex[Array, " pair"],
    bearing: Float[Array, ""],
    snr_db: Float[Array, ""],
    array: SensorArray,
    grid: BeamGrid,
    noise_power: Float[Array, " frequency"] | float,
) -> Complex[Array, "snapshot frequency channel"]:
    """The module's equation for one frame, from its random numbers."""
    frequencies, channels, dtype = grid.frequency.size, len(array.gains), bearing.dtype
    scale = jnp.sqrt(jnp.broadcast_to(jnp.asarray(noise_power, dtype), (frequencies,)) / 2)[:, None]
    signal, noise = jnp.split(pairs, [grid.snapshots * frequencies])
    signal = jnp.sqrt(10 ** (snr_db / 10)) * scale * signal.reshape(grid.snapshots, frequencies, 1)
    noise = scale * noise.reshape(grid.snapshots, frequencies, channels)
    sine, cosine = sine_cosine(2 * jnp.pi * jnp.asarray(grid.frequency, dtype)[:, None] * array.delays(bearing[None]))
    return jnp.asarray(array.alive, dtype) * (signal * jax.lax.complex(cosine, -sine) + noise)
