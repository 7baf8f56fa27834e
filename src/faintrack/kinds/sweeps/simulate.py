"""Sweeps drawn at random: echoes that stand and echoes that move, in a few levels, and nothing between them.

An echo fluctuates from sweep to sweep, in level, length and width, all its cells together. That is what a radar shows
after its own threshold; the likelihood takes the cells for independent instead, with a deviation as large as the scale.
"""

from dataclasses import replace as replaced
from typing import Any

import numpy as np

from faintrack.errors import InputError
from faintrack.kinds.sweeps.build import NEAREST
from faintrack.kinds.sweeps.data import Sweeps, from_sweeps
from faintrack.kinds.sweeps.sections import SimulatedEchoSection, SweepsScenario
from faintrack.results.truth import Known

SPACING, INTERVAL = 30.0, 3.0
"""Metres and seconds where the scenario gives none."""

LEAST = 0.2
"""Share of the full scale below which a radar shows nothing."""


def simulate(scenario: SweepsScenario) -> Sweeps:
    """Sweeps that a scenario's `[simulation]` describes; each is drawn when it is read.

    Raises
    ------
    InputError : the scenario has no simulation.
    """
    table = _simulation(scenario)
    return _drawn(scenario, table.targets, table.seed)


def silence(scenario: SweepsScenario, seed: int) -> Sweeps:
    """The same with nothing that moves."""
    return _drawn(scenario, (), seed)


def targets(scenario: SweepsScenario) -> list[Known]:
    """Targets of a simulation, as results tell their places."""

    def known(number: int, target: SimulatedEchoSection) -> Known:
        def at(times: np.ndarray) -> dict[str, np.ndarray]:
            return {
                name: place + speed * times
                for name, place, speed in zip(("x", "y"), target.place, target.velocity, strict=True)
            }

        return Known(f"target {number}, level {target.level:g}", at)

    return [known(number, target) for number, target in enumerate(_simulation(scenario).targets, start=1)]


def _simulation(scenario: SweepsScenario) -> Any:
    if scenario.simulation is None:
        raise InputError("the scenario has no [simulation]; expected one with sweeps, spokes and samples.")
    return scenario.simulation


def _drawn(scenario: SweepsScenario, moving: tuple[SimulatedEchoSection, ...], seed: int) -> Sweeps:
    table, echo = _simulation(scenario), scenario.echo
    spacing = scenario.sweeps.sample_spacing or SPACING
    interval = scenario.sweeps.interval or INTERVAL
    rng = np.random.default_rng(seed)
    # Evenly over the picture as it is drawn, spoke by sample: echoes are as dense near the antenna as far away.
    nearest = min(NEAREST * echo.along, table.samples / 2)
    azimuth = rng.uniform(0, 2 * np.pi, table.fixed)
    distance = spacing * rng.uniform(nearest, table.samples, table.fixed)
    fixed = np.stack([distance * np.sin(azimuth), distance * np.cos(azimuth)], axis=1)
    place = np.concatenate([fixed, np.array([target.place for target in moving]).reshape(-1, 2)])
    velocity = np.concatenate([np.zeros_like(fixed), np.array([target.velocity for target in moving]).reshape(-1, 2)])
    level = np.concatenate([rng.uniform(0.4, 1.2, table.fixed), [target.level for target in moving]])
    times = interval * np.arange(table.sweeps)
    antenna = np.array(table.antenna_velocity)
    middle = interval / 2

    def sweep(number: int) -> np.ndarray:
        drawn = np.random.default_rng((seed, number))
        values = np.zeros((table.spokes, table.samples), np.float32)
        logs = table.fluctuation * drawn.normal(size=(3, len(place)))
        for which in range(len(place)):
            spoke = table.spokes / 2
            for _ in range(3):  # it is where it is when its spoke looks
                passed = times[number] + interval * spoke / table.spokes - middle
                x, y = place[which] + (velocity[which] - antenna) * passed
                spoke = np.arctan2(x, y) / (2 * np.pi) * table.spokes % table.spokes
            widths = np.exp(logs[1:, which] / 2) * (echo.across, echo.along)
            _add(values, spoke, np.hypot(x, y) / spacing, level[which] * np.exp(logs[0, which]), widths)
        shown = np.where(values < LEAST, 0, np.minimum(values, 1)) * table.full_scale
        return np.round(shown).astype(np.uint8)

    def read(start: int, stop: int) -> np.ndarray:
        return np.stack([sweep(number) for number in range(start, min(stop, table.sweeps))])

    nothing = np.broadcast_to(np.uint8(0), (table.sweeps, table.spokes, table.samples))
    start = times + 0.0
    moves = bool(np.any(antenna))
    look = start[:, None] + interval * np.arange(table.spokes) / table.spokes - middle
    x, y = (speed * look if moves else None for speed in antenna)
    return replaced(from_sweeps(nothing, spacing, times, x=x, y=y), read=read, source="simulation")


def _add(values: np.ndarray, spoke: float, sample: float, level: float, widths: np.ndarray) -> None:
    """Add an echo to a sweep; spokes wrap around."""
    reach = np.ceil(3 * widths).astype(int)
    rows = np.arange(round(spoke) - reach[0], round(spoke) + reach[0] + 1)
    columns = np.arange(max(round(sample) - reach[1], 0), min(round(sample) + reach[1] + 1, values.shape[1]))
    if not len(columns):
        return
    across = np.exp(-(((rows - spoke) / widths[0]) ** 2) / 2)
    along = np.exp(-(((columns - sample) / widths[1]) ** 2) / 2)
    np.add.at(values, np.ix_(rows % len(values), columns), level * across[:, None] * along)
