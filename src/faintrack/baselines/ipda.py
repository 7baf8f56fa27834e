r"""Integrated probabilistic data association: a Gaussian for the state, a probability for whether there is one.

Musicki, Evans and Stankovic (1994). Existence is a Markov chain with :math:`p_b` and :math:`p_s`; a target that appears
has the birth density, a Gaussian, and is merged with one that was there,

.. math::
    q' = p_b (1 - q) + p_s q, \qquad
    q' N(m', P') \approx p_b (1 - q)\, N(m_b, P_b) + p_s q\, N(F m, F P F^T + Q) ,

and a scan with the evidence I (`faintrack.baselines.pda`) gives the existence :math:`q' I / (1 - q' + q' I)`, by the
same rule as everywhere in the package. It is the Bernoulli filter with every density replaced by one Gaussian: exact
for one scan in the linear case, and after that wherever no two hypotheses are left.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from faintrack.baselines.pda import Association, Gaussian, merged
from faintrack.numerics.precision import full_precision
from faintrack.targets.target import Target


class Presumed(eqx.Module):
    """What is believed between scans.

    Attributes
    ----------
    state : of the target, if there is one.
    log_odds : of its existence.
    """

    state: Gaussian
    log_odds: Float[Array, ""]

    @property
    def existence(self) -> Float[Array, ""]:
        """Probability that there is a target."""
        return jax.nn.sigmoid(self.log_odds)


class Ipda(eqx.Module):
    """Integrated probabilistic data association.

    Attributes
    ----------
    association : how detections are told apart.
    birth : density of a target that appears.
    transition, noise : F and Q of the motion from scan to scan.
    target : arrival and departure.
    interval : between scans; seconds.
    """

    association: Association
    birth: Gaussian
    transition: Float[Array, "component component"]
    noise: Float[Array, "component component"]
    target: Target
    interval: float

    def init(self, existence: float = 0.0) -> Presumed:
        """Belief before any scan."""
        odds = jnp.asarray(existence, self.birth.mean.dtype)
        return Presumed(self.birth, jnp.log(odds) - jnp.log1p(-odds))

    def predict(self, presumed: Presumed) -> Presumed:
        """Belief carried to the next scan."""
        forecast = self.target.forecast(presumed.log_odds, self.interval)
        moved = self.moved(presumed.state)
        # Where no target can be yet, the birth density is all there is.
        possible = forecast.existence > -jnp.inf
        share = jnp.where(possible, jnp.exp(forecast.stayed - forecast.existence), 0)
        both = jax.tree.map(lambda *parts: jnp.stack(parts), moved, self.birth)
        return Presumed(merged(jnp.stack([share, 1 - share]), both), forecast.log_odds)

    @full_precision
    def moved(self, state: Gaussian) -> Gaussian:
        """State of a target that stays, at the next scan."""
        covariance = self.transition @ state.covariance @ self.transition.T + self.noise
        return Gaussian(self.transition @ state.mean, covariance)

    def step(self, presumed: Presumed, scan: Any) -> tuple[Presumed, Float[Array, ""]]:
        """Carry a belief to a scan and take it in; returns the log evidence too."""
        predicted = self.predict(presumed)
        state, log_evidence = self.association.take_in(predicted.state, scan)
        return Presumed(state, predicted.log_odds + log_evidence), log_evidence
