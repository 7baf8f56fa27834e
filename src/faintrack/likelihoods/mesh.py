r"""A mesh of measurements, and how much of every cell of a grid each of its points stands for.

The mesh has points in every bin of an active sonar: a few along the delay, several bearings a beam, a few along the
Doppler axis, and goes on where the sonar hears nothing. What lies in a cell of the grid follows from two things.

**Area.** A point stands for the stretch of its ray up to the middles between it and its neighbours,
:math:`A = \tfrac12 (R_+^2 - R_-^2)\, \delta\phi`. Along a ray areas add up to a difference of two numbers. So the area
in a cell follows from where the rays cross its edges, no point is counted one by one, and sensors that move cost little
more than sensors that stand still.

**Velocity.** Where Doppler is measured, a point is a strip of velocities across the gradient of the Doppler shift. The
Doppler shift of a velocity drawn evenly from a cell is, to first order, the sum of two uniform numbers, so the share of
a velocity cell that lies in the strip is a difference of two distribution functions. (aughenbaugh2010, 4.3.2, samples
the line in the middle of the strip instead.) The gradient is that of the point; for mean values of a whole cell that of
its middle (its 4.3.3).
"""

import math
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from faintrack.beliefs.axis import Axis
from faintrack.beliefs.grids import Grid
from faintrack.errors import InputError
from faintrack.likelihoods.exceedances import edge_class
from faintrack.sensors.active import ActiveSonar
from faintrack.sensors.bistatic import Bistatic
from faintrack.targets.states import PlanarState

FAR = 10
"""Widths of the grid from the receiver to where a ray counts as gone."""

NARROW = 1e-3
"""Least spread of the Doppler shift over half a velocity cell; bins."""

ALONG = 1e-6
"""Slope below which a ray runs along the cells; one that runs on their edge counts to those above it."""

Real = Float[Array, "..."]


class Spread(NamedTuple):
    """Doppler shifts that the velocities of a cell have at a place, in bins.

    Attributes
    ----------
    middle : of the velocity in the middle of each cell.
    half_x, half_y : to either side over the widths of a cell in vx and vy; the same for all cells.
    """

    middle: Float[Array, "*place velocity"]
    half_x: Float[Array, "*place 1"]
    half_y: Float[Array, "*place 1"]


