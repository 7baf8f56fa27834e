"""Runs of the paper's example: the five ways to the mean ratio of a cell, and what goes beyond them."""

import functools
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.beliefs.axis import Axis
from faintrack.beliefs.belief import Belief, mode
from faintrack.beliefs.grids import Grid, marginal
from faintrack.filters.bernoulli_particle import BernoulliParticleFilter
from faintrack.filters.birth import stationary
from faintrack.filters.cell_particles import CellParticles
from faintrack.filters.grid import GridFilter
from faintrack.filters.run import run
from faintrack.filters.separable import Separable, separable
from faintrack.likelihoods.guided import Guided
from faintrack.likelihoods.random_points import RandomPoints
from faintrack.likelihoods.unknown_snr import GuidedSnr
from faintrack.sensors.active import Ping
from faintrack.sensors.cells import Cells
from faintrack.studies.aughenbaugh2010 import scene
from faintrack.targets.states import PlanarSnrState, PlanarState
from faintrack.targets.target import Target, UniformBirth

Run = Callable[[PRNGKeyArray], dict[str, Array]]

SWATH = {"fm": (5, 3, 3), "cw": (3, 3, 3)}
"""Bins on either side of a return that are sampled."""

REDUCED = {"fm": (3, 2, 2), "cw": (2, 2, 2)}
"""The same, in the paper's test of robustness (its 5.4)."""

LEVELS_DB = Axis(3.5, 2.0, 7)
"""SNR told apart where it is not known; dB."""

PARTICLES, NEWBORN = 100_000, 25_000
"""Of the particle filter."""

CELL_PARTICLES = 10
"""Particles a cell of the published motion update."""

PRIOR = 0.5
"""Probability of a target before the first scan."""


def finer(cells: tuple[int, int]) -> tuple[int, int, int]:
    """Points a bin; the fine grid needs more bearings, so that each of its cells has one."""
    return (1, 4, 1) if cells == scene.BASE else (1, 5, 1)


@functools.cache
def guided(pulse: str, cells: tuple[int, int], reduced: bool = False) -> Guided:
    """Means of the cells from samples near the returns."""
    swath = (REDUCED if reduced else SWATH)[pulse]
    # Runs are traced, and what they share is not part of them.
    with jax.ensure_compile_time_eval():
        return Guided(scene.likelihood(pulse), scene.grid(cells), swath, finer(cells))


class OfCells(eqx.Module):
    """Ratio of the cell that a state lies in, for particles; 1 outside the grid."""

    means: Guided
    grid: Grid = eqx.field(static=True)

    def log_ratio(self, ping: Ping, states: Any) -> Float[Array, "..."]:
        """Log of the mean ratio of each state's cell."""
        table = jax.lax.optimization_barrier(self.means.log_mean_ratio(ping))
        index, inside = Cells(self.grid.axes).nearest(states)
        # Along axes that do not matter the means have one entry.
        cell = tuple(jnp.minimum(number, count - 1) for number, count in zip(index, table.shape, strict=True))
        return jnp.where(inside, table[cell], 0)


def follow(
    key: PRNGKeyArray,
    pulse: str,
    filter: Any,
    likelihood: Any,
    also: Callable[[Belief], dict[str, Array]] = lambda belief: {},
) -> dict[str, Array]:
    """One run: existence and errors after every scan.

    Parameters
    ----------
    key : of the run; data follow from it alone, so that settings with the same key see the same.
    pulse : "fm" or "cw".
    filter : what carries the belief.
    likelihood : what takes in a scan; or a function of a key to it, where it draws.
    also : what else to keep of a belief, by name.
    """
    for_data, for_filter, for_likelihood = jax.random.split(key, 3)
    pings, lost = scene.pings(for_data, pulse)
    likelihood = likelihood if hasattr(likelihood, "log_ratio") else likelihood(for_likelihood)

    def keep(belief: Belief) -> dict[str, Array]:
        best = mode(belief)
        return {"log_odds": belief.log_odds, "x": best.x, "y": best.y, "vx": best.vx, "vy": best.vy, **also(belief)}

    start = filter.init(jax.random.fold_in(for_filter, scene.SCANS), existence=PRIOR)
    _, kept, _ = run(filter, likelihood, pings, for_filter, keep, start)
    truth = scene.truth()
    x, y, vx, vy = (kept.pop(name) for name in ("x", "y", "vx", "vy"))
    samples = jax.lax.map(likelihood.samples, pings) if isinstance(likelihood, Guided) else jnp.zeros(scene.SCANS)
    return {
        "error": jnp.hypot(x - truth.x, y - truth.y),
        "velocity_error": jnp.hypot(vx - truth.vx, vy - truth.vy),
        "returns": pings.there.sum(axis=1),
        "lost": lost,
        "samples": samples,
        **kept,
    }


