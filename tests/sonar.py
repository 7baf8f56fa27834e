"""A small active sonar, and its likelihood written down again: every bin, one by one, in double precision."""

import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from faintrack.beliefs.axis import Axis, between
from faintrack.beliefs.grids import Grid
from faintrack.likelihoods.protocols import log_ratios
from faintrack.sensors.active import ActiveSonar, Ping, Pulse
from faintrack.sensors.bistatic import Bistatic, fixed
from faintrack.targets.states import PlanarState

SOUND_SPEED = 1500.0
SOURCE, RECEIVER = (300.0, -400.0), (-200.0, 500.0)
"""Metres; 1,030 m apart."""


def pair() -> Bistatic:
    """Made anew, so that it has the precision of the test."""
    return Bistatic(fixed(*SOURCE), fixed(*RECEIVER), SOUND_SPEED)


BEAM_WIDTH = 3 * (math.pi / 4) / math.pi
"""Radians. The response vanishes three beams away: where the reach ends it does not jump."""


def tone(**options: Any) -> ActiveSonar:
    """Delay, bearing and Doppler; an axis of delay longer than what an echo reaches, one of Doppler shorter."""
    known = {"pair": pair(), "reach": (3, 3, 7)} | options
    return ActiveSonar(Pulse(500.0, 1.0, factor=1.0), Axis(2.0, 0.4, 12), 8, BEAM_WIDTH, Axis(-6.0, 2.0, 7), **known)


def sweep(**options: Any) -> ActiveSonar:
    """Delay and bearing."""
    known = {"pair": pair(), "reach": (6, 3, 0)} | options
    return ActiveSonar(Pulse(500.0, 1.0, 4.0), Axis(2.0, 0.2, 24), 8, BEAM_WIDTH, None, **known)


SONARS = {"tone": tone, "sweep": sweep}
AXES = {
    "x": between(-5e3, 4e3, 9),
    "y": between(-4e3, 5e3, 7),
    "vx": between(-12.0, 12.0, 3),
    "vy": between(-12.0, 12.0, 4),
}


def grid(*names: str) -> Grid:
    return Grid(PlanarState, tuple((name, AXES[name]) for name in names or AXES))


def planar(x: Any, y: Any, vx: Any = 0.0, vy: Any = 0.0) -> PlanarState:
    return PlanarState(*(jnp.asarray(each, float) for each in np.broadcast_arrays(x, y, vx, vy)))


@eqx.filter_jit
def log_ratio(likelihood: Any, ping: Ping, states: Any = None) -> jax.Array:
    return log_ratios(likelihood, ping, states)


def responses(sonar: ActiveSonar, place: np.ndarray) -> np.ndarray:
    """aughenbaugh2010, eq. 9-12, in every bin: shape (echo, delay, beam, Doppler) from places in bins (echo, 3)."""
    pulse, step = sonar.pulse, 0.0 if sonar.doppler is None else sonar.doppler.step
    off = [np.asarray(place, float)[:, axis, None] - np.arange(count) for axis, count in enumerate(sonar.shape)]
    off[1] = (off[1] + sonar.beams / 2) % sonar.beams - sonar.beams / 2
    tau, phi = off[0] * sonar.delay.step, off[1] * 2 * np.pi / sonar.beams
    tau, phi, nu = tau[:, :, None, None], phi[:, None, :, None], (off[2] * step)[:, None, None, :]
    inside = np.where(np.abs(tau) < pulse.duration, 1 - np.abs(tau) / pulse.duration, 0)
    argument = pulse.factor * (nu - tau * pulse.bandwidth / pulse.duration) * pulse.duration * inside
    heard = (inside * np.sinc(argument / np.pi)) ** 2 * np.sinc(phi / sonar.beam_width / np.pi) ** 2
    near = [np.abs(each) <= reach for each, reach in zip(off, sonar.reach, strict=True)]
    return heard * (near[0][:, :, None, None] & near[1][:, None, :, None] & near[2][:, None, None, :])


