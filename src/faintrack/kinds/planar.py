"""Targets of a simulation that move in a plane: their states in scans, and what is known of them beside a result."""

import math

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from faintrack.results.truth import Known
from faintrack.scenario.moving import PlanarTargetSection
from faintrack.targets.states import PlanarState

Targets = tuple[PlanarTargetSection, ...]


def states_of(
    targets: Targets, times: Float[np.ndarray, " scan"]
) -> tuple[PlanarState, Bool[np.ndarray, "scan target"]]:
    """States of targets in some scans, components of shape (scan, target), and whether they are there.

    Parameters
    ----------
    targets : of a simulation.
    times : of the scans, from the first; seconds.

    Examples
    --------
    >>> states, there = states_of((PlanarTargetSection(x=100.0, y=0.0, vx=-5.0, start=10.0),), np.array([0.0, 30.0]))
    >>> states.x.ravel().tolist(), there.ravel().tolist()
    ([150.0, 0.0], [False, True])
    """

    def column(name: str) -> Float[np.ndarray, " target"]:
        return np.array([getattr(target, name) for target in targets], float)

    time = np.asarray(times, float)[:, None]
    since = time - column("start")
    still = np.zeros_like(since)
    parts = column("x") + column("vx") * since, column("y") + column("vy") * since, column("vx") + still
    ends = np.array([math.inf if target.end is None else target.end for target in targets], float)
    states = PlanarState(*(jnp.asarray(part, float) for part in (*parts, column("vy") + still)))
    return states, (since >= 0) & (time < ends)


def known(targets: Targets) -> list[Known]:
    """Targets of a simulation, as results tell their places.

    Examples
    --------
    >>> (target,) = known((PlanarTargetSection(x=100.0, y=0.0, vx=-5.0, start=10.0),))
    >>> target.name, target.at(np.array([0.0, 30.0]))["x"].tolist()
    ('target 1', [nan, 0.0])
    """

    def one(number: int, target: PlanarTargetSection) -> Known:
        def at(times: np.ndarray) -> dict[str, np.ndarray]:
            states, there = states_of((target,), times)
            return {name: np.where(there, getattr(states, name), np.nan)[:, 0] for name in ("x", "y")}

        return Known(f"target {number}", at)

    return [one(number, target) for number, target in enumerate(targets, start=1)]