def by_guided(pulse: str, cells: tuple[int, int], reduced: bool = False) -> Run:
    """Samples near the returns, on a grid."""
    return lambda key: follow(key, pulse, scene.filter_on(cells), guided(pulse, cells, reduced))


def by_random(pulse: str, cells: tuple[int, int], count: int) -> Run:
    """Random states in every cell."""
    on = scene.grid(cells)

    def run(key: PRNGKeyArray) -> dict[str, Array]:
        model = scene.likelihood(pulse)
        return follow(key, pulse, scene.filter_on(cells), lambda key: RandomPoints(model, on, count, key))

    return run


def by_cell_particles(key: PRNGKeyArray) -> dict[str, Array]:
    """FM, guided, with the motion update as published: particles from every cell."""
    on = scene.grid(scene.BASE)
    transport = CellParticles(on, scene.MOTION, scene.INTERVAL, CELL_PARTICLES)
    return follow(key, "fm", GridFilter(on, scene.target(), transport, returns=True), guided("fm", scene.BASE))


def by_stationary_birth(key: PRNGKeyArray) -> dict[str, Array]:
    """FM, guided, with new targets only where a stationary prior loses them: at the edges, inward."""
    return follow(key, "fm", _stationary_filter(), guided("fm", scene.BASE))


@functools.cache
def _stationary_filter() -> GridFilter:
    with jax.ensure_compile_time_eval():
        uniform = scene.filter_on(scene.BASE)
        assert isinstance(uniform.transport, Separable)
        born = stationary(uniform.transport, PRIOR)
        target = Target(None, scene.MOTION, born.arrival_rate, 0.0)
        return GridFilter(uniform.grid, target, uniform.transport, born.log_birth)


def by_unknown_snr(key: PRNGKeyArray) -> dict[str, Array]:
    """FM, guided, with the SNR a component of the state."""
    filter, likelihood = _over_snr()
    return follow(
        key, "fm", filter, likelihood, lambda belief: {"snr": jnp.exp(marginal(belief, filter.grid, "snr_db"))}
    )


@functools.cache
def _over_snr() -> tuple[GridFilter, GuidedSnr]:
    with jax.ensure_compile_time_eval():
        on = Grid(PlanarSnrState, (("snr_db", LEVELS_DB), *scene.grid(scene.BASE).axes))
        filter = GridFilter(on, scene.target(), separable(on, scene.MOTION, scene.INTERVAL), returns=True)
        known = scene.likelihood("fm")
        return filter, GuidedSnr(known.sonar, known.threshold, on, swath=SWATH["fm"], finer=finer(scene.BASE))


def by_particles(cell_means: bool) -> Run:
    """FM, particles in place of a grid; weighted by the ratio at their state, or by the guided mean of their cell."""

    def run(key: PRNGKeyArray) -> dict[str, Array]:
        corner = (scene.POSITION, scene.POSITION, scene.SPEED, scene.SPEED)
        ends = (PlanarState(*(jnp.asarray(side * end) for end in corner)) for side in (-1.0, 1.0))
        known = scene.target()
        target = Target(UniformBirth(*ends), scene.MOTION, known.arrival_rate, known.departure_rate)
        filter = BernoulliParticleFilter(target, PARTICLES, NEWBORN)
        likelihood: Any = scene.likelihood("fm")
        if cell_means:
            likelihood = OfCells(guided("fm", scene.BASE), scene.grid(scene.BASE))
        return follow(key, "fm", filter, likelihood)

    return run
