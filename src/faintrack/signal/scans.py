"""From frames to what a likelihood of cells takes in, one frame after the other.

Three ways, one for each thing that may be known of what is seen without a target: its level beforehand (`OverNoise`),
nothing, but that a target moves over the scene (`OverScene`), or nothing, in the power of radar and sonar echoes
(`OverClutter`). Each holds a memory, and each also tells what it made of a frame, for pictures.
"""

from typing import Any, Protocol, runtime_checkable

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from faintrack.sensors.cells import CellScan
from faintrack.signal.background import Memory, Whitening
from faintrack.signal.clutter import ClutterScan, ClutterTracker
from faintrack.signal.fit import Fit, nothing_seen
from faintrack.signal.independence import Independence, Repeated
from faintrack.signal.tails import Tails, Weighed


@runtime_checkable
class Background(Protocol):
    """What is seen without a target, learned from frame to frame."""

    def init(self, frame: Float[Array, "*cells"]) -> Any:
        """Memory before the first frame, of which only shape and scale are taken."""

    def step(
        self, memory: Any, time: Float[Array, ""], frame: Float[Array, "*cells"]
    ) -> tuple[Any, Any, Float[Array, "*cells"]]:
        """Memory after a frame, the scan for the likelihood, and the frame relative to what is expected."""


class OverNoise(eqx.Module):
    """Frames over a level of the noise that is the same everywhere and known.

    Attributes
    ----------
    noise : what the values are divided by; in the unit of the frames.

    Examples
    --------
    >>> _, scan, _ = OverNoise(2.0).step(None, jnp.array(0.0), jnp.array([2.0, 6.0]))
    >>> scan.values.tolist()
    [1.0, 3.0]
    """

    noise: float = 1.0

    def init(self, frame: Float[Array, "*cells"]) -> None:
        """Nothing is remembered."""

    def step(
        self, memory: None, time: Float[Array, ""], frame: Float[Array, "*cells"]
    ) -> tuple[None, CellScan, Float[Array, "*cells"]]:
        """As `Background.step`."""
        values = frame / self.noise
        return None, CellScan(time, values), values


class Scene(eqx.Module):
    """What is known of a scene.

    Attributes
    ----------
    behind : what is seen at every pixel.
    weighed : laws of the residuals; None where they are taken as they are.
    repeated : correlations of the residuals.
    fit : counts of them.
    """

    behind: Memory
    weighed: Weighed | None
    repeated: Repeated
    fit: Fit


class OverScene(eqx.Module):
    """Frames whitened: residuals of mean 0 and variance 1, counted by the share that is independent.

    Attributes
    ----------
    whitening : see `faintrack.signal.background`.
    independence : see `faintrack.signal.independence`.
    tails : see `faintrack.signal.tails`; None where residuals are read as they are.
    """

    whitening: Whitening
    independence: Independence = eqx.field(static=True)
    tails: Tails | None = eqx.field(static=True, default=None)

    def init(self, frame: Float[Array, "y x"]) -> Scene:
        """Memory of a scene that was never seen."""
        shape, dtype = frame.shape, frame.dtype
        weighed = None if self.tails is None else self.tails.init(shape, dtype)
        return Scene(self.whitening.init(shape, dtype), weighed, self.independence.init(shape, dtype), nothing_seen())

    def step(
        self, memory: Scene, time: Float[Array, ""], frame: Float[Array, "y x"]
    ) -> tuple[Scene, CellScan, Float[Array, "y x"]]:
        """As `Background.step`."""
        behind, residual, moved = self.whitening.step(memory.behind, frame)
        weighed = memory.weighed
        if self.tails is not None and weighed is not None:
            weighed, residual = self.tails.step(weighed, residual)
        repeated, independent = self.independence.step(memory.repeated, residual, moved)
        fit = memory.fit.seen(residual, independent)
        scan = CellScan(time, residual, independent=independent, moved=moved)
        return Scene(behind, weighed, repeated, fit), scan, residual


class OverClutter(eqx.Module):
    """Power with a clutter level for every cell, see `faintrack.signal.clutter`."""

    tracker: ClutterTracker

    def init(self, frame: Float[Array, "*cells"]) -> Any:
        """The same level everywhere, that of the frame's mean, hardly known."""
        level = jnp.maximum(jnp.mean(frame), jnp.finfo(frame.dtype).tiny)
        return self.tracker.init(jnp.full_like(frame, level))

    def step(
        self, memory: Any, time: Float[Array, ""], frame: Float[Array, "*cells"]
    ) -> tuple[Any, ClutterScan, Float[Array, "*cells"]]:
        """As `Background.step`."""
        memory, used = self.tracker.step(memory, frame)
        return memory, ClutterScan(time, frame, used), frame * used.shape / used.scale
