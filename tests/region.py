"""A small region: two line arrays at right angles, one or two detectors, beams of five degrees."""

import functools
import math
from typing import Any

import jax
import jax.numpy as jnp

from faintrack.beliefs.axis import Axis
from faintrack.likelihoods.beam_energies import ELSEWHERE, BeamEnergies
from faintrack.sensors.stations import EnergyScan, Fans, Stations
from faintrack.simulation.energies import draw_energies
from faintrack.targets.states import PlanarState
from faintrack.trackers.several import SeveralTargetsTracker, region_tracker

BEAM = math.radians(5)
FANS = Fans((0.0, 0.0), (BEAM, BEAM), (37, 37), (True, True))
STATIONS = Stations(jnp.array([0.0, -500.0]), jnp.array([-500.0, 0.0]), jnp.array([math.pi / 2, 0.0]))
"""One south of the middle along the east axis, one west of it along the north axis."""

MODEL = BeamEnergies(FANS, 0.0, 1.0, 4.0, 1.0, ELSEWHERE)
SCANS = 40


@functools.cache
def tracker(slots: int = 4, surroundings: float = 0.0) -> SeveralTargetsTracker:
    """Two detectors of 9 x 16 cells of 50 m beside each other, velocities up to 5 m/s."""
    return region_tracker(
        MODEL,
        x=(-400.0, 400.0),
        y=(-400.0, 400.0),
        detectors=(2, 1),
        cells=(9, 16),
        cell=50.0,
        speed=Axis(-5.0, 2.5, 5),
        velocity_noise=0.2,
        interval=1.0,
        arrival_rate=1e-3,
        departure_rate=1e-3,
        slots=slots,
        particles=512,
        surroundings=surroundings,
    )


def paths(*starts: tuple[float, float, float, float]) -> PlanarState:
    """Targets at a constant velocity from (x, y, vx, vy), one scan a second."""
    time = jnp.arange(1.0, SCANS + 1)[:, None]
    x, y, vx, vy = (jnp.array(values, float) for values in zip(*starts, strict=True))
    still = jnp.zeros_like(time)
    return PlanarState(x + vx * time, y + vy * time, vx + still, vy + still)


def scans(seed: int, states: PlanarState, present: Any = True) -> EnergyScan:
    """Scans with these targets."""
    there = jnp.broadcast_to(jnp.asarray(present), states.x.shape)
    return draw_energies(jax.random.key(seed), MODEL, jnp.arange(1.0, SCANS + 1), STATIONS, states, there)
