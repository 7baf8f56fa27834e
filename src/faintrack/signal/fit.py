"""Whether residuals of a scene look as the background says: how many lie beyond, and how many are new.

A likelihood ratio is worth what its denominator is. The residuals of a frame are tens of thousands of values, nearly
all of them without a target, so what share of them lies above `BEYOND` deviations is known well, and so is the share of
what they say that is new (`faintrack.signal.independence`). Where either is far from what the likelihood takes for
granted, `Fit.misfits` and `Fit.remarks` say so, with the likely reason and the remedy.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

BEYOND = 3.706
"""Deviations that one of a thousand residuals exceeds, under Student's distribution with ten degrees of freedom."""

OFTEN = 3.0
"""Times as many as expected that are said to be too many."""

NEW = 0.05
"""Share of what residuals say that is new, below which it is said to be too little."""


class Fit(eqx.Module):
    """Counts over all frames so far.

    Attributes
    ----------
    cells : residuals that were numbers.
    beyond : of them, above `BEYOND` deviations.
    frames : with residuals.
    new : sum over the frames of the mean share that is independent.

    Examples
    --------
    >>> import jax
    >>> spiky = jax.random.t(jax.random.key(0), 2.5, (100, 100))
    >>> print(nothing_seen().seen(spiky, jnp.ones((100, 100))).misfits(0.001)[0][:55])
    Without a target 2.3 % of the cells are above 3.7 devia
    """

    cells: Float[Array, ""]
    beyond: Float[Array, ""]
    frames: Float[Array, ""]
    new: Float[Array, ""]

    def seen(self, residuals: Float[Array, "y x"], independent: Float[Array, "y x"]) -> "Fit":
        """After a frame: its residuals over their deviation, and the share of each that is independent."""
        known = ~jnp.isnan(residuals)
        some = jnp.any(known)
        return Fit(
            self.cells + jnp.sum(known),
            self.beyond + jnp.sum(residuals > BEYOND),
            self.frames + some,
            self.new + jnp.where(some, jnp.mean(independent), 0),
        )

    def misfits(self, expected: float) -> tuple[str, ...]:
        """Why existence is too high; one sentence each.

        Parameters
        ----------
        expected : share of residuals above `BEYOND` deviations under the likelihood's noise.
        """
        if not self.frames:
            return ()
        # Few cells may hold as many by chance: three standard deviations of their number are granted.
        number = float(self.beyond)
        if number - 3 * number**0.5 <= OFTEN * expected * float(self.cells):
            return ()
        return (
            f"Without a target {100 * float(self.beyond / self.cells):.2g} % of the cells are above {BEYOND:.1f} "
            f"deviations, and the background expects {100 * expected:.2g} %: the scene has spikes that it does not "
            "know, so existence is too high; count false tracks on frames without a target and raise tracker.declare.",
        )

    def remarks(self) -> tuple[str, ...]:
        """Why targets are declared late; one sentence each."""
        if not self.frames or (new := float(self.new / self.frames)) >= NEW:
            return ()
        return (
            f"Only {100 * new:.2g} % of what a frame says is new: frames come faster than the scene changes, or were "
            "averaged, so targets are declared late; give fewer frames, or a shorter frames.memory.",
        )


def nothing_seen() -> Fit:
    """Before the first frame."""
    return Fit(*(jnp.zeros(()) for _ in range(4)))
