"""What this machine can do at best, measured in the same run as everything else."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp

from faintrack.bench.rows import timed
from faintrack.numerics.draws import normal_pairs


@dataclass(frozen=True)
class Machine:
    """Rates that no row can beat with the same arithmetic.

    Attributes
    ----------
    product_rate : floating point operations a second in the product of two large float32 matrices.
    normal_rate : normal random numbers a second, drawn many at once.
    """

    product_rate: float
    normal_rate: float

    def seconds(self, operations: float = 0.0, normals: float = 0.0) -> float:
        """Seconds for so many operations in matrix products and so many normal random numbers."""
        return operations / self.product_rate + normals / self.normal_rate


def measure(size: int = 2048, seconds: float = 1.0) -> Machine:
    """Measure this machine.

    Parameters
    ----------
    size : rows and columns of the matrices; size^2 random numbers are drawn.
    seconds : of repeating, each.
    """
    draw = jax.jit(lambda key: normal_pairs(key, size**2 // 2))
    multiply = jax.jit(jnp.matmul)
    key = jax.random.key(0)
    matrix = jax.random.normal(key, (size, size))
    product, normals = timed(lambda: multiply(matrix, matrix), seconds), timed(lambda: draw(key), seconds)
    return Machine(2 * size**3 / product.least, size**2 / normals.least)


def beam_operations(frequencies: int, beams: int, channels: int, columns: int) -> float:
    """Floating point operations of a line's beam sums: a real weight times a complex number and an addition is four."""
    return 4.0 * frequencies * beams * channels * columns
