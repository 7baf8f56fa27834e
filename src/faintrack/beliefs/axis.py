"""Axes with evenly spaced values, and what has several: a grid of states, a sensor's cells, frames."""

import math
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from faintrack.errors import InputError


@dataclass(frozen=True)
class Axis:
    """Evenly spaced values, each the middle of a cell.

    Attributes
    ----------
    first : middle of the first cell.
    step : from one cell to the next; above 0.
    count : of cells; at least 1.

    Raises
    ------
    InputError : a step that is not above 0, or no cell.

    Examples
    --------
    >>> Axis(10.0, 0.5, 3).values.tolist(), Axis(10.0, 0.5, 3).last
    ([10.0, 10.5, 11.0], 11.0)
    """

    first: float
    step: float
    count: int

    def __post_init__(self) -> None:
        if not self.step > 0 or self.count < 1:
            raise InputError(f"axis with step {self.step:g} and count {self.count}: expected above 0, and at least 1.")

    @property
    def last(self) -> float:
        """Middle of the last cell."""
        return self.first + (self.count - 1) * self.step

    @property
    def values(self) -> Float[np.ndarray, " cell"]:
        """Middles of the cells."""
        return self.first + self.step * np.arange(self.count)

    @property
    def edges(self) -> Float[np.ndarray, " edge"]:
        """Ends of the cells, one more than there are cells."""
        return self.first + self.step * (np.arange(self.count + 1) - 0.5)

    def place(self, value: Float[Array, "..."] | float) -> Float[Array, "..."] | float:
        """Index of a value, with its fraction; 0 at the first cell."""
        return (value - self.first) / self.step

    def nearest(self, value: Float[Array, "..."] | float) -> Int[Array, "..."]:
        """Index of the cell that a value lies in; below 0 or from `count` on where it lies in none."""
        return jnp.floor(self.place(value) + 0.5).astype(jnp.int32)


def between(low: float, high: float, count: int) -> Axis:
    """Axis whose cells fill the interval from `low` to `high`.

    Examples
    --------
    >>> between(0.0, 2.0, 4).values.tolist()
    [0.25, 0.75, 1.25, 1.75]
    """
    step = (high - low) / count
    return Axis(low + step / 2, step, count)


class Lattice:
    """What has cells along named axes; the names are components of a state.

    Attributes
    ----------
    axes : name and values of each axis, in the order of the array.
    """

    axes: tuple[tuple[str, Axis], ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Of the axes."""
        return tuple(name for name, _ in self.axes)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of cells along each axis."""
        return tuple(axis.count for _, axis in self.axes)

    @property
    def size(self) -> int:
        """Number of cells."""
        return math.prod(self.shape)
