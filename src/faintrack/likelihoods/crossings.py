r"""Where the swaths of two pairs of a multistatic sonar cross: points of a product of ratios.

Near a return the ratio of a pair is a ridge along an ellipse, a delay bin thick and a few beams long; the ratio of
another pair is one along another ellipse. What both say lies where the ridges cross, which may be smaller than any
distance between the mesh points of the first pair. But across the patch that such a point stands for the first ratio is
one number, and the delay of the second pair is linear along it. So the patch is cut where that delay passes from one
mesh point of the second pair to the next: a piece of the patch has the share

.. math:: s_k = \frac{\left| [\tau_-, \tau_+] \cap [k - \tfrac12, k + \tfrac12] \right|}{\tau_+ - \tau_-}

of its area, :math:`\tau_\pm` the second delay at its ends in mesh points, and both ratios are known in its middle. The
pieces of a patch are all of it, whether ellipses cross at a right angle, touch, or are the same.

Velocities are cut likewise (`faintrack.likelihoods.strips`).
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from faintrack.likelihoods.guided import Guided, Near, cover_of, default_at
from faintrack.likelihoods.mesh import NARROW, Mesh
from faintrack.likelihoods.strips import strips_of
from faintrack.sensors.active import Ping
from faintrack.sensors.bistatic import Bistatic
from faintrack.targets.states import PlanarState

AT_ONCE = 32
"""Parts of patches that are cut into pieces at a time."""

CHOSEN = 64
"""Pieces with an excess of both pairs that are taken in at a time."""

BEARINGS = 16, 8
"""Points a beam at least near the returns of a sweep, and of a tone; between those of the mesh by straight lines."""

LOWEST = -1e4
"""Log of a product that is as good as none."""

FLAT = 0.25
"""Mesh points that the second delay may be from a straight line along a part of a patch."""

Real = Float[Array, "..."]
Sums = tuple[Float[Array, " cell"], Float[Array, "cell velocity"]]
"""Log of the highest product in each position cell, and sums over it."""


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
        near, mesh, count = self.near, self.mesh, parts_of(self.mesh)
        place = (jnp.arange(near.bearing.shape[1] * count) + 0.5) / count - 0.5
        bearing = ((near.bearing[:, :1] + place) * mesh.bearing_step)[:, None, :]
        x, y = self.pair.position(mesh.delay(near.delay[:, :, None]), bearing)
        cell, on_grid = mesh.cell(x, y)
        rows = jnp.arange(len(near.delay))[:, None, None], jnp.arange(near.delay.shape[1])[None, :, None]
        used = jnp.repeat(self.used, count, axis=2) & on_grid[..., None]
        return Points(x, y, cell, jnp.repeat(self.area, count, axis=2) / count, used, interpolated(near.log_ratio, rows, place))


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
    cover = guided.cover if ping.pair is None and guided.cover is not None else cover_of(mesh, guided.quiet, pair)
    near = guided.near(ping)
    bearing = (near.bearing * mesh.bearing_step)[:, None, :]
    inner, outer = (mesh.sector(pair, near.delay[:, :, None] + side, bearing) for side in (-0.5, 0.5))
    used = near.used & reported
    default = default_at(mesh, guided.quiet, near.doppler)[:, None, None, :]
    log_excess = log_over(near.log_ratio, default, used)
    inside = jnp.where(reported, cover.inside, 0)
    return Excess(mesh, pair, near, used, ping.there, outer - inner, default, log_excess, inside)


def parts_of(mesh: Mesh) -> int:
    """Parts of the patch of a mesh point along the bearing."""
    return max(1, BEARINGS[mesh.sonar.doppler is not None] // mesh.finer[1])


def log_over(log_ratio: Real, default: Real, used: Bool[Array, "..."]) -> Real:
    """Log of what a ratio is more than the default; minus infinity where it is less, or is not used."""
    over = -jnp.expm1(jnp.log(default) - log_ratio)
    positive = used & (over > 0)
    return jnp.where(positive, log_ratio + jnp.log(jnp.where(positive, over, 1)), -jnp.inf)


def interpolated(
    values: Float[Array, "return delay bearing shift"], where: tuple[Int[Array, "..."], Int[Array, "..."]], bearing: Real
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


class Parts(NamedTuple):
    """Parts of the patches of one pair, as another pair measures their ends.

    Attributes
    ----------
    delay : mesh points of the other pair's delay at the ends of the parts along the bearing.
    bearing : the same of its bearing.
    crossed : whether the swath of a return of the other pair may cross a part of the bearings of a return.
    """

    delay: Float[Array, "return delay end"]
    bearing: Float[Array, "return delay end"]
    crossed: Bool[Array, "return part other"]


class Crossing(NamedTuple):
    """Two pairs, the first with the finer delays.

    Attributes
    ----------
    first, second : their numbers among all pairs.
    guided : of all pairs.
    """

    first: int
    second: int
    guided: list[Guided]

    def log_sums(self, excesses: list[Excess]) -> Float[Array, "x y velocity"]:
        """Log of the mean over cells of both excesses with what the other pairs say.

        Parameters
        ----------
        excesses : of all pairs.
        """
        first, second = excesses[self.first], excesses[self.second]
        shape_of_cells = first.inside.shape[:2]
        cells = math.prod(shape_of_cells)
        parts = self._parts(first, second)
        rows = parts.crossed.reshape(-1, parts.crossed.shape[-1])
        counts = rows.sum(axis=1)
        ends = jnp.cumsum(counts)
        blocks = -(-ends[-1] // AT_ONCE)

        def look(block: Int[Array, ""], carried: Sums) -> Sums:
            number = block * AT_ONCE + jnp.arange(AT_ONCE)
            # The number-th that is true: by rows, since a list of all would take longer than the sums.
            row = jnp.minimum(jnp.searchsorted(ends, number, side="right"), len(rows) - 1)
            passed = jnp.cumsum(rows[row], axis=1) > (number - ends[row] + counts[row])[:, None]
            mine, part = jnp.divmod(row, parts.crossed.shape[1])
            other, there = jnp.argmax(passed, axis=1), number < ends[-1]
            pieces = self._pieces(excesses, parts, mine, part, other, there)
            both = pieces.highest() > -jnp.inf
            (chosen,) = jnp.nonzero(both, size=both.size, fill_value=0)
            chosen = jnp.append(chosen, jnp.zeros(CHOSEN, chosen.dtype))

            def add(chunk: Int[Array, ""], carried: Sums) -> Sums:
                """Sums over what was highest in each position cell so far: a product passes e^88."""
                before, sums = carried
                which = jax.lax.dynamic_slice(chosen, (chunk * CHOSEN,), (CHOSEN,))
                counts = chunk * CHOSEN + jnp.arange(CHOSEN) < both.sum()
                some = jax.tree.map(lambda each: each[which], pieces)
                some = some._replace(area=jnp.where(counts, some.area, 0))
                profiles = [_profile(each, some.x, some.y) for each in excesses[self.second + 1 :]]
                peak = before.at[some.cell].max(some.highest(profiles))
                sums = sums * jnp.exp(before - peak)[:, None]
                return peak, sums.at[some.cell].add(self._of_velocities(excesses, some, profiles, peak[some.cell]))

            return jax.lax.fori_loop(0, -(-both.sum() // CHOSEN), add, carried)

        velocities = max(each.inside.shape[-1] for each in excesses)
        start = jnp.full(cells, LOWEST, first.area.dtype), jnp.zeros((cells, velocities), first.area.dtype)
        peak, sums = jax.lax.fori_loop(0, blocks, look, start)
        return (peak[:, None] + jnp.log(sums / first.mesh.cell_area)).reshape(*shape_of_cells, velocities)

    @property
    def _count(self) -> int:
        """Parts of a patch along which the second delay is a straight line, and the first ratio changes little."""
        first, second = self.guided[self.first].mesh, self.guided[self.second].mesh
        # A circle of the largest range leaves its tangent by this much over a patch, and delays twice as much.
        off = first.sonar.delay.last * first.bearing_step**2 / 8 / _step(second)
        return max(parts_of(first), math.ceil(math.sqrt(off / FLAT)))

    @property
    def _passed(self) -> int:
        """Mesh points of the second delay that one part of a patch may lie in, within a swath."""
        first, second = self.guided[self.first].mesh, self.guided[self.second].mesh
        along = first.sonar.delay.last * first.bearing_step / self._count / _step(second)
        swath = 2 * self.guided[self.second].swath[0] * second.finer[0] + 1
        return min(swath, math.ceil(along) + 2)

    def _parts(self, first: Excess, second: Excess) -> Parts:
        """Parts of the patches around the returns of the first pair, and which returns of the second cross them."""
        near, mesh, other = first.near, first.mesh, second.mesh
        ends = near.bearing.shape[1] * self._count + 1
        bearing = (near.bearing[:, :1] - 0.5 + jnp.arange(ends) / self._count) * mesh.bearing_step
        x, y = first.pair.position(mesh.delay(near.delay[:, :, None]), bearing[:, None, :])
        delay, beam = _measured(second, x, y)
        middle = near.delay.shape[1] // 2
        central = beam[:, middle, :-1]
        aside = jnp.stack([_around(beam[..., side] - central[:, None], other.around) for side in (slice(-1), slice(1, None))])
        wide = jnp.abs(aside).max(axis=(0, 2))
        both = jnp.stack([delay[..., :-1], delay[..., 1:]])
        low, high = both.min(axis=(0, 2)), both.max(axis=(0, 2))
        swath = [steps // 2 for steps in second.near.log_ratio.shape[1:]]
        place, around = second.near.delay[:, swath[0]], second.near.bearing[:, swath[1]]
        crossed = (low[..., None] <= place + swath[0] + 0.5) & (high[..., None] >= place - swath[0] - 0.5)
        off = _around(around - central[..., None], other.around)
        crossed = crossed & (jnp.abs(off) <= swath[1] + 0.5 + wide[..., None])
        crossed = crossed & first.there[:, None, None] & second.there
        if mesh.sonar.doppler is not None and other.sonar.doppler is not None:
            crossed = crossed & self._both_shifts(first, second, x[:, middle, :-1], y[:, middle, :-1])
        return Parts(delay, beam, crossed)

    def _both_shifts(self, first: Excess, second: Excess, x: Real, y: Real) -> Bool[Array, "return part other"]:
        """Whether a velocity of the grid may have the Doppler shifts of both returns."""
        axes = first.mesh.axes
        still = [float((axes[name].edges[0] + axes[name].edges[-1]) / 2) for name in ("vx", "vy")]
        reach = [float(axes[name].edges[-1] - axes[name].edges[0]) / 2 for name in ("vx", "vy")]
        here = PlanarState(x, y, *(jnp.full_like(x, speed) for speed in still))
        shifts, slopes = [], []
        for each in (first, second):
            frequency, axis = each.mesh.sonar.pulse.frequency, each.mesh.sonar.doppler
            assert axis is not None
            finer = each.mesh.finer[2] / axis.step
            shifts.append(jnp.asarray(axis.place(each.pair.doppler(here, frequency))) * each.mesh.finer[2])
            slopes.append([slope * finer for slope in each.pair.doppler_gradient(here, frequency)])
        (px, py), (qx, qy) = slopes
        along = (px * qx + py * qy) / jnp.maximum(px * px + py * py, NARROW**2)
        rest = jnp.abs(qx - along * px) * reach[0] + jnp.abs(qy - along * py) * reach[1]
        swaths = [each.near.doppler.shape[1] / 2 for each in (first, second)]
        # The shift is not quite linear in the velocity.
        allowed = rest + swaths[1] + jnp.abs(along) * swaths[0] + 0.02 * (jnp.abs(qx) * reach[0] + jnp.abs(qy) * reach[1]) + 1
        mine, other = (each.near.doppler[:, each.near.doppler.shape[1] // 2] for each in (first, second))
        off = (other - shifts[1][..., None]) - (along * (mine[:, None] - shifts[0]))[..., None]
        return jnp.abs(off) <= allowed[..., None]

    def _pieces(
        self,
        excesses: list[Excess],
        parts: Parts,
        mine: Int[Array, " part"],
        part: Int[Array, " part"],
        other: Int[Array, " part"],
        there: Bool[Array, " part"],
    ) -> "Pieces":
        """Pieces of some parts, cut at the delays of the second pair's mesh points."""
        first, second = excesses[self.first], excesses[self.second]
        begin, end = (parts.delay[mine, :, part + side] for side in (0, 1))
        low, high = jnp.minimum(begin, end), jnp.maximum(begin, end)
        wide = jnp.maximum(high - low, NARROW)
        swath = second.near.delay.shape[1]
        start = second.near.delay[other, 0][:, None]
        number = (jnp.maximum(jnp.floor(low + 0.5).astype(jnp.int32), start)[..., None]) + jnp.arange(self._passed)
        upper = jnp.minimum(jnp.maximum(high, low + NARROW)[..., None], number + 0.5)
        lower = jnp.maximum(low[..., None], number - 0.5)
        share = jnp.maximum(upper - lower, 0) / wide[..., None] / self._count
        step = end - begin
        run = jnp.where(jnp.abs(step) > NARROW, step, 1)[..., None]
        fraction = jnp.where(jnp.abs(step) > NARROW, 1, 0)[..., None] * ((upper + lower) / 2 - begin[..., None]) / run
        fraction = jnp.clip(jnp.where(jnp.abs(step)[..., None] > NARROW, fraction, 0.5), 0, 1)
        mesh, bearings = first.mesh, part // self._count
        bearing = first.near.bearing[mine, 0] - 0.5 + part / self._count
        bearing = (bearing[:, None, None] + fraction / self._count) * mesh.bearing_step
        x, y = first.pair.position(mesh.delay(first.near.delay[mine][..., None]), bearing)
        cell, on_grid = mesh.cell(x, y)
        along, around = number - start[..., None], self._beam_of(second, other, x, y)
        beam = jnp.floor(around + 0.5).astype(jnp.int32)
        inside = (along < swath) & (beam >= 0) & (beam < second.near.bearing.shape[1]) & on_grid
        inside = inside & there[:, None, None]
        area = jnp.where(inside, share, 0) * first.area[mine, :, bearings][..., None]
        weighed = (area > 0)[..., None]
        # Between the bearings of mesh points a loud return falls by many nats.
        place = (part[:, None, None] + fraction) / self._count - 0.5
        delays = jnp.arange(first.near.delay.shape[1])[:, None]
        told = interpolated(first.near.log_ratio, (mine[:, None, None], delays), place)
        own = first.log_excess[mine, :, bearings][:, :, None, :] > -jnp.inf
        log_first = log_over(told, first.default[mine], weighed & own)
        exact = (upper + lower) / 2 - start[..., None]
        before = jnp.clip(jnp.floor(exact), 0, swath - 2).astype(jnp.int32)
        weight = jnp.clip(exact - before, 0, 1)[..., None]
        rows = [interpolated(second.near.log_ratio, (other[:, None, None], before + side), around) for side in (0, 1)]
        nearest = (jnp.clip(each, 0, second.log_excess.shape[axis] - 1) for axis, each in ((1, along), (2, beam)))
        own = second.log_excess[(other[:, None, None], *nearest)] > -jnp.inf
        log_second = log_over((1 - weight) * rows[0] + weight * rows[1], second.default[other], weighed & own)
        log_first = jnp.broadcast_to(log_first, (*area.shape, log_first.shape[-1]))
        which = [jnp.broadcast_to(each[:, None, None], area.shape) for each in (mine, other)]
        shifts = first.near.doppler[which[0]], second.near.doppler[which[1]]
        pieces = Pieces(x, y, cell, area, log_first, log_second, shifts)
        return jax.tree.map(lambda each: each.reshape(area.size, *each.shape[area.ndim :]), pieces)

    def _beam_of(self, second: Excess, other: Int[Array, " part"], x: Real, y: Real) -> Float[Array, "part delay piece"]:
        """Number of the bearing in the swath of the second pair's return, with its fraction, that places lie at."""
        mesh = second.mesh
        middle = second.near.bearing.shape[1] // 2
        _, beam = _measured(second, x, y)
        off = _around(beam - second.near.bearing[other, middle][:, None, None], mesh.around)
        return off + middle

    def _of_velocities(
        self, excesses: list[Excess], pieces: "Pieces", profiles: list[Real], peak: Float[Array, " piece"]
    ) -> Float[Array, "piece velocity"]:
        """Area times both excesses of the pieces in every velocity cell, with what the other pairs say, over a peak."""
        first, second = excesses[self.first], excesses[self.second]
        highest = _highest(pieces.log_first), _highest(pieces.log_second)
        mine, other = (
            jnp.exp(logs - top[..., None])
            for logs, top in zip((pieces.log_first, pieces.log_second), highest, strict=True)
        )
        scale, x, y, cell = highest[0] + highest[1] - peak, pieces.x, pieces.y, pieces.cell
        strips = strips_of((first.mesh, second.mesh), (first.pair, second.pair), x, y, pieces.shifts)
        beside: Any = jnp.ones(())
        for number, each in enumerate(excesses):
            if number in (self.first, self.second):
                continue
            quiet = each.quiet_at(x, y, cell)
            if number < self.second:
                beside = beside * quiet[..., None, None, :]
                continue
            profile = profiles[number - self.second - 1]
            top = jnp.maximum(profile.max(axis=-1), 0)
            scale = scale + top
            quiet = quiet[..., None, None, :] * jnp.exp(-top)[..., None, None, None]
            read = strips.read(each.mesh, each.pair, jnp.exp(profile - top[..., None]), x, y)
            beside = beside * (quiet + read)
        weighed = jnp.where(pieces.area > 0, pieces.area * jnp.exp(scale), 0)
        both = mine[..., :, None, None] * other[..., None, :, None] * strips.shares
        return weighed[..., None] * jnp.sum(both * beside, axis=(-3, -2))


