"""One scan of an active sonar on a grid, motion and measurement, in the scenes of aughenbaugh2010.

The peer is the paper: the seconds of its guided measurement update and its motion update, on the machine it used.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array

from faintrack.beliefs.belief import Belief
from faintrack.bench.machine import Machine
from faintrack.bench.rows import Row, row, timed
from faintrack.bench.sizes import Sizes
from faintrack.filters.grid import GridFilter
from faintrack.filters.run import step
from faintrack.likelihoods.exceedances import ExceedanceLikelihood
from faintrack.likelihoods.guided import Guided
from faintrack.likelihoods.multistatic import Multistatic
from faintrack.sensors.active import ActiveSonar, Ping
from faintrack.sensors.bistatic import Bistatic, fixed
from faintrack.sensors.multistatic import Pings
from faintrack.simulation.active import capacity_for, draw_ping
from faintrack.studies.aughenbaugh2010 import runs, scene

SCAN = 20
"""Of the run that is timed: the target is in view."""
SECOND = 6000.0, -2000.0
"""Where a second receiver is; m."""
RUNS = 8
"""In a batch."""


def fm_scan_base(machine: Machine, sizes: Sizes) -> Row:
    """FM on the base grid."""
    return _fixed("fm_scan_base", "fm", sizes.base, 15.0, 1.8 + 6, sizes)


def fm_scan_fine(machine: Machine, sizes: Sizes) -> Row:
    """FM on the fine grid."""
    return _fixed("fm_scan_fine", "fm", sizes.fine, 60.0, 6.9 + 105, sizes)


def cw_scan_base(machine: Machine, sizes: Sizes) -> Row:
    """CW on the base grid."""
    return _fixed("cw_scan_base", "cw", sizes.base, 40.0, 10.2 + 6, sizes)


def cw_scan_fine(machine: Machine, sizes: Sizes) -> Row:
    """CW on the fine grid."""
    return _fixed("cw_scan_fine", "cw", sizes.fine, 120.0, 15.4 + 105, sizes)


def fm_scan_moving(machine: Machine, sizes: Sizes) -> Row:
    """FM on the base grid, source and receiver moving."""
    return _moving("fm_scan_moving", "fm", 3 * 15.0, sizes)


def cw_scan_moving(machine: Machine, sizes: Sizes) -> Row:
    """CW on the base grid, source and receiver moving."""
    return _moving("cw_scan_moving", "cw", 3 * 40.0, sizes)


def fm_scan_batch(machine: Machine, sizes: Sizes) -> Row:
    """FM on the base grid, several runs in one call."""
    how = f"share of one of {RUNS} runs"
    return _row("fm_scan_batch", "fm", sizes.base, 15.0, None, how, sizes, count=RUNS)


def fm_scan_two(machine: Machine, sizes: Sizes) -> Row:
    """FM on the base grid, heard by two receivers; the peer is one of them alone."""
    filter, one = scene.filter_on(sizes.base), _guided("fm", sizes.base, moving=False)
    place = Bistatic(fixed(0.0, 0.0), fixed(*SECOND))
    sonar: ActiveSonar = dataclasses.replace(one.likelihood.sonar, pair=place)
    likelihood = ExceedanceLikelihood(sonar, float(one.likelihood.snr), one.likelihood.threshold)
    other = Guided(likelihood, one.mesh.grid, runs.SWATH["fm"], runs.finer(sizes.base))
    state = jax.tree.map(lambda values: values[SCAN], scene.truth())
    capacity = capacity_for(likelihood)
    pings = tuple(
        draw_ping(key, each.likelihood, capacity, jnp.asarray(scene.INTERVAL * SCAN, jnp.float32), state, True)[0]
        for key, each in zip(jax.random.split(jax.random.key(0)), (one, other), strict=True)
    )
    scan = Pings(pings[0].time, pings, jnp.array([True, True]))
    before = filter.init(jax.random.key(0), scene.INTERVAL * (SCAN - 1), existence=0.5)
    both, key = Multistatic([one, other]), jax.random.key(1)
    timing = timed(lambda: _step(filter, both, before, scan, key), sizes.repeat_seconds)
    alone = timed(lambda: _step(filter, one, before, pings[0], key), sizes.repeat_seconds)
    counts = " and ".join(str(int(ping.there.sum())) for ping in pings)
    note = (
        f"motion and measurement of one FM scan on {' x '.join(map(str, filter.grid.shape))} cells, {counts} returns; "
        "two receivers; peer: one of them"
    )
    return row("fm_scan_two", "ms", timing, note, 150.0, alone.least)


def _fixed(name: str, pulse: str, cells: tuple[int, int], target: float, published: float, sizes: Sizes) -> Row:
    return _row(name, pulse, cells, target, published, "sensors stand still", sizes)


def _moving(name: str, pulse: str, target: float, sizes: Sizes) -> Row:
    return _row(name, pulse, sizes.base, target, None, "every ping brings source and receiver", sizes, moving=True)


def _row(
    name: str,
    pulse: str,
    cells: tuple[int, int],
    target: float,
    published: float | None,
    how: str,
    sizes: Sizes,
    moving: bool = False,
    count: int = 1,
) -> Row:
    filter, means = scene.filter_on(cells), _guided(pulse, cells, moving)
    pings, _ = jax.jit(jax.vmap(lambda key: scene.pings(key, pulse)))(jax.random.split(jax.random.key(0), count))
    pings = jax.tree.map(lambda values: values[:, SCAN], pings)
    if moving:
        still = scene.likelihood(pulse).sonar.pair
        pairs = jax.tree.map(lambda value: jnp.broadcast_to(value, (count,)), still)
        pings = dataclasses.replace(pings, pair=pairs)
    before = filter.init(jax.random.key(0), scene.INTERVAL * (SCAN - 1), existence=0.5)

    keys = jax.random.split(jax.random.key(1), count)
    timing = timed(lambda: _stepped(filter, means, before, pings, keys), sizes.repeat_seconds).per(count)
    beside = "no peer" if published is None else "peer: as published"
    note = (
        f"motion and measurement of one {pulse.upper()} scan on {' x '.join(map(str, filter.grid.shape))} cells, "
        f"{int(pings.there.sum()) / count:.0f} returns; {how}; {beside}"
    )
    return row(name, "ms", timing, note, target, published)


@eqx.filter_jit
def _step(filter: GridFilter, means: Guided | Multistatic, before: Belief, scan: Ping | Pings, key: Array) -> Belief:
    """Belief after one scan."""
    return step(filter, means, before, scan, key)[0]


@eqx.filter_jit
def _stepped(filter: GridFilter, means: Guided, before: Belief, pings: Ping, keys: Array) -> Belief:
    """Beliefs after one scan, of runs that begin alike."""
    return jax.lax.map(lambda ping_key: step(filter, means, before, *ping_key)[0], (pings, keys))


def _guided(pulse: str, cells: tuple[int, int], moving: bool) -> Guided:
    """Guided means; with `moving` of a sonar that does not know where source and receiver are."""
    known = runs.guided(pulse, cells)
    if not moving:
        return known
    sonar: ActiveSonar = dataclasses.replace(known.likelihood.sonar, pair=None)
    likelihood = type(known.likelihood)(sonar, float(known.likelihood.snr), known.likelihood.threshold)
    return Guided(likelihood, known.mesh.grid, runs.SWATH[pulse], runs.finer(cells))
