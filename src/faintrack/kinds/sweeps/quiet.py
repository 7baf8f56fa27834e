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
        return np.concatenate([sweeps.read(number, number + 1) for number in order[start:stop].tolist()])

    return replace(
        sweeps,
        read=read,
        x=_of(sweeps.x, order),
        y=_of(sweeps.y, order),
        heading=_of(sweeps.heading, order),
        source=f"{sweeps.source}, sweeps in another order",
    )


def stretch(sweeps: Sweeps, start: float, stop: float) -> Sweeps:
    """Sweeps between two times; see `faintrack.kinds.stretches.part_of`."""
    part = part_of(sweeps.middle, start, stop, sweeps.source)
    return replace(
        sweeps,
        read=lambda low, high: sweeps.read(part.start + low, min(part.start + high, part.stop)),
        times=sweeps.times[part],
        x=_of(sweeps.x, part),
        y=_of(sweeps.y, part),
        heading=_of(sweeps.heading, part),
        source=f"{sweeps.source} from {start:g} to {stop:g} s",
    )


def _of(values: np.ndarray | None, chosen: slice | np.ndarray) -> np.ndarray | None:
    return None if values is None else values[chosen]