class Pieces(NamedTuple):
    """Pieces of patches, a mesh point of both pairs each.

    Attributes
    ----------
    x, y, area : m, m^2.
    cell : of the position.
    log_first, log_second : excess of both pairs at the Doppler points near their returns.
    shifts : numbers of those points.
    """

    x: Float[Array, "*piece"]
    y: Float[Array, "*piece"]
    cell: Int[Array, "*piece"]
    area: Float[Array, "*piece"]
    log_first: Float[Array, "*piece shift"]
    log_second: Float[Array, "*piece other_shift"]
    shifts: tuple[Int[Array, "*piece shift"], Int[Array, "*piece other_shift"]]

    def highest(self, profiles: Sequence[Real] = ()) -> Float[Array, "*piece"]:
        """Log of the largest product of a piece, or more.

        Parameters
        ----------
        profiles : log of the excess of further pairs, at all of their Doppler points.
        """
        every = self.log_first.max(axis=-1) + self.log_second.max(axis=-1)
        for profile in profiles:
            every = every + jnp.maximum(profile.max(axis=-1), 0)
        return jnp.where(self.area > 0, every, -jnp.inf)


def _highest(logs: Real) -> Real:
    """Largest along the last axis, finite."""
    top = logs.max(axis=-1)
    return jnp.where(top > -jnp.inf, top, 0)


