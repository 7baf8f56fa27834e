"""Products of matrices in the precision of their factors.

A GPU multiplies float32 matrices with ten bits of mantissa (TF32) where it is not told otherwise: a log ratio of 24 is
then off by 0.005, and a covariance that shrinks may lose its sign. What a CPU computes stays the same.
"""

import jax

full_precision = jax.default_matmul_precision("highest")
"""Decorator of functions in which matrices are multiplied, alone or in what they call; JAX's setting stays as it is."""
