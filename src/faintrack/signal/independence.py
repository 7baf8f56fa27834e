r"""How much of what residuals say is new: their correlation from frame to frame and between neighbours.

A ratio that is a product over cells and frames takes each for a witness of its own. Residuals of real scenes repeat
themselves: a pixel that a tree raises is raised in the next frame too, and its neighbours with it. A sum over n frames
with the correlation :math:`\rho_l` at a lag of l frames has :math:`\tau = 1 + 2 \sum_l \rho_l` times the variance that
independent ones would give it, and a sum over the cells of a target, weighed by its spread h, has g times that of
independent cells. So of the logarithm of a ratio the share

.. math:: \beta = \frac{1}{g \, \tau}

counts. Both are learnt where they are used. With :math:`x` the residuals, cut off at three deviations, m their sum
weighed by h, :math:`\langle \cdot \rangle` the mean over the pixels around and over the frames that are remembered, and
the past :math:`a_t = \lambda a_{t-1} + m_t` of a pixel,

.. math::
    g = \frac{\langle m^2 \rangle}{\langle x^2 \rangle \sum h^2}, \qquad
    \tau = 1 + 2 \max \left( \frac{\langle m_t \, a_{t-1} \rangle}{\langle m^2 \rangle},
        \frac{\langle m_t \, a'_{t-1} \rangle}{\langle m^2 \rangle}, 0 \right)
      \approx 1 + 2 \sum_l \lambda^{l-1} \rho_l ,

where :math:`a'` has moved with the scene in every frame: a target may stay with the detector or move with the scene. As
:math:`\mathrm{E}[\ell^\beta] \le \mathrm{E}[\ell]^\beta = 1`, what counts less never errs towards a target.
"""

import dataclasses
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from faintrack.signal.windows import shifted, square_sum

CUT = 3.0
"""Deviations at which a residual is cut off: a target among the pixels around has little to say."""

FIRST, FIRST_FRAMES = 3.0, 5.0
"""What tau is taken for before any frame, and how many frames that counts for. A correlation over ten frames is known
after ten; a scene that is taken for white until then gives tracks at its start."""

LASTING = 0.9
"""By which the past fades from frame to frame: ten frames back a correlation counts for a third."""


class Repeated(eqx.Module):
    """Sums over the pixels around and the frames so far, the old ones forgotten.

    Attributes
    ----------
    past_still, past_moving : a and a', the past of m at the same pixel, and at the same place of the scene.
    power : of m.
    cells : of x, times the sum of the squares of h.
    still, moving : of m times either past.
    """

    past_still: Float[Array, "y x"]
    past_moving: Float[Array, "y x"]
    power: Float[Array, "y x"]
    cells: Float[Array, "y x"]
    still: Float[Array, "y x"]
    moving: Float[Array, "y x"]


@dataclasses.dataclass(frozen=True)
class Independence:
    """Learns the module's share.

    Attributes
    ----------
    spread : h beside the middle along an axis, h at the corner is its square; of a target.
    memory : frames after which correlations are forgotten.
    around : reach of the square over whose pixels is averaged.

    Examples
    --------
    >>> import jax
    >>> noise = jax.random.normal(jax.random.key(0), (30, 48, 48))
    >>> learns = Independence(spread=0.2)
    >>> repeated = learns.init((48, 48))
    >>> for frame in noise:
    ...     repeated, share = learns.step(repeated, frame, jnp.zeros(2, int))
    >>> round(float(share.mean()), 1)
    0.9
    """

    spread: float
    memory: float = 30.0
    around: int = 12

    def init(self, shape: tuple[int, ...], dtype: Any = jnp.float32) -> Repeated:
        """Before the first frame."""
        nothing = jnp.zeros(shape, dtype)
        known = jnp.full(shape, FIRST_FRAMES * (2 * self.around + 1) ** 2, dtype)
        product = known * (FIRST - 1) / 2
        return Repeated(nothing, nothing, known, known, product, product)

    def step(
        self, repeated: Repeated, residuals: Float[Array, "y x"], moved: Int[Array, " axis"]
    ) -> tuple[Repeated, Float[Array, "y x"]]:
        """Take in a frame.

        Parameters
        ----------
        repeated : after the frame before.
        residuals : over their deviation; one that is not a number says nothing.
        moved : pixels along y and x by which the scene has moved since the frame before.

        Returns
        -------
        The sums, and the share of every pixel.
        """
        values = jnp.clip(jnp.where(jnp.isnan(residuals), 0, residuals), -CUT, CUT)
        matched = self._weighed(values)

        def kept(sum: Array, new: Array) -> Array:
            return (1 - 1 / self.memory) * sum + square_sum(new, self.around)

        past_moving = shifted(repeated.past_moving, moved)
        repeated = Repeated(
            LASTING * repeated.past_still + matched,
            LASTING * past_moving + matched,
            kept(repeated.power, matched**2),
            kept(repeated.cells, values**2 * (1 + 2 * self.spread**2) ** 2),
            kept(repeated.still, matched * repeated.past_still),
            kept(repeated.moving, matched * past_moving),
        )
        power = repeated.power
        longer = 1 + 2 * jnp.maximum(jnp.maximum(repeated.still, repeated.moving) / power, 0)
        return repeated, 1 / (longer * jnp.maximum(power / repeated.cells, 1))

    def _weighed(self, values: Float[Array, "y x"]) -> Float[Array, "y x"]:
        """Sum over the three pixels along each axis, weighed by the spread."""
        for axis in range(2):
            padded = jnp.pad(values, [(1, 1) if axis == each else (0, 0) for each in range(2)])
            before, after = (
                padded[
                    tuple(
                        slice(start, start + values.shape[axis]) if axis == each else slice(None) for each in range(2)
                    )
                ]
                for start in (0, 2)
            )
            values = values + self.spread * (before + after)
        return values
