"""Sweeps without a moving target: surrogates of them, and stretches."""

from dataclasses import replace

import numpy as np

from faintrack.kinds.stretches import part_of
from faintrack.kinds.surrogates import order_of
from faintrack.kinds.sweeps.data import Sweeps


def surrogate(sweeps: Sweeps, scenario: object, seed: int) -> Sweeps:
    """Sweeps in another order at the same times, each with the place and heading that it was taken from."""
    order = order_of(sweeps.length, seed)

    def read(start: int, stop: int) -> np.ndarray:
        return np.concatenate([sweeps.read(number, number + 1) for number in order[start:stop]])

    placed = {
        name: None if getattr(sweeps, name) is None else getattr(sweeps, name)[order] for name in ("x", "y", "heading")
    }
    return replace(sweeps, read=read, source=f"{sweeps.source}, sweeps in another order", **placed)


def stretch(sweeps: Sweeps, start: float, stop: float) -> Sweeps:
    """Sweeps between two times; see `faintrack.kinds.stretches.part_of`."""
    part = part_of(sweeps.middle, start, stop, sweeps.source)
    cut = {
        name: None if getattr(sweeps, name) is None else getattr(sweeps, name)[part]
        for name in ("times", "x", "y", "heading")
    }
    return replace(
        sweeps,
        read=lambda low, high: sweeps.read(part.start + low, min(part.start + high, part.stop)),
        source=f"{sweeps.source} from {start:g} to {stop:g} s",
        **cut,
    )
