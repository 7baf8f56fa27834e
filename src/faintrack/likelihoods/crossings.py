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
from jaxtyping import Array, Bool, Float, Int

from faintrack.likelihoods.excess import (
    Excess,
    around,
    interpolated,
    log_over,
    measured,
    near_return,
    parts_of_patch,
    profile_of,
)
from faintrack.likelihoods.mesh import NARROW, Mesh
from faintrack.likelihoods.strips import strips_of
from faintrack.targets.states import PlanarState

AT_ONCE = 32
"""Parts of patches that are cut into pieces at a time."""

CHOSEN = 64
"""Pieces with an excess of both pairs that are taken in at a time."""

SEVERAL = 8
"""Pieces a mesh point where a third pair may pass several of its own in one."""

LOWEST = -1e4
"""Log of a product that is as good as none."""

FLAT = 0.25
"""Mesh points that the second delay may be from a straight line along a part of a patch."""

BENT = 0.02
"""Of a Doppler shift: how far it may be from linear in the velocity."""

Real = Float[Array, "..."]
Sums = tuple[Float[Array, " cell"], Float[Array, "cell velocity"]]
"""Log of the highest product in each position cell, and sums over it."""


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


def log_crossed(excesses: Sequence[Excess], first: int, second: int) -> Float[Array, "x y velocity"]:
    """Log of the mean over cells of the excesses of two pairs with what the others say.

    Parameters
    ----------
    excesses : of all pairs, those with the finest delays first.
    first, second : numbers of the two, ascending.
    """
    mine, other = excesses[first], excesses[second]
    shape_of_cells = mine.inside.shape[:2]
    cells = math.prod(shape_of_cells)
    parts = _parts(mine, other)
    rows = parts.crossed.reshape(-1, parts.crossed.shape[-1])
    counts = rows.sum(axis=1)
    ends = jnp.cumsum(counts)
    blocks = -(-ends[-1] // AT_ONCE)

    def look(block: Int[Array, ""], carried: Sums) -> Sums:
        number = block * AT_ONCE + jnp.arange(AT_ONCE)
        # The number-th that is true: by rows, since a list of all would take longer than the sums.
        row = jnp.minimum(jnp.searchsorted(ends, number, side="right"), len(rows) - 1)
        passed = jnp.cumsum(rows[row], axis=1) > (number - ends[row] + counts[row])[:, None]
        which = (*jnp.divmod(row, parts.crossed.shape[1]), jnp.argmax(passed, axis=1))
        pieces = _pieces(mine, other, parts, which, number < ends[-1], SEVERAL if len(excesses) > 2 else 1)
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
            profiles = [profile_of(each, some.x, some.y) for each in excesses[second + 1 :]]
            peak = before.at[some.cell].max(some.highest(profiles))
            sums = sums * jnp.exp(before - peak)[:, None]
            return peak, sums.at[some.cell].add(
                _of_velocities(excesses, (first, second), some, profiles, peak[some.cell])
            )

        return jax.lax.fori_loop(0, -(-both.sum() // CHOSEN), add, carried)

    velocities = max(each.inside.shape[-1] for each in excesses)
    start = jnp.full(cells, LOWEST, mine.area.dtype), jnp.zeros((cells, velocities), mine.area.dtype)
    peak, sums = jax.lax.fori_loop(0, blocks, look, start)
    return (peak[:, None] + jnp.log(sums / mine.mesh.cell_area)).reshape(*shape_of_cells, velocities)


def _count(first: Mesh, second: Mesh) -> int:
    """Parts of a patch along which the second delay is a straight line, and the first ratio changes little."""
    # A circle of the largest range leaves its tangent by this much over a patch, and delays twice as much.
    off = first.sonar.delay.last * first.bearing_step**2 / 8 / _step(second)
    return max(parts_of_patch(first), math.ceil(math.sqrt(off / FLAT)))


def _passed(first: Mesh, second: Mesh, swath: int, cuts: int) -> int:
    """Pieces that one part of a patch may be cut into, of those of a swath."""
    along = first.sonar.delay.last * first.bearing_step / _count(first, second) / _step(second)
    return min(cuts * swath, math.ceil(cuts * along) + 2)


def _parts(first: Excess, second: Excess) -> Parts:
    """Parts of the patches around the returns of the first pair, and which returns of the second cross them."""
    near, mesh, other = first.near, first.mesh, second.mesh
    count = _count(mesh, other)
    ends = near.bearing.shape[1] * count + 1
    bearing = (near.bearing[:, :1] - 0.5 + jnp.arange(ends) / count) * mesh.bearing_step
    x, y = first.pair.position(mesh.delay(near.delay[:, :, None]), bearing[:, None, :])
    delay, beam = measured(second, x, y)
    middle = near.delay.shape[1] // 2
    central = beam[:, middle, :-1]
    aside = jnp.stack(
        [around(beam[..., side] - central[:, None], other.around) for side in (slice(-1), slice(1, None))]
    )
    wide = jnp.abs(aside).max(axis=(0, 2))
    both = jnp.stack([delay[..., :-1], delay[..., 1:]])
    low, high = both.min(axis=(0, 2)), both.max(axis=(0, 2))
    swath = [steps // 2 for steps in second.near.log_ratio.shape[1:]]
    place, bearings = second.near.delay[:, swath[0]], second.near.bearing[:, swath[1]]
    crossed = (low[..., None] <= place + swath[0] + 0.5) & (high[..., None] >= place - swath[0] - 0.5)
    off = around(bearings - central[..., None], other.around)
    crossed = crossed & (jnp.abs(off) <= swath[1] + 0.5 + wide[..., None])
    crossed = crossed & first.there[:, None, None] & second.there
    if mesh.sonar.doppler is not None and other.sonar.doppler is not None:
        crossed = crossed & _both_shifts(first, second, x[:, middle, :-1], y[:, middle, :-1])
    return Parts(delay, beam, crossed)


def _both_shifts(first: Excess, second: Excess, x: Real, y: Real) -> Bool[Array, "return part other"]:
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
    allowed = (
        rest + swaths[1] + jnp.abs(along) * swaths[0] + BENT * (jnp.abs(qx) * reach[0] + jnp.abs(qy) * reach[1]) + 1
    )
    mine, other = (each.near.doppler[:, each.near.doppler.shape[1] // 2] for each in (first, second))
    off = (other - shifts[1][..., None]) - (along * (mine[:, None] - shifts[0]))[..., None]
    return jnp.abs(off) <= allowed[..., None]


def _pieces(
    first: Excess,
    second: Excess,
    parts: Parts,
    which: tuple[Int[Array, " part"], Int[Array, " part"], Int[Array, " part"]],
    there: Bool[Array, " part"],
    cuts: int,
) -> Pieces:
    """Pieces of some parts, cut at the delays of the second pair's mesh points.

    Parameters
    ----------
    first, second, parts : of both pairs.
    which : return of the first pair, part of its bearings, return of the second pair.
    there : whether a part counts.
    cuts : pieces from one mesh point of the second delay to the next.
    """
    mine, part, other = which
    mesh, count, swath = first.mesh, _count(first.mesh, second.mesh), second.near.delay.shape[1]
    begin, end = (parts.delay[mine, :, part + side][..., None] for side in (0, 1))
    low = jnp.minimum(begin, end)
    high = jnp.maximum(jnp.maximum(begin, end), low + NARROW)
    start = second.near.delay[other, 0][:, None, None]
    # Counted from the lower edge of the swath, a cut each.
    cut = jnp.maximum(jnp.floor((low - start + 0.5) * cuts).astype(jnp.int32), 0)
    cut = cut + jnp.arange(_passed(mesh, second.mesh, swath, cuts))
    edge = start - 0.5 + cut / cuts
    upper, lower = jnp.minimum(high, edge + 1 / cuts), jnp.maximum(low, edge)
    share = jnp.maximum(upper - lower, 0) / (high - low) / count
    step, middle = end - begin, (upper + lower) / 2
    sloped = jnp.abs(step) > NARROW
    fraction = jnp.clip(jnp.where(sloped, (middle - begin) / jnp.where(sloped, step, 1), 0.5), 0, 1)
    place = (part[:, None, None] + fraction) / count - 0.5
    bearing = (first.near.bearing[mine, 0][:, None, None] + place) * mesh.bearing_step
    x, y = first.pair.position(mesh.delay(first.near.delay[mine][..., None]), bearing)
    cell, on_grid = mesh.cell(x, y)

    _, beam = measured(second, x, y)
    half, bearings = second.near.bearing.shape[1] // 2, second.near.bearing.shape[1]
    off = around(beam - second.near.bearing[other, half][:, None, None], second.mesh.around)
    along, side = cut // cuts, jnp.floor(off + 0.5).astype(jnp.int32) + half
    inside = (along < swath) & (side >= 0) & (side < bearings) & on_grid & there[:, None, None]
    area = jnp.where(inside, share, 0) * first.area[mine, :, part // count][..., None]
    weighed = (area > 0)[..., None]
    delays = jnp.arange(first.near.delay.shape[1])[:, None]
    told = interpolated(first.near.log_ratio, (mine[:, None, None], delays), place)
    own = first.log_excess[mine, :, part // count][:, :, None, :] > -jnp.inf
    log_first = log_over(told, first.default[mine], weighed & own)
    told = near_return(second, other[:, None, None], middle, beam)
    own = second.log_excess[other[:, None, None], jnp.clip(along, 0, swath - 1), jnp.clip(side, 0, bearings - 1)]
    log_second = log_over(told, second.default[other], weighed & (own > -jnp.inf))

    def spread(values: Int[Array, "part shift"]) -> Int[Array, "part delay piece shift"]:
        return jnp.broadcast_to(values[:, None, None], (*area.shape, values.shape[-1]))

    shifts = spread(first.near.doppler[mine]), spread(second.near.doppler[other])
    pieces = Pieces(x, y, cell, area, log_first, log_second, shifts)
    return jax.tree.map(lambda each: each.reshape(area.size, *each.shape[area.ndim :]), pieces)


def _of_velocities(
    excesses: Sequence[Excess],
    which: tuple[int, int],
    pieces: Pieces,
    profiles: list[Real],
    peak: Float[Array, " piece"],
) -> Float[Array, "piece velocity"]:
    """Area times both excesses of the pieces in every velocity cell, with what the other pairs say, over a peak."""
    first, second = (excesses[number] for number in which)
    highest = _highest(pieces.log_first), _highest(pieces.log_second)
    mine, other = (
        jnp.exp(logs - top[..., None]) for logs, top in zip((pieces.log_first, pieces.log_second), highest, strict=True)
    )
    scale, x, y, cell = highest[0] + highest[1] - peak, pieces.x, pieces.y, pieces.cell
    strips = strips_of((first.mesh, second.mesh), (first.pair, second.pair), x, y, pieces.shifts)
    beside: Any = jnp.ones(())
    for number, each in enumerate(excesses):
        if number in which:
            continue
        quiet = each.quiet_at(x, y, cell)
        if number < which[1]:
            beside = beside * quiet[..., None, None, :]
            continue
        profile = profiles[number - which[1] - 1]
        top = jnp.maximum(profile.max(axis=-1), 0)
        scale = scale + top
        quiet = quiet[..., None, None, :] * jnp.exp(-top)[..., None, None, None]
        read = strips.read(each.mesh, each.pair, profile - top[..., None], x, y)
        beside = beside * (quiet + read)
    weighed = jnp.where(pieces.area > 0, pieces.area * jnp.exp(scale), 0)
    both = mine[..., :, None, None] * other[..., None, :, None] * strips.shares
    return weighed[..., None] * jnp.sum(both * beside, axis=(-3, -2))


def _highest(logs: Real) -> Real:
    """Largest along the last axis, finite."""
    top = logs.max(axis=-1)
    return jnp.where(top > -jnp.inf, top, 0)


def _step(mesh: Mesh) -> float:
    """From one mesh point of the delay to the next; s."""
    return mesh.sonar.delay.step / mesh.finer[0]
