"""Energies of the beams of several arrays that hear several targets."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from faintrack.likelihoods.beam_energies import BeamEnergies
from faintrack.sensors.stations import EnergyScan, Stations


@eqx.filter_jit
def draw_energies(
    key: PRNGKeyArray,
    likelihood: BeamEnergies,
    time: Float[Array, " scan"],
    stations: Stations,
    states: Any,
    present: Bool[Array, "scan target"],
) -> EnergyScan:
    """Scans of beam energies, drawn from the densities that the likelihood evaluates.

    Parameters
    ----------
    key : random key.
    likelihood : beams, and what they report.
    time : of the scans; seconds.
    stations : where the arrays are; components broadcast to (scan, array).
    states : of the targets; components have the shape (scan, target).
    present : when each target is there.

    Examples
    --------
    >>> import math
    >>> from faintrack.sensors.stations import Fans
    >>> from faintrack.targets.states import PlanarState
    >>> likelihood = BeamEnergies(Fans((0.0,), (math.radians(1),), (181,), (True,)), present_mean=100.0)
    >>> stations = Stations(jnp.zeros(1), jnp.zeros(1), jnp.full(1, math.pi / 2))
    >>> north = PlanarState(*(jnp.full((2, 1), value) for value in (0.0, 900.0, 0.0, 0.0)))
    >>> there = jnp.array([[False], [True]])
    >>> scans = draw_energies(jax.random.key(0), likelihood, jnp.arange(2.0), stations, north, there)
    >>> [(row > 50).nonzero()[0].tolist() for row in scans.energy[:, 0]]
    [[], [90]]
    """
    fans = likelihood.fans
    stations = jax.tree.map(lambda values: jnp.broadcast_to(values, (len(time), fans.arrays)), stations)
    beams = jax.vmap(fans.beams)(stations, states)
    number = jnp.arange(fans.most)
    heard = (beams[..., None] == number) & present[:, None, :, None]
    targets = jnp.sum(heard, axis=2)
    energy = likelihood.energies(targets, key)
    usable = jnp.broadcast_to(number < jnp.array(fans.count)[:, None], energy.shape)
    return EnergyScan(time.astype(energy.dtype), energy, usable, stations)