def every_bin(
    sonar: ActiveSonar,
    snr: float,
    threshold: float,
    bins: np.ndarray,
    power: np.ndarray,
    place: np.ndarray,
    rate: np.ndarray | None = None,
) -> np.ndarray:
    """Log ratio of the returns for echoes at places in bins (echo, 3): appendix of aughenbaugh2010, eq. 25-29.

    In a background that exceeds the threshold at a `rate` in every bin a target lowers the probability that the bin is
    quiet as much as in noise of mean 1.
    """
    place = np.asarray(place, float)
    likelihoods = []
    for mean in (1 + snr * responses(sonar, place), np.ones((len(place), *sonar.shape))):
        below = 1 - np.exp(-threshold / mean)
        below = below if rate is None else below / (1 - np.exp(-threshold)) * (1 - rate)
        empty = np.log(below).sum(axis=(1, 2, 3))
        mean, below = (each[:, *np.asarray(bins, int).reshape(-1, 3).T] for each in (mean, below))
        given = (threshold - np.asarray(power)) / mean - np.log(mean)
        likelihoods.append(empty + (np.log((1 - below) / below) + given).sum(axis=1))
    ends = np.array(sonar.shape)[[0, 2]] - 0.5
    heard = ((place[:, [0, 2]] >= -0.5) & (place[:, [0, 2]] < ends)).all(axis=1)
    return np.where(heard, likelihoods[0] - likelihoods[1], 0.0)


def states_at(sonar: ActiveSonar, place: np.ndarray) -> PlanarState:
    """Targets whose echoes fall on places in bins (echo, 3), moving along the bisector of the two directions."""
    place = np.asarray(place, float)
    path = SOUND_SPEED * (sonar.delay.first + sonar.delay.step * place[:, 0])
    bearing = 2 * np.pi / sonar.beams * place[:, 1]
    # The range at which both legs add up to the path, by bisection.
    low, high = np.zeros(len(place)), path
    for _ in range(200):
        middle = (low + high) / 2
        x, y = RECEIVER[0] + middle * np.cos(bearing), RECEIVER[1] + middle * np.sin(bearing)
        short = middle + np.hypot(x - SOURCE[0], y - SOURCE[1]) < path
        low, high = np.where(short, middle, low), np.where(short, high, middle)
    directions = np.zeros((2, len(place)))
    for begin in (SOURCE, RECEIVER):
        east, north = x - begin[0], y - begin[1]
        directions += np.array([east, north]) / np.hypot(east, north)
    # Along the bisector both directions see the same speed v: (c - v) / (c + v) = 1 + nu / f.
    along = directions / np.hypot(*directions)
    cosine = np.hypot(*directions) / 2
    shift = 0.0 if sonar.doppler is None else sonar.doppler.first + sonar.doppler.step * place[:, 2]
    ratio = 1 + shift / sonar.pulse.frequency
    speed = SOUND_SPEED * (1 - ratio) / (1 + ratio) / cosine
    return planar(x, y, *(speed * along))


def ranges(source: tuple[float, float], receiver: tuple[float, float], path: Any, bearing: Any) -> np.ndarray:
    """aughenbaugh2010, eq. 15; 0 before the direct sound."""
    apart, psi = math.dist(source, receiver), math.atan2(source[1] - receiver[1], source[0] - receiver[0])
    share = apart / np.maximum(path, 1e-9)
    with np.errstate(invalid="ignore"):
        found = path / 2 * (1 - share**2) / (1 - share * np.cos(bearing - psi))
    return np.where(path > apart, found, 0.0)


