r"""Pixels that are broken: known by standing out alone, at the same place of the detector, whatever the scene does.

Optics spread a point over the pixels beside it, most of the time: a target lies between pixels or moves across them. A
broken pixel is alone. With r what a frame has over its surroundings, s its deviation there and :math:`\bar r` the mean
of r over the four pixels beside, a pixel is alone in a frame where

.. math:: |r| > 3 s, \qquad \bar r \operatorname{sgn} r < 0.1 \, |r| .

Of the last frames in which the scene moved, the share in which a pixel was alone is remembered where the pixel is. A
stone goes with the scene; a pixel that stays alone through four moves in a row, whose share is then above one half, is
bad, and good again after some fifteen without. Until then one that is alone again, after it was so at the last move, is
in doubt, and not read in that frame. While the scene is at rest nothing is learnt, and its memory explains a broken
pixel like a stone. A point that a camera holds on one pixel is bad too, if it is narrower than a pixel: nothing
tells it from a broken one.
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

FRAMES = 5.0
"""In which the scene moved, over which the share is taken."""

BAD, GOOD = 0.5, 0.02
"""Share of frames alone above which a pixel becomes bad, and below which it is good again."""

DOUBT = 0.15
"""Share above which one that is alone is in doubt: a point of the width 0.55 pixels and five deviations, in the middle
of a pixel, is alone in one of six frames."""


class BadPixels(eqx.Module):
    """What is known of the pixels of a detector.

    Attributes
    ----------
    alone : share of the last frames, of a moving scene, in which a pixel stood out alone.
    bad : pixels that are broken.
    doubted : those that may be, alone in the last frame and before.

    Examples
    --------
    >>> pixels = no_bad_pixels((9, 9))
    >>> frame = jnp.zeros((9, 9)).at[4, 4].set(50.0)
    >>> for _ in range(4):
    ...     pixels = pixels.seen(frame, jnp.ones((9, 9)), jnp.array(True))
    >>> int(pixels.bad.sum()), float(pixels.mended(frame).max())
    (1, 0.0)
    """

    alone: Float[Array, "y x"]
    bad: Bool[Array, "y x"]
    doubted: Bool[Array, "y x"]

    def seen(self, left: Float[Array, "y x"], deviation: Float[Array, "y x"], moved: Bool[Array, ""]) -> "BadPixels":
        """After a frame.

        Parameters
        ----------
        left : what the frame has over its surroundings; any unit.
        deviation : of that; the same unit.
        moved : whether the scene has moved since the frame before.
        """
        size = jnp.abs(left)
        alone = (size > OUTSTANDING * deviation) & (beside(left) * jnp.sign(left) < BESIDE * size)
        share = jnp.where(moved, self.alone + (alone - self.alone) / FRAMES, self.alone)
        return BadPixels(share, share > jnp.where(self.bad, GOOD, BAD), alone & (self.alone > DOUBT))

    def mended(self, frame: Float[Array, "y x"]) -> Float[Array, "y x"]:
        """Frame in which bad pixels have the mean of the four beside them."""
        return jnp.where(self.bad, beside(frame), frame)


def no_bad_pixels(shape: tuple[int, ...], dtype: Any = jnp.float32) -> BadPixels:
    """Of a detector of which nothing was seen."""
    none = jnp.zeros(shape, bool)
    return BadPixels(jnp.zeros(shape, dtype), none, none)


def beside(values: Float[Array, "y x"]) -> Float[Array, "y x"]:
    """Mean of the four pixels beside each; at an edge the pixel within counts twice."""
    padded = jnp.pad(values, 1, mode="reflect")
    return (padded[:-2, 1:-1] + padded[2:, 1:-1] + padded[1:-1, :-2] + padded[1:-1, 2:]) / 4
