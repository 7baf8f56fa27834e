r"""The periscope radar (stone2002, section 4.2): range profiles at 5 Hz, compound clutter, a target for ten seconds.

Ranges are in feet, the cells of the profile, and range rates in feet a second. The clutter tracker follows the level of
every cell, and the likelihood integrates out what it does not know. The target moves at any range rate, not at that of
a grid cell, and is at any place.

The paper gives cells, rates, intervals and probabilities. Chosen: a periscope appears in a cell of range *and* range
rate with 5e-8 a scan, 0.0025 in all; the level's gamma distribution has the shape 1; waves are 15 ft long (standard
deviation of their correlation), last 5 s and come in at 8 m/s, faster than any target; the target is exposed from 10 to
20 s, at any range rate up to 4 m/s; its power fluctuates, and its mean over that of the clutter, which the tracker
knows, is the setting's.

Another peak than the target's is one farther than 40 ft from its path, before it submerges: afterwards what it left at
wrong range rates fans out.
"""

import functools
from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.beliefs.axis import Axis
from faintrack.beliefs.belief import Belief
from faintrack.beliefs.grids import Grid, marginal
from faintrack.filters.grid import GridFilter
from faintrack.filters.run import step
from faintrack.filters.shifts import Shifts
from faintrack.likelihoods.clutter import ClutterLikelihood, absolute
from faintrack.sensors.cells import Cells
from faintrack.signal.clutter import ClutterScan, ClutterTracker
from faintrack.simulation.clutter import CompoundClutter, draw_scans
from faintrack.targets.states import RangeState
from faintrack.targets.target import Target, rates

FOOT = 0.3048
"""Metres."""

INTERVAL, SCANS, RANGES = 0.2, 150, 500
"""Seconds from scan to scan, scans, cells of a foot."""

RATES = Axis(-5.0 / FOOT, 0.1 / FOOT, 100)
"""Range rates, 0.1 m/s apart; ft/s."""

PRIOR, BIRTH = 5e-6, 5e-8
"""Probability of a target at first, in all; of one that appears, a state and scan."""

EXPOSED, SUBMERGED = 10.0, 20.0
"""When the periscope is up; seconds."""

SCR_DB = (0, 2, 4, 6, 8)
"""Mean power of the target over that of the clutter in its settings."""

FASTEST = 4.0 / FOOT
"""Of the targets drawn, outward or inward; ft/s."""

APART = 40.0
"""Feet from the target's path, prolonged to before its exposure, from which on a peak is another."""

CLUTTER = CompoundClutter(shape=1.0, length=15.0, duration=5.0, speed=-8.0 / FOOT)
CLUTTER_TRACKER = ClutterTracker(forget=0.5, neighbour=0.5, guard=1, train=4)


@dataclass(frozen=True)
class Scene:
    """Profile and filter, made once a process."""

    cells: Cells
    filter: GridFilter


@functools.cache
def scene() -> Scene:
    """The paper's grid with the simplified recursion."""
    # Runs are traced, and what they share is not part of them.
    with jax.ensure_compile_time_eval():
        ranges = Axis(0.0, 1.0, RANGES)
        grid = Grid(RangeState, (("range", ranges), ("range_rate", RATES)))
        target = Target(None, None, *rates(BIRTH * grid.size, 1.0, INTERVAL))
        return Scene(Cells((("range", ranges),)), GridFilter(grid, target, Shifts(grid, INTERVAL), simplified=True))


def follow(scans: ClutterScan, likelihood: ClutterLikelihood) -> tuple[Array, Array]:
    """Log of the likelihood ratio of every range, and of every range rate, after each scan (scan, cell)."""
    filter = scene().filter
    # Nothing is drawn: the key is never read.
    unused = jax.random.key(0)

    def take_in(belief: Belief, scan: ClutterScan) -> tuple[Belief, tuple[Array, Array]]:
        belief, _ = step(filter, likelihood, belief, scan, unused)
        over = [belief.log_odds + marginal(belief, filter.grid, name) for name in filter.grid.names]
        return belief, (over[0], over[1])

    return jax.lax.scan(take_in, filter.init(unused, existence=PRIOR), scans)[1]


def look(key: PRNGKeyArray, scr_db: Float[Array, ""] | float) -> dict[str, Array]:
    """Profiles, the likelihood ratios over range and range rate, and the target's path; all after each scan."""
    at = scene()
    for_range, for_rate, for_clutter = jax.random.split(key, 3)
    time = INTERVAL * jnp.arange(SCANS)
    rate = jax.random.uniform(for_rate, (), minval=-FASTEST, maxval=FASTEST)
    middle = jax.random.uniform(for_range, (), minval=RANGES / 4, maxval=3 * RANGES / 4)
    path = middle + rate * (time - (EXPOSED + SUBMERGED) / 2)
    power = CLUTTER.mean * 10 ** (scr_db / 10)
    exposed = (time >= EXPOSED) & (time < SUBMERGED)
    scans = draw_scans(for_clutter, CLUTTER, at.cells, time, RangeState(path, jnp.zeros(SCANS)), exposed, power)
    start = CLUTTER_TRACKER.init(jnp.full(RANGES, CLUTTER.mean))
    _, known = CLUTTER_TRACKER.run(start, scans)
    over_range, over_rate = follow(known, ClutterLikelihood(at.cells, power, absolute))
    return {"power": scans.values, "over_range": over_range, "over_rate": over_rate, "path": path, "rate": rate}


def exposure(key: PRNGKeyArray, scr_db: Float[Array, ""]) -> dict[str, Array]:
    """Highest likelihood ratio of a range on the target's path, and elsewhere; natural logs."""
    run = look(key, scr_db)
    near = jnp.abs(jnp.arange(RANGES) - run["path"][:, None]) <= APART
    before = INTERVAL * jnp.arange(SCANS)[:, None] < SUBMERGED
    return {
        "peak": jnp.where(near, run["over_range"], -jnp.inf).max(),
        "second_peak": jnp.where(before & ~near, run["over_range"], -jnp.inf).max(),
    }