def _step(mesh: Mesh) -> float:
    """From one mesh point of the delay to the next; s."""
    return mesh.sonar.delay.step / mesh.finer[0]


def _around(number: Real, count: int) -> Real:
    """Difference of bearings the shorter way round."""
    return number - count * jnp.round(number / count)


def _measured(excess: Excess, x: Real, y: Real) -> tuple[Real, Real]:
    """Numbers of the mesh points of delay and bearing, with fractions, that a pair measures echoes from places at."""
    nothing, mesh = jnp.zeros(()), excess.mesh
    delay, bearing = excess.pair.echo(PlanarState(x, y, nothing, nothing))
    return jnp.asarray(mesh.sonar.delay.place(delay)) * mesh.finer[0], bearing / mesh.bearing_step


def _profile(excess: Excess, x: Real, y: Real) -> Real:
    """Log of the excess of a pair at places, at all of its Doppler points; minus infinity far from its returns."""
    near, mesh = excess.near, excess.mesh
    delay, beam = _measured(excess, x, y)
    counts = near.log_ratio.shape[1:]
    nothing = jnp.full((*x.shape, mesh.count(2)), -jnp.inf, excess.log_excess.dtype)

    def add(number: Int[Array, ""], profile: Real) -> Real:
        along = jnp.floor(delay + 0.5).astype(jnp.int32) - near.delay[number, 0]
        off = _around(beam - near.bearing[number, counts[1] // 2], mesh.around)
        around = jnp.floor(off + 0.5).astype(jnp.int32) + counts[1] // 2
        inside = (along >= 0) & (along < counts[0]) & (around >= 0) & (around < counts[1])

        def joined() -> Real:
            at = jnp.clip(along, 0, counts[0] - 1), jnp.clip(around, 0, counts[1] - 1)
            told = jnp.where(inside[..., None], excess.log_excess[number][at], -jnp.inf)
            shift = near.doppler[number] - mesh.first(2)
            shift = jnp.where((shift >= 0) & (shift < mesh.count(2)), shift, mesh.count(2))
            return profile.at[..., shift].max(told, mode="drop")

        return jax.lax.cond(inside.any(), joined, lambda: profile)

    return jax.lax.fori_loop(0, excess.there.sum(), add, nothing)
