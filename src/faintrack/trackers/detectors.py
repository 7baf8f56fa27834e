r"""Detectors: a region tiled by grids, each with at most one target and a probability that it is there.

While nothing is known of a target, its density is broad, and a grid holds it best. A region is watched by several
overlapping grids (kreucher2011, VI-A): small enough that two targets in one are rare, large enough that a target stays
until it is found. All of them are one array and one compiled step; several devices share it (`shared_among`).

When the probability of a detector crosses the threshold, its target is **handed over** to particles: the cells around
the highest peak that fall into the same beams as the peak, or their neighbours, are drawn from, and are then empty. In
Stone's terms the surface :math:`\Lambda(s)` of the detector (`faintrack.beliefs.grids`) is cut in two,

.. math::
    \frac{q_R}{1 - q_R} = \sum_{s \in R} \Lambda(s), \qquad \frac{q'}{1 - q'} = \sum_{s \notin R} \Lambda(s)

the odds that there is a target in the cells R that are handed over, and the odds that are left. A second target in the
same detector is what is left, and follows in a later scan (its figures 1-2). Detectors that overlap hold the same
target, so the cells of all of them are emptied.

A region has **surroundings**, from which energy reaches the arrays as well. They are watched by one detector more, with
cells four times as wide: a target outside is none of the region's, but explains what would be taken for one.
"""

import dataclasses
import functools
import math
from collections.abc import Callable, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from faintrack.beliefs.axis import Axis, between
from faintrack.beliefs.belief import update
from faintrack.beliefs.components import rates
from faintrack.beliefs.grids import Grid
from faintrack.errors import InputError
from faintrack.filters.adi import alternating_directions, steps_within
from faintrack.filters.grid import GridFilter
from faintrack.numerics.resampling import systematic
from faintrack.targets.states import PlanarState
from faintrack.targets.target import Target
from faintrack.trackers.beliefs import Beliefs

WIDER = 4
"""Cells of the surroundings over those of the region; looked at in as many points along x and y."""


