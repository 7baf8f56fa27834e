"""Frames drawn from the model: targets in noise, or noise alone."""

import math
from dataclasses import fields
from dataclasses import replace as replaced
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from faintrack.beliefs.axis import Axis
from faintrack.data.sequence import Sequence
from faintrack.errors import InputError
from faintrack.kinds.frames.build import AMPLITUDES, STATES, WIDTH, background_kind
from faintrack.kinds.frames.sections import FramesScenario, SimulatedTargetSection
from faintrack.likelihoods.cells import CellLikelihood, gaussian_spread, point
from faintrack.results.truth import Known
from faintrack.sensors.cells import Cells

SCENE = 10.0
"""Brightness of the flat scene behind whitened images, in standard deviations of the noise."""


def simulate(scenario: FramesScenario) -> Sequence:
    """Frames that a scenario's `[simulation]` describes; each is drawn when it is read.

    Raises
    ------
    InputError : the scenario has no simulation, or a target does not fit its shape.
    """
    table = _simulation(scenario)
    return _drawn(scenario, table.targets, table.seed)


def silence(scenario: FramesScenario, seed: int) -> Sequence:
    """The same without a target."""
    return _drawn(scenario, (), seed)


def targets(scenario: FramesScenario) -> list[Known]:
    """Targets of a simulation, as results tell their places."""
    names = ("range",) if len(_simulation(scenario).shape) == 1 else ("y", "x")

    def known(number: int, target: SimulatedTargetSection) -> Known:
        end = math.inf if target.end is None else target.end

        def at(times: np.ndarray) -> dict[str, np.ndarray]:
            there = (times >= target.start) & (times < end)
            return {
                name: np.where(there, place + rate * (times - target.start), np.nan)
                for name, place, rate in zip(names, target.place, target.velocity, strict=True)
            }

        return Known(f"target {number}, level {target.level:g}", at)

    return [known(number, target) for number, target in enumerate(_simulation(scenario).targets, start=1)]


def _simulation(scenario: FramesScenario) -> Any:
    if scenario.simulation is None:
        raise InputError("the scenario has no [simulation]; expected one with frames and shape.")
    return scenario.simulation


def _drawn(scenario: FramesScenario, targets: tuple[SimulatedTargetSection, ...], seed: int) -> Sequence:
    table = _simulation(scenario)
    names = ("range",) if len(table.shape) == 1 else ("y", "x")
    axes = tuple((name, Axis(0.0, 1.0, count)) for name, count in zip(names, table.shape, strict=True))
    interval = scenario.frames.frame_interval or 1.0
    sequence = Sequence(lambda start, stop: np.empty(0), interval * np.arange(table.frames), axes, "simulation")
    kind = background_kind(scenario, sequence)
    amplitude = AMPLITUDES[scenario.cells.amplitude or ("swerling1" if kind == "clutter" else "gaussian")]
    width = (WIDTH if kind == "whiten" else 0.0) if scenario.cells.width is None else scenario.cells.width
    spread, reach = (gaussian_spread(width), max(1, round(4 * width))) if width else (point, 0)
    cells, state = Cells(axes), STATES[frozenset(names)]
    likelihoods = [
        CellLikelihood(cells, amplitude, target.level, spread, reach, 5 if width else 1) for target in targets
    ]
    for number, target in enumerate(targets):
        if not len(target.place) == len(target.velocity) == len(axes):
            raise InputError(
                f"simulation.targets[{number}] has {len(target.place)} places and {len(target.velocity)} velocities; "
                f"expected {len(axes)}, along {' and '.join(names)}."
            )
    draw = CellLikelihood(cells, amplitude, 1.0).draw
    sign = -1 if scenario.cells.dark else 1
    raised = SCENE if kind == "whiten" else 0.0

    def frame(number: int) -> np.ndarray:
        time = interval * number
        level = jnp.zeros(cells.shape)
        for target, likelihood in zip(targets, likelihoods, strict=True):
            end = math.inf if target.end is None else target.end
            if target.start <= time < end:
                since = time - target.start
                places = {
                    name: jnp.asarray(place + rate * since)
                    for name, place, rate in zip(names, target.place, target.velocity, strict=True)
                }
                still = {field.name: jnp.zeros(()) for field in fields(state) if field.name not in places}
                level = level + likelihood.levels(state(**places, **still))
        key = jax.random.fold_in(jax.random.key(seed), number)
        return np.asarray(scenario.cells.noise * (sign * draw(key, level) + raised), np.float32)

    def read(start: int, stop: int) -> np.ndarray:
        return np.stack([frame(number) for number in range(start, min(stop, table.frames))])

    return replaced(sequence, read=read)
