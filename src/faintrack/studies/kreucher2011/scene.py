r"""The paper's synthetic experiment: two lines of hydrophones, three targets, two of which pass close.

Printed: arrays at (0, 0) and (700, 0) m, beams 1 degree apart, 4 x 4 detectors of 26 x 21 x 26 x 21 cells of 25 m and
1 m/s, two of the three starts, one joint stretch (scans 146 to 188). Chosen, as the paper does not say: arrays that
point east; the region, 0 to 1500 m east and 200 to 1700 m north; scans a second apart; an acceleration of 0.05 m/s per
root second, of the targets as of the tracker; energies of beams with unit noise, which a target raises by `LEVEL`;
detectors that hand over at a probability of 0.9; targets that are declared at an existence of 0.999; the third start,
(1125, 800) m.

Targets move at a nearly constant velocity, drawn anew for every run; their starting velocities are such that they are
where `AIMS` says at scan 167, the middle of the paper's stretch. There the first and the third are 8 m from each other,
less than half a beam, and differ in velocity by about 1.8 m/s: they are in the same beams for tens of scans.

Two arrays cannot tell two targets from the two places where their beams cross otherwise, if both places are in the
region. Here one place of each pair is outside when the targets appear. What happens where both are inside shows with
more targets (`crowd`) and with two that move side by side (`side_by_side`).
"""

import functools
import math

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.beliefs.axis import Axis, between
from faintrack.likelihoods.beam_energies import ELSEWHERE, BeamEnergies
from faintrack.sensors.stations import EnergyScan, Fans, Stations
from faintrack.simulation.energies import draw_energies
from faintrack.targets.motion import PlanarMotion
from faintrack.targets.states import PlanarState
from faintrack.trackers.several import SeveralTargetsTracker, region_tracker

SCANS, MEETING = 220, 167
"""Scans of a run, a second apart, and the one at which two targets meet."""

LEVEL = 3.0
"""Mean energy of a beam with a target, in standard deviations of the noise."""

LEVELS = (2.0, 2.5, 3.0, 3.5, 4.0)
"""How loud targets are where that is varied."""

DECLARE = 0.999
"""Existence at which a target is declared."""

NOISE = 0.05
"""Density of the acceleration of targets; m/s per root second."""

STARTS = ((900.0, 1000.0), (1200.0, 500.0), (1125.0, 800.0))
"""East and north of the targets; m."""

AIMS = ((482.5, 1133.6), (1033.0, 800.6), (482.5, 1141.6))
"""Where they are at the meeting; m."""

CLOSE = (0, 2)
"""The targets that meet."""

REGION = (0.0, 1500.0), (200.0, 1700.0)
"""East and north ends; m."""

CELL, CELLS, SPEED = 25.0, (26, 26), between(-10.5, 10.5, 21)
"""Of a detector: side of a cell, m; cells; velocities, m/s."""

COARSE = between(-10.5, 10.5, 7)
"""Velocities of a detector where runs are many; m/s."""

BOX = (25.0, 675.0), (700.0, 1350.0)
"""East and north ends of one detector by itself; m."""

CROWD, CROWD_SCANS = 10, 80
"""Most targets at once, and scans of runs with so many."""

ARRIVAL, DEPARTURE = 1e-4, 1e-3
"""Of targets; per second."""

DEGREE = math.radians(1)

FANS = Fans((0.0, 0.0), (DEGREE, DEGREE), (180, 180), (True, True))


def stations() -> Stations:
    """Where the two arrays stand."""
    return Stations(jnp.array([0.0, 700.0]), jnp.zeros(2), jnp.full(2, math.pi / 2))


def likelihood(level: Array | float = LEVEL, elsewhere: float = 0.0) -> BeamEnergies:
    """Of beams with unit noise."""
    return BeamEnergies(FANS, present_mean=jnp.reshape(jnp.asarray(level, float), (1,)), elsewhere=elsewhere)


