r"""How an echo looks in a sweep, and where in it a target is seen.

An echo raises the cells about its place, by a level that nobody knows, and its cells deviate from that by much:

.. math::
    \log \ell(z | x) = \log \frac{1}{K} \sum_k \exp \Bigl( u_k \sum_i h_i z_i - \frac{u_k^2}{2} \sum_i h_i^2 \Bigr),
    \qquad h_i = e^{-a_i^2 / (2 w_a^2) - b_i^2 / (2 w_b^2)}

with :math:`z_i` the intensity of cell i and :math:`u_k` the levels, both over the deviation, :math:`a_i` and
:math:`b_i` the rows and samples from the echo to the cell, and :math:`w` their standard deviations. That is
`faintrack.likelihoods.cells` with `gaussian` and `UnknownLevel`; here the cells wrap around in azimuth, and the sums
are two of one axis each. Rows are spokes that are averaged, so that a beam is a few of them wide.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from faintrack.numerics.trigonometry import arctan2, sine_cosine
from faintrack.targets.states import PlanarState


class Rows(eqx.Module):
    """When and whence the rows of a sweep looked; one value a row.

    Attributes
    ----------
    time : seconds from the first sweep.
    x, y : of the antenna; metres.
    heading : that row 0 looks to; radians clockwise from north.
    received : whether the row says anything.
    """

    time: Float[Array, "*sweep row"] | Float[np.ndarray, "*sweep row"]
    x: Float[Array, "*sweep row"] | Float[np.ndarray, "*sweep row"]
    y: Float[Array, "*sweep row"] | Float[np.ndarray, "*sweep row"]
    heading: Float[Array, "*sweep row"] | Float[np.ndarray, "*sweep row"]
    received: Bool[Array, "*sweep row"] | Bool[np.ndarray, "*sweep row"]

    def at(self, row: Int[Array, "..."]) -> tuple[Array, Array, Array, Array]:
        """Time, place and heading of some rows."""
        return self.time[row], self.x[row], self.y[row], self.heading[row]


class Echoes(eqx.Module):
    """Log ratio of an echo at every row and sample of a sweep.

    Attributes
    ----------
    rows, samples : of a sweep.
    offset : place of row 0, from the heading; rows.
    spacing : from sample to sample; metres.
    across, along : standard deviations of an echo; rows and samples.
    levels : of an echo; over the deviation of a cell.
    """

    rows: int = eqx.field(static=True)
    samples: int = eqx.field(static=True)
    offset: float = eqx.field(static=True)
    spacing: float = eqx.field(static=True)
    across: float = eqx.field(static=True)
    along: float = eqx.field(static=True)
    levels: tuple[float, ...] = eqx.field(static=True)

    @property
    def margin(self) -> int:
        """Samples beyond the last one where an echo still reaches into the picture."""
        return _reach(self.along)

    def table(self, values: Float[Array, "row sample"], received: Bool[Array, " row"]) -> Float[Array, "row place"]:
        """Log ratio of an echo at every row and sample, and `margin` samples further: the module's equation.

        Parameters
        ----------
        values : intensity over the deviation.
        received : rows that say something.
        """
        across, along = _profile(self.across), _profile(self.along)
        known = jnp.broadcast_to(received[:, None], values.shape).astype(values.dtype)
        values, known = (jnp.pad(part, ((0, 0), (0, self.margin))) for part in (values * known, known))
        matched = _blurred(_blurred(values, across, 0), along, 1)
        energy = _blurred(_blurred(known, across**2, 0), along**2, 1)
        ratios = jnp.stack([level * matched - level**2 / 2 * energy for level in self.levels])
        return jax.nn.logsumexp(ratios, axis=0) - jnp.log(len(self.levels))

    def place(self, x: Array, y: Array, heading: Array) -> tuple[Array, Array]:
        """Row, with its fraction and not kept within a turn, and sample of places relative to the antenna."""
        row = (arctan2(x, y) - heading) * (self.rows / (2 * np.pi)) - self.offset
        return row, jnp.sqrt(x * x + y * y) / self.spacing

    def position(self, row: Array, sample: Array, heading: Array) -> tuple[Array, Array]:
        """East and north of the antenna of a row and a sample; metres."""
        sine, cosine = sine_cosine(heading + (row + self.offset) * (2 * np.pi / self.rows))
        return sample * self.spacing * sine, sample * self.spacing * cosine

    def seen(self, states: PlanarState, time: Array, rows: Rows, row: Int[Array, "..."]) -> tuple[Array, Array]:
        """Row and sample at which targets are seen in a sweep.

        Each is where it is when its own row looks, and that is not known before it is known where it is. So a row
        looks at the time at which it would see the place of the state; what the target goes meanwhile is no row's time.

        Parameters
        ----------
        states : of the targets at a time.
        time : of the states; seconds.
        rows : of the sweep.
        row : near the targets.
        """
        _, x, y, heading = rows.at(row)
        place, _ = self.place(states.x - x, states.y - y, heading)
        # Few places have many velocities: the barrier keeps what belongs to a place from being computed for each.
        at, x, y, heading = jax.lax.optimization_barrier(rows.at(wrapped(place, self.rows)))
        passed = at - time
        return self.place(states.x + states.vx * passed - x, states.y + states.vy * passed - y, heading)


def wrapped(row: Float[Array, "..."], rows: int) -> Int[Array, "..."]:
    """Number of the nearest row; the one after the last is the first."""
    return jnp.mod(jnp.round(row).astype(jnp.int32), rows)


def turned(rows: Float[Array, "..."], count: int) -> Float[Array, "..."]:
    """Difference of rows by the shorter way round."""
    return jnp.mod(rows + count / 2, count) - count / 2


def _reach(width: float) -> int:
    """Cells to which an echo is looked at."""
    return max(1, round(2 * width))


def _profile(width: float) -> Float[np.ndarray, " cell"]:
    cells = np.arange(-_reach(width), _reach(width) + 1)
    return np.exp(-((cells / width) ** 2) / 2)


def _blurred(values: Float[Array, "row sample"], profile: np.ndarray, axis: int) -> Float[Array, "row sample"]:
    """Sum of the neighbours along an axis, weighted by a profile; rows wrap around."""
    reach = len(profile) // 2
    padding = [(0, 0), (0, 0)]
    padding[axis] = (reach, reach)
    padded = jnp.pad(values, padding, mode="wrap" if axis == 0 else "constant")
    count = values.shape[axis]
    parts = (
        float(share) * jax.lax.slice_in_dim(padded, start, start + count, axis=axis)
        for start, share in enumerate(profile)
    )
    return sum(parts, jnp.zeros_like(values))
