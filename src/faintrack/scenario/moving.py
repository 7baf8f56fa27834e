"""Targets of a simulation that move in a plane, each for a time."""

import math
from typing import TYPE_CHECKING, Annotated

import numpy as np
from jaxtyping import Bool, Float
from pydantic import Field, model_validator

from faintrack.scenario.section import Section

if TYPE_CHECKING:
    from faintrack.targets.states import PlanarState


class PlanarTargetSection(Section):
    """A target that moves at a constant velocity and is there from `start` to `end`.

    Attributes
    ----------
    x, y : where it is at `start`, east and north; m.
    vx, vy : its velocity; m/s.
    start, end : seconds from the first scan; to the last where not given.
    """

    x: float
    y: float
    vx: float = 0.0
    vy: float = 0.0
    start: float = Field(default=0.0, ge=0)
    end: float | None = None

    @model_validator(mode="after")
    def _lasts(self) -> "PlanarTargetSection":
        if self.end is not None and not self.end > self.start:
            raise ValueError(f"end is {self.end:g} s: expected more than start, {self.start:g} s")
        return self


PlanarTargets = Annotated[tuple[PlanarTargetSection, ...], Field(strict=False)]
"""Targets of a simulation; in a file a list of tables."""


def states_of(
    targets: tuple[PlanarTargetSection, ...], times: Float[np.ndarray, " scan"]
) -> "tuple[PlanarState, Bool[np.ndarray, 'scan target']]":
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
    # A kind's sections are imported without JAX.
    import jax.numpy as jnp

    from faintrack.targets.states import PlanarState

    def column(name: str) -> Float[np.ndarray, " target"]:
        return np.array([getattr(target, name) for target in targets], float)

    time = np.asarray(times, float)[:, None]
    since = time - column("start")
    still = np.zeros_like(since)
    parts = column("x") + column("vx") * since, column("y") + column("vy") * since, column("vx") + still
    ends = np.array([math.inf if target.end is None else target.end for target in targets], float)
    states = PlanarState(*(jnp.asarray(part, float) for part in (*parts, column("vy") + still)))
    return states, (since >= 0) & (time < ends)