def tracker(
    level: Array | float = LEVEL,
    separate: bool = False,
    speed: Axis = SPEED,
    slots: int = 8,
    region: tuple[tuple[float, float], tuple[float, float]] = REGION,
    detectors: tuple[int, int] = (4, 4),
) -> SeveralTargetsTracker:
    """The paper's tracker, or that of another region; it allows for sources from elsewhere, of which there are none."""
    return region_tracker(
        likelihood(level, ELSEWHERE),
        *region,
        detectors=detectors,
        cells=CELLS,
        cell=CELL,
        speed=speed,
        velocity_noise=NOISE,
        interval=1.0,
        arrival_rate=ARRIVAL,
        departure_rate=DEPARTURE,
        slots=slots,
        separate=separate,
        declare=DECLARE,
    )


def times(scans: int = SCANS) -> Float[Array, " scan"]:
    """Of the scans; s."""
    return jnp.arange(1.0, scans + 1)


@functools.partial(jax.jit, static_argnames="scans")
def paths(
    key: PRNGKeyArray, starts: Float[Array, "target 2"], velocities: Float[Array, "target 2"], scans: int
) -> PlanarState:
    """Paths of targets at a nearly constant velocity; components have the shape (scan, target)."""
    begin = PlanarState(*starts.T, *velocities.T)
    motion = PlanarMotion(NOISE)

    def step(states: PlanarState, key: PRNGKeyArray) -> tuple[PlanarState, PlanarState]:
        moved = motion.move(states, 1.0, key)
        return moved, moved

    return jax.lax.scan(step, begin, jax.random.split(key, scans))[1]


def truth(key: PRNGKeyArray) -> PlanarState:
    """Paths of the three targets, which start where the paper says and aim for the meeting."""
    starts, aims = jnp.array(STARTS), jnp.array(AIMS)
    drawn = paths(key, starts, (aims - starts) / MEETING, SCANS)
    # Another starting velocity moves a path by a straight line: by the one from where it came to its aim.
    added_x = (aims[:, 0] - drawn.x[MEETING - 1]) / MEETING
    added_y = (aims[:, 1] - drawn.y[MEETING - 1]) / MEETING
    time = times()[:, None]
    return PlanarState(drawn.x + added_x * time, drawn.y + added_y * time, drawn.vx + added_x, drawn.vy + added_y)


def crowd(key: PRNGKeyArray) -> PlanarState:
    """Paths of `CROWD` targets from anywhere well within the region, in any direction, at 1 to 3 m/s."""
    for_start, for_course, for_path = jax.random.split(key, 3)
    starts = jax.random.uniform(for_start, (CROWD, 2)) * 1000 + jnp.array([250.0, 450.0])
    speed, course = jax.random.uniform(for_course, (2, CROWD))
    speed, course = 1 + 2 * speed, 2 * jnp.pi * course
    return paths(for_path, starts, jnp.stack([speed * jnp.sin(course), speed * jnp.cos(course)], 1), CROWD_SCANS)


def side_by_side(beams: Array | float) -> PlanarState:
    """Paths of two targets that move straight on beside each other, so many beams apart as the arrays see them."""
    time = times(CROWD_SCANS)[:, None]
    apart = 1000 * jnp.tan(beams * DEGREE) * jnp.array([-0.5, 0.5])
    still = jnp.zeros((CROWD_SCANS, 2))
    return PlanarState(350 + apart - 0.5 * (time - 40), 1000 + 0.5 * (time - 40) + still, still - 0.5, still + 0.5)


def scans(
    key: PRNGKeyArray, states: PlanarState, level: Array | float = LEVEL, present: Array | bool = True
) -> EnergyScan:
    """Energies of the beams of both arrays; `states` as `paths` has them."""
    shape = states.x.shape
    return draw_energies(key, likelihood(level), times(shape[0]), stations(), states, jnp.broadcast_to(present, shape))
