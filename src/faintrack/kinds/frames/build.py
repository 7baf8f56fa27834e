"""From the sections of a scenario to what tracks in frames: background, likelihood, filter, tracker."""

from typing import Any

import jax.numpy as jnp
import numpy as np

from faintrack.beliefs.axis import Axis, between
from faintrack.beliefs.grids import Grid
from faintrack.data.sequence import Sequence
from faintrack.errors import InputError
from faintrack.filters.bernoulli_particle import BernoulliParticleFilter
from faintrack.filters.grid import GridFilter
from faintrack.filters.grid_then_particles import GridThenParticles
from faintrack.filters.run import Likelihood
from faintrack.filters.separable import POINTS, separable
from faintrack.kinds.frames.sections import FramesScenario
from faintrack.kinds.several import Tracker, build_several, number_of_targets
from faintrack.likelihoods.cells import (
    Amplitude,
    CellLikelihood,
    gaussian,
    gaussian_spread,
    point,
    rayleigh,
    swerling0,
    swerling1,
)
from faintrack.likelihoods.clutter import ClutterLikelihood
from faintrack.likelihoods.heavy_tails import student
from faintrack.likelihoods.unknown_level import UnknownLevel
from faintrack.likelihoods.within import Within
from faintrack.sensors.cells import Cells
from faintrack.signal.background import Whitening
from faintrack.signal.clutter import ClutterTracker
from faintrack.signal.independence import Independence
from faintrack.signal.scans import Background, OverClutter, OverNoise, OverScene
from faintrack.signal.tails import LAWS, Tails
from faintrack.targets.motion import PlanarMotion
from faintrack.targets.states import PlanarState, RangeState
from faintrack.targets.target import Target, UniformBirth

STATES: dict[frozenset[str], Any] = {
    frozenset({"y", "x"}): PlanarState,
    frozenset({"range"}): RangeState,
    frozenset({"range", "range_rate"}): RangeState,
}
"""Axes of a frame, and the states of a target in it."""

AMPLITUDES: dict[str, Amplitude] = {
    "gaussian": gaussian,
    "student": student(LAWS[0][0], slack=0.7),
    "swerling0": swerling0,
    "swerling1": swerling1,
    "rayleigh": rayleigh,
}
TAILS = {"gaussian": 1.05e-4, "student": 1e-3}
"""Amplitudes of values that may be negative; share of the noise above `faintrack.signal.fit.BEYOND` deviations."""

RESIDUALS = tuple(TAILS)
"""Their names."""

DEVIATIONS, POWERS = (2.0, 5.0, 12.0, 30.0), (10.0,)
"""Levels of a target by default: over the standard deviation of the noise; over its power."""

WIDTH = 0.55
"""Of the spread in whitened images by default; cells. Beside its pixel a target then has a fifth of its level."""

PLACES = 3
"""Places of a spread target within a cell, along each axis, that particles tell apart; the cells of a grid have one."""

MEMORY = {"whiten": 30.0, "clutter": 200.0}
"""Frames after which a background is forgotten by default."""

LEARNT = MEMORY["whiten"]
"""Frames from which the correlation of residuals is learnt, where no scene is remembered."""

LARGEST_GRID = 20_000_000
"""Cells of a grid at most: each takes some fifty bytes, and about 0.2 microseconds a frame."""


LARGEST_KERNEL = 50_000_000
"""Numbers from which the motion of a component on a grid is averaged, at most: they take some three gigabytes."""

SHORTEST_INTERVAL = 1e-9
"""Seconds from frame to frame at least: rates in cells a second stay within single precision."""


def background_kind(scenario: FramesScenario, sequence: Sequence) -> str:
    """Background of a scenario, or the one that suits the frames."""
    return scenario.frames.background or ("whiten" if "x" in dict(sequence.axes) else "clutter")


