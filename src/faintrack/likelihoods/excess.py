r"""What each pair of a multistatic sonar says of a ping: a default far from its returns, and the excess near them.

The excess is known at the mesh points around the returns (`faintrack.likelihoods.guided`). Between the bearings of mesh
points the log ratio is a cubic through four of them: on the flank of a loud return it falls by many nats from one to
the next, and what a cell holds of it depends on where its edge lies.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from faintrack.likelihoods.guided import Guided, Near, cover_of, default_at
from faintrack.likelihoods.mesh import Mesh
from faintrack.sensors.active import Ping
from faintrack.sensors.bistatic import Bistatic
from faintrack.targets.states import PlanarState

BEARINGS = 16, 8
"""Points a beam at least near the returns of a sweep, and of a tone."""

Real = Float[Array, "..."]


class Excess(NamedTuple):
    """What one pair says of a ping.

    Attributes
    ----------
    mesh, pair : points, and where source and receiver are.
    near : points around the returns.
    used : which of them count: those of `near`, if the pair reports.
    there : returns.
    area : of the points of delay and bearing; m^2.
    default : what the pair says at Doppler points far from any return; linear.
    log_excess : of each point over the default.
    inside : what the pair says far from any return, less 1, of velocities in a position cell whose delays it hears.
    """

    mesh: Mesh
    pair: Bistatic
    near: Near
    used: Bool[Array, "return delay bearing doppler"]
    there: Bool[Array, " return"]
    area: Float[Array, "return delay bearing"]
    default: Float[Array, "return 1 1 doppler"]
    log_excess: Float[Array, "return delay bearing doppler"]
    inside: Float[Array, "x y velocity"]

    def quiet_at(self, x: Real, y: Real, cell: Int[Array, "..."]) -> Float[Array, "... velocity"]:
        """What the pair says of velocities at places, far from its returns."""
        nothing = jnp.zeros(())
        heard = self.mesh.hears(self.pair.echo(PlanarState(x, y, nothing, nothing))[0])
        return 1 + heard[..., None] * self.inside.reshape(-1, self.inside.shape[-1])[cell]

    def finer(self) -> "Points":
        """Points around the returns, several in the place of each along the bearing."""
        near, mesh, count = self.near, self.mesh, parts_of_patch(self.mesh)
        place = (jnp.arange(near.bearing.shape[1] * count) + 0.5) / count - 0.5
        bearing = ((near.bearing[:, :1] + place) * mesh.bearing_step)[:, None, :]
        x, y = self.pair.position(mesh.delay(near.delay[:, :, None]), bearing)
        cell, on_grid = mesh.cell(x, y)
        rows = jnp.arange(len(near.delay))[:, None, None], jnp.arange(near.delay.shape[1])[None, :, None]
        used = jnp.repeat(self.used, count, axis=2) & on_grid[..., None]
        return Points(
            x, y, cell, jnp.repeat(self.area, count, axis=2) / count, used, interpolated(near.log_ratio, rows, place)
        )


def near_return(excess: "Excess", number: Int[Array, "..."], delay: Real, bearing: Real) -> Float[Array, "... shift"]:
    """Log ratio of a pair at places near a return, at the Doppler points around it.

    Parameters
    ----------
    excess : of the pair.
    number : of the return; broadcasts against the places.
    delay, bearing : numbers of the mesh points of each place, with their fractions.
    """
    near, counts = excess.near, excess.near.log_ratio.shape[1:]
    exact = delay - near.delay[number, 0]
    side = around(bearing - near.bearing[number, counts[1] // 2], excess.mesh.around) + counts[1] // 2
    before = jnp.clip(jnp.floor(exact), 0, max(counts[0] - 2, 0)).astype(jnp.int32)
    share = jnp.clip(exact - before, 0, 1)[..., None]
    low, high = (
        interpolated(near.log_ratio, (number, jnp.minimum(before + step, counts[0] - 1)), side) for step in (0, 1)
    )
    return (1 - share) * low + share * high


class Points(NamedTuple):
    """Points around the returns of a pair; those of `Excess`, or more.

    Attributes
    ----------
    x, y, area : m, m^2.
    cell : of the position.
    used, log_ratio : of each Doppler point.
    """

    x: Float[Array, "return delay bearing"]
    y: Float[Array, "return delay bearing"]
    cell: Int[Array, "return delay bearing"]
    area: Float[Array, "return delay bearing"]
    used: Bool[Array, "return delay bearing doppler"]
    log_ratio: Float[Array, "return delay bearing doppler"]


def excess_of(guided: Guided, ping: Ping, reported: Bool[Array, ""]) -> Excess:
    """What one pair says of a ping.

    Parameters
    ----------
    guided : of the pair.
    ping : its returns.
    reported : whether it reported; otherwise it says nothing.
    """
    mesh, pair = guided.mesh, guided.likelihood.sonar.geometry(ping)
    cover = guided.cover if ping.pair is None and guided.cover is not None else cover_of(mesh, guided.far, pair)
    near = guided.near(ping)
    bearing = (near.bearing * mesh.bearing_step)[:, None, :]
    inner, outer = (mesh.sector(pair, near.delay[:, :, None] + side, bearing) for side in (-0.5, 0.5))
    used = near.used & reported
    default = default_at(mesh, guided.far, near.doppler)[:, None, None, :]
    log_excess = log_over(near.log_ratio, default, used)
    inside = jnp.where(reported, cover.inside, 0)
    return Excess(mesh, pair, near, used, ping.there, outer - inner, default, log_excess, inside)


def parts_of_patch(mesh: Mesh) -> int:
    """Parts of the patch of a mesh point along the bearing."""
    return max(1, BEARINGS[mesh.sonar.doppler is not None] // mesh.finer[1])


def log_over(log_ratio: Real, default: Real, used: Bool[Array, "..."]) -> Real:
    """Log of what a ratio is more than the default; minus infinity where it is less, or is not used."""
    over = -jnp.expm1(jnp.log(default) - log_ratio)
    positive = used & (over > 0)
    return jnp.where(positive, log_ratio + jnp.log(jnp.where(positive, over, 1)), -jnp.inf)


def interpolated(
    values: Float[Array, "return delay bearing shift"],
    where: tuple[Int[Array, "..."], Int[Array, "..."]],
    bearing: Real,
) -> Float[Array, "... shift"]:
    """Values of returns and delays at a number of the bearing with its fraction, by cubics through four points."""
    last = values.shape[2] - 1
    before = jnp.clip(jnp.floor(bearing), 0, max(last - 1, 0)).astype(jnp.int32)
    share = jnp.clip(bearing - before, 0, 1)[..., None]
    # Of Catmull and Rom: through the two points on either side, with the slopes of their neighbours.
    weights = (
        share * (-0.5 + share * (1 - 0.5 * share)),
        1 + share * share * (-2.5 + 1.5 * share),
        share * (0.5 + share * (2 - 1.5 * share)),
        share * share * (-0.5 + 0.5 * share),
    )
    total: Any = 0.0
    for step, weight in zip((-1, 0, 1, 2), weights, strict=True):
        total = total + weight * values[(*where, jnp.clip(before + step, 0, last))]
    return total


def around(number: Real, count: int) -> Real:
    """Difference of bearings the shorter way round.

    Examples
    --------
    >>> float(around(jnp.array(70.0), 72))
    -2.0
    """
    return number - count * jnp.round(number / count)


def measured(excess: Excess, x: Real, y: Real) -> tuple[Real, Real]:
    """Numbers of the mesh points of delay and bearing, with fractions, that a pair measures echoes from places at."""
    nothing, mesh = jnp.zeros(()), excess.mesh
    delay, bearing = excess.pair.echo(PlanarState(x, y, nothing, nothing))
    return jnp.asarray(mesh.sonar.delay.place(delay)) * mesh.finer[0], bearing / mesh.bearing_step


def profile_of(excess: Excess, x: Real, y: Real) -> Real:
    """Log of the excess of a pair at places, at all of its Doppler points; minus infinity far from its returns."""
    near, mesh = excess.near, excess.mesh
    delay, beam = measured(excess, x, y)
    counts = near.log_ratio.shape[1:]
    nothing = jnp.full((*x.shape, mesh.count(2)), -jnp.inf, excess.log_excess.dtype)

    def add(number: Int[Array, ""], profile: Real) -> Real:
        along = jnp.floor(delay + 0.5).astype(jnp.int32) - near.delay[number, 0]
        off = around(beam - near.bearing[number, counts[1] // 2], mesh.around)
        side = jnp.floor(off + 0.5).astype(jnp.int32) + counts[1] // 2
        inside = (along >= 0) & (along < counts[0]) & (side >= 0) & (side < counts[1])

        def joined() -> Real:
            at = jnp.clip(along, 0, counts[0] - 1), jnp.clip(side, 0, counts[1] - 1)
            own = inside[..., None] & (excess.log_excess[number][at] > -jnp.inf)
            told = log_over(near_return(excess, number, delay, beam), excess.default[number, 0, 0], own)
            shift = near.doppler[number] - mesh.first(2)
            shift = jnp.where((shift >= 0) & (shift < mesh.count(2)), shift, mesh.count(2))
            return profile.at[..., shift].max(told, mode="drop")

        return jax.lax.cond(inside.any(), joined, lambda: profile)

    return jax.lax.fori_loop(0, excess.there.sum(), add, nothing)
