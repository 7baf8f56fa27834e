r"""Pixels that are broken: known by standing out alone, at the same place of the detector, whatever the scene does.

Optics spread a point over the pixels beside it, most of the time: a target lies between pixels or moves across them. A
broken pixel is alone. With r what a frame has over its surroundings, s its deviation there and :math:`\bar r` the mean
of r over the four pixels beside, a pixel is alone in a frame where

.. math:: |r| > 3 s, \qquad \bar r \operatorname{sgn} r < 0.1 \, |r| .

The share of the frames in which it was, of the last ten or so, is remembered where the pixel is and not moved with the
scene. From one half on the pixel is bad, seven frames in a row; it is good again after some thirty frames in which it
was not alone. A point at rest on one pixel, narrower than a pixel, is bad too: nothing tells it from a broken one.
"""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

OUTSTANDING = 3.0
"""Deviations from its surroundings from which a pixel stands out."""

BESIDE = 0.1
"""Mean of the four pixels beside over the pixel's own value, from which a pixel is not alone; a point of the width 0.55
pixels in the middle of one has 0.19."""

FRAMES = 10.0
"""Over which the share of frames is taken."""

BAD, GOOD = 0.5, 0.02
"""Share of frames alone above which a pixel becomes bad, and below which it is good again."""


class BadPixels(eqx.Module):
    """What is known of the pixels of a detector.

    Attributes
    ----------
    alone : share of the last frames in which a pixel stood out alone.
    bad : pixels that are not to be read.

    Examples
    --------
    >>> pixels = no_bad_pixels((9, 9))
    >>> frame = jnp.zeros((9, 9)).at[4, 4].set(50.0)
    >>> for _ in range(7):
    ...     pixels = pixels.seen(frame, jnp.ones((9, 9)))
    >>> int(pixels.bad.sum()), float(pixels.mended(frame).max())
    (1, 0.0)
    """

    alone: Float[Array, "y x"]
    bad: Bool[Array, "y x"]

    def seen(self, left: Float[Array, "y x"], deviation: Float[Array, "y x"]) -> "BadPixels":
        """After a frame.

        Parameters
        ----------
        left : what the frame has over its surroundings; any unit.
        deviation : of that; the same unit.
        """
        size = jnp.abs(left)
        alone = (size > OUTSTANDING * deviation) & (beside(left) * jnp.sign(left) < BESIDE * size)
        share = self.alone + (alone - self.alone) / FRAMES
        return BadPixels(share, share > jnp.where(self.bad, GOOD, BAD))

    def mended(self, frame: Float[Array, "y x"]) -> Float[Array, "y x"]:
        """Frame in which bad pixels have the mean of the four beside them."""
        return jnp.where(self.bad, beside(frame), frame)


def no_bad_pixels(shape: tuple[int, ...], dtype: Any = jnp.float32) -> BadPixels:
    """Of a detector of which nothing was seen."""
    return BadPixels(jnp.zeros(shape, dtype), jnp.zeros(shape, bool))


def beside(values: Float[Array, "y x"]) -> Float[Array, "y x"]:
    """Mean of the four pixels beside each; at an edge the pixel within counts twice."""
    padded = jnp.pad(values, 1, mode="reflect")
    return (padded[:-2, 1:-1] + padded[2:, 1:-1] + padded[1:-1, :-2] + padded[1:-1, 2:]) / 4