def chosen(scenario: FramesScenario, sequence: Sequence) -> FramesScenario:
    """Scenario with what was chosen for a sequence filled in."""
    kind = background_kind(scenario, sequence)
    memory = MEMORY.get(kind) if scenario.frames.memory is None else scenario.frames.memory
    speed, noise = target_motion(scenario, sequence)
    frames = scenario.frames.model_copy(update={"background": kind, "memory": memory})
    target = scenario.target.model_copy(update={"speed": speed, "velocity_noise": noise})
    return scenario.model_copy(update={"frames": frames, "target": target})


def target_motion(scenario: FramesScenario, sequence: Sequence) -> tuple[float, float]:
    """Largest speed of new targets and density of their acceleration, in units of the axes."""
    axes, table, interval = dict(sequence.axes), scenario.target, frame_interval(sequence)
    cell = min(axes[name].step for name in ("x", "y", "range") if name in axes)
    speed = cell / interval if table.speed is None else table.speed
    return speed, 0.1 * cell / interval**1.5 if table.velocity_noise is None else table.velocity_noise


def holds_power(scenario: FramesScenario, sequence: Sequence) -> bool:
    """Whether the values are a power or an envelope, which is never negative."""
    return background_kind(scenario, sequence) == "clutter" or scenario.cells.amplitude not in (None, *RESIDUALS)


def frame_interval(sequence: Sequence) -> float:
    """Seconds from frame to frame, the median; 1 where there is one frame alone.

    Raises
    ------
    InputError : frames closer than any sensor takes them.
    """
    interval = float(np.median(np.diff(sequence.times))) if sequence.length > 1 else 1.0
    if interval < SHORTEST_INTERVAL:
        raise InputError(f"frames are {interval:g} s apart; expected at least {SHORTEST_INTERVAL:g} s.")
    return interval


def build_background(scenario: FramesScenario, sequence: Sequence) -> Background:
    """What turns frames into scans.

    Raises
    ------
    InputError : the background does not fit the frames, or its memory is too short.
    """
    kind, table = background_kind(scenario, sequence), scenario.frames
    if kind == "none":
        return OverNoise(scenario.cells.noise)
    memory = MEMORY[kind] if table.memory is None else table.memory
    if kind == "clutter":
        if memory < 1:
            raise InputError(f"frames.memory is {memory:g}; expected at least 1 frame for background clutter.")
        return OverClutter(ClutterTracker(1 - 1 / memory, neighbour=0.25, guard=1, train=4))
    if 0 < memory <= Whitening.least:
        raise InputError(f"frames.memory is {memory:g}; expected 0, or more than {Whitening.least:g} frames.")
    whitening = Whitening(memory=memory)
    if len(sequence.shape) != 2 or min(sequence.shape) <= whitening.outer:
        raise InputError(
            f"frames have shape {sequence.shape}; expected two axes with more than {whitening.outer} cells each "
            "for background whiten."
        )
    width = WIDTH if scenario.cells.width is None else scenario.cells.width
    beside = float(np.exp(-0.5 / width**2)) if width else 0.0
    around = min(Independence.around, min(sequence.shape) - 1)
    tails = None if scenario.cells.amplitude == "gaussian" else Tails(memory or LEARNT)
    return OverScene(whitening, Independence(beside, memory or LEARNT, around), tails)


def build_cells(scenario: FramesScenario, sequence: Sequence, oversample: int) -> Likelihood:
    """Likelihood of a scenario for the frames of a sequence.

    Raises
    ------
    InputError : background and cells do not fit together.
    """
    kind, table, cells = background_kind(scenario, sequence), scenario.cells, Cells(sequence.axes)
    if kind == "clutter":
        levels = table.levels or POWERS
        if table.amplitude is not None or table.width or len(levels) > 1:
            raise InputError(
                "cells: background clutter has its own likelihood, of a target in one cell; expected levels with one "
                "number, and no amplitude or width."
            )
        return ClutterLikelihood(cells, levels[0])
    name = table.amplitude or ("student" if kind == "whiten" else None)
    if name is None:
        raise InputError(f"cells.amplitude is missing; expected one of {', '.join(AMPLITUDES)} for background none.")
    if kind == "whiten" and name not in RESIDUALS:
        raise InputError(f"cells.amplitude is {name}; expected {' or '.join(RESIDUALS)} for background whiten.")
    levels = table.levels or (DEVIATIONS if name in RESIDUALS else POWERS)
    width = (WIDTH if kind == "whiten" else 0.0) if table.width is None else table.width
    spread = gaussian_spread(width) if width else point
    reach = max(1, round(2 * width)) if width else 0
    parts = [
        CellLikelihood(cells, AMPLITUDES[name], level, spread, reach, oversample if width else 1) for level in levels
    ]
    return parts[0] if len(parts) == 1 else UnknownLevel(tuple(parts))