def mesh_points(mesh: Any, source: tuple[float, float], receiver: tuple[float, float]) -> tuple[np.ndarray, ...]:
    """Numbers of delay and bearing of all points from the direct sound to far beyond the grid, their position cell, -1
    where they lie in none, and their area."""
    step = mesh.sonar.delay.step / mesh.finer[0]
    apart = math.dist(source, receiver)
    first = math.ceil((apart / SOUND_SPEED - mesh.sonar.delay.first) / step - 1e-9)
    number = np.arange(first, first + math.ceil(60e3 / SOUND_SPEED / step))[:, None]
    beam = np.arange(mesh.finer[1] * mesh.sonar.beams)
    bearing = beam * (2 * np.pi / len(beam))

    def at(number: np.ndarray) -> np.ndarray:
        return ranges(source, receiver, SOUND_SPEED * (mesh.sonar.delay.first + step * number), bearing)

    area = np.pi / len(beam) * (at(number + 0.5) ** 2 - at(number - 0.5) ** 2)
    x, y = receiver[0] + at(number) * np.cos(bearing), receiver[1] + at(number) * np.sin(bearing)
    # Places are told apart to a micrometre: what lies on an edge lies in the cell above.
    column, row = (
        np.searchsorted(AXES[name].edges.round(6), each.round(6), side="right") - 1
        for name, each in (("x", x), ("y", y))
    )
    shape = AXES["x"].count, AXES["y"].count
    inside = (column >= 0) & (column < shape[0]) & (row >= 0) & (row < shape[1])
    cell = np.where(inside, column * shape[1] + row, -1)
    number, beam = np.broadcast_arrays(number, beam)
    return number.ravel(), beam.ravel(), cell.ravel(), area.ravel()


def count_points(mesh: Any, source: tuple[float, float], receiver: tuple[float, float]) -> tuple[np.ndarray, ...]:
    """Area of all points in every position cell, and of those in bins of the sonar."""
    number, _, cell, area = mesh_points(mesh, source, receiver)
    nearest = np.floor(number / mesh.finer[0] + 0.5)
    heard = (nearest >= 0) & (nearest < mesh.sonar.shape[0])
    shape = AXES["x"].count, AXES["y"].count
    return tuple(
        np.bincount(cell[chosen], area[chosen], shape[0] * shape[1]).reshape(shape)
        for chosen in (cell >= 0, (cell >= 0) & heard)
    )


def shares(sonar: ActiveSonar, pair: Bistatic, x: Any, y: Any, edges: np.ndarray) -> np.ndarray:
    """Share of the velocity cells, vy fastest, between Doppler shifts in bins: shape (place, strip, velocity).

    The shift is linear in a cell of velocities, so that it is the sum of two uniform numbers; its distribution function
    is a second difference of squares.
    """
    x, y = (np.asarray(each, float).ravel()[:, None] for each in (x, y))
    if sonar.doppler is None:
        return np.ones((len(x), len(edges) - 1, 1))
    vx, vy = (each.ravel() for each in np.meshgrid(AXES["vx"].values, AXES["vy"].values, indexing="ij"))
    frequency, step = sonar.pulse.frequency, sonar.doppler.step
    middle = (np.asarray(pair.doppler(planar(x, y, vx, vy), frequency)) - sonar.doppler.first) / step
    slopes = pair.doppler_gradient(planar(x, y), frequency)
    a, b = (
        np.maximum(np.abs(np.asarray(each)) * AXES[name].step / step / 2, 1e-3)[:, None]
        for name, each in zip(("vx", "vy"), slopes, strict=True)
    )
    off = edges[:, None] - middle[:, None, :]
    corners = [(1, a + b), (-1, a - b), (-1, b - a), (1, -a - b)]
    below = sum(sign * np.maximum(off + corner, 0) ** 2 for sign, corner in corners) / (8 * a * b)
    below = np.where(off <= -a - b, 0.0, np.where(off >= a + b, 1.0, below))
    return np.diff(below, axis=1)


