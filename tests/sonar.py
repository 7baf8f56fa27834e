"""A small active sonar, and its likelihood written down again: every bin, one by one, in double precision."""

import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from faintrack.axis import Axis, between
from faintrack.grids import Grid
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
    return likelihood.log_ratio(ping, states)


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
    sonar: ActiveSonar, snr: float, threshold: float, bins: np.ndarray, power: np.ndarray, place: np.ndarray
) -> np.ndarray:
    """Log ratio of the returns for echoes at places in bins (echo, 3): appendix of aughenbaugh2010, eq. 25-29."""
    place = np.asarray(place, float)
    likelihoods = []
    for mean in (1 + snr * responses(sonar, place), np.ones((len(place), *sonar.shape))):
        below = 1 - np.exp(-threshold / mean)
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
