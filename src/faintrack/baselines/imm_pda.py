r"""Interacting multiple models with data association: one model in which there is a target, one in which there is none.

Bar-Shalom, Chang and Blom (1989) form tracks with two models of the same motion: a target, which is detected with
:math:`P_D`, and none, which never is. Each has a Gaussian and a probability :math:`\mu`; before every scan they are
mixed with the transition probabilities :math:`\pi_{ij}` between the models,

.. math::
    \mu_j' = \sum_i \pi_{ij} \mu_i, \qquad N(m_j', P_j') \approx \sum_i \frac{\pi_{ij} \mu_i}{\mu_j'} N(m_i, P_i),

and moved. The target's Gaussian takes in the scan by data association, with the evidence I
(`faintrack.baselines.pda`); the other goes on, with evidence 1; then :math:`\mu \propto \mu' (1, I)`. What tells it
from `faintrack.baselines.ipda` is where a target that appears comes from: from the Gaussian of the model without one,
which started as the birth density, has moved ever since and takes back what the target's Gaussian leaves when it ends.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from faintrack.baselines.ipda import Ipda
from faintrack.baselines.pda import Gaussian, merged


class Models(eqx.Module):
    """What is believed between scans.

    Attributes
    ----------
    states : of the model without a target, then of that with one, stacked.
    log_odds : of the model with a target.
    """

    states: Gaussian
    log_odds: Float[Array, ""]

    @property
    def existence(self) -> Float[Array, ""]:
        """Probability of the model with a target."""
        return jax.nn.sigmoid(self.log_odds)

    @property
    def state(self) -> Gaussian:
        """Of the target, if there is one."""
        return jax.tree.map(lambda parts: parts[1], self.states)


class ImmPda(eqx.Module):
    """Data association with a model in which there is no target.

    Attributes
    ----------
    single : association, motion, birth density and probabilities, the same as of the method without interaction.
    """

    single: Ipda

    def init(self, existence: float = 0.0) -> Models:
        """Belief before any scan: both models have the birth density."""
        odds = jnp.asarray(existence, self.single.birth.mean.dtype)
        both = jax.tree.map(lambda part: jnp.stack([part, part]), self.single.birth)
        return Models(both, jnp.log(odds) - jnp.log1p(-odds))

    def predict(self, models: Models) -> Models:
        """Belief carried to the next scan: mixed, then moved."""
        forecast = self.single.target.forecast(models.log_odds, self.single.interval)
        joint = jnp.exp(jnp.array([[forecast.none, forecast.appeared], [forecast.left, forecast.stayed]]))
        after = joint.sum(axis=0)
        # A model that cannot be has no mixture; it keeps its own state.
        weights = jnp.where(after > 0, joint / jnp.where(after > 0, after, 1), jnp.eye(2))
        mixed = jax.vmap(merged, in_axes=(1, None))(weights, models.states)
        return Models(jax.vmap(self.single.moved)(mixed), forecast.log_odds)

    def step(self, models: Models, scan: Any) -> tuple[Models, Float[Array, ""]]:
        """Carry a belief to a scan and take it in; returns the log evidence of the target too."""
        predicted = self.predict(models)
        state, log_evidence = self.single.association.take_in(predicted.state, scan)
        states = jax.tree.map(lambda both, one: both.at[1].set(one), predicted.states, state)
        return Models(states, predicted.log_odds + log_evidence), log_evidence
