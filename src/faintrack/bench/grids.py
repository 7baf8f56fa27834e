"""One step of motion on grids of four dimensions, ours and Stone Soup's.

Peers differ in what they do: Stone Soup's point-mass filter lays a new grid around the prediction, interpolates, and
convolves by FFT; ours keeps its grid. What is compared is the time a cell.
"""

from collections.abc import Callable
from datetime import datetime, timedelta
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from faintrack.beliefs.axis import Axis
from faintrack.beliefs.grids import Grid
from faintrack.bench.machine import Machine
from faintrack.bench.rows import Row, row, timed
from faintrack.bench.sizes import Sizes
from faintrack.filters.adi import alternating_directions
from faintrack.filters.grid import Transport
from faintrack.filters.separable import separable
from faintrack.targets.motion import PlanarMotion
from faintrack.targets.states import PlanarState

CELL, VELOCITY_CELL = 50.0, 2.0
"""Metres and m/s of the detectors (kreucher2011, sea data); a scan a second."""
VELOCITY_NOISE = 0.3
FAR, FAST, SLOW_SCANS, SHIP_NOISE = 66e3, 12.0, 60.0, 0.05
"""A sonar's region to a side and fastest velocity, metres and m/s; seconds between scans; m/s per root second."""


def implicit_step_4d(machine: Machine, sizes: Sizes) -> Row:
    """An alternating-direction step of all detectors of a surveillance region."""
    places = Axis(0.0, CELL, sizes.places)
    rates = Axis(-VELOCITY_CELL * (sizes.rates // 2), VELOCITY_CELL, sizes.rates)
    grid = Grid(PlanarState, (("vx", rates), ("vy", rates), ("x", places), ("y", places)))
    transport = alternating_directions(grid, VELOCITY_NOISE, 1.0)
    cells = sizes.detectors * grid.size
    log_weights = jnp.full((sizes.detectors, *grid.shape), -np.log(grid.size), jnp.float32)
    carried = jax.jit(jax.vmap(_carry(transport), in_axes=(0, None)))
    timing = timed(lambda: carried(log_weights, jnp.array(1.0)), sizes.repeat_seconds)
    theirs = point_mass_step(sizes.peer_cells)
    peer = None
    if theirs is not None:
        peer = timed(theirs, sizes.repeat_seconds).least * cells / sizes.peer_cells**4
    beside = (
        "Stone Soup is not installed" if peer is None else "peer: Stone Soup's point-mass prediction, as many cells"
    )
    note = (
        f"alternating-direction step of {sizes.detectors} x {' x '.join(map(str, grid.shape))} cells, logarithms "
        f"included; {beside}; limit: every weight read and written once"
    )
    return row("implicit_step_4d", "ms", timing, note, 20.0, peer, once_over(log_weights, sizes))


def separable_step_base(machine: Machine, sizes: Sizes) -> Row:
    """Kernels on the base grid of the active sonar."""
    return _separable("separable_step_base", *sizes.base, 6.0, sizes)


def separable_step_fine(machine: Machine, sizes: Sizes) -> Row:
    """Kernels on its fine grid."""
    return _separable("separable_step_fine", *sizes.fine, 40.0, sizes)


def _separable(name: str, places: int, rates: int, target: float, sizes: Sizes) -> Row:
    place = Axis(0.0, FAR / places, places)
    rate = Axis(-FAST, 2 * FAST / (rates - 1), rates)
    grid = Grid(PlanarState, (("x", place), ("vx", rate), ("y", place), ("vy", rate)))
    carried = jax.jit(_carry(separable(grid, PlanarMotion(SHIP_NOISE), SLOW_SCANS)))
    log_weights = jnp.full(grid.shape, -np.log(grid.size), jnp.float32)
    timing = timed(lambda: carried(log_weights, jnp.array(SLOW_SCANS)), sizes.repeat_seconds)
    note = (
        f"separable kernels on {' x '.join(map(str, grid.shape))} cells, logarithms included; no peer; limit: "
        "every weight read and written once"
    )
    return row(name, "ms", timing, note, target, limit=once_over(log_weights, sizes))


def _carry(transport: Transport) -> Callable[[Any, Any], Any]:
    return lambda log_weights, end: transport.carry(log_weights, jnp.zeros(()), end, jax.random.key(0))


def once_over(values: Any, sizes: Sizes) -> float:
    """Seconds to read and write an array once."""
    doubled = jax.jit(lambda values: 2 * values)
    return timed(lambda: doubled(values), sizes.repeat_seconds).least


def point_mass_step(cells: int) -> Callable[[], Any] | None:
    """A prediction of Stone Soup's point-mass filter with so many cells along each axis; None where not installed."""
    try:
        from stonesoup.functions import grid_creation
        from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
        from stonesoup.predictor.pointmass import PointMassPredictor
        from stonesoup.types.array import StateVectors
        from stonesoup.types.state import PointMassState
    except ImportError:
        return None
    mean = np.array([[0.0], [3.0], [0.0], [-3.0]])
    covariance = np.diag([200.0**2, 3.0**2, 200.0**2, 3.0**2])
    shape = np.array([cells] * 4)
    points, delta, dimensions, center, vectors = grid_creation(mean, covariance, 4, 4, shape)
    off = points - mean
    weight = np.exp(-0.5 * np.sum(off * np.linalg.solve(covariance, off), axis=0))[:, None]
    weight /= weight.sum() * np.prod(delta)
    start = datetime(2000, 1, 1)
    prior = PointMassState(
        state_vector=StateVectors(points),
        weight=weight,
        grid_delta=delta,
        grid_dim=dimensions,
        center=center,
        eigVec=vectors,
        Npa=shape,
        timestamp=start,
    )
    motion = ConstantVelocity(VELOCITY_NOISE**2)
    predictor = PointMassPredictor(CombinedLinearGaussianTransitionModel([motion, motion]))
    return lambda: predictor.predict(prior, timestamp=start + timedelta(seconds=1))