def build_tracker(scenario: FramesScenario, sequence: Sequence) -> Tracker:
    """Tracker of a scenario for the frames of a sequence.

    Raises
    ------
    InputError : the axes of the frames are not those of a state, the tables do not fit together, the grid is too
        large, or too many of its cells are passed between two frames.
    """
    axes = dict(sequence.axes)
    kind = STATES.get(frozenset(axes))
    if kind is None:
        raise InputError(
            f"frames have the axes {', '.join(axes)}; expected y and x, range, or range and range_rate, beside time."
        )
    interval, table, filter_table = frame_interval(sequence), scenario.target, scenario.filter
    speed, noise = target_motion(scenario, sequence)
    # A Doppler axis says itself how fast targets may be.
    rates = {rate: between(-speed, speed, filter_table.speeds) for rate in kind.rates.values() if rate not in axes}
    extent = {name: (float(axis.edges[0]), float(axis.edges[-1])) for name, axis in (axes | rates).items()}
    low, high = (
        kind(**{name: jnp.asarray(ends[side], jnp.float32) for name, ends in extent.items()}) for side in (0, 1)
    )
    motion = PlanarMotion(noise)
    target = Target(UniformBirth(low, high), motion, table.arrival_rate, table.departure_rate)
    particles = BernoulliParticleFilter(target, filter_table.particles, filter_table.births)
    finer = Within(build_cells(scenario, sequence, PLACES), Cells(sequence.axes))
    if filter_table.kind == "particles":
        return build_several(particles, finer, scenario.tracker, interval)
    grid = Grid(kind, (*axes.items(), *rates.items()))
    if grid.size > LARGEST_GRID:
        listed = " x ".join(map(str, grid.shape))
        raise InputError(
            f"the grid has {listed} cells, more than {LARGEST_GRID:,}; "
            "expected fewer filter.speeds, or filter.kind particles."
        )
    for place, rate in grid.pairs:
        _require_short(grid.axes[place], grid.axes[rate], noise, interval)
    carried = GridFilter(grid, target, separable(grid, motion, interval))
    likelihood = build_cells(scenario, sequence, oversample=1)
    if number_of_targets(likelihood, scenario.tracker) == 1:
        return build_several(carried, likelihood, scenario.tracker, interval)
    both = GridThenParticles(carried, particles)
    return build_several(both, likelihood, scenario.tracker, interval, finer=finer)


def _require_short(place: tuple[str, Axis], rate: tuple[str, Axis], noise: float, interval: float) -> None:
    """Refuse targets that may pass so many cells between two frames that no memory holds their motion."""
    (name, along), (rate_name, rates) = place, rate
    fastest = max(abs(rates.edges[0]), abs(rates.edges[-1]))
    cells = (fastest * interval + 6 * noise * interval**1.5) / along.step
    if 2 * cells * rates.count**2 * POINTS > LARGEST_KERNEL:
        raise InputError(
            f"targets pass up to {cells:.3g} cells of {name} between two frames, with {rates.count} values of "
            f"{rate_name}; expected a lower target.speed or target.velocity_noise, or filter.kind particles."
        )


def units_of(name: str, axes: dict[str, Axis]) -> str:
    """Unit of an axis of frames or of a component: cells that are numbered from 0 have no other."""
    place = {"vx": "x", "vy": "y", "range_rate": "range"}.get(name, name)
    axis = axes.get(place)
    numbered = axis is not None and axis.first == 0 and axis.step == 1
    unit = ("pixel" if place in ("x", "y") else "cell") if numbered else "m"
    return unit if name == place else f"{unit}/s"