class Detectors(eqx.Module):
    """Grids of one kind over the parts of a region.

    Attributes
    ----------
    filter : of one detector; the cells of its grid are counted from the detector's place.
    place : what is added to the states of the grid; components have the shape (detector,).
    fineness : points along each component of the position at which a cell is looked at.
    """

    filter: GridFilter
    place: Any
    fineness: int = eqx.field(static=True, default=2)

    @property
    def count(self) -> int:
        """Number of detectors."""
        return len(jax.tree.leaves(self.place)[0])

    @property
    def limits(self) -> tuple[Any, Any]:
        """Lowest and highest state within the grids, component by component; one without an axis has any value."""
        grid = self.filter.grid
        anywhere = {field.name: (-np.inf, np.inf) for field in dataclasses.fields(self.place)}
        edges = anywhere | {name: axis.edges for name, axis in grid.axes}

        def corner(end: int, outermost: Callable[[Any], Any]) -> Any:
            reach = {name: each[end] + outermost(getattr(self.place, name)) for name, each in edges.items()}
            return grid.kind(**reach)

        return corner(0, jnp.min), corner(-1, jnp.max)

    def covers(self, states: Any) -> Bool[Array, "*points"]:
        """Whether states have a position within the grids."""
        low, high = self.limits
        inside = [
            (getattr(states, name) >= getattr(low, name)) & (getattr(states, name) <= getattr(high, name))
            for name in rates(self.filter.grid.kind)
        ]
        return functools.reduce(jnp.logical_and, inside)

    @property
    def points(self) -> Any:
        """States at which a scan is looked at, evenly spread in the cells of all detectors, as open meshes.

        A cell may be wider than a beam, so it has `fineness` points along every component of the position. Their axes
        stand first, then the detector's, then those of the grid.
        """
        grid = self.filter.grid
        steps = dict(grid.axes)
        moving = [name for name in rates(grid.kind) if name in steps]
        spread = (np.arange(self.fineness) + 0.5) / self.fineness - 0.5
        flat = (1,) * len(grid.axes)

        def within(name: str, mesh: Array, place: Array) -> Array:
            middles = mesh + jnp.reshape(place, (-1, *flat)).astype(mesh.dtype)
            if name not in moving:
                return middles
            shape = tuple(self.fineness if other == name else 1 for other in moving)
            return middles + jnp.asarray(steps[name].step * spread, mesh.dtype).reshape(*shape, 1, *flat)

        meshes = grid.states()
        names = [field.name for field in dataclasses.fields(meshes)]
        return grid.kind(**{name: within(name, getattr(meshes, name), getattr(self.place, name)) for name in names})

    def init(self, key: PRNGKeyArray, time: float = 0.0) -> Beliefs:
        """Beliefs before any scan, stacked; their states are `states`."""
        one = self.filter.init(key, time)
        return Beliefs(
            None,
            jnp.repeat(one.log_weights[None], self.count, axis=0),
            jnp.repeat(one.log_odds[None], self.count),
            one.time,
        )

    def predict(self, beliefs: Beliefs, time: Float[Array, ""], key: PRNGKeyArray) -> Beliefs:
        """Beliefs carried forward to `time`."""
        return beliefs.changed(lambda belief: self.filter.predict(belief, time, key))

    def update(self, beliefs: Beliefs, log_ratio: Float[Array, "..."]) -> Beliefs:
        """Take in one scan through its log ratio at all `points`: each cell has the mean ratio of its own."""
        over = tuple(range(log_ratio.ndim - 1 - len(self.filter.grid.axes)))
        count = self.fineness ** len(over)
        log_ratio = jax.nn.logsumexp(log_ratio, axis=over) - np.log(count)
        return beliefs.changed(lambda belief, log_ratio: update(belief, log_ratio)[0], log_ratio)

    def peak(
        self, beliefs: Beliefs, beams: Int[Array, "array *points"], margin: int, count: int, key: PRNGKeyArray
    ) -> tuple[Int[Array, " array"], Any, Float[Array, ""]]:
        """Highest peak of the detector that is surest of a target.

        Parameters
        ----------
        beliefs : of all detectors.
        beams : that all `points` fall in, see `faintrack.sensors.stations.Fans.beams`.
        margin : beams on either side of the peak's that belong to it.
        count : states to draw.
        key : random key.

        Returns
        -------
        The beams of the peak, `count` states with equal weights, and the log odds that its target exists.
        """
        for_cell, for_place = jax.random.split(key)
        surest = jnp.argmax(beliefs.log_odds)
        weights = beliefs.log_weights[surest]
        within = beams.ndim - 2 - weights.ndim
        still = tuple(number for number, count in enumerate(beams.shape[2 + within :]) if count == 1)
        top = jnp.argmax(jax.nn.logsumexp(weights, axis=still))
        middle = (slice(None), *(self.fineness // 2,) * within, surest)
        at_top = beams[middle].reshape(len(beams), -1)[:, top]
        mine = jnp.where(self._cells_around(beams, at_top, margin)[surest], weights, -jnp.inf)
        log_odds = beliefs.log_odds[surest] + jax.nn.logsumexp(mine)
        cells = systematic(for_cell, mine.ravel() - jax.nn.logsumexp(mine), count, count)
        return at_top, self._within(surest, cells, for_place), log_odds

    def emptied(
        self,
        beliefs: Beliefs,
        beams: Int[Array, "array *points"],
        middle: Int[Array, " array"],
        margin: int,
        key: PRNGKeyArray,
    ) -> Beliefs:
        """What is left without the cells around some beams; a detector all of whose cells are taken begins anew."""
        log_weights = jnp.where(self._cells_around(beams, middle, margin), -jnp.inf, beliefs.log_weights)
        axes = tuple(range(1, log_weights.ndim))
        kept = jax.nn.logsumexp(log_weights, axis=axes, keepdims=True)
        some = kept > -jnp.inf
        start = self.filter.init(key).log_weights
        return Beliefs(
            None,
            jnp.where(some, log_weights - jnp.where(some, kept, 0), start),
            beliefs.log_odds + kept.reshape(-1),
            beliefs.time,
        )

    def _cells_around(
        self, beams: Int[Array, "array *points"], middle: Int[Array, " array"], margin: int
    ) -> Bool[Array, "detector *cells"]:
        """Cells with a point in the same beams as a peak or their neighbours."""
        near = around(beams, middle, margin)
        return jnp.any(near, axis=tuple(range(near.ndim - 1 - len(self.filter.grid.axes))))

    def _within(self, detector: Int[Array, ""], cells: Int[Array, " count"], key: PRNGKeyArray) -> Any:
        """States drawn evenly within cells of a detector."""
        grid = self.filter.grid
        numbers = jnp.unravel_index(cells, grid.shape)
        places = jax.random.uniform(key, (len(grid.axes), len(cells)), minval=-0.5, maxval=0.5)
        drawn = {
            name: axis.first + axis.step * (number + place)
            for (name, axis), number, place in zip(grid.axes, numbers, places, strict=True)
        }
        still = jax.tree.map(lambda _: jnp.zeros(len(cells)), self.place)
        states = dataclasses.replace(still, **drawn)
        return jax.tree.map(lambda values, place: values + jnp.asarray(place)[detector], states, self.place)


def around(beams: Int[Array, "array *points"], middle: Int[Array, " array"], margin: int) -> Bool[Array, "*points"]:
    """Points that fall within `margin` of the middle's beam in every array, or are as little heard there as it."""
    middle = middle.reshape(-1, *(1,) * (beams.ndim - 1))
    heard = (beams >= 0) & (middle >= 0)
    return jnp.all(jnp.where(heard, jnp.abs(beams - middle) <= margin, (beams < 0) & (middle < 0)), axis=0)


def hand_over(
    watches: Sequence[Detectors],
    beliefs: Sequence[Beliefs],
    beams: Sequence[Array],
    margin: int,
    count: int,
    key: PRNGKeyArray,
) -> tuple[tuple[Beliefs, ...], Any, Float[Array, ""]]:
    """Cut the peak of the detector that is surest of a target out of all of them.

    Parameters
    ----------
    watches, beliefs, beams : detectors of every kind, what they believe, and the beams that their `points` fall in.
    margin, count, key : see `Detectors.peak`.

    Returns
    -------
    What is left, `count` states with equal weights, and the log odds that the target exists.
    """
    surest = jnp.argmax(jnp.stack([jnp.max(each.log_odds) for each in beliefs]))
    peaks = [
        functools.partial(watch.peak, of, at, margin, count, key)
        for watch, of, at in zip(watches, beliefs, beams, strict=True)
    ]
    middle, states, log_odds = jax.lax.switch(surest, peaks)
    left = tuple(
        watch.emptied(of, at, middle, margin, key) for watch, of, at in zip(watches, beliefs, beams, strict=True)
    )
    return left, states, log_odds


def planar_detectors(
    x: tuple[float, float],
    y: tuple[float, float],
    detectors: tuple[int, int],
    cells: tuple[int, int],
    cell: float,
    speed: Axis,
    target: Target,
    interval: float,
    fineness: int = 2,
) -> Detectors:
    """Detectors of targets that move at a nearly constant velocity within a region.

    Parameters
    ----------
    x, y, detectors, cells, cell : see `tiles`.
    speed : cells of either component of the velocity; m/s.
    target : that is watched for; where it appears is not read.
    interval : between scans; seconds. Scans come at whole multiples of it.
    fineness : see `Detectors`.

    Raises
    ------
    InputError : detectors that do not cover the region.
    """
    (along_x, along_y), place = tiles(x, y, detectors, cells, cell)
    # Stepped fastest in this order of the axes.
    grid = Grid(PlanarState, (("vx", speed), ("vy", speed), ("x", along_x), ("y", along_y)))
    substeps = steps_within(float(np.abs(speed.edges).max()) * interval, cell)
    transport = alternating_directions(grid, target.motion.velocity_noise, interval, substeps)
    return Detectors(GridFilter(grid, target, transport), place, fineness)


def surrounding_detector(watch: Detectors, width: float, interval: float) -> Detectors:
    """One detector of a region and of what lies around it, with cells `WIDER` times as wide.

    Parameters
    ----------
    watch : detectors of the region, of `planar_detectors`.
    width : of the surroundings; metres.
    interval : between scans; seconds.
    """
    axes = dict(watch.filter.grid.axes)
    cells, speeds = surrounding_cells(watch, width)
    x, y = ((low - width, high + width) for low, high in _ends(watch))
    slow = between(float(axes["vx"].edges[0]), float(axes["vx"].edges[-1]), speeds)
    return planar_detectors(x, y, (1, 1), cells, WIDER * axes["x"].step, slow, watch.filter.target, interval, WIDER)


def surrounding_cells(watch: Detectors, width: float) -> tuple[tuple[int, int], int]:
    """Cells along x and y of the `surrounding_detector`, and along each axis of the velocity."""
    axes = dict(watch.filter.grid.axes)
    wide = WIDER * axes["x"].step
    across, along = (math.ceil((high - low + 2 * width) / wide - 1e-9) for low, high in _ends(watch))
    return (across, along), math.ceil(axes["vx"].count / 2)


def _ends(watch: Detectors) -> list[tuple[float, float]]:
    """Ends of the detectors along x and y; metres."""
    low, high = watch.limits
    return [(float(getattr(low, name)), float(getattr(high, name))) for name in ("x", "y")]


def tiles(
    x: tuple[float, float], y: tuple[float, float], detectors: tuple[int, int], cells: tuple[int, int], cell: float
) -> tuple[tuple[Axis, Axis], PlanarState]:
    """Tile a region with detectors that overlap evenly.

    Parameters
    ----------
    x, y : ends of the region, east and north; metres.
    detectors : along x and y.
    cells : of one detector along x and y.
    cell : side of a cell; metres.

    Returns
    -------
    Axes of x and y of one detector, from 0 on, and the place of each detector.

    Raises
    ------
    InputError : detectors that do not cover the region.

    Examples
    --------
    >>> (x, _), place = tiles((0.0, 1000.0), (0.0, 500.0), (2, 1), (12, 10), 50.0)
    >>> x.values[:2].tolist(), place.x.tolist()
    ([25.0, 75.0], [0.0, 400.0])
    """
    corners = []
    for name, (low, high), count, across in zip("xy", (x, y), detectors, cells, strict=True):
        if count * across * cell < (high - low) * (1 - 1e-9):
            raise InputError(
                f"region: {count} detectors of {across} cells of {cell:g} m cover {count * across * cell:g} m of the "
                f"{high - low:g} m along {name}; expected all of it."
            )
        last = max(high - across * cell, low)
        corners.append(np.linspace(low, last, count) if count > 1 else np.array([low]))
    east, north = (corner.ravel() for corner in np.meshgrid(*corners, indexing="ij"))
    still = np.zeros(east.size)
    axes = tuple(Axis(cell / 2, cell, count) for count in cells)
    return (axes[0], axes[1]), PlanarState(*(jnp.asarray(values, float) for values in (east, north, still, still)))


def shared_among(beliefs: Beliefs, devices: Sequence[Any]) -> Beliefs:
    """Beliefs whose detectors are spread evenly over several devices; a step compiled for them stays there.

    Parameters
    ----------
    beliefs : of the detectors.
    devices : from `jax.devices()`.

    Raises
    ------
    InputError : the number of detectors is not a multiple of that of the devices.

    Examples
    --------
    >>> beliefs = Beliefs(None, jnp.zeros((4, 3, 3)), jnp.zeros(4), jnp.array(0.0))
    >>> shared_among(beliefs, jax.devices()[:1]).log_weights.shape
    (4, 3, 3)
    """
    count = len(beliefs.log_odds)
    if count % len(devices):
        raise InputError(f"{count} detectors on {len(devices)} devices; expected a multiple of these.")
    mesh = jax.sharding.Mesh(np.array(devices), ("detector",))
    spread = jax.sharding.NamedSharding(mesh, jax.sharding.PartitionSpec("detector"))
    log_weights, log_odds = jax.device_put((beliefs.log_weights, beliefs.log_odds), spread)
    return dataclasses.replace(beliefs, log_weights=log_weights, log_odds=log_odds)
