r"""The paper's example: a bistatic sonar, a target that comes into view, is blanked, comes back and leaves.

The source is at the origin, the receiver 5 km north of it (its fig. 3). A ping every 3 minutes; FM or CW. The target
starts at (-30, 25) km with (5.5, -4.125) m/s. By the published numbers it is in view in scans 11 to 29 and 34 to 51.
That is so for FM; the bins of CW, 0.42 s wide around their printed ends, hear it in scans 33 and 52 too.

Chosen, as the paper does not say: sound speed 1500 m/s; for the motion a relaxation time of 36,000 s and a velocity
with a standard deviation of 5 m/s; birth 0.01 and survival 0.99 a scan; the SNR of 9.5 dB is known to the tracker; a
target that leaves the grid comes back by the birth density. The beams' and pulses' responses are those of the paper,
with sin(x)/x without pi.
"""

import functools
import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PRNGKeyArray

from faintrack.beliefs.axis import Axis, between
from faintrack.beliefs.grids import Grid
from faintrack.filters.grid import GridFilter
from faintrack.filters.separable import separable
from faintrack.likelihoods.exceedances import ExceedanceLikelihood
from faintrack.sensors.active import ActiveSonar, Ping, Pulse
from faintrack.sensors.bistatic import Bistatic, fixed
from faintrack.simulation.active import capacity_for, draw_ping
from faintrack.targets.motion import OrnsteinUhlenbeck
from faintrack.targets.states import PlanarState
from faintrack.targets.target import Target, rates

SCANS, INTERVAL = 60, 180.0
"""Pings of a run, and seconds from one to the next."""

SNR_DB, THRESHOLD_DB = 9.5, {"fm": 10.0, "cw": 9.5}
"""Of the target, and of what is reported, over the mean noise power."""

BLANKED, LAST = 4.333, 34.05
"""Delays between which the sonar listens; s."""

POSITION, SPEED = 33e3, 12.0
"""Largest coordinate, m, and velocity component, m/s."""

BASE, FINE = (51, 7), (73, 11)
"""Cells along each axis of position, and of velocity."""

RELAXATION, SPREAD = 36_000.0, 5.0
"""Of the velocity: time in which it is forgotten, s, and standard deviation, m/s."""

BIRTH, SURVIVAL = 0.01, 0.99
"""Probabilities a scan."""

MOTION = OrnsteinUhlenbeck(SPREAD * math.sqrt(2 / RELAXATION), RELAXATION)


def grid(cells: tuple[int, int]) -> Grid:
    """Grid of so many cells in position and velocity."""
    place, rate = (between(-end, end, count) for end, count in zip((POSITION, SPEED), cells, strict=True))
    return Grid(PlanarState, (("x", place), ("y", place), ("vx", rate), ("vy", rate)))


@functools.cache
def likelihood(pulse: str) -> ExceedanceLikelihood:
    """Log ratio of the sonar's returns with "fm" or "cw" pulses."""
    # Runs are traced, and what they share is not part of them.
    with jax.ensure_compile_time_eval():
        pair, beams, width = Bistatic(fixed(0.0, 0.0), fixed(0.0, 5000.0)), 72, math.radians(5.0)
        listens = LAST - BLANKED
        if pulse == "fm":
            step = listens / 18_000
            delay = Axis(BLANKED + step / 2, step, 18_000)
            sonar = ActiveSonar(Pulse(2350.0, 1.0, 400.0, factor=1.0), delay, beams, width, None, pair)
        else:
            delay, doppler = Axis(BLANKED, listens / 71, 72), Axis(-40.0, 80.0 / 70, 71)
            sonar = ActiveSonar(Pulse(2575.0, 1.5, factor=1.0), delay, beams, width, doppler, pair, reach=(4, 6, 6))
        return ExceedanceLikelihood(sonar, _linear(SNR_DB), _linear(THRESHOLD_DB[pulse]))


@functools.cache
def filter_on(cells: tuple[int, int]) -> GridFilter:
    """The tracker on a grid, with kernels for each component."""
    # Runs are traced, and what they share is not part of them.
    with jax.ensure_compile_time_eval():
        on = grid(cells)
        return GridFilter(on, target(), separable(on, MOTION, INTERVAL), returns=True)


def target() -> Target:
    """What the tracker knows of arrival and departure."""
    return Target(None, MOTION, *rates(BIRTH, SURVIVAL, INTERVAL))


def times() -> np.ndarray:
    """Of the pings; s."""
    return INTERVAL * np.arange(SCANS)


def truth() -> PlanarState:
    """States of the target at every ping."""
    time = jnp.asarray(times(), jnp.float32)
    return PlanarState(-30e3 + 5.5 * time, 25e3 - 4.125 * time, jnp.full(SCANS, 5.5), jnp.full(SCANS, -4.125))


@functools.cache
def in_view(pulse: str) -> np.ndarray:
    """Whether the sonar can hear the target, scan by scan."""
    with jax.ensure_compile_time_eval():
        sonar = likelihood(pulse).sonar
        assert sonar.pair is not None
        delay, _, doppler = sonar.place(sonar.pair, truth())
        return np.asarray(sonar.heard(delay, doppler))


def blanked(pulse: str) -> np.ndarray:
    """Whether the target is in the blanked zone, scan by scan."""
    seen = np.flatnonzero(in_view(pulse))
    number = np.arange(SCANS)
    return (number > seen[0]) & (number < seen[-1]) & ~in_view(pulse)


def pings(key: PRNGKeyArray, pulse: str) -> tuple[Ping, jax.Array]:
    """Returns of all scans, and how many there were too many for their places."""
    model = likelihood(pulse)

    def one(key: PRNGKeyArray, time: jax.Array, state: PlanarState) -> tuple[Ping, jax.Array]:
        return draw_ping(key, model, capacity_for(model), time, state, True)

    return jax.vmap(one)(jax.random.split(key, SCANS), jnp.asarray(times(), jnp.float32), truth())


def _linear(db: float) -> float:
    return 10.0 ** (db / 10)
