"""One scan of several arrays: all detectors of a region and the targets in hand.

The paper (kreucher2011) takes 1.5 s an update of four detectors and two targets on a processor of 2008. A region of 400
million cells is for a GPU: a second a scan keeps up with arrays that report once a second.
"""

import dataclasses
import math

import jax
import jax.numpy as jnp

from faintrack.beliefs.axis import Axis
from faintrack.bench.grids import once_over
from faintrack.bench.machine import Machine
from faintrack.bench.rows import Row, row, timed
from faintrack.bench.sizes import Sizes
from faintrack.likelihoods.beam_energies import ELSEWHERE, BeamEnergies
from faintrack.sensors.stations import EnergyScan, Fans, Stations
from faintrack.targets.states import PlanarState
from faintrack.trackers.several import SeveralTargetsTracker, region_tracker

PAPER = 1.5
"""Seconds."""
BEAM = math.radians(1)


def several_sea_trial(machine: Machine, sizes: Sizes) -> Row:
    """Four detectors of 51 x 13 x 51 x 13 cells, two targets."""
    return _update(
        "several_sea_trial",
        (2, 2),
        sizes.places,
        Axis(-2.0 * (sizes.rates // 2), 2.0, sizes.rates),
        50.0,
        40.0,
        PAPER,
        sizes,
    )


def several_synthetic(machine: Machine, sizes: Sizes) -> Row:
    """Sixteen detectors of 26 x 21 x 26 x 21 cells, two targets."""
    places, rates = sizes.small_places, sizes.small_rates
    return _update("several_synthetic", (4, 4), places, Axis(-1.0 * (rates // 2), 1.0, rates), 25.0, 110.0, None, sizes)


def several_region(machine: Machine, sizes: Sizes) -> Row:
    """Sixteen detectors of 200 x 25 x 200 x 25 cells, 400 million together, two targets."""
    places, rates = sizes.region_places, sizes.region_rates
    return _update("several_region", (4, 4), places, Axis(-0.5 * (rates // 2), 0.5, rates), 25.0, 1000.0, None, sizes)


def _update(
    name: str,
    detectors: tuple[int, int],
    places: int,
    speed: Axis,
    cell: float,
    target: float,
    peer: float | None,
    sizes: Sizes,
) -> Row:
    tracker, scans = problem(detectors, places, speed, cell, sizes)
    key = jax.random.key(0)
    watching = tracker.init(key)
    stations = jax.tree.map(lambda values: values[0], scans.stations)
    followed = watching.followed
    for x in (0.3, 0.6):
        at = (x * places * cell, 0.4 * places * cell, 1.0, -1.0)
        states = PlanarState(*(value + jnp.linspace(-1.0, 1.0, sizes.followers) for value in at))
        followed = tracker.trackers.take(followed, states, jnp.array(6.0), stations, tracker.margin)
    watching = dataclasses.replace(watching, followed=followed)
    timing = timed(lambda: tracker.steps(watching, scans, key), sizes.repeat_seconds).per(len(scans.time))
    weights = watching.beliefs[0].log_weights
    shape = " x ".join(map(str, weights.shape))
    beside = "no peer" if peer is None else "peer: the paper's time, of 2011"
    note = (
        f"a scan of two arrays, {shape} cells, two targets of {sizes.followers} particles; {beside}; limit: every "
        "weight read and written once"
    )
    return row(name, "ms", timing, note, target, peer, once_over(weights, sizes))


def problem(
    detectors: tuple[int, int], places: int, speed: Axis, cell: float, sizes: Sizes
) -> tuple[SeveralTargetsTracker, EnergyScan]:
    """Tracker and a few scans of noise; two lines to the east south of the region."""
    width = cell * places * (1 + 0.7 * (detectors[0] - 1))
    fans = Fans((0.0, 0.0), (BEAM, BEAM), (181, 181), (True, True))
    tracker = region_tracker(
        BeamEnergies(fans, 0.0, 1.0, 3.0, 1.0, ELSEWHERE),
        (0.0, width),
        (200.0, 200.0 + width),
        detectors,
        (places, places),
        cell,
        speed,
        velocity_noise=0.1,
        interval=1.0,
        arrival_rate=1e-4,
        departure_rate=1e-3,
        particles=sizes.followers,
    )
    time = jnp.arange(1.0, sizes.scans + 1)
    energy = jax.random.normal(jax.random.key(1), (sizes.scans, 2, 181))
    stations = Stations(
        *(
            jnp.broadcast_to(jnp.array(values), (sizes.scans, 2))
            for values in ((0.0, 700.0), (0.0, 0.0), (math.pi / 2, math.pi / 2))
        )
    )
    return tracker, EnergyScan(time, energy, jnp.ones(energy.shape, bool), stations)
