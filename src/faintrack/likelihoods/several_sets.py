"""Log ratio of what several sensors report at one time, each of which knows of its own set alone."""

import dataclasses
from typing import Any, Protocol, runtime_checkable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from faintrack.likelihoods.bearing_proposal import Candidates, where_likely
from faintrack.sensors.several_sets import SeveralSets
from faintrack.targets.states import PlanarState
from faintrack.targets.target import Birth


@runtime_checkable
class OfOneSet(Protocol):
    """Likelihood of the set of one sensor, and what else is asked of it; see `faintrack.likelihoods.protocols`."""

    def log_ratio(self, scan: Any, states: Any) -> Float[Array, "..."]:
        """Natural log of p(set | target at state) / p(set | no target)."""

    def association(self, scan: Any, states: Any) -> Float[Array, "..."]:
        """Probability of every entry to be the target's, if there is a target at the state."""

    def part(self, scan: Any, states: Any, log_weights: Float[Array, " point"]) -> Float[Array, " entry"]:
        """What a target adds to the density of what is false, as a multiple of that."""

    def beside(self, scan: Any, parts: Float[Array, "target entry"], existence: Float[Array, " target"]) -> Any:
        """Set with other targets as part of its background."""

    def alike(self, scan: Any, states: Any, centres: Any) -> Bool[Array, "centre *points"]:
        """Whether targets are one to the sensor."""

    def candidates(self, scan: Any, birth: Birth) -> Candidates | None:
        """Function of (key, count) to new targets about what the set says; None of births that it knows nothing of."""

    def simulate(self, scan: Any, states: PlanarState, present: Bool[Array, ""] | bool, key: PRNGKeyArray) -> Any:
        """Set drawn from the model."""


class SeveralSetsLikelihood(eqx.Module):
    """Log ratio of what several sensors report at one time: the sum of theirs (stone2002, section 2.4.3).

    Attributes
    ----------
    each : of every sensor; they are alike.
    """

    each: OfOneSet

    @eqx.filter_jit
    def log_ratio(self, scan: SeveralSets[Any], states: Any) -> Float[Array, "..."]:
        """Natural log of p(all sets | target at state) / p(all sets | no target)."""
        ratios = jax.vmap(self.each.log_ratio, in_axes=(0, None))(scan.sets, states)
        return jnp.where(scan.heard.reshape(-1, *(1,) * (ratios.ndim - 1)), ratios, 0).sum(axis=0)

    @eqx.filter_jit
    def association(self, scan: SeveralSets[Any], states: Any) -> Float[Array, "..."]:
        """Probability of every entry to be the target's, shape (sensor, entry, ...)."""
        return jax.vmap(self.each.association, in_axes=(0, None))(scan.sets, states)

    def part(
        self, scan: SeveralSets[Any], states: Any, log_weights: Float[Array, " point"]
    ) -> Float[Array, "sensor entry"]:
        """What a target adds to the density of what is false at every sensor."""
        return jax.vmap(self.each.part, in_axes=(0, None, None))(scan.sets, states, log_weights)

    def beside(
        self, scan: SeveralSets[Any], parts: Float[Array, "target sensor entry"], existence: Float[Array, " target"]
    ) -> SeveralSets[Any]:
        """Scan with other targets as part of every sensor's background."""
        beside = jax.vmap(self.each.beside, in_axes=(0, 1, None))
        return dataclasses.replace(scan, sets=beside(scan.sets, parts, existence))

    def alike(self, scan: SeveralSets[Any], states: Any, centres: Any) -> Bool[Array, "centre *points"]:
        """Whether targets are one to every sensor that reported."""
        close = jax.vmap(self.each.alike, in_axes=(0, None, None))(scan.sets, states, centres)
        heard = scan.heard.reshape(-1, *(1,) * (close.ndim - 1))
        return jnp.all(close | ~heard, axis=0) & jnp.any(heard, axis=0)

    def propose(
        self, scan: SeveralSets[Any], birth: Birth, key: PRNGKeyArray, count: int
    ) -> tuple[PlanarState, Float[Array, " count"]]:
        """New targets, half of them where all sensors at a time say (`bearing_proposal.where_likely`).

        They are chosen from those about the set of the first sensor that reported; of a lone sensor they are these.
        """
        first = self.each.candidates(scan.first(), birth)
        if first is not None and scan.heard.shape[-1] == 1:
            return first(key, count)
        return where_likely(self, scan, birth, key, count, first)

    def simulate(
        self, scan: SeveralSets[Any], states: PlanarState, present: Bool[Array, ""] | bool, key: PRNGKeyArray
    ) -> SeveralSets[Any]:
        """What all sensors report of one target; one that did not report has nothing."""
        keys = jax.random.split(key, scan.heard.shape[-1])
        sets = jax.vmap(lambda each, key: self.each.simulate(each, states, present, key))(scan.sets, keys)
        there = sets.there & scan.heard[:, None]
        return dataclasses.replace(scan, sets=dataclasses.replace(sets, there=there))