def mean_ratios(
    guided: Any,
    source: tuple[float, float],
    receiver: tuple[float, float],
    bins: np.ndarray,
    power: np.ndarray,
    rate: np.ndarray | None = None,
) -> np.ndarray:
    """Mean ratio of the cells, shape (x, y, velocity): the sum over all points of the mesh, one by one.

    aughenbaugh2010, eq. 20: points in the swath of a return have their ratio, others the mean of what they have without
    returns, those that are not heard 1. Velocities of the others are told apart at the middle of the cell.
    """
    likelihood, mesh, swath = guided.likelihood, guided.mesh, guided.swath
    sonar, finer, pair = mesh.sonar, np.array(mesh.finer), Bistatic(fixed(*source), fixed(*receiver), SOUND_SPEED)

    def ratios(bins: np.ndarray, power: np.ndarray, number: np.ndarray) -> np.ndarray:
        """At points of the mesh, shape (point, 3)."""
        snr, threshold, place = float(likelihood.snr), likelihood.threshold, number / finer
        return sum(
            chance * np.exp(every_bin(sonar, snr * level, threshold, bins, power, place, rate))
            for level, chance in likelihood.fading
        )

    none = np.zeros((0, 3), int)
    doppler = np.arange(sonar.shape[2] * finer[2]) + math.ceil(-finer[2] / 2)
    inside = np.stack(np.meshgrid(*map(np.arange, finer[:2]), doppler, indexing="ij"), axis=-1)
    inside[..., 0] += finer[0] * (sonar.shape[0] // 2)
    default = ratios(none, none[:, 0], inside.reshape(-1, 3)).reshape(-1, len(doppler)).mean(axis=0)

    delay, beam, cell, area = mesh_points(mesh, source, receiver)
    delay, beam, cell, area = (each[cell >= 0] for each in (delay, beam, cell, area))
    number = np.stack(np.broadcast_arrays(delay[:, None], beam[:, None], doppler), axis=-1)
    nearest = np.floor(number / finer + 0.5)
    heard = (nearest[..., 0] >= 0) & (nearest[..., 0] < sonar.shape[0])
    near = np.zeros(heard.shape, bool)
    for each in np.asarray(bins) * finer:
        off = np.abs(number - each)
        off[..., 1] = np.minimum(off[..., 1], mesh.around - off[..., 1])
        near |= heard & (off <= np.array(swath) * finer).all(axis=-1)
    points, strips = np.nonzero(near)
    told = ratios(bins, power, number[near])

    shape = AXES["x"].count * AXES["y"].count, len(mesh.velocities[0])
    edges = (np.append(doppler, doppler[-1] + 1) - 0.5) / finer[2]
    x, y = pair.position(mesh.delay(jnp.asarray(delay[points])), jnp.asarray(beam[points] * mesh.bearing_step))
    share = shares(sonar, pair, x, y, edges)[np.arange(len(points)), strips]
    sums = np.zeros((2, *shape))
    np.add.at(sums[0], cell[points], (area[points] * told)[:, None] * share)
    np.add.at(sums[1], cell[points], (area[points] * default[strips])[:, None] * share)
    total = np.bincount(cell, area, shape[0])
    in_bins = np.bincount(cell, area * heard[:, 0], shape[0])
    middle_x, middle_y = np.meshgrid(AXES["x"].values, AXES["y"].values, indexing="ij")
    with np.errstate(invalid="ignore", divide="ignore"):
        across = np.einsum("psv,s->pv", shares(sonar, pair, middle_x, middle_y, edges), default - 1)
        rest = 1 + (in_bins / total)[:, None] * across - sums[1] / total[:, None]
        found = sums[0] / total[:, None] + np.maximum(rest, 0)
    empty = np.flatnonzero(total == 0)
    vx, vy = (np.asarray(each) for each in mesh.velocities)
    here = planar(middle_x.ravel()[empty, None], middle_y.ravel()[empty, None], vx, vy)
    place = np.stack([np.asarray(each).ravel() for each in sonar.place(pair, here)], axis=-1)
    found[empty] = ratios(bins, power, place * finer).reshape(-1, shape[1])
    return found.reshape(AXES["x"].count, AXES["y"].count, -1)