class Mesh(eqx.Module):
    """Points of measurement beside the cells of a grid.

    Attributes
    ----------
    sonar : bins.
    grid : with the axes x and y and, where Doppler is measured, vx and vy; others are not read.
    finer : points a bin along delay, bearing and Doppler; without Doppler the last is 1.

    Raises
    ------
    InputError : a grid without an axis that is needed, or less than one point a bin.
    """

    sonar: ActiveSonar
    grid: Grid = eqx.field(static=True)
    finer: tuple[int, int, int] = eqx.field(static=True)

    def __post_init__(self) -> None:
        if self.sonar.doppler is None:
            self.finer = (*self.finer[:2], 1)

    def __check_init__(self) -> None:
        lacking = [name for name in self.names if name not in self.grid.names]
        if lacking:
            raise InputError(f"mesh: the grid has no axis {lacking[0]}; expected {', '.join(self.names)}.")
        if min(self.finer) < 1:
            raise InputError(f"mesh: {self.finer} points a bin; expected at least 1.")

    @property
    def names(self) -> tuple[str, ...]:
        """Axes of the grid that matter: position, and velocity where Doppler is measured."""
        return ("x", "y") if self.sonar.doppler is None else ("x", "y", "vx", "vy")

    @property
    def axes(self) -> dict[str, Axis]:
        """Those axes by their names."""
        every = dict(self.grid.axes)
        return {name: every[name] for name in self.names}

    @property
    def cell_area(self) -> float:
        """Area of a position cell; m^2."""
        return self.axes["x"].step * self.axes["y"].step

    @property
    def around(self) -> int:
        """Bearings of the mesh."""
        return self.finer[1] * self.sonar.beams

    @property
    def bearing_step(self) -> float:
        """From one bearing to the next; radians."""
        return 2 * math.pi / self.around

    def first(self, axis: int) -> int:
        """Number of the first point of delay (0) or Doppler (2) in the first bin."""
        return math.ceil(-self.finer[axis] / 2)

    def count(self, axis: int) -> int:
        """Number of points in all bins."""
        return self.finer[axis] * self.sonar.shape[axis]

    def heard(self, number: Int[Array, "..."], axis: int) -> Bool[Array, "..."]:
        """Whether points of delay or Doppler lie in bins of the sonar."""
        return (number >= self.first(axis)) & (number < self.first(axis) + self.count(axis))

    def hears(self, delay: Real) -> Bool[Array, "..."]:
        """Whether delays, in s, lie in bins of the sonar."""
        return self.sonar.heard(jnp.asarray(self.sonar.delay.place(delay)), jnp.zeros(()))

    def whole(self, number: Int[Array, "..."], axis: int) -> tuple[Int[Array, "..."], Int[Array, "..."]]:
        """Class of the bin before a point of delay or Doppler (`edge_class`), and its place after that bin."""
        inside = jnp.clip(number, self.first(axis), self.first(axis) + self.count(axis) - 1)
        before = jnp.floor_divide(inside, self.finer[axis])
        return edge_class(before, self.sonar.shape[axis], self.sonar.reach[axis]), inside - before * self.finer[axis]

    def delay(self, number: Real | Int[Array, "..."]) -> Real:
        """Seconds, of points or of places between them."""
        return self.sonar.delay.first + self.sonar.delay.step / self.finer[0] * number

    def sector(self, pair: Bistatic, number: Real, bearing: Real) -> Real:
        """Area along the ray of a bearing up to a delay; m^2."""
        distance = pair.distance(self.delay(number), bearing)
        return distance * distance * (0.5 * self.bearing_step)

    def cell(self, x: Real, y: Real) -> tuple[Int[Array, "..."], Bool[Array, "..."]]:
        """Number of the position cell, y fastest, and whether a place lies in one."""
        along_x, along_y = self.axes["x"], self.axes["y"]
        # However the cosine of a ray along an edge is rounded, its points lie in the cells that its area is in.
        above = 10 * ALONG
        column, row = along_x.nearest(x + above * along_x.step), along_y.nearest(y + above * along_y.step)
        inside = (column >= 0) & (column < along_x.count) & (row >= 0) & (row < along_y.count)
        return jnp.where(inside, column * along_y.count + row, 0), inside

    @property
    def velocities(self) -> tuple[Float[Array, " velocity"], Float[Array, " velocity"]]:
        """Middles of the velocity cells, vy fastest; one that stands still where Doppler is not measured."""
        if self.sonar.doppler is None:
            return jnp.zeros(1), jnp.zeros(1)
        vx, vy = np.meshgrid(self.axes["vx"].values, self.axes["vy"].values, indexing="ij")
        return jnp.asarray(vx.ravel(), float), jnp.asarray(vy.ravel(), float)

    def middles(self) -> PlanarState:
        """Middles of all cells, shape (x, y, velocity)."""
        x, y = jnp.meshgrid(*(jnp.asarray(self.axes[name].values, float) for name in "xy"), indexing="ij")
        return PlanarState(x[..., None], y[..., None], *self.velocities)

    def spread(self, pair: Bistatic, x: Real, y: Real) -> Spread:
        """Doppler shifts of the velocity cells at places."""
        doppler = self.sonar.doppler
        if doppler is None:
            nothing = jnp.zeros((*x.shape, 1))
            return Spread(nothing, nothing, nothing)
        here = PlanarState(x[..., None], y[..., None], *self.velocities)
        frequency = self.sonar.pulse.frequency
        half = [
            jnp.maximum(jnp.abs(each) * (self.axes[name].step / doppler.step / 2), NARROW)
            for name, each in zip(("vx", "vy"), pair.doppler_gradient(here, frequency), strict=True)
        ]
        return Spread(jnp.asarray(doppler.place(pair.doppler(here, frequency))), *half)

    def shares(self, spread: Spread, edges: Float[Array, "*_ edge"]) -> Float[Array, "*place strip velocity"]:
        """Share of every velocity cell between consecutive Doppler shifts.

        Parameters
        ----------
        spread : of the velocity cells at places.
        edges : Doppler shifts, ascending; in numbers of points, with leading axes that broadcast against the places.
        """
        if self.sonar.doppler is None:
            return jnp.ones((*spread.middle.shape[:-1], edges.shape[-1] - 1, 1))
        middle, *half = (each[..., None, :] for each in spread)
        return jnp.diff(below((edges / self.finer[2])[..., None] - middle, *half), axis=-2)

    def areas(self, pair: Bistatic) -> tuple[Float[Array, "x y"], Float[Array, "x y"]]:
        """Area of all points in every position cell, and of those that are heard; m^2."""
        bearing = jnp.arange(self.around) * self.bearing_step
        x = self._crossings(pair, "x", pair.receiver.x, jnp.cos(bearing), bearing)
        y = self._crossings(pair, "y", pair.receiver.y, jnp.sin(bearing), bearing)

        def both(x: Float[Array, "ray column 2"], y: Float[Array, "ray row 2"]) -> Float[Array, "x y"]:
            enter = jnp.maximum(x[:, :, None, 0], y[:, None, :, 0])
            leave = jnp.minimum(x[:, :, None, 1], y[:, None, :, 1])
            return jnp.maximum(leave - enter, 0).sum(axis=0)

        return both(x[0], y[0]), both(x[1], y[1])

    def _crossings(
        self, pair: Bistatic, name: str, start: Real, slope: Float[Array, " ray"], bearing: Float[Array, " ray"]
    ) -> tuple[Float[Array, "ray slab 2"], Float[Array, "ray slab 2"]]:
        """Area along every ray up to its ends in every slab of cells: of all points, and of those that are heard."""
        axis = self.axes[name]
        safe = jnp.where(jnp.abs(slope) < ALONG, ALONG, slope)[:, None]
        # A ray that runs along the cells never leaves its slab; a number far outside the grid says so and stays finite.
        distance = jnp.clip((jnp.asarray(axis.edges, float) - start) / safe, 0, FAR * axis.step * axis.count)
        nothing = jnp.zeros(())
        place = PlanarState(
            pair.receiver.x + distance * jnp.cos(bearing)[:, None],
            pair.receiver.y + distance * jnp.sin(bearing)[:, None],
            nothing,
            nothing,
        )
        number = jnp.ceil(self.finer[0] * self.sonar.delay.place(pair.echo(place)[0]))
        low = self.first(0)

        def ends(number: Real) -> Float[Array, "ray slab 2"]:
            along = self.sector(pair, number - 0.5, bearing[:, None])
            return jnp.sort(jnp.stack([along[:, :-1], along[:, 1:]], axis=-1), axis=-1)

        return ends(number), ends(jnp.clip(number, low, low + self.count(0)))

    def on_grid(self, values: Float[Array, "x y velocity"]) -> Float[Array, "..."]:
        """Values of all cells with the axes of the grid in their order, 1 along those that do not matter."""
        names, order = self.names, self.grid.names
        values = values.reshape([axis.count for axis in self.axes.values()])
        values = values.transpose([names.index(name) for name in order if name in names])
        return jnp.expand_dims(values, [number for number, name in enumerate(order) if name not in names])


def below(x: Any, a: Any, b: Any) -> Any:
    r"""Probability that the sum of two numbers, uniform from -a to a and from -b to b, is at most x.

    Notes
    -----
    With m the smaller and M the larger of a and b, and :math:`u = a + b - |x|`, the tail beyond :math:`|x|` is 0 for
    u < 0, :math:`u^2 / 8ab` up to u = 2m, and :math:`(u - m) / 2M` from there on. It is exactly 0 and 1 outside: what a
    loud return puts on a cell that it cannot reach has to be nothing.

    Examples
    --------
    >>> [float(below(jnp.array(x), 1.0, 0.5)) for x in (-1.5, -0.5, 0.0, 2.0)]
    [0.0, 0.25, 0.5, 1.0]
    """
    small, large = jnp.minimum(a, b), jnp.maximum(a, b)
    # Quotients once for all x: a and b are much smaller arrays.
    corner, side = 1 / (8 * a * b), 1 / (2 * large)
    inside = jnp.maximum(a + b - jnp.abs(x), 0)
    tail = jnp.where(inside < 2 * small, inside * inside * corner, (inside - small) * side)
    return jnp.where(x > 0, 1 - tail, tail)
