"""Sets of measurements, of which one at most is a target's, through a tracker: bearings and contacts."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from faintrack.beliefs.belief import Belief
from faintrack.kinds.several import Tracker
from faintrack.numerics.precision import full_precision
from faintrack.sensors.several_sets import SeveralSets


class SetsStep(eqx.Module):
    """Sets of several sensors through a tracker."""

    tracker: Tracker

    def scans(self, block: SeveralSets) -> SeveralSets:
        """Some scans."""
        return block

    @full_precision
    def advance(
        self, state: Any, scan: SeveralSets, key: PRNGKeyArray
    ) -> tuple[Any, tuple[Any, Float[Array, "sensor entry"]]]:
        """Tracker after a scan; the estimate, and the probability of every entry that it is a target's."""
        following, estimate = self.tracker.step(state, scan, key)
        likelihood: Any = self.tracker.likelihood

        def own(belief: Belief) -> Float[Array, "sensor entry"]:
            return belief.existence * (likelihood.association(scan, belief.states) @ jnp.exp(belief.log_weights))

        missed = jnp.prod(jnp.stack([1 - own(belief) for belief in following.beliefs]), axis=0)
        return following, (estimate, 1 - missed)
