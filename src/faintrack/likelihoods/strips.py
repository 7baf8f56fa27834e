r"""Shares of velocity cells that lie in strips of two pairs' Doppler shifts.

A Doppler mesh point is a strip of velocities across the gradient of the shift. Of a velocity cell the strip of the
first pair has a share as in `faintrack.likelihoods.mesh`. Along the middle of that strip within the cell the shift of
the second pair is linear, from :math:`\nu_-` to :math:`\nu_+` in mesh points, and the strip n of the second pair has
the part

.. math:: \frac{\left| [\nu_-, \nu_+] \cap [n - \tfrac12, n + \tfrac12] \right|}{\nu_+ - \nu_-}

of it. Strips of one direction, as those of receivers in one place, are no special case.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from faintrack.likelihoods.mesh import NARROW, Mesh
from faintrack.sensors.bistatic import Bistatic
from faintrack.targets.states import PlanarState

Real = Float[Array, "..."]


class Shifts(NamedTuple):
    """Doppler shifts of the velocity cells at places, in mesh points.

    Attributes
    ----------
    middle : of the velocity in the middle of each cell.
    slope_x, slope_y : change over half a cell in vx and vy.
    """

    middle: Float[Array, "*place velocity"]
    slope_x: Float[Array, "*place 1"]
    slope_y: Float[Array, "*place 1"]


def shifts_of(mesh: Mesh, pair: Bistatic, x: Real, y: Real) -> Shifts:
    """Doppler shifts of a pair at places.

    Parameters
    ----------
    mesh, pair : of the pair; its sonar measures Doppler.
    x, y : places; m.
    """
    doppler, frequency = mesh.sonar.doppler, mesh.sonar.pulse.frequency
    assert doppler is not None
    here = PlanarState(x[..., None], y[..., None], *mesh.velocities)
    slopes = pair.doppler_gradient(here, frequency)
    finer = mesh.finer[2]
    slope_x, slope_y = (
        slope * (finer * mesh.axes[name].step / doppler.step / 2)
        for name, slope in zip(("vx", "vy"), slopes, strict=True)
    )
    return Shifts(jnp.asarray(doppler.place(pair.doppler(here, frequency))) * finer, slope_x, slope_y)


class Strips(NamedTuple):
    """Parts of velocity cells in strips of two pairs.

    Attributes
    ----------
    shares : of the cell.
    along_x, along_y : middles of the parts, in half cells from the middle of the cell; None where no pair has strips.
    """

    shares: Float[Array, "*place strip other velocity"]
    along_x: Float[Array, "*place strip other velocity"] | None
    along_y: Float[Array, "*place strip other velocity"] | None

    def read(self, mesh: Mesh, pair: Bistatic, profile: Real, x: Real, y: Real) -> Real:
        """What another pair has in the parts: its ratio in their middles, by straight lines of its logarithm.

        Parameters
        ----------
        mesh, pair : of the other pair.
        profile : log of its ratio at each place, from the first Doppler point in a bin of the sonar to the last.
        x, y : places; m.
        """
        if mesh.sonar.doppler is None:
            return jnp.exp(profile)[..., None, None, :]
        low, count = mesh.first(2), mesh.count(2)
        if self.along_x is None or self.along_y is None:
            edges = low + jnp.arange(count + 1) - 0.5
            shares = mesh.shares(mesh.spread(pair, x, y), edges)
            return jnp.einsum("...n,...nv->...v", jnp.exp(profile), shares)[..., None, None, :]
        shifts = shifts_of(mesh, pair, x, y)
        middle, slope_x, slope_y = (each[..., None, None, :] for each in shifts)
        shift = middle + slope_x * self.along_x + slope_y * self.along_y - low
        before = jnp.clip(jnp.floor(shift), 0, max(count - 2, 0)).astype(jnp.int32)
        share = jnp.clip(shift - before, 0, 1)

        def at(number: Int[Array, "..."]) -> Real:
            flat = jnp.minimum(number, count - 1).reshape(*profile.shape[:-1], -1)
            return jnp.take_along_axis(profile, flat, axis=-1).reshape(number.shape)

        ends = at(before), at(before + 1)
        # At the end of a swath there is one of the two.
        near = jnp.where(share < 0.5, *ends)
        both = jnp.minimum(*ends) > -jnp.inf
        between = jnp.where(both, ends[0], 0) * (1 - share) + jnp.where(both, ends[1], 0) * share
        inside = (shift >= -0.5) & (shift < count - 0.5)
        return jnp.where(inside, jnp.exp(jnp.where(both, between, near)), 0)


def strips_of(
    meshes: tuple[Mesh, Mesh],
    pairs: tuple[Bistatic, Bistatic],
    x: Real,
    y: Real,
    points: tuple[Int[Array, "place strip"], Int[Array, "place other"]],
) -> Strips:
    """Parts of velocity cells at places.

    Parameters
    ----------
    meshes, pairs : of both pairs.
    x, y : places; m.
    points : consecutive Doppler points of both pairs, at every place.
    """
    measured = [mesh.sonar.doppler is not None for mesh in meshes]
    if not any(measured):
        return Strips(jnp.ones((*x.shape, 1, 1, 1)), None, None)
    which = 0 if measured[0] else 1
    mesh, pair = meshes[which], pairs[which]
    edges = points[which][:, :1] + jnp.arange(points[which].shape[1] + 1) - 0.5
    shares = mesh.shares(mesh.spread(pair, x, y), edges)
    shifts = shifts_of(mesh, pair, x, y)
    line = _line(shifts, points[which])
    if not all(measured):
        middles = [(begin + end) / 2 for begin, end in line]
        apart = -2 if which == 0 else -3
        return Strips(*(jnp.expand_dims(each, apart) for each in (shares, *middles)))
    other = shifts_of(meshes[1], pairs[1], x, y)
    ends = [
        other.middle[..., None, :] + other.slope_x[..., None, :] * along_x + other.slope_y[..., None, :] * along_y
        for along_x, along_y in zip(*line, strict=True)
    ]
    low, high = jnp.minimum(*ends), jnp.maximum(*ends)
    high = jnp.maximum(high, low + NARROW)
    number = points[1][:, None, :, None]
    lower, upper = jnp.maximum(low[..., None, :], number - 0.5), jnp.minimum(high[..., None, :], number + 0.5)
    parts = jnp.maximum(upper - lower, 0) / (high - low)[..., None, :]
    step = ends[1] - ends[0]
    wide = jnp.abs(step) > NARROW
    fraction = jnp.where(
        wide[..., None, :],
        ((lower + upper) / 2 - ends[0][..., None, :]) / jnp.where(wide, step, 1)[..., None, :],
        0.5,
    )
    middles = [begin[..., None, :] + fraction * (end - begin)[..., None, :] for begin, end in line]
    return Strips(shares[..., None, :] * parts, middles[0], middles[1])


def _line(shifts: Shifts, number: Int[Array, "place strip"]) -> tuple[tuple[Real, Real], tuple[Real, Real]]:
    """Ends of the middle line of strips in velocity cells, along vx and along vy; its nearest corner where it is
    outside."""
    steep = jnp.abs(shifts.slope_x) >= jnp.abs(shifts.slope_y)
    large = jnp.where(steep, shifts.slope_x, shifts.slope_y)[..., None, :]
    small = jnp.where(steep, shifts.slope_y, shifts.slope_x)[..., None, :]
    large = jnp.where(jnp.abs(large) > NARROW, large, NARROW)
    small = jnp.where(jnp.abs(small) > NARROW, small, NARROW)
    reach = jnp.abs(large) + jnp.abs(small)
    off = jnp.clip(number[..., None] - shifts.middle[..., None, :], -reach, reach)
    # Along the steeper component the line leaves the cell where the other one is at these.
    ends = [jnp.clip((off + side * jnp.abs(large)) / small, -1, 1) for side in (-1, 1)]
    others = [jnp.clip((off - small * end) / large, -1, 1) for end in ends]
    chosen = steep[..., None, :]
    along_x = [jnp.where(chosen, other, end) for end, other in zip(ends, others, strict=True)]
    along_y = [jnp.where(chosen, end, other) for end, other in zip(ends, others, strict=True)]
    return (along_x[0], along_x[1]), (along_y[0], along_y[1])
