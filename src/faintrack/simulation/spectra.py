r"""Spectra of an array straight from the signal model, for Monte Carlo runs.

A frame is that of `faintrack.sensors.spectra`. `over_spectra` hands frame after frame to whatever takes them in and
keeps none; `draw_spectra` keeps them all. For samples, propagation and all, see `faintrack.simulation.samples`.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Complex, Float, Int, PRNGKeyArray

from faintrack.sensors.array import SensorArray
from faintrack.sensors.beams import BeamGrid
from faintrack.sensors.spectra import pairs_of, received

TakeIn = Callable[[Any, Int[Array, ""], Complex[Array, "snapshot frequency channel"]], tuple[Any, Any]]


def draw_spectra(
    key: PRNGKeyArray,
    array: SensorArray,
    grid: BeamGrid,
    bearing: Float[Array, " frame"],
    snr_db: Float[Array, " frame"],
    noise_power: Float[Array, " frequency"] | float = 1.0,
    elevation: Float[Array, " frame"] | None = None,
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
    elevation : of the source in each frame; radians. Its waves are level where not given.

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

    return over_spectra(keep, None, key, array, grid, bearing, snr_db, noise_power, elevation)[1]


def over_spectra(
    take_in: TakeIn,
    state: Any,
    key: PRNGKeyArray,
    array: SensorArray,
    grid: BeamGrid,
    bearing: Float[Array, " frame"],
    snr_db: Float[Array, " frame"],
    noise_power: Float[Array, " frequency"] | float = 1.0,
    elevation: Float[Array, " frame"] | None = None,
) -> tuple[Any, Any]:
    """Draw frame after frame and hand each to a function, as `jax.lax.scan` does; no frame is kept.

    Parameters
    ----------
    take_in : function of (state, number of the frame, its spectra) to the next state and what to keep of it.
    state : before the first frame.
    key, array, grid, bearing, snr_db, noise_power, elevation : as in `draw_spectra`, which draws the same spectra.

    Returns
    -------
    The last state, and what was kept of every frame, stacked.
    """

    def numbers(frame: Array) -> Array:
        return pairs_of(jax.random.fold_in(key, frame), array, grid, bearing.dtype)

    def spectra(pairs: Array, frame: Array) -> Array:
        above = None if elevation is None else elevation[frame]
        return received(pairs, bearing[frame], snr_db[frame], array, grid, noise_power, above)

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
